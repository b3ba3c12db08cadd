# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replays the missions of a bag: gives its commands to a new world, without a node.

The replay compares step reports. From the recorded reports it takes what is not in the commands:
which drones were lost with their vehicles, and the actions of drones without a command.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2

from dsse_ros.mission.command_intake import CommandIntake
from dsse_ros.mission.mission import Mission
from dsse_ros.mission.step_reports import step_report_of
from dsse_ros.recording.bag import Recorded
from dsse_ros.recording.replayed import Difference, ReplayedMission
from dsse_ros.scenario.limits import LARGEST_GRID_CELLS, check_cells
from dsse_ros.search import HOLD, FieldError, SearchEnv
from msg_adapters.agents import AgentsInfo, agents_from_message
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message, step_report_message

_TOPIC = re.compile(
    r"(?P<namespace>.*/)(?:(?P<drone>drone\d+)/(?P<command>cmd_action|cmd_action_name|command_pose"
    r"|command_path)|(?P<name>agents|step_report|joint_action))"
)
_TAKE: dict[str, Callable[[CommandIntake, int, Any], bool]] = {
    "cmd_action": CommandIntake.action,
    "cmd_action_name": CommandIntake.action_name,
    "command_pose": CommandIntake.goal,
    "command_path": CommandIntake.path,
}
_TYPES = {
    "agents": "std_msgs/msg/String",
    "step_report": "sensor_msgs/msg/PointCloud2",
    "joint_action": "std_msgs/msg/Int32MultiArray",
    "cmd_action": "std_msgs/msg/Int8",
    "cmd_action_name": "std_msgs/msg/String",
    "command_pose": "geometry_msgs/msg/PoseStamped",
    "command_path": "nav_msgs/msg/Path",
}
_DIAGNOSTICS = "/diagnostics"

_FIRST = ("action", "held", "col", "row")
"""Fields of a drone that are compared first: the others follow from them."""

LATENCY_NS = 100_000_000
"""Transport time within which a command may have missed the step after its publication."""
_SURE_NS = 500_000_000
"""What was published that long before the diagnostics is counted in them."""


@dataclass(frozen=True)
class _Command:
    time_ns: int
    name: str
    drone: str
    topic: str
    message: Any


@dataclass(frozen=True)
class _Report:
    time_ns: int
    message: PointCloud2
    points: NDArray[Any]

    @property
    def search(self) -> tuple[int, int]:
        """run_id and number of the mission."""
        return int(self.points["run_id"][0]), int(self.points["mission"][0])

    @property
    def step(self) -> int:
        return int(self.points["step"][0])


@dataclass(frozen=True)
class _Status:
    """What the diagnostics of a run contain."""

    time_ns: int
    run_id: int
    step_mode: str
    rejected: dict[str, int]


@dataclass(frozen=True)
class _Refusal:
    time_ns: int
    code: str
    reason: str
    topic: str
    drone: str
    mission: ReplayedMission
    step: int


@dataclass
class _Recording:
    """The recorded messages of one namespace."""

    infos: dict[tuple[int, int], AgentsInfo] = field(default_factory=dict)
    events: list[_Command | _Report] = field(default_factory=list)


def replay(
    messages: Iterable[Recorded], max_cells: int = LARGEST_GRID_CELLS
) -> Iterator[ReplayedMission]:
    """Replay all missions of a bag, and yield each when it is done.

    Messages are ordered by their publish time. On one machine, or if one caused the other, this is
    the order in which they were taken.

    Args:
        messages: Of a bag, as `read_bag` yields them.
        max_cells: Cells of the largest grid; missions on larger ones are not replayed.

    Raises:
        FieldError: If `agents` or a report cannot be read, or there is no mission in the bag.
    """
    recordings, statuses = _collect(messages)
    for namespace, recording in sorted(recordings.items()):
        recording.events.sort(key=lambda event: event.time_ns)
        reports = [event for event in recording.events if isinstance(event, _Report)]
        for run_id in dict.fromkeys(report.search[0] for report in reports):
            of_run = [status for status in statuses if status.run_id == run_id]
            run = _Run(namespace, run_id, recording.infos, of_run, max_cells)
            yield from run.replay(recording.events)


def _collect(messages: Iterable[Recorded]) -> tuple[dict[str, _Recording], list[_Status]]:
    recordings: defaultdict[str, _Recording] = defaultdict(_Recording)
    statuses: list[_Status] = []
    seen: set[tuple[str, int]] = set()
    for one in messages:
        time_ns = one.publish_time_ns or one.log_time_ns
        if one.topic == _DIAGNOSTICS:
            if one.type_name == "diagnostic_msgs/msg/DiagnosticArray":
                statuses += _statuses(time_ns, one.message)
            continue
        match = _TOPIC.fullmatch(one.topic)
        if match is None:
            continue
        name = match["name"] or match["command"]
        # A new subscription receives a latched message again.
        if one.type_name != _TYPES[name] or (one.topic, time_ns) in seen:
            continue
        seen.add((one.topic, time_ns))
        recording = recordings[match["namespace"]]
        try:
            if name == "agents":
                info = agents_from_message(one.message)
                recording.infos[info.run_id, info.mission] = info
            elif name == "step_report":
                points = step_report_from_message(one.message)
                if len(points):
                    recording.events.append(_Report(time_ns, one.message, points))
            else:
                drone = match["drone"] or ""
                recording.events.append(_Command(time_ns, name, drone, one.topic, one.message))
        except ValueError as error:
            raise FieldError(f"{one.topic}: {error}") from None
    if not any(recording.infos for recording in recordings.values()):
        raise FieldError("the bag has no message on agents: it says what was searched")
    return recordings, statuses


def _statuses(time_ns: int, message: Any) -> Iterator[_Status]:
    for status in message.status:
        values = {pair.key: pair.value for pair in status.values}
        if values.get("run_id", "").isdecimal() and "step_mode" in values:
            rejected = {
                key.removeprefix("rejected."): int(value[:18])
                for key, value in values.items()
                if key.startswith("rejected.") and value.isdecimal()
            }
            yield _Status(time_ns, int(values["run_id"][:18]), values["step_mode"], rejected)


class _Run:
    """Replays the missions of one start of a simulation, one after the other."""

    def __init__(
        self,
        namespace: str,
        run_id: int,
        infos: dict[tuple[int, int], AgentsInfo],
        statuses: list[_Status],
        max_cells: int,
    ) -> None:
        self._namespace = namespace
        self._max_cells = max_cells
        self._run_id = run_id
        self._infos = infos
        self._statuses = sorted(statuses, key=lambda status: status.time_ns)
        self._refusals: list[_Refusal] = []
        self._outcomes: list[ReplayedMission] = []
        self._pending: list[_Command] = []

    def replay(self, events: Sequence[_Command | _Report]) -> list[ReplayedMission]:
        """Return the outcome of all missions."""
        flight: _Flight | None = None
        outcome: ReplayedMission | None = None
        for event in events:
            if isinstance(event, _Command):
                self._pending.append(event)
                continue
            run_id, number = event.search
            if run_id != self._run_id:
                continue
            if outcome is None or number != outcome.number:
                if flight is not None:
                    self._feed(flight, self._pending)
                self._pending.clear()
                outcome = ReplayedMission(self._namespace, run_id, number)
                self._outcomes.append(outcome)
                flight = self._begin(outcome, event, flight)
            elif flight is not None and not (outcome.difference or outcome.incomplete):
                self._go_on(flight, event)
            if flight is not None and not (outcome.difference or outcome.incomplete):
                outcome.difference = flight.compare(event)
        self._check_refusals()
        return self._outcomes

    def _begin(
        self, outcome: ReplayedMission, report: _Report, last: _Flight | None
    ) -> _Flight | None:
        """Return a mission at its start, None if it cannot be replayed."""
        info = self._infos.get(report.search)
        if info is None:
            outcome.incomplete = "the bag has no message on agents of it"
            return last
        outcome.seed = info.seed
        if info.definition is None or info.seed is None:
            outcome.incomplete = "agents does not contain its definition and seed"
        elif report.step:
            outcome.incomplete = f"it was recorded from step {report.step} on"
        elif len(report.points) != len(info.agents):
            outcome.incomplete = "agents and step_report are not of the same drones"
        else:
            try:
                check_cells(info.grid_size, self._max_cells)
            except FieldError as error:
                outcome.incomplete = str(error)
            else:
                return _Flight(info, outcome, last)
        return last

    def _go_on(self, flight: _Flight, report: _Report) -> None:
        """Bring the mission to the step of a report."""
        outcome, step = flight.outcome, flight.mission.result.step
        if report.step == step:
            flight.repeat(report)
        elif report.step == step + 1:
            if flight.mission.done:
                outcome.difference = Difference(
                    report.step, "", "the mission", "under way", "over before"
                )
                return
            taken = self._taken(flight, report)
            self._feed(flight, self._pending[:taken])
            del self._pending[:taken]
            flight.advance(report)
        elif report.step > step:
            outcome.incomplete = (
                f"it is replayed to step {step}: the bag has no report of step {step + 1}"
            )

    def _taken(self, flight: _Flight, report: _Report) -> int:
        """Return how many of the commands were taken before the step of a report.

        These are all commands published before the step, unless the step differs with them and the
        last ones may still have been on their way. In lockstep a step is due as soon as every drone
        has a command, in real time at any time.
        """
        count = len(self._pending)
        if flight.leads_to(report, self._pending)[0]:
            return count
        realtime = self._step_mode(report.time_ns) == "realtime"
        for fewer in range(count - 1, -1, -1):
            if report.time_ns - self._pending[fewer].time_ns > LATENCY_NS:
                break
            same, complete = flight.leads_to(report, self._pending[:fewer])
            if same and (complete or realtime):
                return fewer
        return count

    def _step_mode(self, time_ns: int) -> str:
        """Return the mode at a time, as far as the diagnostics contain it."""
        before = [status for status in self._statuses if status.time_ns <= time_ns]
        known = before[-1:] or self._statuses[:1]
        return known[0].step_mode if known else "lockstep"

    def _feed(self, flight: _Flight, commands: Sequence[_Command]) -> None:
        for command in commands:
            refused = flight.take(command)
            if refused is not None:
                code, reason = refused
                flight.outcome.refused[code] += 1
                self._refusals.append(
                    _Refusal(
                        command.time_ns, code, reason, command.topic, command.drone,
                        flight.outcome, flight.mission.result.step,
                    )
                )  # fmt: skip

    def _check_refusals(self) -> None:
        """Note a command that was refused more often than the simulation counted."""
        if not self._statuses:
            return
        last = self._statuses[-1]
        by_code: defaultdict[str, list[_Refusal]] = defaultdict(list)
        for refusal in self._refusals:
            if refusal.time_ns < last.time_ns - _SURE_NS:
                by_code[refusal.code].append(refusal)
        for code, refusals in by_code.items():
            first = refusals[0]
            step = first.step + 1
            known = first.mission.difference
            if len(refusals) > last.rejected.get(code, 0) and not (known and known.step <= step):
                first.mission.difference = Difference(
                    step, first.drone, first.topic, "taken", f"refused: {first.reason}"
                )


class _Flight:
    """A mission during its replay."""

    def __init__(self, info: AgentsInfo, outcome: ReplayedMission, last: _Flight | None) -> None:
        assert info.definition is not None and info.seed is not None
        self.info = info
        self.outcome = outcome
        self._reasons: list[str] = []
        if last is not None and last.info.definition == info.definition:
            self.mission: Mission = last.mission
            self.mission.reset(info.seed)
            # Keep the intake: it recognizes a last joint action that is sent again.
            self._intake: CommandIntake = last._intake
            self._reasons = last._reasons
        else:
            env = SearchEnv(info.definition.scenario, info.definition.rules)
            self.mission = Mission(env, info.seed, belief=False)
            self._intake = self._new_intake()
        self.mission.number = outcome.number
        # Stamps are mission time, as far as is known.
        self._first_stamp: tuple[int, int] | None = None
        self._mission_time = True

    def _new_intake(self) -> CommandIntake:
        def note(_: str, text: str) -> None:
            # Without the topic.
            self._reasons.append(text.partition(": ")[2])

        return CommandIntake(self.mission, self.info.frame, note, lambda _: None)

    def take(self, command: _Command) -> tuple[str, str] | None:
        """Give the mission a command; returns code and reason if it is refused."""
        return self._take(self._intake, command)

    def _take(self, intake: CommandIntake, command: _Command) -> tuple[str, str] | None:
        before = intake.rejected.copy()
        self._reasons.clear()
        if command.name == "joint_action":
            intake.joint_action(command.message)
        elif command.drone in self.info.agents:
            _TAKE[command.name](intake, self.info.agents.index(command.drone), command.message)
        refused = list((intake.rejected - before).elements())
        return (refused[0], " ".join(self._reasons) or refused[0]) if refused else None

    def leads_to(self, report: _Report, commands: Sequence[_Command]) -> tuple[bool, bool]:
        """Return whether these commands lead to the actions of a report, and are complete."""
        mission = self.mission
        state = mission.commands.state()
        intake = self._new_intake()
        for command in commands:
            self._take(intake, command)
        complete = not mission.missing
        self._fill_up(report)
        joint = mission.commands.take(mission.live, mission.result.cells, "hold")
        mission.commands.restore(state)
        return bool(np.array_equal(joint, report.points["action"])), complete

    def _fill_up(self, report: _Report) -> int:
        """Give drones without a command the action of the report; returns how many those are."""
        missing = self.mission.missing
        for drone in missing:
            action = int(report.points["action"][drone])
            known = HOLD <= action < len(self.info.actions)
            self.mission.commands.set_action(drone, action if known else HOLD)
        return len(missing)

    def advance(self, report: _Report) -> None:
        """Do the step of a report with the commands that were taken."""
        self.outcome.uncommanded += self._fill_up(report)
        self.mission.advance("hold")
        self.outcome.steps += 1

    def repeat(self, report: _Report) -> None:
        """Take out the drones that were lost since; their report comes again."""
        for drone in np.flatnonzero(report.points["terminated"]).tolist():
            if not self.mission.result.terminated[drone] and self.mission.lose(drone):
                self.outcome.lost.append(self.info.agents[drone])
        # Mission time may have restarted.
        self._first_stamp = None

    def compare(self, report: _Report) -> Difference | None:
        """Return the first difference of the last step to its report."""
        mission = self.mission
        if len(report.points) != len(self.info.agents):
            return Difference(report.step, "", "drones", str(len(report.points)), "others")
        stamp_ns = to_nanoseconds(report.message.header.stamp)
        expected_ns = self._expected_ns(report.step, stamp_ns)
        own = step_report_of(mission, self.info.frame, self.outcome.run_id)
        message = step_report_message(self.info.frame, own, report.message.header.stamp)
        # Do not compare the bytes of the message: rclpy leaves padding between fields undefined.
        if message == report.message and stamp_ns == expected_ns:
            return None
        if own.dtype != report.points.dtype:
            return Difference(report.step, "", "fields", str(report.points.dtype), str(own.dtype))
        names = own.dtype.names or ()
        for i, drone in enumerate(self.info.agents):
            for name in (*_FIRST, *(name for name in names if name not in _FIRST)):
                recorded, replayed = report.points[name][i], own[name][i]
                if recorded.tobytes() != replayed.tobytes():
                    return Difference(
                        report.step, drone, name, self._shown(name, recorded),
                        self._shown(name, replayed),
                    )  # fmt: skip
        if stamp_ns != expected_ns:
            return Difference(report.step, "", "header.stamp", str(stamp_ns), str(expected_ns))
        for name in message.get_fields_and_field_types():
            recorded, replayed = getattr(report.message, name), getattr(message, name)
            if recorded != replayed:
                return Difference(report.step, "", name, str(recorded), str(replayed))
        return None

    def _expected_ns(self, step: int, stamp_ns: int) -> int:
        """Return the stamp that a report must have; its own where stamps are no mission time."""
        first, first_ns = self._first_stamp = self._first_stamp or (step, stamp_ns)
        step_ns = max(round(self.info.step_duration_s * 1e9), 1)
        expected_ns = first_ns + (step - first) * step_ns
        if step == first + 1 and expected_ns != stamp_ns:
            self._mission_time = False
        return expected_ns if self._mission_time else stamp_ns

    def _shown(self, name: str, value: Any) -> str:
        if name == "action" and 0 <= value < len(self.info.actions):
            return f"{value} ({self.info.actions[value]})"
        return str(value)
