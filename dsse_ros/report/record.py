# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission as it was recorded, as arrays; read from the CSV of `record_file`."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.definition_log import definition_file, read_definitions
from dsse_ros.mission.mission_log import COLUMNS, OF_COVERAGE
from dsse_ros.report.drone_places import check_flown, places_of
from dsse_ros.report.flown_paths import paths_in
from dsse_ros.report.looked_at import looks_in
from dsse_ros.report.of_vehicles import FlownByVehicles, of_vehicles, turns_of
from dsse_ros.scenario.agents import definition_from
from dsse_ros.scenario.definition import SearchDefinition
from dsse_ros.scenario.frames import cell_to_map, scenario_frame
from dsse_ros.scenario.json_keys import Keys
from dsse_ros.scenario.limits import LARGEST_GRID_CELLS, check_cells
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search import FieldError, Rules
from dsse_ros.sensors.sensor import SEARCH

Search = Callable[[int], SearchDefinition]
"""Returns what so many drones have searched."""
DEFAULT_MAPS = 6
_MCAP = b"\x89MCAP0\r\n"
"""How MCAP files begin."""
_ROUNDING_M = 6e-4
"""Precision of the metres in a log, which have three decimals."""
_LONGEST_FIELD = 1000
"""Characters of a field of a log: a path of a vehicle has about 300."""


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
        flown: What vehicles have flown in metres; else None.
        work: (K, N) int8 of `WORKS`, what the vehicles still had to do; None without vehicles whose
            actions last as long as they need.
        looks: (K, N) of `viewpoints.VIEWPOINTS`, from where they looked; None with `work`.
        probabilities: (K, N) float64, map values of the cells searched; None if not recorded.
        pos: (K,) float64 cumulative probability of success after each step; None if not recorded.
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
    looks: NDArray[np.void] | None = None
    flown: FlownByVehicles | None = None
    probabilities: NDArray[np.float64] | None = None
    pos: NDArray[np.float64] | None = None
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
        """(K, N, P + 1, 2) the path of each step in metres, see `flown_paths.paths_in`."""
        return paths_in(self)

    @property
    def grid_size(self) -> int:
        """Cells along a side of the grid, G."""
        return self.scenario.grid_size

    @property
    def area(self) -> NDArray[np.bool_] | None:
        """The cells to search, (G, G) bool [row, col]; None for all."""
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
        return looks_in(self)

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


def chosen_steps(
    record: RecordedMission, wanted: Sequence[int], count: int = DEFAULT_MAPS
) -> list[int]:
    """Return the recorded steps, 0 to K - 1, to draw maps of.

    Args:
        record: The mission.
        wanted: Steps of the mission; none for some from the start to the end.
        count: Number of those.

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


def read_csv(
    path: str | os.PathLike[str],
    search: Search | None = None,
    max_cells: int = LARGEST_GRID_CELLS,
) -> list[RecordedMission]:
    """Return the missions of a log, without an incomplete last step.

    Args:
        path: The file.
        search: What was searched; by default the file beside the log states it.
        max_cells: Cells of the largest grid.

    Raises:
        FieldError: If the file cannot be read, is not a log, has no step, has a larger grid, or is
            of another search.
    """
    name = f"file: {os.fspath(path)!r}"
    missions: dict[str, list[list[list[str]]]] = {}
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            columns = next(reader, [])
            if not {*COLUMNS} <= {*columns}:
                raise FieldError(f"{name} is neither the CSV of a mission nor a bag (MCAP)")
            for mission, rows in _steps(reader, len(columns), name):
                missions.setdefault(mission, []).append(rows)
    except OSError as error:
        raise FieldError(f"{name}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error):
        raise FieldError(f"{name} is neither the CSV of a mission nor a bag (MCAP)") from None
    if not missions:
        raise FieldError(f"{name}: no step of a mission")
    # The last step may be incomplete, if the mission was cut off.
    last = next(reversed(missions.values()))
    if len(last) > 1 and len(last[-1]) < len(last[0]):
        del last[-1]
    stated = {} if search is not None else _stated(path)
    # Most missions of a file are of the same search.
    stated_search = cache(lambda keys, drones: definition_from(keys, drones, None))
    read = []
    for mission, steps in missions.items():
        try:
            of_mission, seed = search, None
            if of_mission is None:
                if int(mission) not in stated:
                    raise FieldError(f"{definition_file(path).name} has no line for it")
                keys, seed = stated[int(mission)]
                of_mission = partial(stated_search, keys)
            read.append(replace(_mission(columns, steps, of_mission, max_cells), seed=seed))
        except (ValueError, OverflowError, IndexError) as error:
            raise FieldError(f"{name}: mission {mission}: {error}") from None
    return read


def _stated(path: str | os.PathLike[str]) -> dict[int, tuple[Keys, int]]:
    """Return what the file beside a log states, see `read_definitions`.

    Raises:
        FieldError: If there is none, or it is damaged.
    """
    file = definition_file(path)
    try:
        return read_definitions(path)
    except FileNotFoundError:
        raise FieldError(
            f"file: {str(file)!r}, which describes the search, is missing; use --scenario"
        ) from None
    except (OSError, ValueError) as error:
        raise FieldError(f"file: {str(file)!r}: {error}") from None


def _steps(
    reader: Iterator[list[str]], num_columns: int, name: str
) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield the rows of each step with the number of its mission, whole rows only."""
    key: tuple[str, str] | None = None
    rows: list[list[str]] = []
    for row in reader:
        if len(row) != num_columns:
            # The row was cut off. In the middle of a file, the step's other rows reveal that.
            continue
        if max(map(len, row)) > _LONGEST_FIELD:
            raise FieldError(
                f"{name}: a field must have at most {_LONGEST_FIELD} characters, got "
                f"{max(map(len, row))}"
            )
        if key is not None and (row[0], row[1]) != key:
            yield key[0], rows
            rows = []
        key = (row[0], row[1])
        rows.append(row)
    if key is not None:
        yield key[0], rows


def _count_drones(steps: Sequence[Sequence[Sequence[str]]]) -> int:
    """Return the number of drones in the rows of a mission's steps.

    Raises:
        ValueError: If there is none, or the steps have different drones or persons.
    """
    names = [row[3] for row in steps[0]]
    for rows in steps:
        if [row[3] for row in rows] != names:
            raise ValueError(f"step {rows[0][1]} has different drones or persons from the first")
    count = sum(name.startswith("drone") for name in names)
    if not count:
        raise ValueError("no drone")
    return count


def _increasing(steps: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the numbers of the steps after checking them.

    Raises:
        ValueError: If they do not increase, or one is below 0.
    """
    if (np.diff(steps) <= 0).any() or steps[0] < 0:
        raise ValueError("its steps do not increase")
    return steps


def _places(
    definition: SearchDefinition,
    scenario: ResolvedScenario,
    cells: NDArray[np.int64],
    metres: NDArray[np.float64],
    count: int,
) -> NDArray[np.float64] | None:
    """Return (col, row) of the drones in metres, (K, N, 2) with fractions; None on cells.

    Args:
        definition: What was searched.
        scenario: Its scenario.
        cells: (K, N + P, 2) as (col, row), of the drones and the persons.
        metres: (K, N + P, 2), to the east and to the north.
        count: N.

    Raises:
        ValueError: If metres and cells are of different positions.
    """
    first, places = 0, None
    if definition.rules.in_metres:
        first, places = count, places_of(scenario, *np.moveaxis(metres[:, :count], 2, 0))
        check_flown(places, cells[:, :count])
    expected = cell_to_map(scenario_frame(scenario), *np.moveaxis(cells[:, first:], 2, 0))
    if not np.allclose(np.moveaxis(metres[:, first:], 2, 0), expected, rtol=0, atol=_ROUNDING_M):
        raise ValueError(
            f"scenario: {scenario.grid_size} cells of {scenario.cell_size:g} m a side do not have "
            "the recorded positions"
        )
    return places


def _mission(
    columns: Sequence[str],
    steps: Sequence[Sequence[Sequence[str]]],
    search: Search,
    max_cells: int,
) -> RecordedMission:
    """Return a mission from the rows of its steps.

    Raises:
        ValueError: If they do not fit together, or are of another search.
    """
    definition = search(count := _count_drones(steps))
    rules, scenario = definition.rules, definition.scenario.resolve(definition.rules)
    check_cells(scenario.grid_size, max_cells)
    # NumPy's own strings would all be as long as the longest.
    table = np.array(steps, object)

    def column(name: str, kind: Any = np.float64, agents: slice = slice(0, count)) -> NDArray[Any]:
        values: NDArray[Any] = table[:, agents, columns.index(name)].astype(kind)
        return values

    persons, everybody = slice(count, None), slice(None)
    cells = np.stack([column(name, np.int64, everybody) for name in ("col", "row")], axis=2)
    metres = np.stack([column(name, agents=everybody) for name in ("east_m", "north_m")], axis=2)
    pos = table[:, 0, columns.index("pos")]
    # Not what was observed, which metres belong to.
    true = [name for name in ("true_col", "true_row") if name in columns]
    of_drones = np.stack([column(name, np.int64) for name in true or ("col", "row")], axis=2)

    def flag(name: str, **agents: slice) -> NDArray[np.bool_]:
        return column(name, np.int64, **agents).astype(bool)

    rate, repeated = (column(name)[:, 0] if name in columns else None for name in OF_COVERAGE)
    return check_limit(
        RecordedMission(
            number=int(table[0, 0, 0]),
            steps=_increasing(column("step", np.int64)[:, 0]),
            times_s=column("time_s")[:, 0],
            cells=of_drones,
            actions=column("action", np.str_),
            commands=column("command" if "command" in columns else "action", np.str_),
            **of_vehicles(column, columns, rules.actions),
            rewards=column("reward"),
            terminated=flag("terminated"),
            truncated=flag("truncated"),
            found=flag("found"),
            held=flag("held"),
            rules=rules,
            scenario=scenario,
            probabilities=column("probability"),
            pos=pos.astype(np.float64) if (pos != "").all() else None,
            coverage_rate=rate,
            repeated_coverage=repeated,
            persons=cells[:, persons],
            person_found=flag("found", agents=persons),
            in_cells=_places(definition, scenario, cells, metres, count),
            **(turns_of(column) if rules.in_metres else {}),
        )
    )
