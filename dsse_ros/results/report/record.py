# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission as it was recorded, as arrays: from the CSV of `record_file`, or from a bag."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.mission.recording.step_inputs import FlownPaths, StepInputs, commands_in_metres
from dsse_ros.search.environments.metres_drones import wind_of
from dsse_ros.search.step.looks import looks_of
from dsse_ros.search.step.metres_kernels import path_of_action
from dsse_ros.search.step.metres_paths import MOTION_STATES, airframes_of, pieces_of
from dsse_ros.search.step.viewpoints import NO_LOOK, viewpoints_at
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.sensors.sensor import SEARCH

Floats = NDArray[np.float64]
Search = Callable[[int], SearchDefinition]
"""Returns what so many drones have searched."""
DEFAULT_MAPS = 6
_MCAP = b"\x89MCAP0\r\n"
"""How MCAP files begin."""
_OF_LEG = 8
"""Points for each cell of a leg, to find the cells that it crosses."""


@dataclass(frozen=True, eq=False)
class RecordedMission:
    """K recorded steps of N drones, and of P persons if these are known.

    Cells are (col, row), row 0 in the north. They are the drones' true cells or, in a bag of drones
    that observe wrong positions, the observed ones.

    Attributes:
        number: Number of the mission.
        steps: (K,) int64, the recorded steps in ascending order; 0 is the start.
        times_s: (K,) float64 mission time since the start of the mission.
        cells: (K, N, 2) int64.
        actions: (K, N) names of the actions, "" for none.
        rewards: (K, N) float64.
        terminated: (K, N) bool.
        truncated: (K, N) bool.
        found: (K, N) bool, whether the drone found a person in the step.
        held: (K, N) bool.
        rules: The rules of the search.
        scenario: The scenario, resolved.
        commands: (K, N) names of the commanded actions, `actions` without faults; None if not
            recorded.
        flown: The paths of vehicles in metres; else None.
        work: (K, N) int8 of `WORKS`, the work that vehicles still had to do; None without vehicles
            whose actions last as long as they need.
        vehicle_viewpoints: (K, N) of `VIEWPOINTS`, the cells from which the vehicles looked; None
            with `work`.
        probabilities: (K, N) float64, map values of the cells searched; None if not recorded.
        pos: (K,) float64 cumulative probability of success after each step; None if not recorded.
        pos_alive: POS alive at the end; None without `Incident.survival`, or not computed, see
            `recomputed.pos_alive`.
        object_shares: (K, O) float64 probability of each possible object of the incident after
            each step; None if there is one, or not computed, see `recomputed.object_shares`.
        coverage_rate: (K,) float64 share of the cells to cover that are covered after each step;
            None if not recorded, or for another task.
        repeated_coverage: (K,) float64 visits of other cells, over the number of cells to cover.
        waited: (K, N) bool, whether the drone searched where nobody could be, by the map that it
            observed; None if not computed, see `recomputed.with_waits`.
        persons: (K, P, 2) int64; None if not recorded.
        person_found: (K, P) bool; None if not recorded.
        seed: Seed of the mission; None if not known.
        run_id: run_id of the simulation; None if not known.
        in_cells: (K, N, 2) float64 (col, row) of the drones in metres, whose fractions lie between
            cells; None if drones move from cell to cell.
        turns: (K, N, 2) float64, turns and speeds in metres; None if not recorded.
        courses: (K, N, 2) float64, headings and airspeeds in metres; None if not recorded.
    """

    number: int
    steps: NDArray[np.int64]
    times_s: NDArray[np.float64]
    cells: NDArray[np.int64]
    actions: NDArray[np.str_]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    found: NDArray[np.bool_]
    held: NDArray[np.bool_]
    rules: Rules
    scenario: ResolvedScenario
    commands: NDArray[np.str_] | None = None
    work: NDArray[np.int8] | None = None
    vehicle_viewpoints: NDArray[np.void] | None = None
    flown: FlownPaths | None = None
    probabilities: NDArray[np.float64] | None = None
    pos: NDArray[np.float64] | None = None
    pos_alive: float | None = None
    object_shares: NDArray[np.float64] | None = None
    coverage_rate: NDArray[np.float64] | None = None
    repeated_coverage: NDArray[np.float64] | None = None
    waited: NDArray[np.bool_] | None = None
    persons: NDArray[np.int64] | None = None
    person_found: NDArray[np.bool_] | None = None
    seed: int | None = None
    run_id: int | None = None
    in_cells: NDArray[np.float64] | None = None
    turns: NDArray[np.float64] | None = None
    courses: NDArray[np.float64] | None = None

    @property
    def places(self) -> NDArray[Any]:
        """(K, N, 2) (col, row) of the drones; in metres, fractions lie between cells."""
        return self.cells if self.in_cells is None else self.in_cells

    @cached_property
    def paths(self) -> NDArray[np.float64]:
        """The path of each drone in metres in each step, (K, N, P + 1, 2) at equal times.

        Positions are as in `step.metres_paths`. Vehicles' paths are recorded, others flown again.
        Where that is not possible, as after a step that was not recorded, they are straight.
        """
        if self.flown is not None:
            return self.flown.paths
        scenario = self.scenario
        airframes, wind = airframes_of(scenario.kinds), wind_of(scenario)
        ends = (self.places + 0.5) * scenario.cell_size
        before = np.concatenate([ends[:1], ends[:-1]])
        shares = np.linspace(0.0, 1.0, pieces_of(airframes, wind.step_s) + 1)
        paths: Floats = before[:, :, None] + shares[:, None] * (ends - before)[:, :, None]
        if self.courses is None or self.turns is None:
            return paths
        flies = self.acted[1:] & (np.diff(self.steps) == 1)[:, None]
        state = np.zeros(1, MOTION_STATES)
        extent = scenario.grid_size.extent(scenario.cell_size)
        for k, n in np.argwhere(flies).tolist():
            state[0] = *ends[k, n], *self.courses[k, n]
            path, turn = paths[k + 1, n], self.turns[k + 1, n]
            path_of_action(airframes, scenario.kind_of[n], wind, state, turn, path)
            # A drone stops at the edge of the grid.
            np.clip(path, 0.0, extent, out=path)
        # A log rounds positions and headings.
        paths[:, :, -1] = ends
        return paths

    def tracks(self, num_steps: int) -> NDArray[Any]:
        """Return the places of each drone in the first recorded steps, (N, M, 2) (col, row).

        In metres they are those on its paths, P for each step after the first.
        """
        if self.in_cells is None:
            return self.cells[:num_steps].swapaxes(0, 1)
        paths = self.paths[:num_steps].swapaxes(0, 1)
        later = paths[:, 1:, 1:].reshape(len(paths), -1, 2)
        tracks: Floats = np.concatenate([paths[:, 0, -1:], later], axis=1)
        return tracks / self.scenario.cell_size - 0.5

    def looked_on_tracks(self, num_steps: int) -> NDArray[np.bool_] | None:
        """Return whether each drone looked on each leg of `tracks`, (N, M - 1).

        None if all did, as they do without vehicles.
        """
        if self.flown is None:
            return None
        looked = self.flown.looked[1:num_steps, :, 1:].swapaxes(0, 1)
        return looked.reshape(len(looked), -1)

    @property
    def grid_size(self) -> GridShape:
        """Columns and rows of the grid."""
        return self.scenario.grid_size

    @property
    def area(self) -> NDArray[np.bool_] | None:
        """The cells to search, (R, C) bool [row, col]; None for all."""
        return self.scenario.area_mask

    @property
    def agents(self) -> list[str]:
        """Names of the drones."""
        return [f"drone{i}" for i in range(self.cells.shape[1])]

    @property
    def complete(self) -> bool:
        """Whether the mission was recorded to its end, with no drone left in flight."""
        return bool((self.terminated | self.truncated)[-1].all())

    @property
    def missing_steps(self) -> int:
        """Number of steps up to the last one that were not recorded."""
        return int(self.steps[-1]) + 1 - len(self.steps)

    @cached_property
    def in_flight(self) -> NDArray[np.bool_]:
        """Which drones were in the search before each step, (K, N)."""
        out = self.terminated | self.truncated
        return np.vstack([np.ones_like(out[:1]), ~out[:-1]])

    @cached_property
    def acted(self) -> NDArray[np.bool_]:
        """Which drones were in the search and did their actions, (K, N): none at the start.

        In the step that detects the timeout, no drone acts unless the rules let it.
        """
        acts: NDArray[np.bool_] = self.in_flight & (self.steps > 0)[:, np.newaxis]
        acts[self.steps > self.rules.last_acting_step(self.scenario.timestep_limit)] = False
        return acts

    @property
    def _off_grid(self) -> NDArray[np.bool_]:
        return np.asarray(((self.cells < 0) | (self.cells >= self.grid_size)).any(axis=2))

    @property
    def covers(self) -> bool:
        """Whether the task is coverage."""
        return self.rules.covers

    @cached_property
    def searched(self) -> NDArray[np.bool_]:
        """Which drones searched a cell of the grid in each step, (K, N); covering counts too.

        In metres all that fly do.
        """
        if self.rules.in_metres:
            return self.acted
        looked = self.actions == SEARCH
        if self.covers:
            looked |= np.diff(self.cells, axis=0, prepend=self.cells[:1]).any(axis=2)
        return np.asarray(self.acted & looked & ~self._off_grid)

    @cached_property
    def viewpoints(self) -> NDArray[np.void]:
        """The cells from which drones on cells looked, (K, N) of `VIEWPOINTS`.

        They are those of the vehicles, if vehicles flew the mission.
        """
        if self.vehicle_viewpoints is not None:
            return self.vehicle_viewpoints
        done = np.where(self.acted, numbers_of(self.actions, self.rules.actions), NO_LOOK)
        return viewpoints_at(done, self.cells[..., 0], self.cells[..., 1])

    @property
    def looked_at(self) -> NDArray[np.int64]:
        """Every look at a cell of the grid, (Q, 4) as (number of the step, drone, col, row).

        In metres these are the cells that a drone flew over between the ends of two steps.
        """
        return self._looks[0]

    @property
    def pods_of_looks(self) -> NDArray[np.float64]:
        """POD of each person in the cell of each look of `looked_at`, (Q, P); 0 in metres."""
        return self._looks[1]

    @cached_property
    def _looks(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        if self.covers:
            step, drone = np.nonzero(self.searched)
            pod = self.scenario.probability_of_detection
            looked = np.column_stack([step, drone, self.cells[step, drone]])
            return looked, np.full((len(step), 1), pod)
        if self.rules.in_metres:
            cells = _flown_over(self.places, self.acted, self.grid_size)
            return cells, np.zeros((len(cells), self.scenario.person_amount))
        looks, parts = looks_of(self.scenario, self.rules), [np.empty((0, 4), np.int64)]
        pods, views = [np.empty((0, looks.pods.shape[1]))], self.viewpoints
        for n in range(views.shape[1]):
            for action in range(len(self.rules.actions)):
                done = np.flatnonzero(views["action"][:, n] == action)
                at = np.stack([views["x"][done, n], views["y"][done, n]], axis=1)
                for look in looks.numbers(n, action):
                    cells = at + looks.offsets[look]
                    parts.append(np.column_stack([done, np.full_like(done, n), cells]))
                    pods.append(np.repeat(looks.pods[look : look + 1], len(done), axis=0))
        looked = np.concatenate(parts)
        off_grid = ((looked[:, 2:] < 0) | (looked[:, 2:] >= self.grid_size)).any(axis=1)
        order = np.lexsort((looked[:, 1], looked[:, 0]))
        order = np.setdiff1d(order, np.flatnonzero(off_grid), assume_unique=True)
        return looked[order], np.concatenate(pods)[order]

    @property
    def object_names(self) -> list[str]:
        """The classes of leeway that the object of the incident may be."""
        incident = self.scenario.incident
        return [] if incident is None else [one.category.key for one in incident.objects]

    @cached_property
    def lost(self) -> NDArray[np.bool_]:
        """Which drones were out of the search before it ended for all, (K, N).

        The end of a mission flags every remaining drone: a find or the timeout does not lose them.
        """
        lost = self.terminated | self.truncated
        done = self.found[-1].any()
        if self.coverage_rate is not None:
            done |= self.coverage_rate[-1] == 1.0
        ended = self.in_flight[-1] & (self.truncated[-1] | done)
        lost[-1] &= ~ended | self._off_grid[-1]
        return lost

    def inputs(self, k: int) -> StepInputs:
        """Return the inputs of the k-th recorded step; its commands are recorded."""
        if self.rules.in_metres:
            assert self.turns is not None
            commands: list[Any] = commands_in_metres(self.turns[k], self.held[k])
        else:
            assert self.commands is not None
            commands = numbers_of(self.commands[k], self.rules.actions).tolist()
        return StepInputs(
            commands,
            None if self.work is None else self.work[k],
            None if self.vehicle_viewpoints is None else self.vehicle_viewpoints[k],
            None if self.flown is None else FlownPaths(self.flown.paths[k], self.flown.looked[k]),
        )


def _flown_over(
    places: NDArray[np.float64], acted: NDArray[np.bool_], grid: GridShape
) -> NDArray[np.int64]:
    """Return the cells under the straight legs between recorded steps.

    Args:
        places: (K, N, 2) (col, row) of the drones.
        acted: (K, N) which drones flew in each step.

    Returns:
        (Q, 4) as (number of the step, drone, col, row), each once.
    """
    before, drones = np.nonzero(acted[1:])
    legs = places[before + 1, drones] - places[before, drones]
    shares = np.linspace(0.0, 1.0, int(_OF_LEG * np.abs(legs).max(initial=1.0)) + 2)
    way = places[before, drones][:, None] + shares[:, None] * legs[:, None]
    # The far edge of the grid belongs to its cells; beyond it, vehicles are over none.
    cells = np.floor(way + 0.5).astype(np.int64) - (way == np.array(grid) - 0.5)
    steps = np.stack([before + 1, drones], axis=1)[:, None].repeat(len(shares), axis=1)
    over = np.concatenate([steps, cells], axis=2).reshape(-1, 4)
    return np.unique(over[((over[:, 2:] >= 0) & (over[:, 2:] < grid)).all(axis=1)], axis=0)


def places_of(
    scenario: ResolvedScenario, east_m: NDArray[np.float64], north_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (col, row) of positions (K, N) from the south-west corner, (K, N, 2).

    Fractions lie between cells.
    """
    cell_m = scenario.cell_size
    places = [east_m / cell_m - 0.5, scenario.grid_size.rows - 0.5 - north_m / cell_m]
    return np.stack(places, axis=-1).astype(np.float64)


def numbers_of(names: NDArray[np.str_], actions: Sequence[str]) -> NDArray[np.int8]:
    """Return the numbers of actions by name; of other names -1, as `NO_ACTION` and `NO_LOOK`."""
    numbers = np.full(names.shape, -1, np.int8)
    for number, name in enumerate(actions):
        numbers[names == name] = number
    return numbers


def chosen_steps(
    record: RecordedMission, wanted: Sequence[int], count: int = DEFAULT_MAPS
) -> list[int]:
    """Return the recorded steps, 0 to K - 1, to draw maps of.

    Args:
        wanted: Steps of the mission; none for some from the start to the end.

    Raises:
        FieldError: If a wanted step was not recorded.
    """
    if not wanted:
        last = len(record.steps) - 1
        return np.unique(np.linspace(0, last, count).round().astype(int)).tolist()
    places = {step: k for k, step in enumerate(record.steps.tolist())}
    for step in wanted:
        if step not in places:
            first, last = record.steps[0], record.steps[-1]
            raise FieldError(f"steps must be recorded steps, {first} to {last}, got {step}")
    return sorted({places[step] for step in wanted})


def is_bag(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is a bag: an MCAP file, or a folder of rosbag2."""
    if Path(path).is_dir():
        return True
    try:
        with Path(path).open("rb") as file:
            return file.read(len(_MCAP)) == _MCAP
    except OSError:
        return False


def check_limit(record: RecordedMission) -> RecordedMission:
    """Return a record whose steps fit the time limit of its scenario.

    Raises:
        FieldError: If they do not.
    """
    limit, last = record.scenario.timestep_limit, int(record.steps[-1])
    # The step after the last one detects the timeout.
    if last > record.rules.last_step(limit) + 1:
        raise FieldError(f"scenario: timestep_limit must allow the recorded {last}, got {limit}")
    return record
