# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recorded missions from a log, the CSV of `record_file`."""

from __future__ import annotations

import csv
import logging
import os
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.mission.files.definition_log import definition_file, read_definitions
from dsse_ros.mission.files.mission_log import COLUMNS, OF_COVERAGE
from dsse_ros.mission.recording.step_inputs import FlownPaths
from dsse_ros.results.report.record import (
    RecordedMission,
    Search,
    check_limit,
    numbers_of,
    places_of,
)
from dsse_ros.search.step.fault_kernels import WORKS
from dsse_ros.search.step.viewpoints import viewpoints_at
from dsse_ros.world.scenario.agents import definition_from
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import cell_to_map
from dsse_ros.world.scenario.json_keys import Keys
from dsse_ros.world.scenario.limits import LARGEST_GRID_CELLS, check_cells
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame

_LOGGER = logging.getLogger(__name__)

_ROUNDING_M = 6e-4
"""Precision of the metres in a log, which have three decimals."""
_LONGEST_FIELD = 1000
"""Characters of a field of a log: a path of a vehicle has about 300."""
_TOLERANCE = 1e-4
"""Cells; a log has three decimals of a metre."""
_Column = Callable[..., NDArray[Any]]
"""Returns a column of the log, (K, N), by its name and data type."""


def read_csv(
    path: str | os.PathLike[str],
    search: Search | None = None,
    max_cells: int = LARGEST_GRID_CELLS,
) -> list[RecordedMission]:
    """Return the missions of a log, without an incomplete last step.

    Args:
        search: What was searched; by default the file beside the log states it.

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
        step = last.pop()
        _LOGGER.warning("%s: step %s lacks lines; it is left out", name, step[0][1])
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
    """Return what the file beside a log states, see `read_definitions`."""
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
    for line, row in enumerate(reader, start=2):
        if len(row) != num_columns:
            # In the middle of a file, the step's other rows reveal that.
            _LOGGER.warning("%s: line %d was cut off; it is left out", name, line)
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
    """Return the numbers of the steps after checking them."""
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
        cells: (K, N + P, 2) as (col, row), of the drones and the persons.
        metres: (K, N + P, 2), to the east and to the north.

    Raises:
        ValueError: If metres and cells are of different positions.
    """
    first, places = 0, None
    if definition.rules.in_metres:
        first, places = count, places_of(scenario, *np.moveaxis(metres[:, :count], 2, 0))
        _check_in_cells(places, cells[:, :count])
    expected = cell_to_map(scenario_frame(scenario), *np.moveaxis(cells[:, first:], 2, 0))
    if not np.allclose(np.moveaxis(metres[:, first:], 2, 0), expected, rtol=0, atol=_ROUNDING_M):
        raise ValueError(
            f"scenario: {scenario.grid_size} cells of {scenario.cell_size:g} m do not have "
            "the recorded positions"
        )
    return places


def _shares(name: str, texts: NDArray[Any]) -> NDArray[np.float64]:
    """Return probabilities."""
    values = texts.astype(np.float64)
    wrong = ~((values >= 0) & (values <= 1))
    if wrong.any():
        raise ValueError(f"{name} must be from 0 to 1, got {shown(texts[wrong][0])}")
    return values


def _mission(
    columns: Sequence[str],
    steps: Sequence[Sequence[Sequence[str]]],
    search: Search,
    max_cells: int,
) -> RecordedMission:
    """Return a mission from the rows of its steps."""
    definition = search(count := _count_drones(steps))
    rules, scenario = definition.rules, definition.scenario.resolve(definition.rules)
    check_cells(scenario.grid_size, max_cells)
    # NumPy's own strings would all be as long as the longest.
    table = np.array(steps, object)

    def column(name: str, kind: Any = np.float64, agents: slice = slice(0, count)) -> NDArray[Any]:
        values: NDArray[Any] = table[:, agents, columns.index(name)].astype(kind)
        return values

    def names(name: str) -> NDArray[np.str_]:
        known = {"", *rules.actions}
        texts = {str(text) for text in table[:, :count, columns.index(name)].flat}
        if rules.actions and (unknown := sorted(texts - known)):
            allowed = ", ".join(rules.actions)
            raise ValueError(f"{name} must be empty or one of {allowed}, got {shown(unknown[0])}")
        return column(name, np.str_)

    def pairs(*pair: str, **kind: Any) -> NDArray[Any]:
        return np.stack([column(name, **kind) for name in pair], axis=2)

    persons, everybody = slice(count, None), slice(None)
    cells = pairs("col", "row", kind=np.int64, agents=everybody)
    metres = pairs("east_m", "north_m", agents=everybody)
    turns = courses = None
    if rules.in_metres:
        turns, courses = pairs("turn", "speed"), pairs("heading_deg", "airspeed")
        courses[..., 0] = np.radians(courses[..., 0])
    pos = table[:, 0, columns.index("pos")]
    # Not what was observed, which metres belong to.
    true = [name for name in ("true_col", "true_row") if name in columns]

    def flag(name: str, **agents: slice) -> NDArray[np.bool_]:
        return column(name, np.int64, **agents).astype(bool)

    rate, repeated = (column(name)[:, 0] if name in columns else None for name in OF_COVERAGE)
    return check_limit(
        RecordedMission(
            number=int(table[0, 0, 0]),
            steps=_increasing(column("step", np.int64)[:, 0]),
            times_s=column("time_s")[:, 0],
            cells=pairs(*(true or ("col", "row")), kind=np.int64),
            actions=names("action"),
            commands=names("command" if "command" in columns else "action"),
            **_of_vehicles(column, columns, rules.actions),
            rewards=column("reward"),
            terminated=flag("terminated"),
            truncated=flag("truncated"),
            found=flag("found"),
            held=flag("held"),
            rules=rules,
            scenario=scenario,
            probabilities=column("probability"),
            pos=_shares("pos", pos) if (pos != "").all() else None,
            coverage_rate=rate,
            repeated_coverage=repeated,
            persons=cells[:, persons],
            person_found=flag("found", agents=persons),
            in_cells=_places(definition, scenario, cells, metres, count),
            turns=turns,
            courses=courses,
        )
    )


def _check_in_cells(places: NDArray[np.float64], cells: NDArray[np.int64]) -> None:
    """Raise unless places (K, N, 2) lie in their cells."""
    away = np.abs(places - cells)
    # This form of the comparison also refuses NaN.
    if not (away <= 0.5 + _TOLERANCE).all():
        raise ValueError("scenario: the recorded positions do not lie in their cells")


def _of_vehicles(
    column: _Column, columns: Collection[str], actions: Sequence[str]
) -> dict[str, Any]:
    """Return the fields of `RecordedMission` on vehicles."""
    if "path" in columns:
        return {"flown": _flown_paths(column)}
    if "work" in columns:
        work, viewpoints = _works(column("work", np.str_)), _viewpoints(column, actions)
        return {"work": work, "vehicle_viewpoints": viewpoints}
    return {}


def _flown_paths(column: _Column) -> FlownPaths:
    """Return the paths that vehicles have flown, see `mission_log.OF_FLOWN`.

    Raises:
        ValueError: If there is no path, or no flag, of a vehicle.
    """
    points = [[text.split() for text in row] for row in column("path", np.str_).tolist()]
    flags = [[list(text) for text in row] for row in column("looked", np.str_).tolist()]
    looked = np.array(flags, np.int64) > 0
    return FlownPaths(np.array(points, np.float64).reshape(*looked.shape, 2), looked)


def _viewpoints(column: _Column, actions: Sequence[str]) -> NDArray[np.void]:
    """Return the viewpoints of vehicles, (K, N) of `VIEWPOINTS`.

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


def _works(names: NDArray[np.str_]) -> NDArray[np.int8]:
    """Return the numbers of `WORKS` by name.

    Raises:
        ValueError: If a name is unknown.
    """
    unknown = sorted(set(names.ravel().tolist()) - {*WORKS})
    if unknown:
        raise ValueError(f"work must be one of {', '.join(WORKS)}, got {unknown[0]!r}")
    return np.vectorize(WORKS.index, otypes=[np.int8])(names)
