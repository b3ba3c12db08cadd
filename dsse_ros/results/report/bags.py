# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recorded missions from a bag."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.recording.bag import Recorded, of_searches, read_bag
from dsse_ros.mission.recording.step_inputs import FlownPaths, viewpoints_in_report
from dsse_ros.results.report.recomputed import Maps
from dsse_ros.results.report.record import RecordedMission, Search, check_limit, places_of
from dsse_ros.world.scenario.agents import AgentsInfo, agents_from_json
from dsse_ros.world.scenario.limits import LARGEST_GRID_CELLS, check_cells
from dsse_ros.world.scenario.scenario import ResolvedScenario
from msg_adapters.images import image_to_probability
from msg_adapters.mission_report import mission_report_from_message
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import looked_of, path_of, step_report_from_message

_BELIEF = "belief"
_READ: dict[str, Callable[[Any], Any]] = {
    "agents": lambda message: agents_from_json(message.data),
    "step_report": step_report_from_message,
    "mission_report": mission_report_from_message,
}
"""Topics, and the readers of their messages."""

_LOGGER = logging.getLogger(__name__)
Key = tuple[int, int]
"""Run and mission."""


@dataclass
class _Reports:
    """The published messages of one mission.

    Attributes:
        rows: By step, the last report (N,) of it.
        heard: By step, the stamp and the wall time of its first report, in nanoseconds.
    """

    rows: dict[int, NDArray[Any]] = field(default_factory=dict)
    heard: dict[int, tuple[int, int]] = field(default_factory=dict)


class MissionBag:
    """The missions of one simulation in a bag.

    Args:
        namespace: Of the simulation; None for the only one.
        search: What was searched; by default `agents` states it.

    Attributes:
        missions: Missions with a recorded step, in order.

    Raises:
        FieldError: If the bag cannot be read, has no step, does not have the namespace, has a
            larger grid, or is of another search.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        namespace: str | None = None,
        search: Search | None = None,
        max_cells: int = LARGEST_GRID_CELLS,
    ) -> None:
        self._path = path
        self._name = f"file: {os.fspath(path)!r}"
        self._cut_off = False
        infos: dict[str, dict[Key, AgentsInfo]] = {}
        reports: dict[str, dict[Key, _Reports]] = {}
        for place, name, recorded in self._messages(*_READ):
            content = self._content(recorded, _READ[name])
            if name == "agents":
                infos.setdefault(place, {})[content.run_id, content.mission] = content
            elif content.size:
                _note(reports.setdefault(place, {}), np.atleast_2d(content), recorded)
        if not reports:
            raise FieldError(f"{self._name}: no step of a mission")
        self.namespace = self._chosen(namespace, reports)
        self._reports = reports[self.namespace]
        known = infos.get(self.namespace, {})
        self.missions = []
        for key, kept in self._reports.items():
            try:
                self.missions.append(_mission(key, known.get(key), kept.rows, search, max_cells))
            except ValueError as error:
                raise FieldError(f"{self._name}: mission {key[1]}: {error}") from None

    def _messages(self, *names: str) -> Iterator[tuple[str, str, Recorded]]:
        """Yield namespace, name and message of topics."""
        for place, name, recorded in of_searches(read_bag(self._path, self._note_cut_off), names):
            yield place.rstrip("/"), name, recorded

    def _note_cut_off(self, line: str) -> None:
        # The file is read more than once.
        if not self._cut_off:
            _LOGGER.warning("%s; what follows is missing", line)
        self._cut_off = True

    def _content(self, recorded: Recorded, read: Callable[[Any], Any]) -> Any:
        try:
            return read(recorded.message)
        except ValueError as error:
            raise FieldError(f"{self._name}: {recorded.topic}: {error}") from None

    def _chosen(self, namespace: str | None, found: Collection[str]) -> str:
        shown = ", ".join(sorted(name or "/" for name in found))
        if namespace is None:
            if len(found) > 1:
                raise FieldError(f"namespace: choose one of the file: {shown}")
            return next(iter(found))
        wanted = f"/{namespace.strip('/')}".rstrip("/")
        if wanted not in found:
            raise FieldError(f"namespace must be one of the file ({shown}), got {namespace!r}")
        return wanted

    def beliefs(self, record: RecordedMission, wanted: Collection[int]) -> Maps:
        """Return the beliefs (R, C) that were published with recorded steps.

        Args:
            record: One of `missions`.
            wanted: Numbers of recorded steps, 0 to K - 1.

        Raises:
            FieldError: If a message is no map.
        """
        assert record.run_id is not None
        heard = self._reports[record.run_id, record.number].heard
        steps = record.steps.tolist()
        # Runs begin with the same stamps: take the map that came with the report.
        of_stamp = {heard[steps[k]][0]: k for k in wanted if steps[k] in heard}
        nearest_ns: dict[int, int] = {}
        maps: Maps = {}
        for place, _, recorded in self._messages(_BELIEF):
            if place != self.namespace:
                continue
            k = of_stamp.get(to_nanoseconds(recorded.message.header.stamp))
            if k is None:
                continue
            away_ns = abs(recorded.log_time_ns - heard[steps[k]][1])
            if k not in maps or away_ns < nearest_ns[k]:
                maps[k] = self._content(recorded, image_to_probability)
                nearest_ns[k] = away_ns
        return maps


def _note(reports: dict[Key, _Reports], of_steps: NDArray[Any], recorded: Recorded) -> None:
    """Keep the rows (K, N) of a report."""
    first = of_steps[0, 0]
    known = reports.setdefault((int(first["run_id"]), int(first["mission"])), _Reports())
    for row in of_steps:
        step = int(row["step"][0])
        # The report of a mission has neither turns and speeds in metres nor looks of vehicles.
        if _says_more(row) or not _says_more(known.rows.get(step)):
            known.rows[step] = row
    if len(of_steps) == 1:
        stamp_ns = to_nanoseconds(recorded.message.header.stamp)
        known.heard.setdefault(int(first["step"]), (stamp_ns, recorded.log_time_ns))


def _says_more(row: NDArray[Any] | None) -> bool:
    return row is not None and not {"turn_action", "look_action"}.isdisjoint(row.dtype.names or ())


def _in_metres(scenario: ResolvedScenario, reports: Sequence[NDArray[Any]]) -> dict[str, Any]:
    """Return the further fields of `RecordedMission` of a mission in metres."""

    def table(name: str) -> NDArray[Any]:
        return np.stack([report[name] for report in reports])

    of_metres: dict[str, Any] = {"in_cells": places_of(scenario, table("x"), table("y"))}
    # A report of the mission does not have them.
    if all(map(_says_more, reports)):
        turns = np.stack([table("turn_action"), table("speed_action")], axis=2)
        of_metres["turns"] = turns
        of_metres["courses"] = np.stack([table("heading"), table("airspeed")], axis=2)
        if looked_of(reports[0]) is not None:
            paths = np.stack([path_of(report) for report in reports])
            of_metres["flown"] = FlownPaths(paths, table("looked") > 0)
    return of_metres


def _mission(
    key: Key,
    info: AgentsInfo | None,
    rows: dict[int, NDArray[Any]],
    search: Search | None,
    max_cells: int,
) -> RecordedMission:
    """Return a mission from its reports (N,) by step."""
    if info is None:
        raise ValueError("no message of the topic agents")
    check_cells(info.frame.grid_size, max_cells)
    definition = search(len(info.agents)) if search else info.definition
    if definition is None:
        raise ValueError("agents does not describe the search; use --scenario")
    rules, scenario = definition.rules, definition.scenario.resolve(definition.rules)
    if (scenario.grid_size, scenario.cell_size) != (info.frame.grid_size, info.frame.cell_size_m):
        raise ValueError(
            f"scenario: {scenario.grid_size} cells of {scenario.cell_size:g} m are not the "
            f"recorded {info.frame.grid_size} of {info.frame.cell_size_m:g} m"
        )
    steps = sorted(rows)
    if any(len(row) != len(info.agents) for row in rows.values()):
        raise ValueError(f"step_report must have the {len(info.agents)} drones of agents")

    def table(name: str) -> NDArray[Any]:
        return np.stack([rows[step][name] for step in steps])

    actions, names = table("action"), np.array([*info.actions, ""])
    if (actions >= len(info.actions)).any():
        raise ValueError(f"step_report has action {actions.max()}, which agents does not name")
    by_vehicles = all("look_action" in (row.dtype.names or ()) for row in rows.values())
    viewpoints = (
        viewpoints_in_report(np.stack([rows[step] for step in steps])) if by_vehicles else None
    )
    return check_limit(
        RecordedMission(
            number=key[1],
            steps=np.array(steps),
            times_s=np.array(steps) * info.step_duration_s,
            cells=np.stack([table("col"), table("row")], axis=2).astype(np.int64),
            actions=names[np.maximum(actions, -1)],
            rewards=table("reward"),
            terminated=table("terminated") > 0,
            truncated=table("truncated") > 0,
            found=table("found") > 0,
            held=table("held") > 0,
            rules=rules,
            scenario=scenario,
            seed=info.seed,
            run_id=key[0],
            vehicle_viewpoints=viewpoints,
            **(_in_metres(scenario, [rows[step] for step in steps]) if rules.in_metres else {}),
        )
    )
