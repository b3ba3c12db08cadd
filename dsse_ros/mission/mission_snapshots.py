# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks of a mission's snapshot, because its checksum is not a signature."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsse_ros.search import HOLD, Snapshot, SnapshotError

_LARGEST = 2**63 - 1


def check_mission(snapshot: Snapshot, now: Snapshot, grid_size: int, num_actions: int) -> None:
    """Raise unless the values of a snapshot besides the world are possible in such a mission.

    Args:
        snapshot: The snapshot.
        now: A snapshot of the present mission.
        grid_size: Grid size of the search.
        num_actions: Number of actions of a drone.

    Raises:
        SnapshotError: If a value is impossible; the message names it.
    """
    extra, arrays, of_now = snapshot.extra, snapshot.arrays, now.arrays
    drones, actions = range(len(now.extra["tracks"])), range(HOLD, num_actions)
    tracks = extra["tracks"]
    possible = {
        "seed": _is_int(extra["seed"], 0),
        "number": _is_int(extra["number"], 1),
        "aborted": isinstance(extra["aborted"], bool),
        "_stamp_ns": _is_int(extra["_stamp_ns"], 1),
        "lost": _is_list(extra["lost"], lambda one: _is_in(one, drones)),
        "tracks": _is_list(tracks, lambda track: _is_list(track, _is_cell) and len(track) > 0)
        and len(tracks) == len(drones),
        "commands": isinstance(extra["commands"], dict)
        and _is_list(
            extra["commands"].get("goals"),
            lambda pair: (
                _is_pair(pair) and _is_in(pair[0], drones) and _is_cell(pair[1], grid_size)
            ),
        )
        and _is_list(
            extra["commands"].get("last"),
            lambda pair: _is_pair(pair) and _is_in(pair[0], drones) and _is_in(pair[1], actions),
        ),
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
    for name in ("result_actions", "result_commands"):
        if possible[name]:
            possible[name] = bool(np.isin(arrays[name], actions).all())
    wrong = [name for name, is_possible in possible.items() if not is_possible]
    if wrong:
        raise SnapshotError(f"the snapshot is of an impossible mission: {', '.join(wrong)}")


def _is_int(value: Any, least: int, most: int = _LARGEST) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _is_in(value: Any, numbers: range) -> bool:
    return _is_int(value, numbers[0], numbers[-1])


def _is_list(value: Any, holds: Any) -> bool:
    return isinstance(value, list) and all(holds(one) for one in value)


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2


def _is_cell(value: Any, grid: int = 0) -> bool:
    """Return whether a value is a cell on a grid of this size; with 0, on or near any grid."""
    low, high = (0, grid - 1) if grid else (-(2**15), 2**15 - 1)
    return _is_pair(value) and all(_is_int(part, low, high) for part in value)
