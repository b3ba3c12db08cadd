# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Carries out the orders to one vehicle; the caller has the link and the clock."""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, get_args

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.base.checks import check_number
from dsse_ros.base.defects import Defects, describe
from dsse_ros.vehicles.autopilots import Failsafe
from dsse_ros.vehicles.control.commands import (
    ACCEPTED,
    DO_SET_MODE,
    CommandSender,
    ControllerSettings,
    OrderFailedError,
    Situation,
    TakenOverError,
)
from dsse_ros.vehicles.control.message_requests import MessageRequests
from dsse_ros.vehicles.control.mode_watch import ModeWatch
from dsse_ros.vehicles.control.setpoints import MissedSetpoints, SetpointStreamer
from dsse_ros.vehicles.control.transfer import Done
from dsse_ros.vehicles.control.upload import Download, VerifiedUpload, mission_digest
from dsse_ros.vehicles.control.vehicle_state import (
    VehicleState,
    observe,
    without_answer,
    without_link,
)
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    CommandAck,
    GlobalPosition,
    Heartbeat,
    Incoming,
    MissionMessage,
    Outgoing,
    PositionTarget,
    SetPositionTarget,
    StatusText,
)

Status = Literal["idle", "under_way", "done", "failed", "taken_over", "failsafe", "silent"]

_MISSION_MESSAGES = get_args(MissionMessage)
_TICK_S = 0.2
_READ_AGAIN_S = 1.0
"""Least time between two readings of a mission."""
_CONCERNING = mavlink.MAV_SEVERITY_NOTICE
"""Texts that are less severe do not explain failures."""
_logger = logging.getLogger(__name__)


class Order(ABC):
    """An order to a vehicle: see `orders`.

    Attributes:
        finishes_alone: Whether an autopilot in its guided mode finishes it without us.
        flies_to_setpoints: Whether the vehicle needs setpoints for it.
    """

    finishes_alone: ClassVar[bool] = False
    flies_to_setpoints: ClassVar[bool] = False

    @abstractmethod
    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """Yield what is being waited for, whenever something may have changed, until it is done.

        Raises:
            OrderFailedError: If it cannot be carried out.
            TakenOverError: If somebody else has the vehicle.
        """


@dataclass(frozen=True)
class Outcome:
    """The outcome of the latest order.

    Attributes:
        order: The order, None if there was none.
        number: Its number, from 1; 0 if there was none.
        status: `idle` without an order; `done` only by what the vehicle did; `failed`;
            `taken_over` by a person or `failsafe` by the autopilot, and nothing is sent until an
            order comes with a new authority; `silent` while no heartbeats come, and nothing is
            sent, after which an order goes on.
        reason: One line for people: what it is waiting for, or what went wrong; None if it is idle
            or done.
        final: Whether an order that has failed would fail again.
    """

    order: Order | None = None
    number: int = 0
    status: Status = "idle"
    reason: str | None = None
    final: bool = False

    @classmethod
    def of_given(cls, order: Order | None, number: int) -> Outcome:
        """Return the outcome of an order that has just been given, or has been dropped."""
        return cls(None, number) if order is None else cls(order, number, "under_way", "given")


class VehicleController:
    """Flies one vehicle, one order at a time; a new order replaces the last one.

    Its caller passes only messages of the vehicle, and sends the heartbeats. No defect of ours
    makes it raise: the order fails, with the reason.

    Args:
        target: The vehicle's autopilot.
        source: Ourselves.
        settings: How to fly.

    Attributes:
        counts: Events by a short key.
        situation: What its parts share, and orders too, as the next three.
        commands: What sends commands.
        setpoints: What sends setpoints.
        modes: Compares the vehicle's mode with those that orders bring about.
        exchange: The latest transfer of a mission, None if there was none.
        uploaded: Digest of the mission that was uploaded for the order; None for none.
        source: Ourselves.

    Raises:
        ValueError: If the target is everybody.
    """

    def __init__(self, target: Address, source: Address, settings: ControllerSettings) -> None:
        check_number("target.system", target.system, 1, 255)
        self.counts: Counter[str] = Counter()
        self.source = source
        self.situation = Situation(target, settings)
        self.commands = CommandSender(self.situation)
        self.setpoints = SetpointStreamer(self.situation)
        self.modes = ModeWatch(self.situation, self.commands, self.counts)
        self.exchange: VerifiedUpload | Download | None = None
        self._requests = MessageRequests(target, self.situation.autopilot, settings.position_hz)
        self._steps: Iterator[str] | None = None
        self._outcome = Outcome()
        self._defects = Defects()
        self._due_s = -math.inf
        self.uploaded: str | None = None
        self._missed = MissedSetpoints(self.situation.autopilot, self.setpoints)
        self._changes_read = 0
        self._read_s = -math.inf
        self._handing_over = False
        self._authority = 0
        self._lost_authority = -1

    @property
    def state(self) -> VehicleState:
        """What the vehicle reports."""
        return self.situation.state

    @property
    def outcome(self) -> Outcome:
        """The outcome of the latest order."""
        if self._silent:
            silence = f"no heartbeat for {self.situation.settings.link_timeout_s:g} s"
            return replace(self._outcome, status="silent", reason=silence)
        return self._outcome

    @property
    def deadline(self) -> float:
        """Time at which `tick` is due."""
        if not self._may_act:
            return self._due_s
        transfer_s = self.exchange.deadline if self.exchange is not None else None
        return min(
            self._due_s, self.setpoints.deadline, math.inf if transfer_s is None else transfer_s
        )

    def give(self, order: Order | None, now: float, authority: int = 0) -> list[Outgoing]:
        """Take an order in place of any other; returns what to send.

        Args:
            order: The order; None for none, so that a vehicle in the air goes on by itself.
            now: Our time in seconds.
            authority: Number of the consent that the order goes back to. Once somebody else has
                the vehicle, only an order with a greater one is carried out.
        """
        before = self._outcome
        self._outcome = Outcome.of_given(order, before.number + 1)
        self._steps = self.uploaded = None
        with self._event(now) as sent:
            if order is not None:
                if authority <= self._lost_authority:
                    lost: Status = "failsafe" if before.status == "failsafe" else "taken_over"
                    self._outcome = replace(self._outcome, status=lost, reason=self._elsewhere())
                    return sent
                self._authority = authority
                if self.modes.given_up:
                    self.modes.resume()
            self.commands.begin()
            self.situation.begin_progress()
            if self.exchange is not None and self.exchange.result is None:
                self.situation.out += self.exchange.cancel(now)
            if order is None:
                self.setpoints.stop()
                return sent
            to_setpoints = order.flies_to_setpoints
            self.modes.expect_failsafe(to_setpoints=to_setpoints)
            self.situation.state = self._with_setpoint_loss(self.state)
            self.setpoints.begin(to_setpoints=to_setpoints)
            self._steps = order.carry_out(self)
        return sent

    def receive(self, message: Incoming, now: float) -> list[Outgoing]:
        """Take a message of the vehicle; returns what to send."""
        with self._event(now) as sent:
            situation, before, was_silent = self.situation, self.state, self._silent
            state = observe(before, message, now, situation.autopilot)
            heartbeat = isinstance(message, Heartbeat)
            exchange = self.exchange
            ours = isinstance(exchange, VerifiedUpload) and exchange.writing
            if ours and state.mission_changes > before.mission_changes:
                state = replace(state, mission_changes=before.mission_changes)
            if state.identity.restarts > before.identity.restarts:
                self._requests.forget()
            self.modes.setpoints_missed = self._missed.watch(message, before, state, now)
            situation.state = self._with_setpoint_loss(state, heartbeat=heartbeat)
            self._requests.receive(message, now)
            if situation.state.failsafe not in (None, Failsafe.OFFBOARD, before.failsafe):
                self.modes.require_confirmation()
            match message:
                case Heartbeat():
                    if was_silent:
                        self.counts["link_found"] += 1
                        self.modes.require_confirmation()
                        situation.restart_stall_timer()
                    self.commands.watch_arming()
                    self.modes.watch(before)
                case PositionTarget() if self._may_act:
                    self.setpoints.watch_reports()
                case GlobalPosition() if self._may_act:
                    self.setpoints.watch_position(under_way=self._steps is not None)
                case StatusText(severity, text) if severity <= _CONCERNING:
                    situation.note_text(text)
                case CommandAck(target_system=system, target_component=component):
                    own = self.source
                    if (system or own.system, component or own.component) == own:
                        self.commands.acknowledged(message)
                        if message.command == DO_SET_MODE:
                            self.modes.acknowledge(accepted=message.result in ACCEPTED)
                case _ if self.exchange is not None and isinstance(message, _MISSION_MESSAGES):
                    situation.out += self.exchange.receive(message, situation.target, now)
            if situation.state.crashed and not before.crashed:
                self.setpoints.stop()
                if self._steps is not None:
                    raise OrderFailedError(f"crashed: {situation.state.crashed}", final=True)
            named = situation.state.failsafe not in (None, Failsafe.CRITICAL)
            unnamed = before.failsafe is Failsafe.CRITICAL
            if named and unnamed and self._outcome.status == "failsafe":
                # The status text with the cause comes after the heartbeat with the effect.
                self._outcome = replace(
                    self._outcome, reason=self._elsewhere() + situation.recent_texts()
                )
        return sent

    def tick(self, now: float) -> list[Outgoing]:
        """Let time pass; returns what to send."""
        self._due_s = now + _TICK_S
        situation = self.situation
        timeout_s = situation.settings.link_timeout_s
        with self._event(now) as sent:
            if situation.state.connected and now - situation.state.heard_s > timeout_s:
                situation.state = without_link(situation.state)
                self._requests.forget()
                self.modes.end_setpoint_loss()
                self.counts["link_lost"] += 1
            if self._may_act and self.exchange is not None:
                situation.out += self.exchange.tick(now)
            self._read_mission()
        return sent + self._due_requests(now)

    def mission_read(self, read: Done, changes: int) -> None:
        """Take a mission that was read back; if it may have changed meanwhile, only another one.

        Args:
            read: The mission.
            changes: `VehicleState.mission_changes` as the reading began.
        """
        situation = self.situation
        digest = mission_digest(read.items, situation.autopilot)
        other = self.uploaded not in (None, digest)
        if other or situation.state.mission_changes == changes:
            situation.state = replace(situation.state, mission=digest)

    def _read_mission(self) -> None:
        """Read the mission that the vehicle flies for us back whenever it may have changed."""
        situation, exchange = self.situation, self.exchange
        if exchange is not None and exchange.result is None:
            return
        if isinstance(exchange, Download):
            self.exchange = None
            if isinstance(exchange.result, Done):
                self.mission_read(exchange.result, self._changes_read)
        state, order, mode = situation.state, self._outcome.order, situation.autopilot.mission_mode
        # An earlier run of the program may have uploaded it.
        adopted = order is None and state.flying and self.modes.is_ours(mode)
        ours = self._may_act and (self.uploaded or adopted)
        if state.mission or not ours or situation.now < self._read_s:
            return
        self._read_s, self._changes_read = situation.now + _READ_AGAIN_S, state.mission_changes
        self.exchange = Download(
            situation.target, self.source, timeouts=situation.settings.transfer
        )
        situation.out += self.exchange.start(situation.now)

    def _due_requests(self, now: float) -> list[Outgoing]:
        """Return the requests for messages that are due.

        To a vehicle that somebody else has, they go only until it is known which vehicle it is.
        """
        state, waits = self.state, self._steps is not None
        unidentified = state.identity.uid is None
        if not state.connected or state.problem or not (self._may_act or unidentified):
            return []
        if self._requests.has_no_version:
            self.situation.state = without_answer(state)
        return self._requests.due(
            now,
            has_setpoint=self.setpoints.expects_reports,
            unexplained=waits and not (state.ready or state.armed or state.unready),
        )

    def hand_over(self, hold: Order, now: float) -> list[Outgoing]:
        """Have a vehicle that flies to our setpoints hold by itself; returns what to send.

        One that takes off, comes down or flies a mission does that without us, and one that
        somebody else has is left alone.

        Args:
            hold: The order to hold.
            now: Our time in seconds.
        """
        autopilot, outcome, modes = self.situation.autopilot, self._outcome, self.modes
        ours = self._may_act and modes.allowed is not None and self.state.flying
        shown = modes.announced or {self.state.mode}
        if not ours or autopilot.guided_mode not in shown or shown - autopilot.orderly_modes:
            return []
        order = outcome.order if outcome.status == "under_way" else None
        if order is not None and order.finishes_alone and not autopilot.streams_setpoints:
            return []
        self._handing_over = True
        return self.give(hold, now, self._authority)

    def release(self, hold: Order, now: float) -> list[Outgoing]:
        """Drop the order, and leave a vehicle that needs setpoints where it is without them.

        Args:
            hold: The order to hold.
            now: Our time in seconds.

        Returns:
            What to send.
        """
        if self.situation.autopilot.streams_setpoints and self._outcome.order != hold:
            sent = self.hand_over(hold, now)
            if self._handing_over:
                return sent
        return self.give(None, now)

    @property
    def handing_over(self) -> bool:
        """Whether, after `hand_over`, the vehicle does not hold yet."""
        if not (self._handing_over and self._may_act and self._outcome.status == "under_way"):
            return False
        autopilot = self.situation.autopilot
        by_itself = autopilot.resting_mode != autopilot.guided_mode
        return not (self.modes.resting and (by_itself or self.setpoints.confirmed))

    @property
    def _may_act(self) -> bool:
        """Whether the vehicle can receive messages, and nobody else has it."""
        return self.state.connected and not self.state.problem and self.modes.confirmed

    @property
    def _silent(self) -> bool:
        return bool(self.state.mode) and not self.state.connected

    @contextmanager
    def _event(self, now: float) -> Iterator[list[Outgoing]]:
        """Handle an event, then continue the order; the list has what to send afterwards."""
        self.situation.now = now
        out: list[Outgoing] = []
        try:
            yield out
            if self._may_act:
                self._advance()
        except OrderFailedError as error:
            self._end("failed", str(error), final=error.final)
        except TakenOverError as error:
            self._end_taken_over(error.what)
        except Exception as error:
            # Streamed setpoints go on, and keep the vehicle where it is.
            self.counts["errors"] += 1
            log_new(self._defects, f"vehicle {self.situation.target.system}", error)
            self.exchange = None
            if self._outcome.status == "under_way":
                self._end("failed", describe(error))
        sent, self.situation.out[:] = [*self.situation.out], []
        if self._may_act:
            out += sent
        elif self.state.connected and not self.state.problem and self.modes.streams_unconfirmed:
            self.setpoints.send(under_way=self._steps is not None)
            sent, self.situation.out[:] = [*self.situation.out], []
            out += [message for message in sent if isinstance(message, SetPositionTarget)]

    def _advance(self) -> None:
        if self.modes.lacks_setpoints:
            self._restore_setpoints()
            return
        if self._steps is not None:
            try:
                self._wait(next(self._steps))
            except StopIteration:
                self._end("done")
        if self._steps is None and not self.state.flying:
            # Setpoints are for a vehicle in the air: they would lift off one that is armed again.
            self.setpoints.stop()
        self.setpoints.send(under_way=self._steps is not None)

    def _wait(self, reason: str) -> None:
        if reason != self._outcome.reason or self._outcome.status != "under_way":
            self._outcome = replace(self._outcome, status="under_way", reason=reason)

    def _end(self, status: Status, reason: str | None = None, *, final: bool = False) -> None:
        self._steps = self.uploaded = None
        self._outcome = replace(self._outcome, status=status, reason=reason, final=final)
        self.counts[status] += 1

    def _end_taken_over(self, what: str | None) -> None:
        failsafe = what is None and self.state.failsafe is not None
        self.modes.give_up()
        self.situation.state = self._with_setpoint_loss(self.state)
        self._lost_authority = self._authority
        self.exchange = None
        self.setpoints.stop()
        self.situation.out.clear()
        reason = (what or self._elsewhere()) + self.situation.recent_texts()
        self._end("failsafe" if failsafe else "taken_over", reason)

    def _with_setpoint_loss(self, state: VehicleState, *, heartbeat: bool = False) -> VehicleState:
        order = self._outcome.order
        has_order = self._outcome.status in ("under_way", "done", "failed")
        wanted = has_order and order is not None and order.flies_to_setpoints
        return self.modes.with_setpoint_loss(state, wanted=wanted, heartbeat=heartbeat)

    def _restore_setpoints(self) -> None:
        """Send setpoints and command no mode: the autopilot goes back by itself, or it is lost."""
        situation = self.situation
        if self._steps is None and self.setpoints.target is None:
            return
        if self.setpoints.target is None:
            if not situation.state.has_position:
                self._wait("waiting for the vehicle's position")
                return
            state = situation.state
            self.setpoints.fly_to(state.lat_deg, state.lon_deg, state.alt_amsl_m)
        self.modes.await_guided_mode()
        if self._steps is not None:
            situation.restart_stall_timer()
            self._wait(f"setpoints are missing: waiting for {situation.autopilot.guided_mode}")
        self.setpoints.send(under_way=self._steps is not None)

    def _elsewhere(self) -> str:
        state = self.state
        failsafe = f", {state.failsafe.value} failsafe" if state.failsafe else ""
        return f"in {state.mode or 'no known mode'}{failsafe}"


def log_new(defects: Defects, name: str, error: Exception) -> None:
    """Log a defect with its traceback, if it is new.

    Args:
        defects: What is known.
        name: Whose defect it is.
        error: The defect.
    """
    if defects.is_new(error):
        _logger.error("%s: %s", name, describe(error), exc_info=error)
