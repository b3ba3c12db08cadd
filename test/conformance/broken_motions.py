# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replaces the registered motions by broken ones, and prints what the conformance test says.

It is a program of its own, because the search has its motions compiled in. It needs an empty
`NUMBA_CACHE_DIR`: the cache does not know that the motions differ from those of the package.
"""

from __future__ import annotations

from typing import Any

from dsse_ros.base.compiled.jit import part
from dsse_ros.world.targets import registry
from dsse_ros.world.targets.best_cell import best_cell_chances, move_to_best_cell
from dsse_ros.world.targets.drawn_cell import drift_chances, move_with_drift
from dsse_ros.world.targets.motion import PersonMotion


@part
def more_drift(
    constants: Any, sea: Any, x: int, y: int, window: Any, out: Any, scratch: Any
) -> None:
    drift_chances(constants, sea, x, y, window, out, scratch)
    for k in range(9):
        out[k] *= 0.95
    out[9] += 0.05


@part
def below_zero(
    constants: Any, sea: Any, x: int, y: int, window: Any, out: Any, scratch: Any
) -> None:
    drift_chances(constants, sea, x, y, window, out, scratch)
    out[0], out[8] = out[0] + 1.0, out[8] - 1.0


@part
def stay(constants: Any, sea: Any, x: int, y: int, window: Any, out: Any, scratch: Any) -> None:
    for k in range(10):
        out[k] = k == 4


@part
def leap(constants: Any, world: Any, sea: Any, person: Any, direction: int) -> None:
    person.x += 2


BROKEN = {
    "window": PersonMotion("", move_to_best_cell, stay),
    "drift": PersonMotion("", move_with_drift, more_drift, own_drift=True),
    "random_walk": PersonMotion("", move_with_drift, below_zero),
    "markov_chain": PersonMotion("", leap, best_cell_chances),
}


def main() -> None:
    registry.MOTIONS.update(BROKEN)
    # Compiles the search with the broken motions.
    from dsse_ros.conformance.target_model import target_model_test

    for name, motion in BROKEN.items():
        try:
            target_model_test(motion)
        except AssertionError as error:
            print(f"{name}: {error}", flush=True)


if __name__ == "__main__":
    main()
