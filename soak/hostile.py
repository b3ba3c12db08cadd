# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hostile messages: to the adapters, over DDS, and as MAVLink frames."""

from __future__ import annotations

import itertools
import os
import random
import socket
import statistics
import time
from collections import Counter
from typing import Any

from autopilot.wire import Codec, mavlink
from fuzz import any_message
from hostile_messages import GRID_SIZE, hostile
from live_fuzz import fuzz

from dsse_ros.mission.run.command_intake import CommandIntake
from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.frames import GridFrame
from soak.rigs import (
    SEARCH,
    UP,
    Bridge,
    Rig,
    domain,
    open_files,
    resident_bytes,
    threads,
)
from soak.row import Figures, Goal, Row, Run, zero

SCENARIO: dict[str, Any] = {
    "grid_size": GRID_SIZE,
    "num_drones": 3,
    "person_initial_position": (7, 7),
    "probability_of_detection": 0.0,
}
MEMORY = Goal("growth_mib", most=5.0)
SENDERS = ((1, 1), (1, 1), (1, 1), (2, 1), (245, 191), (255, 190), (0, 0), (1, 100))
"""Senders as system and component, most often the vehicle's own."""


def hostile_adapters(run: Run) -> Figures:
    """Send a mission messages that it must refuse."""
    number = run.size(100_000, 2_000)
    mission = Mission(parallel_env(**SCENARIO), seed=1)
    frame = GridFrame(GRID_SIZE, 130.0, -24.0, -46.0, 0.0, 120.0)
    intake = CommandIntake(mission, frame, lambda *_: None, lambda _: None)
    mission.command_all([SEARCH, SEARCH, UP])
    mission.advance("search")
    before = mission.snapshot().to_bytes()
    expected: Counter[str] = Counter()
    taken = 0
    memory = resident_bytes(os.getpid())
    messages = itertools.islice(hostile(random.Random(9)), number)
    for done, (topic, message, reason) in enumerate(run.each(messages, "messages")):
        if done == number // 10:
            memory = resident_bytes(os.getpid())
        taken += take(intake, topic, message)
        expected[reason] += 1
    return {
        "messages": number,
        "taken": taken,
        "miscounted": sum((expected - intake.rejected).values())
        + sum((intake.rejected - expected).values()),
        "reasons": len(expected),
        "changed": int(mission.snapshot().to_bytes() != before),
        "growth_mib": (resident_bytes(os.getpid()) - memory) / 2**20,
    }


def take(intake: CommandIntake, topic: str, message: Any) -> bool:
    """Pass the message of a topic to a mission, and return whether it is a new command."""
    return intake.topics()[topic](message)


def hostile_dds(run: Run) -> Figures:
    """Publish messages that the node must refuse, no faster than it takes them."""
    number = run.size(1000, 100)
    with domain(run.folder) as rig:
        sim = rig.sim(SCENARIO | {"seed": 1})
        sim.fly(SEARCH, SEARCH, UP)
        seen = len(sim.reports)
        in_flight: Counter[str] = Counter()
        expected: Counter[str] = Counter()
        messages = itertools.islice(hostile(random.Random(10)), number)
        for topic, message, reason in run.each(messages, "messages"):
            if in_flight[topic] == 4:
                sim.wait_until_quiet()
                in_flight.clear()
            in_flight[topic] += 1
            expected[reason] += 1
            sim.talk(type(message), topic).publish(message)
        health = sim.health_when(lambda h: int(h["rejected"]) >= number)
        counted = Counter(
            {k.removeprefix("rejected."): int(v) for k, v in health.items() if "rejected." in k}
        )
        changed = len(sim.reports) - seen
    return {
        "messages": number,
        "miscounted": sum((expected - counted).values()) + sum((counted - expected).values()),
        "changed": changed,
    }


def hostile_live(run: Run) -> Figures:
    """Send a live search what once ended its nodes, and copies of inputs with values replaced.

    Growth is that of the mean memory of a node from the second to the last of six parts of the
    time: what is kept for the next missions has its size by then.
    """
    with domain(run.folder) as rig:
        fuzzed = fuzz(rig, seed=0, seconds=run.size(3600.0, 5.0))
    growth = {
        name: statistics.mean(values[-part:]) - statistics.mean(values[part : 2 * part])
        for name, values in fuzzed.memory_mib.items()
        for part in [max(len(values) // 6, 1)]
        if len(values) > 1
    }
    return {
        "inputs": fuzzed.inputs,
        "accepted": fuzzed.answers["ok"],
        "unanswered": fuzzed.inputs - fuzzed.answers.total(),
        "missions": fuzzed.missions,
        "growth_mib": max(growth.values(), default=0.0),
        **{f"{name}_growth_mib": grown for name, grown in growth.items()},
        **{f"{name}_mib": values for name, values in fuzzed.memory_mib.items()},
    }


def hostile_mavlink(run: Run) -> Figures:
    """Send frames of every message, from the vehicle and from others, through the whole bridge.

    A TCP connection loses no frame and waits for the bridge.
    """
    number = run.size(1_000_000, 5_000)
    kinds = list(mavlink.mavlink_map.values())
    draw = random.Random(11)
    with domain(run.folder) as rig, socket.create_server(("127.0.0.1", 0)) as server:
        rig.sim(SCENARIO | {"num_drones": 1, "seed": 1})
        bridge = Bridge(rig, [_Listening(server)], arm=False)  # type: ignore[list-item]
        connection, _ = server.accept()
        with connection:
            connection.setblocking(False)
            vehicle = Flood(rig, connection, bridge)
            memory = files = running = 0
            for done in run.each(range(number), "frames"):
                if done == number // 5:
                    vehicle.flush()
                    pid = bridge.process.child.pid
                    memory, files, running = resident_bytes(pid), open_files(pid), threads(pid)
                system, component = draw.choice(SENDERS)
                vehicle.send(any_message(kinds[done % len(kinds)], draw), system, component)
            vehicle.flush()
            counted = vehicle.counted_all(number)
            growth = (resident_bytes(pid) - memory) / 2**20
            figures = {
                "frames": number,
                "messages": len(kinds),
                "uncounted": number - counted,
                "errors": vehicle.counts.get("errors", 0),
                "arm_commands": vehicle.arm_commands,
                "growth_mib": growth,
                "more_files": open_files(pid) - files,
                "more_threads": threads(pid) - running,
                "died": int(not bridge.process.running),
            }
            bridge.process.stop()
    return figures


class _Listening:
    """Address that a bridge connects to."""

    def __init__(self, server: socket.socket) -> None:
        self.connection = f"tcp:127.0.0.1:{server.getsockname()[1]}"


OF_CODEC = ("accepted", "bad_data", "wrong_sender", "not_needed", "invalid")


class Flood:
    """A vehicle that sends arbitrary frames.

    Attributes:
        arm_commands: Number of commands to arm it from the bridge.
        counts: The last counts that the bridge published.
    """

    def __init__(self, rig: Rig, connection: socket.socket, bridge: Bridge) -> None:
        self._rig = rig
        self._connection = connection
        self._bridge = bridge
        self._codecs: dict[tuple[int, int], Codec] = {}
        self._receiver = Codec(200)
        self._waiting = bytearray()
        self.arm_commands = 0
        self.counts: dict[str, int] = {}

    def send(self, message: Any, system: int, component: int) -> None:
        """Queue a message of this sender."""
        codec = self._codecs.setdefault((system, component), Codec(system))
        codec.srcComponent = component
        self._waiting += codec.encode(message)
        if len(self._waiting) > 1 << 16:
            self.flush()

    def flush(self) -> None:
        """Send all queued messages, and read those of the bridge."""
        while self._waiting:
            self._read()
            try:
                del self._waiting[: self._connection.send(self._waiting[: 1 << 14])]
            except BlockingIOError:
                self._rig.executor.spin_once(timeout_sec=0.002)
            assert self._bridge.process.running, self._bridge.process.output[-2000:]

    def _read(self) -> None:
        try:
            data = self._connection.recv(1 << 16)
        except BlockingIOError:
            return
        for message in self._receiver.decode_all(data, datagram=False):
            self.arm_commands += (
                message.get_type() == "COMMAND_LONG"
                and message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM
                and message.param1 == 1.0
            )

    def counted_all(self, number: int) -> int:
        """Return how many frames the bridge has counted, once it counts no more."""
        last, last_s = -1, time.monotonic()
        while True:
            self._rig.executor.spin_once(timeout_sec=0.05)
            self._read()
            state = self._bridge.state(0)
            self.counts = {
                key.removeprefix("count."): int(value)
                for key, value in state.items()
                if key.startswith("count.")
            }
            counted = sum(self.counts.get(key, 0) for key in OF_CODEC)
            if counted >= number:
                return counted
            if counted != last:
                last, last_s = counted, time.monotonic()
            if time.monotonic() - last_s > 60:
                return counted


ROWS = (
    Row(
        "hostile_adapters",
        "100 000 hostile commands through the adapters: no exception, no change of state, each "
        "reason counted, memory flat",
        hostile_adapters,
        "{messages} messages: {taken} taken, {miscounted} miscounted, memory {growth_mib:+.1f} MiB",
        (*zero("taken", "miscounted", "changed"), MEMORY),
    ),
    Row(
        "hostile_dds",
        "1000 hostile commands over DDS: no exception, no change of state, each reason counted",
        hostile_dds,
        "{messages} messages: {miscounted} miscounted, {changed} steps done",
        zero("miscounted", "changed"),
    ),
    Row(
        "hostile_live",
        "An hour of hostile inputs to live searches, 20 a second, among them all that once ended a "
        "node: no node ends, each input is answered, memory flat",
        hostile_live,
        "{inputs} inputs in {missions} missions, {accepted} accepted: {unanswered} unanswered, "
        "memory {growth_mib:+.1f} MiB in the node where it grows most",
        (
            Goal("unanswered", most=0),
            Goal("growth_mib", most=5.0, timed=True),
        ),
    ),
    Row(
        "hostile_mavlink",
        "10^6 MAVLink frames of every message with random fields through the whole bridge: no "
        "exception, each counted, nothing armed, memory flat",
        hostile_mavlink,
        "{frames} frames of {messages} messages: {uncounted} uncounted, {arm_commands} arm "
        "commands, memory {growth_mib:+.1f} MiB",
        (
            *zero("uncounted", "errors", "arm_commands", "more_files", "more_threads", "died"),
            MEMORY,
        ),
    ),
)
