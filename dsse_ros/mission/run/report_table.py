# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Step reports as a table of text, one line for each step, without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.step.fault_kernels import SEARCHING, STATUSES
from dsse_ros.world.scenario.agents import AgentsInfo

HEADER_EVERY = 20
"""Steps after which the header is repeated."""
_LONGEST_NAME = 14
_LAST_S = 1e9
"""Longest time at sea that is shown, s."""


class ReportTable:
    """Turns the reports of one mission after the other into lines.

    Args:
        width: Columns of the terminal. Drones that do not fit are counted; one is always shown.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._search: tuple[int, int] | None = None
        self._last: NDArray[Any] | None = None
        self._since_header = 0

    def lines(self, info: AgentsInfo, report: NDArray[Any]) -> list[str]:
        """Return the lines for a report; none for one that repeats the last.

        Args:
            info: The search.
            report: (N,) of a `step_report_dtype`.

        Raises:
            ValueError: If the report does not fit the search.
        """
        _check(info, report)
        run_id, mission, step = (int(report[name][0]) for name in ("run_id", "mission", "step"))
        written: list[str] = []
        if (run_id, mission) != self._search:
            written += [_title(info, run_id, mission)]
            self._since_header = HEADER_EVERY
        elif self._last is not None:
            if self._last.tobytes() == report.tobytes():
                return []
            before = int(self._last["step"][0])
            if step > before + 1:
                written.append(f"steps {before + 1} to {step - 1} were not received")
        self._search, self._last = (run_id, mission), report
        shown, width = _layout(info, report, self._width)
        if self._since_header >= HEADER_EVERY:
            names = [name.ljust(width) for name in info.agents[:shown]]
            written.append(_row("step", "time", "reward", names))
            self._since_header = 0
        self._since_header += 1
        written.append(_of_step(info, report, shown, width))
        if _is_over(report):
            # Some rules have a step beyond the limit.
            steps = min(step, info.timestep_limit)
            written.append(
                f"mission {mission} is over after {steps} steps: {_outcome(info, report)}"
            )
        return [_printable(line) for line in written]


def _check(info: AgentsInfo, report: NDArray[Any]) -> None:
    """Check that a report has the drones and the actions of a search."""
    if not 0 < len(report) == len(info.agents):
        raise ValueError(f"drones must be {len(info.agents)}, as in agents, got {len(report)}")
    for action in (report["action"].min(), report["action"].max()):
        if not -1 <= action < len(info.actions):
            raise ValueError(f"action must be from -1 to {len(info.actions) - 1}, got {action}")


def _is_over(report: NDArray[Any]) -> bool:
    return bool((report["terminated"] | report["truncated"]).all())


def _title(info: AgentsInfo, run_id: int, mission: int) -> str:
    seed = "" if info.mission != mission or info.seed is None else f", seed {info.seed}"
    size, number = info.frame.grid_size, len(info.agents)
    drones = "1 drone" if number == 1 else f"{number} drones"
    return f"mission {mission} of run {run_id}: {drones}, {size} cells{seed}"


def _layout(info: AgentsInfo, report: NDArray[Any], width: int) -> tuple[int, int]:
    """Return how many drones are shown, and how wide the column of each is."""
    words = ["FOUND", *info.actions]
    if "status" in (report.dtype.names or ()):
        words += STATUSES
    cell = sum(len(str(size)) for size in info.frame.grid_size) + 1
    column = cell + 1 + min(max(map(len, words)), _LONGEST_NAME)
    if _has_battery(report):
        column += len(" 100%")
    number = len(report)
    room = width - len(_of_all("", "", ""))
    if number * (column + 2) <= room:
        return number, column
    room -= 2 + len(_others(number))
    return min(max(room // (column + 2), 1), number), column


def _of_step(info: AgentsInfo, report: NDArray[Any], shown: int, width: int) -> str:
    """Return the line of a step with its first drones, and the number of the others."""
    over = _is_over(report)
    columns = [_drone(info, entry, over).ljust(width) for entry in report[:shown]]
    others = report[shown:]
    if len(others):
        columns.append(_others(len(others)))
        finders = [info.agents[shown + i] for i in np.flatnonzero(others["found"])]
        columns += [f"{name} FOUND" for name in finders]
    step = int(report["step"][0])
    minutes, seconds = divmod(int(min(step * info.step_duration_s, _LAST_S)), 60)
    reward = f"{float(report['reward'].sum()):.1f}"
    return _row(str(step), f"{minutes}:{seconds:02}", reward, columns)


def _others(number: int) -> str:
    return f"and {number} more"


def _drone(info: AgentsInfo, entry: np.void, over: bool) -> str:
    """Return the cell of a drone, and what it did in the step, which may be the last one."""
    text = f"{entry['col']},{entry['row']} {_state(info, entry, over)}"
    if "battery" in (entry.dtype.names or ()) and not np.isnan(entry["battery"]):
        text += f" {entry['battery']:.0f}%"
    return text


def _state(info: AgentsInfo, entry: np.void, over: bool) -> str:
    action = int(entry["action"])
    if entry["found"]:
        return "FOUND"
    if entry["held"]:
        return "held"
    status = int(entry["status"]) if "status" in (entry.dtype.names or ()) else SEARCHING
    if status != SEARCHING:
        return STATUSES[status]
    # In the last step of a mission every drone is terminated.
    if entry["terminated"] and not (over and action >= 0):
        return "out"
    return info.actions[action][:_LONGEST_NAME] if action >= 0 else "-"


def _has_battery(report: NDArray[Any]) -> bool:
    return "battery" in (report.dtype.names or ()) and not bool(np.isnan(report["battery"]).all())


def _outcome(info: AgentsInfo, report: NDArray[Any]) -> str:
    """Return how a mission has ended, from its last report."""
    if report["all_found"].any():
        if "coverage_rate" in (report.dtype.names or ()):
            return "all covered"
        finders = [info.agents[i] for i in np.flatnonzero(report["found"])]
        return f"found by {', '.join(finders)}" if finders else "all found"
    return "out of time" if report["truncated"].any() else "no drone left"


def _row(step: str, time: str, reward: str, columns: Sequence[str]) -> str:
    return "  ".join([_of_all(step, time, reward), *columns]).rstrip()


def _of_all(step: str, time: str, reward: str) -> str:
    return f"{step:>4}  {time:>6}  {reward:>8}"


def _printable(line: str) -> str:
    """Return a line without what could command a terminal: names come from a message."""
    return "".join(letter if letter.isprintable() else "?" for letter in line)
