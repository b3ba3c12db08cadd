# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What drones in metres and vehicles did in a recorded mission, from the texts of a log."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.step.fault_kernels import WORKS


class FlownByVehicles(NamedTuple):
    """What vehicles have flown, see `dsse_ros.mission.flown.Flown`.

    Attributes:
        paths: (K, N, P, 2) float64.
        looked: (K, N, P) bool.
    """

    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]


def flown_of(column: Callable[..., NDArray[Any]]) -> FlownByVehicles:
    """Return what vehicles have flown, see `mission_log.OF_FLOWN`.

    Args:
        column: Returns a column of the log, (K, N), by its name and data type.

    Raises:
        ValueError: If there is no path, or no flag, of a vehicle.
    """
    points = [[text.split() for text in row] for row in column("path", np.str_).tolist()]
    flags = [[list(text) for text in row] for row in column("looked", np.str_).tolist()]
    looked = np.array(flags, np.int64) > 0
    return FlownByVehicles(np.array(points, np.float64).reshape(*looked.shape, 2), looked)


def turns_of(column: Callable[..., NDArray[Any]]) -> dict[str, Any]:
    """Return turns and courses in metres, by the fields of `RecordedMission`; see `flown_of`."""
    return {
        "turns": np.stack([column("turn"), column("speed")], axis=2),
        "courses": np.stack([np.radians(column("heading_deg")), column("airspeed")], axis=2),
    }


def works_of(names: NDArray[np.str_]) -> NDArray[np.int8]:
    """Return the numbers of `WORKS` by name.

    Raises:
        ValueError: If a name is unknown.
    """
    unknown = sorted(set(names.ravel().tolist()) - {*WORKS})
    if unknown:
        raise ValueError(f"work must be one of {', '.join(WORKS)}, got {unknown[0]!r}")
    return np.vectorize(WORKS.index, otypes=[np.int8])(names)
