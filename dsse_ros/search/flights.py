# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The flights of the drones of B worlds, in metres."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.fault_fields import FAULTS, faults_of
from dsse_ros.scenario.fields import FieldError, shown
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search.snapshot import SnapshotError
from dsse_ros.search.world_ensemble import WorldEnsemble
from dsse_ros.sensors.lateral_range import LateralRange
from dsse_ros.sensors.registry import SENSORS
from dsse_ros.step.flight import FlightTask, path_of_action
from dsse_ros.step.flight_paths import FLIGHTS, MOST_PIECES, Wind, flyers_of, pieces_of
from dsse_ros.step.sightings import eyes_of


class Flights:
    """Positions, headings and speeds of the drones, and their paths in the last step.

    Args:
        scenario: The scenario.
        rules: Its rules.
        num_worlds: B.

    Attributes:
        flights: (B, N) of `flight_paths.FLIGHTS`.
        paths: (B, N, K + 1, 2) float64, metres to the east and to the south of the grid's
            north-west corner: positions of the drones at equal times of the last step.
        looked: (B, N, K + 1) bool: whether they looked right before the step and on each piece.
        actions: (B, N, 2) float64, turns and speeds of the next step, see `flight_paths`.
        flyers, eyes, wind: See `FlightTask`.

    Raises:
        FieldError: If the scenario is not for a search in metres.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules, num_worlds: int) -> None:
        self.flyers, self.wind = flyers_of(scenario.kinds), wind_of(scenario)
        self.eyes = eyes_of(lateral_ranges(scenario), scenario.step_duration_s)
        self._cell_m = scenario.cell_size
        shape = num_worlds, scenario.num_drones
        self.flights = np.zeros(shape, FLIGHTS)
        self.actions = np.zeros((*shape, 2))
        pieces = pieces_of(self.flyers, self.wind.step_s)
        # Vehicles fly other paths than drones.
        pieces = MOST_PIECES if rules.vehicle_timed_actions else pieces
        self.paths = np.zeros((*shape, pieces + 1, 2))
        self.looked = np.zeros((*shape, pieces + 1), np.bool_)
        self._given = np.zeros(shape, np.bool_)
        _check_kinds(scenario)
        faults = [name for name in faults_of(scenario) if name != "wind"]
        if faults:
            raise FieldError(
                f"{FAULTS[faults[0]].switches[0]} must be 0 with space metres, where only wind "
                f"makes drones deviate"
            )

    def task(self, ensemble: WorldEnsemble | None) -> FlightTask:
        """Return the flights for the kernels."""
        assert ensemble is not None
        truth = ensemble.tracks.truth_m
        assert truth is not None
        return FlightTask(
            self.flyers, self.eyes, self.wind, self._cell_m, truth.transpose(1, 0, 2),
            self.flights, self.paths, self.looked, self._given, self.actions,
        )  # fmt: skip

    def plan(self, drone: int, action: NDArray[np.float64], kind: int) -> NDArray[np.float64]:
        """Return the path (K + 1, 2) of an action of a drone of the first world, without flying it.

        Args:
            drone: The drone.
            action: Its turn and speed.
            kind: Number of its kind.
        """
        flight, path = self.flights[0, drone : drone + 1].copy(), np.empty(self.paths.shape[2:])
        path_of_action(self.flyers, kind, self.wind, flight, action, path)
        return path

    def give(self, drone: int, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> None:
        """Have a drone of the first world fly what its vehicle has flown, in the next step.

        Heading and speed after it are those of the last piece. Positions count to a millimetre, as
        a log has them.

        Args:
            drone: The drone.
            path: (K + 1, 2), as `paths`.
            looked: (K + 1,), as `looked`.
        """
        state, pieces, path = self.flights[0, drone], len(path) - 1, np.round(path, 3)
        self.paths[0, drone], self.looked[0, drone] = path, looked
        self._given[0, drone] = True
        wind = self.wind
        east, south = (path[-1] - path[-2]) * pieces / wind.step_s - (wind.east, wind.south)
        state["speed"] = math.hypot(east, south)
        if state["speed"] > 0.0:
            state["heading"] = math.atan2(east, -south)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that a snapshot needs."""
        return {"flights": self.flights, "looked": self.looked}

    def in_cells(self) -> NDArray[np.float64]:
        """Return the positions (B, N, 2) in cells, with the centre of cell (0, 0) at (0, 0)."""
        places = np.stack([self.flights["east"], self.flights["south"]], axis=-1)
        cells: NDArray[np.float64] = places / self._cell_m - 0.5
        return cells

    def check(self, flights: NDArray[np.void], grid_size: int) -> None:
        """Check the states in a snapshot, an array of the same shape.

        Raises:
            SnapshotError: If they are not finite, or not on the grid.
        """
        places = np.stack([flights["east"], flights["south"]])
        inside = (places >= 0.0) & (places <= grid_size * self._cell_m)
        rest = np.isfinite(flights["heading"]) & (flights["speed"] >= 0.0)
        if not (inside.all() and rest.all() and np.isfinite(flights["speed"]).all()):
            raise SnapshotError("the snapshot is damaged: flights are not on the grid")


def _check_kinds(scenario: ResolvedScenario) -> None:
    """Raise unless the kinds of drones can fly in metres.

    Raises:
        FieldError: If one cannot.
    """
    for name, kind in zip(dict.fromkeys(scenario.searchers), scenario.kinds, strict=True):
        assert kind.speed is not None
        if kind.min_speed > kind.speed:
            raise FieldError(
                f"searchers: {name!r}: min_speed must be at most its speed, {kind.speed:g} m/s, "
                f"got {kind.min_speed:g}"
            )
        for field in ("endurance_min", "moves", "search_altitude"):
            if getattr(kind, field) is not None:
                raise FieldError(
                    f"searchers: {name!r}: {field} must be None with space metres, got "
                    f"{shown(getattr(kind, field))}"
                )


def wind_of(scenario: ResolvedScenario) -> Wind:
    """Return the wind of a scenario."""
    toward = math.radians(scenario.wind_toward)
    east, north = math.sin(toward), math.cos(toward)
    return Wind(scenario.wind_speed * east, -scenario.wind_speed * north, scenario.step_duration_s)


def lateral_ranges(scenario: ResolvedScenario) -> list[LateralRange]:
    """Return how each kind of drone sees what it passes.

    Raises:
        FieldError: If a sensor sees nothing in passing, or cannot see in this scenario.
    """
    ranges = []
    for kind in scenario.kinds:
        assert kind.sensor is not None
        lateral = SENSORS[kind.sensor].lateral
        if lateral is None:
            known = ", ".join(
                name for name, sensor in SENSORS.items() if sensor.lateral is not None
            )
            raise FieldError(
                f"sensor must be one of {known} with space metres, got {kind.sensor!r}"
            )
        try:
            ranges.append(lateral(scenario, kind))
        except ValueError as error:
            raise FieldError(f"sensor: {kind.sensor}: {error}") from None
    return ranges
