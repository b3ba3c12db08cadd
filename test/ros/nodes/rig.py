# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes of their own, and the topics and services of a mission as a peer sees them."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from domains import free_domain
from forked import ForkedNode, forkable
from numpy.typing import NDArray
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Int32MultiArray, String
from std_srvs.srv import SetBool, Trigger

from dsse_ros.ros.nodes.settings import FULL_NAMES
from dsse_ros.ros.runtime.fast_dds import MEMORY_FROM_PROFILES, variable
from msg_adapters.commands import joint_action_message
from msg_adapters.diagnostics import status_name
from msg_adapters.step_report import step_report_from_message
from msg_adapters.vehicle_tasks import vehicle_tasks_from_message

with warnings.catch_warnings():
    # ROS 2's own imports, on the first message that is converted.
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

T = TypeVar("T")

ACTIONS = ("left", "right", "up", "down", "search")
"""The actions of the profile `paper`, by number."""

TIMEOUT_S = 150.0
"""Until a test gives up waiting; a first start compiles, and a busy machine may take minutes."""

RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
ALL = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Every report from the last one on: what waits is not overtaken by what comes."""
EVERY = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
"""Every message from now on, however slowly the test takes them."""

# By default a node that missed the first announcements, or a message, waits 3 s for the next try,
# and one that was killed is there for 20 s more.
_PROFILES = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com">
  <participant profile_name="quick" is_default_profile="true">
    <rtps><builtin><discovery_config>
      <leaseDuration><sec>10</sec></leaseDuration>
      <leaseAnnouncement><sec>0</sec><nanosec>200000000</nanosec></leaseAnnouncement>
    </discovery_config></builtin></rtps>
  </participant>
  <data_writer profile_name="quick_writer" is_default_profile="true">
    <qos><data_sharing><kind>OFF</kind></data_sharing></qos>
    <times><{0}><sec>0</sec><nanosec>20000000</nanosec></{0}></times>
    <historyMemoryPolicy>DYNAMIC</historyMemoryPolicy>
  </data_writer>
  <data_reader profile_name="quick_reader" is_default_profile="true">
    <qos><data_sharing><kind>OFF</kind></data_sharing></qos>
    <historyMemoryPolicy>DYNAMIC</historyMemoryPolicy>
  </data_reader>
</profiles>
"""
_HEARTBEAT_PERIODS = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": "heartbeatPeriod",
    "FASTDDS_DEFAULT_PROFILES_FILE": "heartbeat_period",
}
"""As Fast DDS calls it, before Kilted and since."""


def _environment() -> dict[str, str]:
    name = variable()
    period = _HEARTBEAT_PERIODS[name]
    profiles = Path(tempfile.gettempdir()) / f"dsse_ros_test_{name}_{os.getuid()}.xml"
    written = profiles.with_suffix(f".{os.getpid()}")
    written.write_text(_PROFILES.format(period), encoding="utf-8")
    # In one go: a node of another test may be reading it.
    written.replace(profiles)
    return {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_PYTHON_CHECK_FIELDS": "1",
        name: str(profiles),
        MEMORY_FROM_PROFILES: "1",
    }


ENVIRONMENT = _environment()
"""What the tests and the nodes they start have in common."""


class Process:
    """A program of the package, or a script.

    Args:
        arguments: What follows `python -m`, or `python` where it is a file.
        log: Where its output goes.
        domain: ROS domain.
    """

    def __init__(self, arguments: Sequence[str], log: Path, domain: int) -> None:
        self.log = log
        environment = os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(domain)}
        program, *words = arguments
        self.child: ForkedNode | subprocess.Popen[bytes]
        with log.open("wb") as output:
            if program.startswith("dsse_ros.ros.nodes.") and forkable(environment):
                self.child = ForkedNode(program, words, log, environment)
            else:
                self.child = subprocess.Popen(
                    [sys.executable, *([] if program.endswith(".py") else ["-m"]), *arguments],
                    # In the source tree -m would find the package there, and compile it again.
                    cwd=log.parent,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    env=environment,
                )

    @property
    def output(self) -> str:
        """All that it has written."""
        return self.log.read_text(errors="replace")

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self.child.poll() is None

    def signal(self, *numbers: signal.Signals) -> None:
        """Send it signals, if it runs."""
        for number in numbers:
            self.child.send_signal(number)

    def wait(self) -> int:
        """Return its exit code when it has ended."""
        return self.child.wait(TIMEOUT_S)

    def kill(self) -> None:
        """End it without asking."""
        self.child.kill()
        self.child.wait()

    def stop(self) -> None:
        """Interrupt it, and hold it to ending in peace."""
        if self.running:
            self.signal(signal.SIGINT)
        try:
            code = self.wait()
        except subprocess.TimeoutExpired:
            self.kill()
            raise
        assert code == 0, self.output
        assert "Traceback" not in self.output, self.output


class Inbox(list[Any]):
    """Messages of a topic in the order in which they came."""

    @property
    def last(self) -> Any:
        """The last message."""
        return self[-1]


class Rig:
    """A domain with a peer in it.

    Args:
        folder: For what the nodes write.
        domain: To join; by default one of its own.
    """

    def __init__(self, folder: Path, domain: int | None = None) -> None:
        self.folder = folder
        self.domain = free_domain() if domain is None else domain
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node("peer", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[Process] = []
        self._clients: dict[str, Any] = {}
        self._publishers: dict[tuple[str, Any], Publisher] = {}

    def close(self) -> None:
        """Stop everything.

        The peer leaves first: Fast DDS can deadlock as it removes an endpoint while another node
        leaves (its issue #6502).
        """
        try:
            self.executor.shutdown()
            self.node.destroy_node()
            self.context.try_shutdown()
            for process in self.processes:
                if process.running:
                    process.stop()
        finally:
            for process in self.processes:
                if process.running:
                    process.kill()

    def start(
        self, node: str, parameters: Mapping[str, Any] | None = None, *arguments: str
    ) -> Process:
        """Start a node of the package; further arguments follow --ros-args.

        Fields of the scenario and of the rules are given by their own names.
        """
        full_names = FULL_NAMES if node == "sim_node" else {}
        command = [f"dsse_ros.ros.nodes.{node}", "--ros-args", *arguments]
        for name, value in (parameters or {}).items():
            command += ["-p", f"{full_names.get(name, name)}:={json.dumps(value)}"]
        log = self.folder / f"{len(self.processes)}_{node}.log"
        process = Process(command, log, self.domain)
        self.processes.append(process)
        return process

    def run(self, script: Path, *arguments: str) -> Process:
        """Start a script."""
        log = self.folder / f"{len(self.processes)}_{script.stem}.log"
        process = Process([str(script), *arguments], log, self.domain)
        self.processes.append(process)
        return process

    def sim(
        self, parameters: Mapping[str, Any] | None = None, *arguments: str, namespace: str = ""
    ) -> Sim:
        """Start a sim_node and wait for its first report."""
        remaps = ["-r", f"__ns:={namespace}"] if namespace else []
        process = self.start("sim_node", parameters, *remaps, *arguments)
        return Sim(self, process, namespace)

    def until(self, condition: Callable[[], T], what: str = "", timeout_s: float = TIMEOUT_S) -> T:
        """Return the condition's value as soon as it is true.

        Raises:
            AssertionError: If it is not in time.
        """
        deadline = time.monotonic() + timeout_s
        while not (value := condition()):
            if time.monotonic() > deadline:
                logs = "\n".join(f"{p.log.name}:\n{p.output}" for p in self.processes)
                raise AssertionError(f"{what or 'the condition'} within {timeout_s:g} s\n{logs}")
            self.executor.spin_once(timeout_sec=0.02)
        return value

    def drain(self) -> None:
        """Take all messages that have come so far."""
        with contextlib.suppress(TimeoutException):
            while True:
                handler, *_ = self.executor.wait_for_ready_callbacks(timeout_sec=0.0)
                handler()

    def listen(self, kind: Any, topic: str, qos: QoSProfile = EVERY) -> Inbox:
        """Return the messages of a topic as they come."""
        inbox = Inbox()
        self.node.create_subscription(kind, topic, inbox.append, qos)
        return inbox

    @contextlib.contextmanager
    def listening(self, kind: Any, topic: str, qos: QoSProfile = EVERY) -> Iterator[Inbox]:
        """Listen for a while."""
        inbox = Inbox()
        subscription = self.node.create_subscription(kind, topic, inbox.append, qos)
        try:
            yield inbox
        finally:
            self.node.destroy_subscription(subscription)

    def first(self, kind: Any, topic: str, qos: QoSProfile = LATCHED) -> Any:
        """Return the first message that one who joins now gets."""
        with self.listening(kind, topic, qos) as inbox:
            self.until(lambda: inbox, f"a message on {topic}")
            return inbox[0]

    def talk(self, kind: Any, topic: str, qos: QoSProfile = RELIABLE) -> Publisher:
        """Return a publisher that somebody listens to."""
        publisher = self._publishers.get((topic, kind))
        if publisher is None:
            publisher = self.node.create_publisher(kind, topic, qos)
            self._publishers[topic, kind] = publisher
        self.until(publisher.get_subscription_count, f"a listener to {topic}")
        return publisher

    def deliver(self) -> None:
        """Return when all that was published is with those it was for."""
        for publisher in self._publishers.values():
            assert publisher.wait_for_all_acked(Duration(seconds=TIMEOUT_S))

    def call(self, kind: Any, service: str, **fields: Any) -> Any:
        """Return the response of a service, when what was published before it is here too."""
        if service not in self._clients:
            self._clients[service] = self.node.create_client(kind, service)
        client = self._clients[service]
        self.until(client.service_is_ready, f"service {service}")
        future = client.call_async(kind.Request(**fields))
        self.until(future.done, f"a response of {service}")
        self.drain()
        return future.result()


class Sim:
    """A sim_node as its peers see it.

    Attributes:
        reports: All step reports since it was started.
        refused: Commands refused by reason, as the diagnostics last seen here had it.
    """

    def __init__(self, rig: Rig, process: Process, namespace: str) -> None:
        self.rig = rig
        self.process = process
        self.namespace = namespace
        self.refused: Counter[str] = Counter()
        self.reports = rig.listen(PointCloud2, self.topic("step_report"), ALL)
        rig.until(lambda: self.reports, "the first step report")

    def topic(self, name: str) -> str:
        """Return a topic of the node."""
        return f"{self.namespace}/{name}"

    @property
    def report(self) -> NDArray[Any]:
        """The last step report, one entry per drone."""
        return step_report_from_message(self.reports.last)

    @property
    def step_number(self) -> int:
        """Steps done."""
        return int(self.report["step"][0])

    @property
    def search(self) -> tuple[int, int]:
        """run_id and mission of the last report."""
        return search_of(self.report)

    @property
    def cells(self) -> list[tuple[int, int]]:
        """Where the drones are, as (col, row)."""
        return cells(self.report)

    @property
    def flying(self) -> bool:
        """Whether a drone is in flight."""
        report = self.report
        return not (report["terminated"] | report["truncated"]).all()

    @cached_property
    def _tasks(self) -> Inbox:
        return self.rig.listen(PointCloud2, self.topic("vehicle_tasks"), LATCHED)

    def tasks(self) -> NDArray[Any]:
        """Return the tasks of the vehicles, one entry per drone."""

        def current() -> bool:
            tasks = [vehicle_tasks_from_message(message)[-1] for message in self._tasks[-1:]]
            return any(search_of(task) == self.search for task in tasks)

        self.rig.until(current, "the tasks")
        return vehicle_tasks_from_message(self._tasks.last)[-1]

    def begin(self, *actions: int) -> NDArray[Any]:
        """Command all drones and return the tasks with which their vehicles begin."""
        seen = int(self.tasks()["task"].max())
        self.joint(*actions)
        self.rig.until(lambda: self.tasks()["task"].max() > seen, "the tasks of the step")
        return self.tasks()

    def next_report(self, seen: int) -> NDArray[Any]:
        """Return the report after the first `seen` ones."""
        self.rig.until(lambda: len(self.reports) > seen, "a step report")
        return step_report_from_message(self.reports[seen])

    # Commands

    def talk(self, kind: Any, topic: str) -> Publisher:
        """Return a publisher to a topic of the node."""
        return self.rig.talk(kind, self.topic(topic))

    def joint(self, *actions: int, step: int | None = None, mission: int | None = None) -> None:
        """Command all drones, by default for the step to come of the reported mission."""
        step = self.step_number if step is None else step
        mission = self.search[1] if mission is None else mission
        publisher = self.talk(Int32MultiArray, "joint_action")
        publisher.publish(joint_action_message(mission, step, actions))

    def fly(self, *actions: int) -> NDArray[Any]:
        """Command all drones and return the report of the step."""
        seen = len(self.reports)
        self.joint(*actions)
        return self.next_report(seen)

    def command(self, drone: int, action: int | str) -> None:
        """Command one drone, by the name of an action or its number in the profile `paper`."""
        name = action if isinstance(action, str) else ACTIONS[action]
        self.talk(String, f"drone{drone}/cmd_action_name").publish(String(data=name))

    # Services

    def call(self, kind: Any, service: str, **fields: Any) -> Any:
        """Return the response of a service of the node."""
        return self.rig.call(kind, f"{self.namespace}/sim_node/{service}", **fields)

    def trigger(self, service: str) -> tuple[bool, str]:
        """Return success and message of a Trigger service."""
        response = self.call(Trigger, service)
        return response.success, response.message

    def reset(self) -> NDArray[Any]:
        """Start a new mission and return its first report."""
        seen, before = len(self.reports), self.search
        assert self.trigger("reset")[0]

        def of_new_mission() -> list[NDArray[Any]]:
            reports = map(step_report_from_message, self.reports[seen:])
            return [report for report in reports if search_of(report) != before]

        # In real time steps of the old one may come first.
        return self.rig.until(of_new_mission, "the first report of a new mission")[0]

    def pause(self, paused: bool) -> None:
        """Hold the mission, or let it go on."""
        assert self.call(SetBool, "pause", data=paused).success

    def wait_until_quiet(self) -> None:
        """Return when the node has dealt with every message sent so far."""
        self.rig.deliver()
        # It is asked after them, so it answers after them.
        self.get("seed")

    def kill(self) -> None:
        """End the node without asking, once it has sent what there was to send.

        One that is killed as it sends leaves the shared memory of its listener locked: Fast DDS
        then makes another, and the listener gets nothing any more.
        """
        self.wait_until_quiet()
        self.process.kill()

    # Parameters

    def try_set(self, **values: Any) -> list[SetParametersResult]:
        """Change parameters one by one and return the verdicts."""
        parameters = [Parameter(n, value=v).to_parameter_msg() for n, v in values.items()]
        return list(self.call(SetParameters, "set_parameters", parameters=parameters).results)

    def try_set_together(self, **values: Any) -> SetParametersResult:
        """Change all of these parameters or none."""
        parameters = [Parameter(n, value=v).to_parameter_msg() for n, v in values.items()]
        return self.call(
            SetParametersAtomically, "set_parameters_atomically", parameters=parameters
        ).result

    def set(self, **values: Any) -> None:
        """Change parameters."""
        for result in self.try_set(**values):
            assert result.successful, result.reason

    def get(self, *names: str) -> list[Any]:
        """Return the values of parameters."""
        values = self.call(GetParameters, "get_parameters", names=list(names)).values
        return [parameter_value_to_python(value) for value in values]

    def parameters(self) -> dict[str, ParameterDescriptor]:
        """Return the descriptors of all parameters."""
        names = list(self.call(ListParameters, "list_parameters").result.names)
        described = self.call(DescribeParameters, "describe_parameters", names=names).descriptors
        return dict(zip(names, described, strict=True))

    # Diagnostics

    def health_when(self, condition: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Return the first diagnostics from now on that satisfy the condition.

        What was published before them is here then too. They are the values, with `level`,
        `message` and the message's first part as `state`.
        """
        name = status_name(f"{self.namespace}/sim_node")
        with self.rig.listening(DiagnosticArray, "/diagnostics") as inbox:

            def found() -> dict[str, Any] | None:
                while inbox:
                    for status in inbox.pop(0).status:
                        values: dict[str, Any] = {pair.key: pair.value for pair in status.values}
                        values |= {"level": status.level, "message": status.message}
                        values["state"] = status.message.split("; ")[0]
                        if status.name != name:
                            continue
                        self.refused = Counter(
                            {k[9:]: int(v) for k, v in values.items() if k.startswith("rejected.")}
                        )
                        if condition(values):
                            return values
                return None

            health = self.rig.until(found, "such diagnostics")
            self.rig.drain()
        assert health is not None
        return health

    def health_after(self, *reasons: str) -> dict[str, Any]:
        """Return the diagnostics that count these refusals beside those seen before."""
        expected = self.refused + Counter(reasons)
        return self.health_when(lambda _: self.refused == expected)

    def health(self) -> dict[str, Any]:
        """Return the next diagnostics."""
        return self.health_when(lambda _: True)


@pytest.fixture(scope="module", name="rig")
def rig_of_module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A domain of its own, in which nodes can be started; they are stopped at the end."""
    rig = Rig(tmp_path_factory.mktemp("rig"))
    try:
        yield rig
    finally:
        rig.close()


def cells(report: NDArray[Any]) -> list[tuple[int, int]]:
    """Return the cells (col, row) of a report."""
    return list(zip(report["col"].tolist(), report["row"].tolist(), strict=True))


def search_of(report: NDArray[Any]) -> tuple[int, int]:
    """Return run_id and mission of a report."""
    return int(report["run_id"][0]), int(report["mission"][0])


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message's header."""
    stamp = message.header.stamp
    return stamp.sec * 10**9 + stamp.nanosec


def content(message: Any) -> tuple[Any, ...]:
    """Return all of a step report, stamp included."""
    fields = [(f.name, f.offset, f.datatype, f.count) for f in message.fields]
    return (
        stamp_ns(message), message.header.frame_id, message.height, message.width, fields,
        message.is_bigendian, message.point_step, message.row_step, message.is_dense,
        bytes(message.data),
    )  # fmt: skip


def steps_of(messages: Iterable[Any]) -> list[bytes]:
    """Return what step reports say of the drones, whichever run and mission they are of."""
    reports = [step_report_from_message(message) for message in messages]
    for report in reports:
        report["run_id"] = report["mission"] = 0
    return [report.tobytes() for report in reports]


def occupancy(grid: Any) -> NDArray[np.int8]:
    """Return the cells of an OccupancyGrid, row 0 in the south."""
    return np.asarray(grid.data, np.int8).reshape(grid.info.height, grid.info.width)
