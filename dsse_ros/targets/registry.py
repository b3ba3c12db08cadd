# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The target models by name: motions, which move step by step, and ensembles of tracks."""

from __future__ import annotations

from typing import TypeAlias

from dsse_ros.targets.best_cell import BEST_CELL
from dsse_ros.targets.constant_drift import CONSTANT_DRIFT
from dsse_ros.targets.drawn_cell import DRAWN_CELL
from dsse_ros.targets.drifting_map import DRIFTING_MAP
from dsse_ros.targets.ensemble import Ensemble
from dsse_ros.targets.leeway import LEEWAY
from dsse_ros.targets.markov_chain import MARKOV_CHAIN
from dsse_ros.targets.motion import PersonMotion
from dsse_ros.targets.random_walk import RANDOM_WALK

TargetModel: TypeAlias = PersonMotion | Ensemble

MOTIONS: dict[str, PersonMotion] = {
    "window": BEST_CELL,
    "drift": DRAWN_CELL,
    "random_walk": RANDOM_WALK,
    "markov_chain": MARKOV_CHAIN,
}
"""The motions by name; `constants.motion` is the number of the one in use."""

TARGET_MODELS: dict[str, TargetModel] = {
    **MOTIONS,
    "constant_drift": CONSTANT_DRIFT,
    "leeway": LEEWAY,
    "drifting_map": DRIFTING_MAP,
}
"""The choices for `person_motion` of the rules."""


def has_own_drift(name: str) -> bool:
    """Return whether this is a motion in which each person has its own drift."""
    model = TARGET_MODELS[name]
    return isinstance(model, PersonMotion) and model.own_drift


def drifts_with_incident(name: str) -> bool:
    """Return whether this is an ensemble of an incident's tracks."""
    model = TARGET_MODELS[name]
    return isinstance(model, Ensemble) and model.of_incident
