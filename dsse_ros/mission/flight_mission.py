# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The mission of drones that fly in metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.flight_commands import FlightCommands
from dsse_ros.mission.flown import Flown
from dsse_ros.mission.mission import HISTORY_DTYPE, Mission, StepResult
from dsse_ros.mission.mission_snapshots import Possible, is_by_drone, is_pair
from dsse_ros.search import HOLD, SearchEnv, Snapshot
from dsse_ros.search.flights import Flights

_OF_FLOWN = ("actions", "paths", "looked")
"""Arrays of `Flown` that a snapshot has beside the world."""


class FlightMission(Mission):
    """A `Mission` whose drones fly by a turn and a speed; see `FlightEnv`.

    A result has `flown`; its actions by number are `HOLD`, and no cell counts as searched. A drone
    is held if it has no command and `missing_action` is `hold`.
    """

    # The commands have other values, so only what commands drones in metres may set them.
    commands: FlightCommands  # type: ignore[assignment]

    _history_dtype = np.dtype([*HISTORY_DTYPE.descr, ("place", "<f8", (2,))])

    @property
    def _flights(self) -> Flights:
        assert self.env.world.flight is not None
        return self.env.world.flight

    def command_all(self, actions: Sequence[Any]) -> None:
        """Set the next turn and speed of every drone in flight; None is no command."""
        for drone in self.live:
            if actions[drone] is not None:
                turn, speed = actions[drone]
                self.commands.set_action(drone, (float(turn), float(speed)))

    def advance(self, missing_action: str) -> StepResult:
        """See `Mission`."""
        held = np.zeros(len(self.tracks), bool)
        if missing_action == "hold":
            held[self.missing] = True
        result = super().advance(missing_action)
        self.commands.after_step()
        self.result = replace(result, held=held, probabilities=np.zeros(len(held)))
        return self.result

    def snapshot(self, *, past: bool = True) -> Snapshot:
        """See `Mission`."""
        snapshot = super().snapshot(past=past)
        assert self.result.flown is not None
        for name in _OF_FLOWN:
            snapshot.arrays[f"result_{name}_m"] = getattr(self.result.flown, name).copy()
        return snapshot

    def restore(self, snapshot: Snapshot) -> StepResult:
        """See `Mission`."""
        super().restore(snapshot)
        for name in _OF_FLOWN:
            getattr(self._flights, name)[0] = snapshot.arrays[f"result_{name}_m"]
        self.result = replace(self.result, flown=Flown.of_flights(self._flights))
        return self.result

    def ways(self, actions: NDArray[Any] | None) -> NDArray[np.float64]:
        """Return the paths of actions (N, 2) without flying them, (N, P, 2) (col, row).

        Args:
            actions: Turns and speeds; None for drones that stay.
        """
        flights, kinds = self._flights, self.env.world.looks.kind
        ways = np.repeat(flights.in_cells()[0][:, None], flights.paths.shape[2], axis=1)
        if actions is not None:
            for drone in self.live:
                path = flights.plan(drone, actions[drone], int(kinds[drone]))
                ways[drone] = path / self.env.scenario.cell_size - 0.5
        return ways

    @property
    def pieces(self) -> int:
        """Number of pieces of a path."""
        return self._flights.paths.shape[2] - 1

    def set_paths(self, paths: NDArray[np.float64], looked: NDArray[np.bool_]) -> None:
        """Have the drones fly in the next step what vehicles have flown, see `Flown`.

        Args:
            paths: (N, P, 2) float64.
            looked: (N, P) bool.

        Raises:
            ValueError: If there are more or fewer points than in a path of the mission.
        """
        if paths.shape != self._flights.paths.shape[1:]:
            raise ValueError(f"path must be {self.pieces + 1} points, got {paths.shape[1]}")
        for drone in self.live:
            self.set_flown(drone, paths[drone], looked[drone])

    def set_flown(self, drone: int, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> None:
        """Have a drone fly in the next step what its vehicle has flown, see `Flights.give`."""
        self._flights.give(drone, path, looked)

    def _command_buffer(self) -> FlightCommands:  # type: ignore[override]
        flights = self._flights
        return FlightCommands(flights, self.env.world.looks.kind)

    def _numbers(self, joint: NDArray[Any]) -> NDArray[np.int8]:
        self._flights.actions[0] = joint
        return np.full(len(joint), HOLD, np.int8)

    def _follow_tracks(self, cells: NDArray[np.int64]) -> None:
        flights = self._flights
        ends = flights.in_cells()[0]
        for track, path, (col, row) in zip(
            self.tracks, flights.paths[0], ends.tolist(), strict=True
        ):
            if not track:
                track.append((col, row))
            elif track[-1] != (col, row):
                between = path[1:-1] / self.env.scenario.cell_size - 0.5
                track += [*map(tuple, between.tolist()), (col, row)]

    def _result(self, *values: Any) -> StepResult:
        return replace(super()._result(*values), flown=Flown.of_flights(self._flights))

    def _packed(self, result: StepResult) -> NDArray[Any]:
        row = super()._packed(result)
        row["place"] = result.places
        return row

    @property
    def _possible(self) -> Possible:
        drones = range(len(self.tracks))
        side_m = self.env.world.grid_size * self.env.scenario.cell_size

        def commands(state: dict[str, Any]) -> bool:
            return is_by_drone(state.get("last"), drones, _is_action) and is_by_drone(
                state.get("tracks"), drones, _is_track
            )

        def within(low: float, high: float) -> Any:
            return lambda array: bool(((array >= low) & (array <= high)).all())

        return Possible(
            _is_place,
            commands,
            {
                "result_actions": lambda array: bool((array == HOLD).all()),
                "result_actions_m": within(-1.0, 1.0),
                "result_paths_m": within(0.0, side_m),
                "result_looked_m": within(0.0, 1.0),
            },
        )


def _is_place(value: Any) -> bool:
    return is_pair(value) and all(isinstance(part, float) and math.isfinite(part) for part in value)


def _is_track(value: Any) -> bool:
    return isinstance(value, list) and len(value) > 1 and all(map(_is_place, value))


def _is_action(value: Any) -> bool:
    return is_pair(value) and all(isinstance(part, float) and abs(part) <= 1.0 for part in value)


def mission_of(env: SearchEnv, seed: int, *, belief: bool = True) -> Mission:
    """Return the mission of an environment, see `Mission`; in metres a `FlightMission`."""
    kind = FlightMission if env.rules.in_metres else Mission
    return kind(env, seed, belief=belief)
