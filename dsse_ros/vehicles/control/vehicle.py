# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles, each with a link, a controller and a thread that runs both."""

from __future__ import annotations

import contextlib
import queue
import select
import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.base.defects import Defects
from dsse_ros.vehicles.control.commands import ControllerSettings
from dsse_ros.vehicles.control.orders import Hold
from dsse_ros.vehicles.control.vehicle_controller import (
    Order,
    Outcome,
    VehicleController,
    log_new,
)
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.mavlink.codec import Codec
from dsse_ros.vehicles.mavlink.link import parse_connection
from dsse_ros.vehicles.mavlink.messages import Address, Heartbeat, Outgoing, StatusText
from dsse_ros.vehicles.mavlink.signing import SigningClock, read_key

_HEARTBEAT_S = 1.0
_REOPEN_S = 1.0
_MAX_WAIT_S = 0.2
_AFTER_ERROR_S = 0.1
CLOSE_S = 6.0
"""Longest time that closing takes."""
_HAND_OVER_S = 4.0
"""How long, of that time, the vehicle may take until it is seen to hold."""
_MAX_TEXTS = 100
_MAVLINK_VERSION = 3
_OURS = Heartbeat(
    mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0,
    mavlink.MAV_STATE_ACTIVE, _MAVLINK_VERSION,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class VehicleSettings(ControllerSettings):
    """A vehicle, how it is reached and how it is flown.

    Attributes:
        connection: In one of the forms of `link.parse_connection`.
        system_id: The vehicle's.
        own_system_id: Ours.
        signing_key_file: 32 bytes or 64 hexadecimal digits that nobody else can read; empty to
            leave messages unsigned. The time of the last signature is kept beside it.
    """

    connection: str
    system_id: int = 1
    own_system_id: int = 245
    signing_key_file: str = ""


@dataclass(frozen=True)
class VehicleSnapshot:
    """A vehicle at one moment, as its thread has seen it.

    Attributes:
        state: What the vehicle reports.
        outcome: Outcome of the latest order that its controller has.
        trouble: Problem with the link or the signatures; None if there is none.
        counts: Number of events; see `Vehicle.counts`.
    """

    state: VehicleState
    outcome: Outcome
    trouble: str | None
    counts: Mapping[str, int]


class Vehicle:
    """One vehicle; everything is safe from any thread and returns at once but for `join`, `close`.

    Its own thread alone drives link, codec and controller. Others give it orders through a queue,
    and read the snapshot that it publishes.

    Args:
        settings: How to reach the vehicle and how to fly it.

    Raises:
        ValueError: If the connection has none of the forms, or there is no key in the key file.
    """

    def __init__(self, settings: VehicleSettings) -> None:
        self.settings = settings
        target = Address(settings.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        source = Address(settings.own_system_id, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        key, clock = None, None
        if settings.signing_key_file:
            file = Path(settings.signing_key_file)
            try:
                key = read_key(file)
            except ValueError as error:
                raise ValueError(f"signing_key_file: {error}") from error
            clock = SigningClock(file.with_name(f"{file.name}.{source.system}-{target.system}"))
        self._codec = Codec(source, target, key=key, clock=clock)
        self._clock = clock
        self._link = parse_connection(settings.connection)
        self._controller = VehicleController(target, source, settings)
        self._defects = Defects()
        self._counts: Counter[str] = Counter()
        self._outbox: list[Outgoing] = []
        self._thread: threading.Thread | None = None
        self._up = False
        self._trouble: str | None = None
        self._reopen_s = 0.0
        self._heartbeat_s = 0.0
        # What threads share.
        self._snapshot = self._take_snapshot()
        self._calls: queue.SimpleQueue[Callable[[float], list[Outgoing]]] = queue.SimpleQueue()
        self._given = Outcome()
        self._giving = threading.Lock()
        self._texts: deque[StatusText] = deque(maxlen=_MAX_TEXTS)
        self._closing = False
        self._woken, self._waker = socket.socketpair()
        self._woken.setblocking(False)
        self._waker.setblocking(False)

    def start(self) -> None:
        """Start the thread: a link that does not open is tried again, see `trouble`.

        Raises:
            RuntimeError: If it was started before.
        """
        if self._thread is not None:
            raise RuntimeError("a vehicle can start only once")
        name = f"vehicle {self.settings.system_id}"
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def adopt(self, mode: str) -> None:
        """Take it over from an earlier program: see `ModeWatch.adopt`."""

        def adopted(now: float) -> list[Outgoing]:
            self._controller.modes.adopt(mode)
            return []

        self._calls.put(adopted)
        self._wake()

    def give(self, order: Order, authority: int = 0) -> int:
        """Give an order in place of any other; returns its number, from 1.

        Args:
            order: The order.
            authority: See `VehicleController.give`.
        """
        return self._put(order, lambda now: self._controller.give(order, now, authority))

    def release(self) -> int:
        """Drop the order; a vehicle in the air goes on by itself, or holds if it needs setpoints.

        Returns:
            A number as `give`.
        """
        return self._put(None, lambda now: self._controller.release(Hold(), now))

    def _put(self, order: Order | None, call: Callable[[float], list[Outgoing]]) -> int:
        """Have the thread call a function with our time, and send what it returns."""
        with self._giving:
            latest = Outcome.of_given(order, self._given.number + 1)
            self._calls.put(call)
            self._wake()
            self._given = latest
        return latest.number

    @property
    def system_id(self) -> int:
        """Its system id."""
        return self.settings.system_id

    @property
    def connection(self) -> str:
        """Name of its link, whatever the form in which the settings have it."""
        return self._link.name

    @property
    def snapshot(self) -> VehicleSnapshot:
        """The vehicle as its thread saw it last; an order given since then is not in it."""
        return self._snapshot

    @property
    def state(self) -> VehicleState:
        """What the vehicle reports."""
        return self._snapshot.state

    @property
    def outcome(self) -> Outcome:
        """Outcome of the latest order."""
        outcome, latest = self._snapshot.outcome, self._given
        return latest if latest.number > outcome.number else outcome

    @property
    def trouble(self) -> str | None:
        """Problem with the link or the signatures; None if there is none."""
        return self._snapshot.trouble

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of events, by a short key; 0 for a missing one.

        Of what came: `accepted`, `bad_data`, `invalid`, `wrong_sender`, `wrong_address`,
        `not_needed`, `unsigned` and `forged`. Of us: `heartbeats` sent, `heartbeats_missed`,
        `unsent`, `opened`, `closed` and `errors`. Of orders and the vehicle: `done`, `failed`,
        `taken_over`, `failsafe`, `link_lost`, `link_found` and `offboard_lost`.
        """
        return self._snapshot.counts

    def take_texts(self) -> list[StatusText]:
        """Return the status texts of the vehicle since the last call, at most 100 of them."""
        texts = []
        with contextlib.suppress(IndexError):
            while True:
                texts.append(self._texts.popleft())
        return texts

    def stop(self) -> None:
        """Have the thread end, once a vehicle in the air that flies to our setpoints holds."""
        self._closing = True
        self._wake()

    def join(self, timeout_s: float) -> None:
        """Wait for the end of the thread after `stop`, no longer than so many seconds."""
        if self._thread is None:
            self._close_wakers()
        else:
            self._thread.join(timeout_s)

    def close(self) -> None:
        """Stop and join."""
        self.stop()
        self.join(CLOSE_S)

    def __enter__(self) -> Vehicle:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _wake(self) -> None:
        with contextlib.suppress(OSError):
            self._waker.send(b"\0")

    def _close_wakers(self) -> None:
        self._waker.close()
        self._woken.close()

    # The thread

    def _run(self) -> None:
        while not self._closing:
            self._isolated_turn()
        now = time.monotonic()
        end_s = now + _HAND_OVER_S
        self._outbox += self._controller.hand_over(Hold(), now)
        while (self._outbox or self._controller.handing_over) and time.monotonic() < end_s:
            self._isolated_turn()
        self._link.close()
        self._codec.close()
        self._close_wakers()

    def _isolated_turn(self) -> None:
        try:
            self._turn()
        except OSError as error:
            self._drop(error)
        except Exception as error:
            # The vehicle needs heartbeats even if we fail on its messages.
            self._counts["errors"] += 1
            log_new(self._defects, f"vehicle {self.settings.system_id}", error)
            time.sleep(_AFTER_ERROR_S)
        self._snapshot = self._take_snapshot()

    def _take_snapshot(self) -> VehicleSnapshot:
        counts = self._counts + self._codec.counts + self._link.counts + self._controller.counts
        state = self._controller.state
        trouble = self._trouble or (self._clock.trouble if self._clock else None)
        if not trouble and not (self._clock and state.connected):
            # Bad signatures of others are harmless while the vehicle's own are good.
            trouble = self._codec.trouble
        return VehicleSnapshot(state, self._controller.outcome, trouble, MappingProxyType(counts))

    def _turn(self) -> None:
        """Wait for the next event, and handle it."""
        now = time.monotonic()
        if not self._up and now >= self._reopen_s:
            self._reopen_s = now + _REOPEN_S
            self._link.open()
            self._codec.forget_rest()
            self._up = True
            self._counts["opened"] += 1
        due_s = min(self._controller.deadline, self._heartbeat_s, now + _MAX_WAIT_S)
        ready = self._wait(max(0.0, due_s - now) if not self._outbox else 0.0)
        now = time.monotonic()
        if now >= self._heartbeat_s:
            # Keep an even pace without catching up on missed ones.
            if self._counts["heartbeats"]:
                late_s = now - self._heartbeat_s
                self._counts["heartbeats_missed"] += int(late_s / _HEARTBEAT_S)
            next_s = self._heartbeat_s + _HEARTBEAT_S
            self._heartbeat_s = next_s if next_s > now else now + _HEARTBEAT_S
            self._outbox.insert(0, _OURS)
            self._counts["heartbeats"] += self._up
        with contextlib.suppress(queue.Empty):
            while True:
                self._outbox += self._calls.get_nowait()(now)
        if ready:
            self._receive(now)
        if now >= self._controller.deadline:
            self._outbox += self._controller.tick(now)
        outbox, self._outbox = self._outbox, []
        if self._up:
            for message in outbox:
                self._link.send(self._codec.encode(message))
            if ready and not outbox:
                self._link.send(b"")
            if not self._link.connecting:
                self._trouble = None

    def _wait(self, seconds: float) -> bool:
        """Wait until there is something to do, and return whether it is on the link."""
        poll = select.poll()
        poll.register(self._woken, select.POLLIN)
        if self._up:
            unsent = select.POLLOUT if self._link.waits_to_send else 0
            poll.register(self._link, select.POLLIN | unsent)
        ready = dict(poll.poll(1000 * seconds))
        if ready.pop(self._woken.fileno(), 0):
            with contextlib.suppress(BlockingIOError):
                self._woken.recv(4096)
        return bool(ready)

    def _receive(self, now: float) -> None:
        for data, peer in self._link.receive(now):
            messages = self._codec.decode(data, now, datagram=self._link.datagram)
            if messages:
                self._link.confirm_peer(peer, now)
            for message in messages:
                if isinstance(message, StatusText):
                    self._texts.append(message)
                self._outbox += self._controller.receive(message, now)

    def _drop(self, error: OSError) -> None:
        if self._up:
            self._counts["closed"] += 1
        self._up = False
        self._trouble = f"{self.connection}: {error.strerror or error}"
        self._reopen_s = time.monotonic() + _REOPEN_S
        self._link.close()
        self._outbox.clear()


class VehicleFleet(list[Vehicle]):
    """Vehicles, which start and close together; one that fails does not stop others.

    Args:
        settings: One for each vehicle.

    Raises:
        ValueError: If two of them would share a link, or as `Vehicle` does.
    """

    def __init__(self, settings: Sequence[VehicleSettings]) -> None:
        links = Counter(parse_connection(vehicle.connection).name for vehicle in settings)
        for connection, number in links.items():
            if number > 1:
                raise ValueError(
                    f"connection must differ, got {connection!r} for {number} vehicles"
                )
        super().__init__(Vehicle(vehicle) for vehicle in settings)

    def start(self) -> None:
        """Start them all."""
        for vehicle in self:
            vehicle.start()

    def close(self) -> None:
        """Close them all, in the time of one."""
        for vehicle in self:
            vehicle.stop()
        end_s = time.monotonic() + CLOSE_S
        for vehicle in self:
            vehicle.join(max(0.0, end_s - time.monotonic()))
