# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks of a mission's snapshot, because its checksum is not a signature."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search import HOLD, Snapshot, SnapshotError

_LARGEST = 2**63 - 1


class Possible(NamedTuple):
    """What the values of a snapshot can be where drones fly in cells or in metres.

    Attributes:
        place: Whether a value is a place of a track.
        commands: Whether a value is the state of the commands.
        arrays: Whether an array by this name is possible; its shape and type are.
    """

    place: Callable[[Any], bool]
    commands: Callable[[dict[str, Any]], bool]
    arrays: dict[str, Callable[[NDArray[Any]], bool]]


def of_cells(num_drones: int, grid_size: int, num_actions: int) -> Possible:
    """Return what is possible where drones fly from cell to cell."""
    drones, actions = range(num_drones), range(HOLD, num_actions)

    def commands(state: dict[str, Any]) -> bool:
        return is_by_drone(
            state.get("goals"), drones, lambda value: _is_cell(value, grid_size)
        ) and is_by_drone(state.get("last"), drones, lambda value: _is_in(value, actions))

    def are_actions(array: NDArray[Any]) -> bool:
        return bool(np.isin(array, actions).all())

    names = ("result_actions", "result_commands")
    return Possible(_is_cell, commands, dict.fromkeys(names, are_actions))


def check_mission(snapshot: Snapshot, now: Snapshot, can_be: Possible) -> None:
    """Raise unless the values of a snapshot besides the world are possible in such a mission.

    Args:
        snapshot: The snapshot.
        now: A snapshot of the present mission.
        can_be: What they can be.

    Raises:
        SnapshotError: If a value is impossible; the message names it.
    """
    extra, arrays, of_now = snapshot.extra, snapshot.arrays, now.arrays
    drones = range(len(now.extra["tracks"]))
    tracks = extra["tracks"]
    possible = {
        "seed": _is_int(extra["seed"], 0),
        "number": _is_int(extra["number"], 1),
        "aborted": isinstance(extra["aborted"], bool),
        "_stamp_ns": _is_int(extra["_stamp_ns"], 1),
        "lost": _is_list(extra["lost"], lambda value: _is_in(value, drones)),
        "tracks": _is_list(tracks, lambda track: _is_list(track, can_be.place) and len(track) > 0)
        and len(tracks) == len(drones),
        "commands": isinstance(extra["commands"], dict) and can_be.commands(extra["commands"]),
    }
    for name in [name for name in of_now if name.startswith("result_")]:
        stored, known = arrays.get(name), of_now[name]
        possible[name] = stored is not None and (stored.shape, stored.dtype) == (
            known.shape,
            known.dtype,
        )
    history = arrays["history"]
    possible["history"] = (
        history.dtype == of_now["history"].dtype
        and history.shape[1:] == (len(drones),)
        and "worlds" in arrays
        and arrays["worlds"].dtype == of_now["worlds"].dtype
        and arrays["worlds"].shape == (1,)
        and len(history) == arrays["worlds"]["t"][0]
    )
    for name, is_possible in can_be.arrays.items():
        possible[name] = possible[name] and is_possible(arrays[name])
    wrong = [name for name, is_right in possible.items() if not is_right]
    if wrong:
        raise SnapshotError(f"the snapshot is of an impossible mission: {', '.join(wrong)}")


def _is_int(value: Any, least: int, most: int = _LARGEST) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _is_in(value: Any, numbers: range) -> bool:
    return _is_int(value, numbers[0], numbers[-1])


def _is_list(value: Any, holds: Any) -> bool:
    return isinstance(value, list) and all(holds(part) for part in value)


def is_by_drone(value: Any, drones: range, holds: Callable[[Any], bool]) -> bool:
    """Return whether a value is a list of pairs of a drone and a value that passes `holds`."""
    return _is_list(
        value, lambda pair: is_pair(pair) and _is_in(pair[0], drones) and holds(pair[1])
    )


def is_pair(value: Any) -> bool:
    """Return whether a value is a list of two."""
    return isinstance(value, list) and len(value) == 2


def _is_cell(value: Any, grid: int = 0) -> bool:
    """Return whether a value is a cell on a grid of this size; with 0, on or near any grid."""
    low, high = (0, grid - 1) if grid else (-(2**15), 2**15 - 1)
    return is_pair(value) and all(_is_int(part, low, high) for part in value)
