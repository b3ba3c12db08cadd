# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The drones of B worlds under their faults, and one of them, for compiled functions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import expanded


class Fleet(NamedTuple):
    """The faults of B worlds, and the abilities of their drones.

    Attributes:
        faults: (1,) of `fault_kernels.FAULT_CONSTANTS`.
        abilities: (N,) of `fault_kernels.ABILITIES`.
        conditions: (B, N) of `fault_kernels.CONDITIONS`.
        losses: (N,) int64, step in which each drone is lost; 0 for never.
        home_steps: (N, G, G) int32 of `ways_home.WaysHome`; (N, 0, 0) without batteries.
        home_actions: (N, G, G) int8 of `ways_home.WaysHome`; (N, 0, 0) without batteries.
        applied: (B, N) int8, actions that the drones did in the last step.
    """

    faults: NDArray[np.void]
    abilities: NDArray[np.void]
    conditions: NDArray[np.void]
    losses: NDArray[np.int64]
    home_steps: NDArray[np.int32]
    home_actions: NDArray[np.int8]
    applied: NDArray[np.int8]


class Flyer(NamedTuple):
    """One drone of one world.

    Attributes:
        drone: Of `kernels.DRONES`.
        condition: Of `fault_kernels.CONDITIONS`.
        ability: Of `fault_kernels.ABILITIES`.
        home_steps: (G, G) int32, of `Fleet`.
        home_actions: (G, G) int8, of `Fleet`.
    """

    drone: np.void
    condition: np.void
    ability: np.void
    home_steps: NDArray[np.int32]
    home_actions: NDArray[np.int8]


@expanded
def flyer_of(drones, fleet, b, n):
    """Return drone n of world b."""
    return Flyer(
        drones[b, n], fleet.conditions[b, n], fleet.abilities[n],
        fleet.home_steps[n], fleet.home_actions[n],
    )  # fmt: skip
