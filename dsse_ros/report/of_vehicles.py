# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What drones in metres and vehicles did in a recorded mission, from the texts of a log."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.step.fault_kernels import WORKS
from dsse_ros.step.viewpoints import NO_LOOK, viewpoints_at


class FlownByVehicles(NamedTuple):
    """What vehicles have flown, see `dsse_ros.mission.flown.Flown`.

    Attributes:
        paths: (K, N, P, 2) float64.
        looked: (K, N, P) bool.
    """

    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]


def of_vehicles(
    column: Callable[..., NDArray[Any]], columns: Collection[str], actions: Sequence[str]
) -> dict[str, Any]:
    """Return what a log has of vehicles, by the fields of `RecordedMission`; see `flown_of`.

    Args:
        column: See `flown_of`.
        columns: The names of the columns.
        actions: Names of the actions.

    Raises:
        ValueError: If a value is not allowed.
    """
    if "path" in columns:
        return {"flown": flown_of(column)}
    if "work" in columns:
        return {"work": works_of(column("work", np.str_)), "looks": looks_of(column, actions)}
    return {}


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


def looks_of(column: Callable[..., NDArray[Any]], actions: Sequence[str]) -> NDArray[np.void]:
    """Return from where vehicles looked, (K, N) of `viewpoints.VIEWPOINTS`; see `flown_of`.

    Args:
        column: Returns a column of the log, (K, N), by its name and data type.
        actions: Names of the actions.

    Raises:
        ValueError: If an action is unknown, or there is no cell.
    """
    names = column("look_action", np.str_)
    unknown = sorted(set(names.ravel().tolist()) - {*actions, ""})
    if unknown:
        raise ValueError(f"look_action must be one of {', '.join(actions)}, got {unknown[0]!r}")
    col, row = (
        np.where(names == "", "0", column(name, np.str_)).astype(np.int64)
        for name in ("look_col", "look_row")
    )
    return viewpoints_at(numbers_of(names, actions), col, row)


def numbers_of(names: NDArray[np.str_], actions: Sequence[str]) -> NDArray[np.int8]:
    """Return the numbers of actions by name, `NO_LOOK` for other names."""
    numbers = np.full(names.shape, NO_LOOK, np.int8)
    for number, name in enumerate(actions):
        numbers[names == name] = number
    return numbers


def works_of(names: NDArray[np.str_]) -> NDArray[np.int8]:
    """Return the numbers of `WORKS` by name.

    Raises:
        ValueError: If a name is unknown.
    """
    unknown = sorted(set(names.ravel().tolist()) - {*WORKS})
    if unknown:
        raise ValueError(f"work must be one of {', '.join(WORKS)}, got {unknown[0]!r}")
    return np.vectorize(WORKS.index, otypes=[np.int8])(names)
