# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The drones of B worlds that fly in metres."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.environments.snapshot import SnapshotError
from dsse_ros.search.environments.world_ensemble import WorldEnsemble
from dsse_ros.search.step.metres_detection import detectors_of
from dsse_ros.search.step.metres_kernels import MetresArrays, path_of_action
from dsse_ros.search.step.metres_paths import (
    MOST_PIECES,
    MOTION_STATES,
    Wind,
    airframes_of,
    pieces_of,
)
from dsse_ros.world.scenario.fault_fields import FAULTS, check_wind, faults_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.sensors.lateral_range import LateralRange
from dsse_ros.world.sensors.registry import SENSORS


class MetresDrones:
    """Positions, headings and speeds of the drones, and their paths in the last step.

    Args:
        scenario: The scenario.
        rules: Its rules.
        num_worlds: B.

    Attributes:
        states: (B, N) of `metres_paths.MOTION_STATES`.
        paths: (B, N, K + 1, 2) float64, metres to the east and to the south of the grid's
            north-west corner: positions of the drones at equal times of the last step.
        looked: (B, N, K + 1) bool: whether they looked right before the step and on each piece.
        actions: (B, N, 2) float64, turns and speeds of the next step, see `metres_paths`.
        airframes, detectors, wind: See `MetresArrays`; the wind is the scenario's, or one reported
            since.

    Raises:
        FieldError: If the scenario is not for a search in metres.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules, num_worlds: int) -> None:
        self.airframes, self.wind = airframes_of(scenario.kinds), wind_of(scenario)
        self.detectors = detectors_of_kinds(scenario)
        self._cell_m = scenario.cell_size
        shape = num_worlds, scenario.num_drones
        self.states = np.zeros(shape, MOTION_STATES)
        self.actions = np.zeros((*shape, 2))
        pieces = pieces_of(self.airframes, self.wind.step_s)
        # Vehicles fly other paths than drones.
        self._of_vehicles = rules.vehicle_timed_actions
        pieces = MOST_PIECES if self._of_vehicles else pieces
        self.paths = np.zeros((*shape, pieces + 1, 2))
        self.looked = np.zeros((*shape, pieces + 1), np.bool_)
        self._preset = np.zeros(shape, np.bool_)
        _check_kinds(scenario)
        faults = [name for name in faults_of(scenario) if name != "wind"]
        if faults:
            raise FieldError(
                f"{FAULTS[faults[0]].switches[0]} must be 0 with space metres, where only wind "
                f"makes drones deviate"
            )

    def arrays(self, ensemble: WorldEnsemble | None) -> MetresArrays:
        """Return the arrays for the kernels."""
        assert ensemble is not None
        truth = ensemble.tracks.truth_m
        assert truth is not None
        return MetresArrays(
            airframes=self.airframes,
            detectors=self.detectors,
            wind=self.wind,
            cell_m=self._cell_m,
            truth=truth.transpose(1, 0, 2),
            states=self.states,
            paths=self.paths,
            looked=self.looked,
            preset=self._preset,
            actions=self.actions,
        )

    def plan(self, drone: int, action: NDArray[np.float64], kind: int) -> NDArray[np.float64]:
        """Return the path (K + 1, 2) of an action of a drone of the first world, without flying it.

        Args:
            drone: The drone.
            action: Its turn and speed.
            kind: Number of its kind.
        """
        state, path = self.states[0, drone : drone + 1].copy(), np.empty(self.paths.shape[2:])
        path_of_action(self.airframes, kind, self.wind, state, action, path)
        return path

    def preset(self, drone: int, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> None:
        """Set the path of a drone of the first world in the next step: its vehicle has flown it.

        Heading and speed after it are those of the last piece. Positions count to a millimetre, as
        a log has them.

        Args:
            drone: The drone.
            path: (K + 1, 2), as `paths`.
            looked: (K + 1,), as `looked`.
        """
        state, pieces, path = self.states[0, drone], len(path) - 1, np.round(path, 3)
        self.paths[0, drone], self.looked[0, drone] = path, looked
        self._preset[0, drone] = True
        wind = self.wind
        east, south = (path[-1] - path[-2]) * pieces / wind.step_s - (wind.east, wind.south)
        state["speed"] = math.hypot(east, south)
        if state["speed"] > 0.0:
            state["heading"] = math.atan2(east, -south)

    def preset_plan(self, drone: int, kind: int) -> None:
        """Have a drone of the first world fly its action as a vehicle would, unless it has a path.

        Args:
            drone: The drone.
            kind: Number of its kind.
        """
        if not self._preset[0, drone]:
            looked = np.ones(self.looked.shape[2], np.bool_)
            looked[0] = self.looked[0, drone, -1]
            self.preset(drone, self.plan(drone, self.actions[0, drone], kind), looked)

    @property
    def wind_mps(self) -> tuple[float, float]:
        """Velocity of the wind to the east and to the north, m/s."""
        return self.wind.east, -self.wind.south

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that a snapshot needs."""
        return {"motion_states": self.states, "looked": self.looked}

    def in_cells(self) -> NDArray[np.float64]:
        """Return the positions (B, N, 2) in cells, with the centre of cell (0, 0) at (0, 0)."""
        places = np.stack([self.states["east"], self.states["south"]], axis=-1)
        cells: NDArray[np.float64] = places / self._cell_m - 0.5
        return cells

    def check(self, states: NDArray[np.void], grid: GridShape) -> None:
        """Check the states in a snapshot, an array of the same shape.

        Raises:
            SnapshotError: If they are not finite, or those of drones are not on the grid.
        """
        places = np.stack([states["east"], states["south"]], axis=-1)
        inside = (places >= 0.0) & (places <= grid.extent(self._cell_m))
        if self._of_vehicles:
            inside = np.isfinite(places)
        rest = np.isfinite(states["heading"]) & (states["speed"] >= 0.0)
        if not (inside.all() and rest.all() and np.isfinite(states["speed"]).all()):
            raise SnapshotError("the snapshot is damaged: drones are not on the grid")


def _check_kinds(scenario: ResolvedScenario) -> None:
    """Raise unless the kinds of drones can fly in metres."""
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


def reported_wind(
    wind_mps: tuple[float, float], airframes: NDArray[np.void], step_s: float
) -> Wind:
    """Return a wind that was reported in flight.

    Args:
        wind_mps: Its velocity to the east and to the north, m/s.
        airframes: (K,) of all kinds of drones.
        step_s: Time of a step, s.

    Raises:
        FieldError: If it is not slower than the drones.
    """
    east, north = wind_mps
    check_wind("vehicle_wind", math.hypot(east, north), float(airframes["cruise"].min()))
    return Wind(east, -north, step_s)


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
                name for name, sensor in SENSORS.loaded().items() if sensor.lateral is not None
            )
            raise FieldError(
                f"sensor must be one of {known} with space metres, got {kind.sensor!r}"
            )
        try:
            ranges.append(lateral(scenario, kind))
        except ValueError as error:
            raise FieldError(f"sensor: {kind.sensor}: {error}") from None
    return ranges


def detectors_of_kinds(scenario: ResolvedScenario) -> NDArray[np.void]:
    """Return what each kind of drone sees of each appearance, (K, A) of `DETECTORS`.

    Raises:
        FieldError: As `lateral_ranges`.
    """
    return np.stack(
        [
            detectors_of(lateral_ranges(seen_as), scenario.step_duration_s)
            for seen_as in scenario.seen_as
        ],
        axis=1,
    )


def strips_of(scenario: ResolvedScenario) -> tuple[float, ...]:
    """Return the width of the strip that each drone sees on its path, in metres.

    It is the sweep width of an inverse cube law, else twice the definite range.
    """
    widths = [lateral.sweep_width_m or 2 * lateral.reach_m for lateral in lateral_ranges(scenario)]
    return tuple(widths[kind] for kind in scenario.kind_of)
