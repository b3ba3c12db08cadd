# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks of a mission's snapshot, because its checksum is not a signature."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.search.environments.metres_drones import MetresDrones, reported_wind
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.step.constants import NO_ACTION

_LARGEST = 2**63 - 1


class Possible(NamedTuple):
    """What the values of a snapshot can be, on cells or in metres.

    Attributes:
        place: Whether a value is a place of a track.
        commands: Whether a value is the state of the commands.
        arrays: Whether an array by this name is possible; its shape and type are.
        extra: Whether a further value by this name is possible.
    """

    place: Callable[[Any], bool]
    commands: Callable[[dict[str, Any]], bool]
    arrays: dict[str, Callable[[NDArray[Any]], bool]]
    extra: dict[str, Callable[[Any], bool]] = {}


def possible_in(env: SearchEnv) -> Possible:
    """Return what is possible in missions of an environment."""
    return _on_cells(env) if env.world.metres is None else _in_metres(env, env.world.metres)


def _on_cells(env: SearchEnv) -> Possible:
    drones, actions = range(env.world.num_drones), range(NO_ACTION, len(env.rules.actions))
    grid = env.world.grid_size

    def commands(state: dict[str, Any]) -> bool:
        return _is_by_drone(
            state.get("goals"), drones, lambda value: _is_cell(value) and grid.holds(*value)
        ) and _is_by_drone(state.get("last"), drones, lambda value: _is_in(value, actions))

    def are_actions(array: NDArray[Any]) -> bool:
        return bool(np.isin(array, actions).all())

    names = ("result_actions", "result_commands")
    return Possible(_is_cell, commands, dict.fromkeys(names, are_actions))


def _in_metres(env: SearchEnv, metres: MetresDrones) -> Possible:
    drones = range(env.world.num_drones)
    extent = env.world.grid_size.extent(env.scenario.cell_size)

    def commands(state: dict[str, Any]) -> bool:
        return _is_by_drone(state.get("last"), drones, _is_action) and _is_by_drone(
            state.get("tracks"), drones, _is_track
        )

    def within(low: float, high: float | GridExtent) -> Callable[[NDArray[Any]], bool]:
        return lambda array: bool(((array >= low) & (array <= high)).all())

    def is_wind(value: Any) -> bool:
        if not _is_place(value):
            return False
        try:
            reported_wind(tuple(value), metres.airframes, metres.wind.step_s)
        except FieldError:
            return False
        return True

    return Possible(
        _is_place,
        commands,
        {
            "result_actions": lambda array: bool((array == NO_ACTION).all()),
            "result_actions_m": within(-1.0, 1.0),
            # A vehicle may be off the grid.
            "result_paths_m": (lambda array: bool(np.isfinite(array).all()))
            if env.rules.vehicle_timed_actions
            else within(0.0, extent),
            "result_looked_m": within(0.0, 1.0),
        },
        {"wind": is_wind},
    )


def check_mission(snapshot: Snapshot, now: Snapshot, can_be: Possible) -> None:
    """Raise unless the values of a snapshot besides the world are possible in such a mission.

    Args:
        now: A snapshot of the present mission.

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
    possible |= {name: is_right(extra.get(name)) for name, is_right in can_be.extra.items()}
    wrong = [name for name, is_right in possible.items() if not is_right]
    if wrong:
        raise SnapshotError(f"the snapshot is of an impossible mission: {', '.join(wrong)}")


def _is_int(value: Any, least: int, most: int = _LARGEST) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _is_in(value: Any, numbers: range) -> bool:
    return _is_int(value, numbers[0], numbers[-1])


def _is_list(value: Any, holds: Any) -> bool:
    return isinstance(value, list) and all(holds(part) for part in value)


def _is_by_drone(value: Any, drones: range, holds: Callable[[Any], bool]) -> bool:
    """Return whether a value is a list of pairs of a drone and a value that passes `holds`."""
    return _is_list(
        value, lambda pair: _is_pair(pair) and _is_in(pair[0], drones) and holds(pair[1])
    )


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2


def _is_cell(value: Any) -> bool:
    """Return whether a value is a cell on or near any grid."""
    return _is_pair(value) and all(_is_int(part, -(2**15), 2**15 - 1) for part in value)


def _is_place(value: Any) -> bool:
    return _is_pair(value) and all(
        isinstance(part, float) and math.isfinite(part) for part in value
    )


def _is_track(value: Any) -> bool:
    return isinstance(value, list) and len(value) > 1 and all(map(_is_place, value))


def _is_action(value: Any) -> bool:
    return _is_place(value) and all(abs(part) <= 1.0 for part in value)
