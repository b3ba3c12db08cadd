# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The record of a mission: one CSV row per step and drone, and per step and person."""

from __future__ import annotations

import contextlib
import csv
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.definition_log import DefinitionLog
from dsse_ros.mission.run.mission import Mission, StepResult
from dsse_ros.search.step.fault_kernels import STATUSES, WORKS
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import cell_to_geodetic

COLUMNS = (
    "mission", "step", "time_s", "agent", "col", "row", "east_m", "north_m", "lat_deg", "lon_deg",
    "action", "reward", "terminated", "truncated", "found", "held", "probability", "pos",
)  # fmt: skip
"""Column names; `probability` is that of the searched cell, `pos` is `Mission.pos`.
Persons have no action and no reward."""
OF_COVERAGE = ("coverage_rate", "repeated_coverage")
"""Further columns of a coverage task, see `dsse_ros.search.environments.coverage_task`."""
OF_FAULTS = ("command", "status", "battery", "true_col", "true_row")
"""Further columns of missions with faults, empty for persons: the commanded action, one of
`fault_kernels.STATUSES`, percent, and the true cell, because `col` and `row` are observed.
"""


OF_VEHICLES = ("work", "look_action", "look_col", "look_row")
"""Further columns of missions with `vehicle_timed_actions`, which have faults too: one of
`fault_kernels.WORKS`; the action whose looks the vehicle has done, and the cell from which, empty
if it has not looked.
"""
OF_FLOWN = ("path", "looked")
"""Further columns of missions with `vehicle_timed_actions` in metres, empty for persons: `path` and
`looked` of `Flown`; the points as x y x y ..., metres to the east and to the south of the grid's
north-west corner, and 0 or 1 for each.
"""
OF_FLIGHT = ("heading_deg", "airspeed", "turn", "speed")
"""Further columns of missions in metres, empty for persons: the heading clockwise from north, the
airspeed in m/s, and the action, see `step.metres_paths`. `east_m`, `north_m`, `lat_deg` and
`lon_deg` are where the drone is in its cell."""


def columns_of(
    *, covers: bool, faults: bool, vehicles: bool = False, metres: bool = False
) -> tuple[str, ...]:
    """Return the columns of a mission's record."""
    groups = (
        (covers, OF_COVERAGE), (faults, OF_FAULTS), (vehicles and not metres, OF_VEHICLES),
        (metres, OF_FLIGHT), (vehicles and metres, OF_FLOWN),
    )  # fmt: skip
    return COLUMNS + tuple(name for has, names in groups if has for name in names)


class MissionLog:
    """Writes the steps of missions to a file as they happen, and their search beside it.

    Args:
        path: The file; existing content is overwritten.
        resume_at: First (mission, step) to write; the file keeps the rows before it.

    Raises:
        FieldError: If the file cannot be written, or is to be resumed but is not a mission's log.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        frame: GridFrame,
        *,
        resume_at: tuple[int, int] | None = None,
        covers: bool = False,
        faults: bool = False,
        vehicles: bool = False,
        metres: bool = False,
    ) -> None:
        self._path = path
        self._frame = frame
        self._faults, self._vehicles = faults, vehicles
        self._defined: DefinitionLog | None = None
        self._mission = (0, 0)
        self._of_coverage = OF_COVERAGE if covers else ()
        columns = columns_of(covers=covers, faults=faults, vehicles=vehicles, metres=metres)
        self._further = len(columns) - len(COLUMNS) - len(self._of_coverage)
        try:
            if resume_at is not None:
                _cut(path, resume_at, columns)
            mode = "w" if resume_at is None else "a"
            self._file = Path(path).open(mode, newline="", encoding="utf-8")  # noqa: SIM115
            # A device, such as /dev/null, has no file beside it.
            if Path(path).is_file():
                self._defined = DefinitionLog(path, resume=resume_at is not None)
        except OSError as error:
            raise FieldError(f"record_file: {os.fspath(path)!r}: {error.strerror}") from None
        self._writer = csv.writer(self._file, lineterminator="\n")
        # The last written step, and the offset of its rows.
        self._last = (0, 0)
        self._last_at = 0
        if self._file.tell() == 0:
            self._writer.writerow(columns)

    def write(self, mission: Mission, result: StepResult) -> None:
        """Append a step, or overwrite it if it is the last one; it is in the file on return."""
        if self._defined is not None and self._mission != (mission.number, mission.seed):
            self._defined.write(mission)
            self._mission = (mission.number, mission.seed)
        self._seek((mission.number, result.step))
        env, step_s = mission.env, mission.env.scenario.step_duration_s
        action_names = env.rules.actions
        persons = env.world.persons[0]
        of_persons = np.stack([persons["x"], persons["y"]], axis=1)
        cells = np.vstack([result.cells, of_persons])
        col, row = np.vstack([result.places, of_persons]).T
        east, north = cell_to_map(self._frame, col, row)
        lat, lon, _ = cell_to_geodetic(self._frame, col, row, 0.0)
        drones, pos = len(result.cells), "" if mission.pos is None else repr(mission.pos)
        coverage = mission.coverage
        covered = [repr(coverage[name]) for name in self._of_coverage]
        for i, (col, row) in enumerate(cells.tolist()):
            place = (
                col, row, f"{east[i]:.3f}", f"{north[i]:.3f}", f"{lat[i]:.9f}", f"{lon[i]:.9f}",
            )  # fmt: skip
            head = (mission.number, result.step, f"{result.step * step_s:.3f}")
            if i < drones:
                action = int(result.actions[i])
                flags = (result.terminated, result.truncated, result.found, result.held)
                self._writer.writerow(
                    (
                        *head,
                        f"drone{i}",
                        *place,
                        action_names[action] if action >= 0 else "",
                        repr(float(result.rewards[i])),
                        *(int(flag[i]) for flag in flags),
                        repr(float(result.probabilities[i])),
                        pos,
                        *covered,
                        *self._of_faults(mission, result, i),
                        *_of_flight(result, i, vehicles=self._vehicles),
                    )  # fmt: skip
                )
            else:
                found = int(persons["found"][i - drones])
                more = ("",) * self._further
                self._writer.writerow(
                    (*head, f"person{i - drones}", *place, "", "", "", "", found, "", "", "", *more)
                )
        self._file.flush()

    def _of_faults(self, mission: Mission, result: StepResult, drone: int) -> tuple[Any, ...]:
        """Return the values of `OF_FAULTS` and `OF_VEHICLES`, if the log has these columns."""
        if not self._faults or result.conditions is None:
            return ()
        condition, command = result.conditions[drone], int(result.commands[drone])
        world = mission.env.world
        place, has_battery = world.drones[0, drone], world.faults and world.faults.has_battery
        return (
            mission.env.rules.actions[command] if command >= 0 else "",
            STATUSES[condition["status"]],
            repr(float(condition["battery"])) if has_battery else "",
            int(place["x"]),
            int(place["y"]),
            *((WORKS[condition["work"]], *_look(mission, drone)) if self._vehicles else ()),
        )

    def _seek(self, step: tuple[int, int]) -> None:
        """Seek to the first row of this (mission, step)."""
        if step == self._last:
            self._file.seek(self._last_at)
            self._file.truncate()
        self._last, self._last_at = step, self._file.tell()

    def sync(self) -> None:
        """Flush the file to disk, so that it survives a loss of power."""
        with contextlib.suppress(OSError):
            os.fsync(self._file.fileno())
            if self._defined is not None:
                self._defined.sync()

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        if self._defined is not None:
            self._defined.close()


def _look(mission: Mission, drone: int) -> tuple[Any, ...]:
    """Return the action and the cell of a vehicle's look."""
    viewpoints = mission.env.world.viewpoints
    if viewpoints is None or viewpoints.array[0, drone]["action"] < 0:
        return ("", "", "")
    look = viewpoints.array[0, drone]
    return (mission.env.rules.actions[look["action"]], int(look["x"]), int(look["y"]))


def _of_flight(result: StepResult, drone: int, *, vehicles: bool) -> tuple[str, ...]:
    """Return the values of `OF_FLIGHT`, and with vehicles of `OF_FLOWN`; none between cells."""
    if result.flown is None:
        return ()
    state, (turn, speed) = result.flown.flights[drone], result.flown.actions[drone].tolist()
    heading_deg = math.degrees(float(state["heading"])) % 360.0
    values = (f"{heading_deg:.6f}", f"{state['speed']:.6f}", repr(turn), repr(speed))
    if not vehicles:
        return values
    path = " ".join(map(repr, result.flown.paths[drone].ravel().tolist()))
    return (*values, path, "".join(str(int(looked)) for looked in result.flown.looked[drone]))


def _cut(path: str | os.PathLike[str], end: tuple[int, int], columns: Sequence[str]) -> None:
    """Cut a record before the first row of this (mission, step) or a later one.

    Partial rows from a crash are cut too: they are at the end, after that step.

    Raises:
        FieldError: If the file is not a record of a mission.
        OSError: If it cannot be read or written.
    """
    if not Path(path).exists():
        return
    with Path(path).open("rb+") as file:
        head = file.readline()
        header = ",".join(columns).encode() + b"\n"
        if head not in (header, header[: len(head)]):
            raise FieldError(f"record_file: {os.fspath(path)!r} is not a record of a mission")
        keep = len(head) if head == header else 0
        for line in file:
            try:
                mission, step, _ = line.split(b",", 2)
                before = (int(mission), int(step)) < end and line.endswith(b"\n")
            except ValueError:
                before = False
            if not before:
                break
            keep += len(line)
        file.truncate(keep)
