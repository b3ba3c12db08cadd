# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A loop as users of DSSE 1.1.9 write it, on that package or on `dsse_ros.compat`."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.worker import serve

GRID_SIZE = 40
STARTS = [(20, 0), (20, 39), (0, 20), (39, 20)]
PACKAGE = "DSSE.environment.wrappers"
STACKS = {
    "no_wrapper": (),
    "all_positions": (("", "AllPositionsWrapper"),),
    "flatten": (("", "AllFlattenWrapper"),),
    "top_cells": (("", "TopNProbsWrapper"),),
    "communication": (
        (".communication_wrapper", "CommunicationWrapper"),
        ("", "AllPositionsWrapper"),
    ),
    "matrix": (("", "MatrixEncodeWrapper"),),
}
"""Wrappers by name, the innermost first; every stack starts with RetainDronePosWrapper."""


def make(config: dict[str, Any]) -> Iterator[int]:
    """Yield 1 for every call of `step` on a stack; missions without a find, of 100 steps."""
    if config["install_aliases"]:
        importlib.import_module("dsse_ros.compat.aliases").install_aliases()
    env: Any = importlib.import_module("DSSE").DroneSwarmSearch(
        grid_size=GRID_SIZE,
        drone_amount=len(STARTS),
        person_initial_position=(GRID_SIZE // 2, GRID_SIZE // 2),
        probability_of_detection=0.0,
    )
    env = importlib.import_module(PACKAGE).RetainDronePosWrapper(env, STARTS)
    for module, name in STACKS[config["stack"]]:
        env = getattr(importlib.import_module(PACKAGE + module), name)(env)
    joints = [
        dict(zip(env.possible_agents, joint, strict=True))
        for joint in np.random.default_rng(1).integers(0, 9, (1000, len(STARTS))).tolist()
    ]
    env.reset()
    while True:
        for joint in joints:
            env.step(joint)
            yield 1
            if not env.agents:
                env.reset()


if __name__ == "__main__":
    serve(make)
