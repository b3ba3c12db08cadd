# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replays the missions of a bag: flies the reported actions again in a new world, without a node.

The replay compares the step reports and the messages of `computed` with those of the bag. It takes
the drones' commands, and which drones were lost with their vehicles, from the reports.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.mission_journal import take_entry
from dsse_ros.mission.recording.bag import Recorded, of_searches
from dsse_ros.mission.recording.computed import computed, digest
from dsse_ros.mission.recording.recorded_inputs import (
    HISTORY,
    RecordedInputs,
    inputs_of,
    reason_not_to_compute,
)
from dsse_ros.mission.recording.step_inputs import (
    FlownPaths,
    StepInputs,
    commands_in_metres,
    viewpoints_in_report,
)
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_messages import OF_BELIEF, StepMessages
from dsse_ros.mission.run.step_reports import step_report_of
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.agents import AgentsInfo, agents_from_json
from dsse_ros.world.scenario.limits import LARGEST_GRID_CELLS, check_cells
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import (
    looked_of,
    path_of,
    step_report_from_message,
    step_report_message,
    wind_of,
)
from msg_adapters.topics import EACH_DRONE, TOPICS, Reading, of_drones, replayed, topic_of

_FIRST = ("action", "held", "col", "row")
"""Fields of a drone that are compared first: the others follow from them."""
_ANOTHER = ": the message differs in the replay"


@dataclass
class ReplayedMission:
    """The outcome of the replay of a mission.

    Attributes:
        namespace: Namespace of its topics, with a slash at the end.
        run_id, number: The run and the number of the mission.
        seed: Its seed.
        steps: Steps that were replayed.
        ended: Whether the mission ended within these steps.
        compared: Number of compared messages by topic; of all drones as `drone<i>/pose`.
        lost: Names of the drones that were lost with their vehicles.
        drones: Number of drones.
        difference: The first difference, "" for none; nothing is replayed after it.
        incomplete: Why it cannot be replayed, or not to its end; "" if it can.
    """

    namespace: str
    run_id: int
    number: int
    seed: int | None = None
    steps: int = 0
    ended: bool = False
    compared: Counter[str] = field(default_factory=Counter)
    lost: list[str] = field(default_factory=list)
    drones: int = 0
    difference: str = ""
    incomplete: str = ""

    @property
    def fewer(self) -> dict[str, tuple[int, int]]:
        """Topics with fewer messages than expected: the number compared, and that expected."""
        expected = {
            name: (self.steps + 1) * (self.drones if name.startswith(EACH_DRONE) else 1)
            for name in self.compared
            if not {"once", "between steps"} & {*TOPICS[name].replay}
        }
        return {
            name: (self.compared[name], count)
            for name, count in expected.items()
            if self.compared[name] < count
        }


@dataclass(frozen=True)
class _Other:
    """A message of another compared topic, by its digest: maps take much memory."""

    time_ns: int
    name: str
    key: Any
    digest: bytes

    def may(self, how: Reading) -> bool:
        """Return whether the messages of its topic are published in this way."""
        return how in topic_of(self.name).replay


@dataclass(frozen=True)
class _Report:
    """A step report, with the other messages of its step."""

    time_ns: int
    message: PointCloud2
    points: NDArray[Any]
    others: list[_Other] = field(default_factory=list)

    @property
    def stamp_ns(self) -> int:
        return to_nanoseconds(self.message.header.stamp)

    @cached_property
    def search(self) -> tuple[int, int]:
        """run_id and number of the mission."""
        return self._of_most("run_id"), self._of_most("mission")

    @cached_property
    def step(self) -> int:
        """Number of the step."""
        return self._of_most("step")

    def _of_most(self, name: str) -> int:
        """Return the value of most drones, which have the same, unless the report is damaged."""
        return int(Counter(self.points[name].tolist()).most_common(1)[0][0])

    @property
    def keys(self) -> tuple[Any, Any]:
        """What a message of its step has in common with it."""
        return self.stamp_ns, (*self.search, self.step)


@dataclass
class _Recording:
    """The recorded messages of one namespace."""

    infos: dict[tuple[int, int], AgentsInfo] = field(default_factory=dict)
    reports: list[_Report] = field(default_factory=list)
    others: list[_Other] = field(default_factory=list)
    texts: list[tuple[int, str]] = field(default_factory=list)

    def missions(self) -> dict[tuple[int, int], list[_Report]]:
        """Return the reports of each mission in order, with the other messages of their steps."""
        self.reports.sort(key=lambda report: report.time_ns)
        times, of_key = [report.time_ns for report in self.reports], defaultdict(list)
        missions: defaultdict[tuple[int, int], list[_Report]] = defaultdict(list)
        for report in self.reports:
            missions[report.search].append(report)
            for key in report.keys:
                of_key[key].append(report)
        for other in sorted(self.others, key=lambda other: other.time_ns):
            after = other.may("after report")
            following = bisect_right(times, other.time_ns)
            before, behind = self.reports[:following][-1:], self.reports[following:][:1]
            if same := of_key.get(other.key):
                # Runs begin with the same stamps: take the report that came with the message.
                past = [report for report in same if report.time_ns <= other.time_ns]
                near = past if after and past else same
                report = min(near, key=lambda report: abs(report.time_ns - other.time_ns))
                report.others.append(other)
            elif found := before if after else behind or before:
                found[0].others.append(other)
        return missions


class Replay:
    """The replay of a bag.

    Args:
        messages: Of the bag, as `read_bag` yields them.
        max_cells: Cells of the largest grid; missions on larger ones are not replayed.

    Raises:
        FieldError: If `agents`, a report or a compared message cannot be read, or there is no
            mission in the bag.
    """

    def __init__(self, messages: Iterable[Recorded], max_cells: int = LARGEST_GRID_CELLS) -> None:
        self._max_cells = max_cells
        self._messages: Counter[str] = Counter()
        self._compared: Counter[str] = Counter()
        self._recordings = _collect(messages, self._messages)

    def missions(self) -> Iterator[ReplayedMission]:
        """Replay all missions, and yield each when it is done."""
        for namespace, recording in sorted(self._recordings.items()):
            belief = any(other.may("belief") for other in recording.others)
            repetition: _Repetition | None = None
            all_inputs = inputs_of(recording.texts)
            for search, reports in recording.missions().items():
                outcome = ReplayedMission(namespace, *search)
                info, inputs = recording.infos.get(search), all_inputs.get(search)
                outcome.incomplete = _reason_not_to_replay(
                    info, reports[0], self._max_cells
                ) or reason_not_to_compute(info, reports[-1].step, inputs)
                if info is not None:
                    outcome.seed, outcome.drones = info.seed, len(info.agents)
                    if not outcome.incomplete:
                        repetition = _Repetition(info, outcome, repetition, belief=belief)
                        repetition.run(reports, inputs)
                for name, count in outcome.compared.items():
                    self._compared[namespace + name] += count
                yield outcome

    @property
    def not_compared(self) -> dict[str, tuple[int, int]]:
        """Messages not compared so far, and all, by topic; of all drones as `drone<i>/pose`."""
        left = self._messages - self._compared
        return {topic: (left[topic], self._messages[topic]) for topic in sorted(left)}


def _collect(messages: Iterable[Recorded], counts: Counter[str]) -> dict[str, _Recording]:
    """Return the recordings by their namespaces, and count the messages of all topics."""
    recordings: defaultdict[str, _Recording] = defaultdict(_Recording)
    names = replayed("followed", "compared")
    for namespace, name, recorded in of_searches(_each_once(messages, counts), names):
        recording, time_ns = recordings[namespace], recorded.time_ns
        try:
            message = recorded.message
            if name == "agents":
                info = agents_from_json(message.data)
                recording.infos[info.run_id, info.mission] = info
            elif name == HISTORY:
                recording.texts.append((time_ns, message.data))
            elif name == "step_report":
                points = step_report_from_message(message)
                if len(points):
                    recording.reports.append(_Report(time_ns, message, points))
            else:
                recording.others.append(_Other(time_ns, name, _key(message), digest(message)))
        except ValueError as error:
            raise FieldError(f"{recorded.topic}: {error}") from None
    if not any(recording.infos for recording in recordings.values()):
        raise FieldError("the bag has no message on agents, which describes the search")
    return recordings


def _each_once(messages: Iterable[Recorded], counts: Counter[str]) -> Iterator[Recorded]:
    """Yield messages, and count them by topic; a new subscription receives a latched one again."""
    seen: set[tuple[str, int, int]] = set()
    for recorded in messages:
        identity = (recorded.topic, recorded.time_ns, hash(recorded.data))
        if identity not in seen:
            seen.add(identity)
            counts[of_drones(recorded.topic)] += 1
            yield recorded


def _key(message: Any) -> Any:
    """Return what a message and the report of its step have in common."""
    if hasattr(message, "markers"):
        message = message.markers[0] if message.markers else None
    if hasattr(message, "header"):
        return to_nanoseconds(message.header.stamp)
    return tuple(getattr(message, "data", ())[:-1])


def _reason_not_to_replay(info: AgentsInfo | None, first: _Report, max_cells: int) -> str:
    """Return why a mission with this first report cannot be replayed, "" if it can."""
    if info is None:
        return "the bag has no message on agents of it"
    if info.definition is None or info.seed is None:
        return "agents does not contain its definition and seed"
    if first.step:
        return f"it was recorded from step {first.step} on"
    if len(first.points) != len(info.agents):
        return "agents and step_report are not of the same drones"
    try:
        check_cells(info.frame.grid_size, max_cells)
    except FieldError as error:
        return str(error)
    return ""


class _Repetition:
    """A mission during its replay."""

    def __init__(
        self,
        info: AgentsInfo,
        outcome: ReplayedMission,
        last: _Repetition | None,
        *,
        belief: bool,
    ) -> None:
        assert info.definition is not None and info.seed is not None
        self.info = info
        self.outcome = outcome
        self.frame = info.frame
        if last is not None and last.info.definition == info.definition:
            self.mission: Mission = last.mission
            self.mission.reset(info.seed)
        else:
            env = SearchEnv(info.definition.scenario, info.definition.rules)
            # In a live search the map that drones observe is the belief.
            belief = belief or not env.scenario.has_persons
            self.mission = Mission(env, info.seed, belief=belief)
        self.mission.number = outcome.number
        self._messages = StepMessages(self.mission, self.frame, outcome.run_id)
        self._digests: dict[str, set[bytes]] = {}
        self._digests_of = -1
        self._mission_time = True

    def run(self, reports: Sequence[_Report], inputs: RecordedInputs | None) -> None:
        """Do the steps of the reports with the inputs between them, up to the first difference."""
        step_ns = max(round(self.info.step_duration_s * 1e9), 1)
        expected, self._mission_time = _expected_stamps(reports, step_ns)
        outcome = self.outcome
        for number, (report, expected_ns) in enumerate(zip(reports, expected, strict=True)):
            if number:
                self._advance(report)
            if not (self.outcome.difference or self.outcome.incomplete):
                self._set_wind(report)
            if not (outcome.difference or outcome.incomplete):
                outcome.difference = self._compare(report, expected_ns, step_ns, inputs)
            if outcome.difference or outcome.incomplete:
                return
        # An aborted mission has a report of all of it, too.
        outcome.ended = self.mission.done or "mission_report" in outcome.compared

    def _advance(self, report: _Report) -> None:
        """Bring the mission to the step of a report."""
        mission, step = self.mission, self.mission.result.step
        if report.step == step:
            self._mark_lost(report)
        elif report.step != step + 1:
            self.outcome.incomplete = (
                f"it is replayed to step {step}: the bag has no report of step {step + 1}"
            )
        elif mission.done:
            self.outcome.difference = (
                f"step {report.step}: the mission is under way in the bag, over before in the "
                "replay"
            )
        elif len(report.points) == len(self.info.agents):
            inputs_in_report(report.points, len(self.info.actions)).repeat(mission)
            self.outcome.steps += 1

    def _set_wind(self, report: _Report) -> None:
        """Set the wind of a report for the next steps."""
        wind_mps = wind_of(report.points)
        if wind_mps is None:
            return
        try:
            self.mission.report_wind(wind_mps)
        except FieldError as error:
            self.outcome.difference = f"step {report.step}: {error}"

    def _mark_lost(self, report: _Report) -> None:
        """Take out the drones that were lost since; their report comes again."""
        for drone in np.flatnonzero(report.points["terminated"]).tolist():
            if not self.mission.result.terminated[drone] and self.mission.lose(drone):
                self.outcome.lost.append(self.info.agents[drone])

    def _compare(
        self, report: _Report, expected_ns: int, step_ns: int, inputs: RecordedInputs | None
    ) -> str:
        """Return the first difference of the last step to its report and messages, or ""."""
        where = f"step {report.step}, {self.outcome.namespace}"
        self.outcome.compared["step_report"] += 1
        different = self._different_report(report, expected_ns)
        if different:
            return f"{where}step_report{different}"
        later = (report.stamp_ns + step_ns, (*report.search, report.step + 1))
        others = [
            other
            for other in report.others
            if other.key in report.keys
            # Else the bag was cut off before the report of the next step.
            or not (
                (other.time_ns > report.time_ns and other.key in later)
                or (not self._mission_time and other.may("between steps"))
            )
        ]
        if report.step != self._digests_of:
            self._digests, self._digests_of = {}, report.step
        self._compute(report, {other.name for other in others})
        for entry in () if inputs is None else inputs.take(report.step):
            take_entry(self.mission, entry)
            self._compute(report, OF_BELIEF)
        for other in others:
            if digests := self._digests[other.name]:
                self.outcome.compared[of_drones(other.name)] += 1
                if other.digest not in digests:
                    return f"{where}{other.name}{_ANOTHER}"
        return ""

    def _compute(self, report: _Report, names: Iterable[str]) -> None:
        """Compute what messages of the last step may be now; inputs change them."""
        stamp = report.message.header.stamp
        for name in names:
            digests = self._digests.setdefault(name, set())
            digests |= set(computed(self._messages, name, stamp))

    def _different_report(self, report: _Report, expected_ns: int) -> str:
        """Return where the report of the last step differs, and how; "" if it does not."""
        if len(report.points) != len(self.info.agents):
            return f": {len(report.points)} drones in the bag, {len(self.info.agents)} in agents"
        own = step_report_of(self.mission, self.frame, self.outcome.run_id)
        head = self._messages.header(report.message.header.stamp)
        message = step_report_message(head, own)
        if own.dtype != report.points.dtype:
            return _two(": fields", report.points.dtype, own.dtype)
        names = own.dtype.names or ()
        for i, drone in enumerate(self.info.agents):
            for name in (*_FIRST, *names):
                recorded, replayed = report.points[name][i], own[name][i]
                if recorded.tobytes() != replayed.tobytes():
                    shown = [self._shown(name, value) for value in (recorded, replayed)]
                    return _two(f", {drone}: {name}", *shown)
        if report.stamp_ns != expected_ns:
            return _two(": header.stamp", report.stamp_ns, expected_ns)
        return "" if message == report.message else _ANOTHER

    def _shown(self, name: str, value: Any) -> str:
        if name in ("action", "command") and 0 <= value < len(self.info.actions):
            return f"{value} ({self.info.actions[value]})"
        return str(value)


def _two(what: str, recorded: Any, replayed: Any) -> str:
    return f"{what} is {recorded} in the bag, {replayed} in the replay"


def _expected_stamps(reports: Sequence[_Report], step_ns: int) -> tuple[list[int], bool]:
    """Return the stamps that the reports must have, and whether these are mission time.

    They are if most are `step_ns` apart. Where they are not, each must have the one that it has.
    """
    expected: list[int] = []
    mission_time = False
    # A step that is reported again may be the first of another mission time.
    starts = [i for i in range(1, len(reports)) if reports[i].step == reports[i - 1].step]
    for begin, end in pairwise([0, *starts, len(reports)]):
        times = [(report.step * step_ns, report.stamp_ns) for report in reports[begin:end]]
        (first_ns, count), *_ = Counter(stamp - since for since, stamp in times).most_common(1)
        known = 2 * count > len(times) > 1
        mission_time |= known
        expected += [first_ns + since if known else stamp for since, stamp in times]
    return expected, mission_time


def inputs_in_report(report: NDArray[Any], num_actions: int) -> StepInputs:
    """Return the inputs of a step from its report (N,); an unknown command counts as none."""
    names = report.dtype.names or ()
    if "turn_action" in names:
        turns = np.stack([report["turn_action"], report["speed_action"]], axis=1)
        turns = np.where(np.abs(turns) <= 1.0, turns, 0.0)
        looked = looked_of(report)
        flown = None if looked is None else FlownPaths(path_of(report), looked)
        return StepInputs(commands_in_metres(turns, report["held"] > 0), flown=flown)
    commands = report["command" if "command" in names else "action"]
    known = (commands >= NO_ACTION) & (commands < num_actions)
    by_vehicles = "work" in names
    return StepInputs(
        np.where(known, commands, NO_ACTION).tolist(),
        report["work"].astype(np.int8) if by_vehicles else None,
        viewpoints_in_report(report) if by_vehicles else None,
    )
