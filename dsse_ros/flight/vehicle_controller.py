# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Carries out the orders to one vehicle, without a link and a clock: both are its caller's."""

from __future__ import annotations

import logging
import math
import traceback
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, get_args

from dsse_ros.flight.autopilots import PacedSetpoint
from dsse_ros.flight.commands import (
    CommandSender,
    ControllerSettings,
    ModeOwnership,
    OrderFailedError,
    Situation,
    TakenOverError,
)
from dsse_ros.flight.mavlink_messages import (
    CommandAck,
    Heartbeat,
    Incoming,
    Outgoing,
    SetPositionTarget,
    StatusText,
)
from dsse_ros.flight.mission_messages import Address, MissionMessage
from dsse_ros.flight.transfer import Exchange
from dsse_ros.flight.vehicle_state import MessageRequests, VehicleState, observe, without_link

Status = Literal["idle", "under_way", "done", "failed", "taken_over", "silent"]

_MISSION_MESSAGES = get_args(MissionMessage)
_TICK_S = 0.2
_TARGET_DEG = 1e-5
_TARGET_ALT_M = 1.0
_TARGET_STALE_S = 5.0
_HOME_GAIN = 0.05
_logger = logging.getLogger(__name__)


class Order(ABC):
    """What a vehicle can be ordered to do: see `orders`.

    Attributes:
        finishes_alone: Whether an autopilot in its guided mode finishes it without us.
    """

    finishes_alone: ClassVar[bool] = False

    @abstractmethod
    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """Yield what is being waited for, whenever something may have changed, until it is done.

        Raises:
            OrderFailedError: If it cannot be carried out.
            TakenOverError: If somebody else has the vehicle.
        """


@dataclass(frozen=True)
class Outcome:
    """What has become of the latest order.

    Attributes:
        order: The order, None if there was none.
        number: Its number, from 1; 0 if there was none.
        status: `idle` without an order; `done` only by what the vehicle did; `failed`;
            `taken_over` by a pilot or a failsafe, and nothing is sent until an order is given
            while the vehicle is in GUIDED again (PX4: HOLD or OFFBOARD); `silent` while no
            heartbeats come, and nothing is sent, after which an order goes on.
        reason: One line for people: what it is waiting for, or what went wrong.
        final: Whether an order that has failed would fail again.
    """

    order: Order | None = None
    number: int = 0
    status: Status = "idle"
    reason: str = ""
    final: bool = False


class SetpointStreamer:
    """Keeps a vehicle on its way to a place: by a stream of setpoints, or until it confirms one.

    Args:
        situation: Of the vehicle.

    Attributes:
        target: Where it is to fly; None for nowhere.
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._autopilot = situation.autopilot
        self.target: SetPositionTarget | None = None
        self._set_s = 0.0
        self._streaming_since_s = 0.0
        self._due_s = -math.inf
        self._tries = 0
        self._paced: PacedSetpoint | None = None
        self._home_amsl_m = math.nan

    def begin(self) -> None:
        """Forget the target of the last order, unless a stream of setpoints must not end."""
        if not self._autopilot.streams_setpoints:
            self.stop()

    def stop(self) -> None:
        """Send no more setpoints."""
        self.target = None

    def fly_to(self, lat_deg: float, lon_deg: float, alt_m: float) -> None:
        """Have the vehicle fly to a place, at an altitude above home."""
        situation = self._situation
        target = SetPositionTarget(situation.target, lat_deg, lon_deg, float(alt_m))
        if self.target is None:
            self._streaming_since_s = situation.now
        if target != self.target:
            self.target = target
            self._set_s = self._due_s = situation.now
            self._tries = 0

    @property
    def deadline(self) -> float:
        """When the next setpoint is due."""
        return self._due_s if self.target is not None else math.inf

    def streamed_for(self, seconds: float) -> bool:
        """Whether there have been setpoints for that long."""
        return self.target is not None and self._situation.now - self._streaming_since_s >= seconds

    @property
    def confirmed(self) -> bool:
        """Whether the vehicle flies to the target, by its own report if there are such."""
        now, state, target = self._situation.now, self._situation.state, self.target
        if self._autopilot.streams_setpoints:
            return state.mode == self._autopilot.guided_mode
        if state.target is None or target is None or state.target_s <= self._set_s:
            return False
        alt_amsl_m = target.alt_m + state.alt_amsl_m - state.alt_m
        return (
            now - state.target_s < _TARGET_STALE_S
            and abs(state.target[0] - target.lat_deg) < _TARGET_DEG
            and abs(state.target[1] - target.lon_deg) < _TARGET_DEG
            and abs(state.target[2] - alt_amsl_m) < _TARGET_ALT_M
        )

    def send(self, *, under_way: bool) -> None:
        """Send the setpoint if it is due.

        Args:
            under_way: Whether an order is; streamed setpoints go on after it.

        Raises:
            OrderFailedError: If the vehicle does not accept it.
        """
        situation, settings = self._situation, self._situation.settings
        if self.target is None or situation.now < self._due_s:
            return
        if self._autopilot.streams_setpoints:
            self._due_s = situation.now + 1 / settings.setpoint_hz
            situation.out.append(self._streamed(self.target))
            return
        self._due_s = situation.now + settings.command_s
        if not under_way or situation.state.mode != self._autopilot.guided_mode:
            return
        if self.confirmed:
            self._tries = 0
            return
        if self._tries >= settings.command_tries:
            fence = ": its own geofence is enabled" if situation.state.fenced else ""
            raise OrderFailedError(
                f"the vehicle does not accept its target{fence}{situation.recent_texts()}"
            )
        self._tries += 1
        situation.out.append(self.target)

    def _streamed(self, target: SetPositionTarget) -> SetPositionTarget:
        """Return the setpoint that leads to the target, at the speed that is asked for."""
        state, speed_mps = self._situation.state, self._situation.settings.speed_mps
        if not state.has_position:
            return target
        place = (state.lat_deg, state.lon_deg)
        if speed_mps > 0 and self._autopilot.paced_setpoints:
            if state.mode != self._autopilot.guided_mode:
                # It stays where it is until it is seen to follow setpoints.
                self._paced = None
                target = replace(target, lat_deg=state.lat_deg, lon_deg=state.lon_deg)
            else:
                if self._paced is None or self._paced.target != target:
                    self._paced = PacedSetpoint(target, speed_mps, place, state.boot_s)
                target = self._paced.advance(place, state.boot_s)
        if not self._autopilot.setpoints_amsl:
            return target
        # PX4 moves its home by up to a metre in the first minutes of a flight: hence the mean.
        home_m = state.alt_amsl_m - state.alt_m
        if not math.isfinite(self._home_amsl_m):
            self._home_amsl_m = home_m
        self._home_amsl_m += _HOME_GAIN * (home_m - self._home_amsl_m)
        return replace(target, alt_m=target.alt_m + self._home_amsl_m, above_sea=True)


class VehicleController:
    """Flies one vehicle, one order at a time, of which the latest counts.

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
        modes: Whose mode the vehicle is in.
        exchange: The latest transfer of a mission, None if there was none.
        source: Ourselves.

    Raises:
        ValueError: If the target is everybody.
    """

    def __init__(self, target: Address, source: Address, settings: ControllerSettings) -> None:
        if not 1 <= target.system <= 255:
            raise ValueError(f"target: system {target.system!r} is not allowed; 1 to 255")
        self.counts: Counter[str] = Counter()
        self.source = source
        self.situation = Situation(target, settings)
        self.commands = CommandSender(self.situation)
        self.setpoints = SetpointStreamer(self.situation)
        self.modes = ModeOwnership(self.situation, self.commands, self.counts)
        self.exchange: Exchange | None = None
        self._requests = MessageRequests(target, self.situation.autopilot, settings.position_hz)
        self._steps: Iterator[str] | None = None
        self._outcome = Outcome()
        self._defects = Defects(f"vehicle {target.system}")
        self._due_s = -math.inf
        self._handing_over = False

    @property
    def state(self) -> VehicleState:
        """What the vehicle reports."""
        return self.situation.state

    @property
    def outcome(self) -> Outcome:
        """What has become of the latest order."""
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

    def give(self, order: Order, now: float) -> list[Outgoing]:
        """Take an order in place of any other; returns what to send."""
        self._outcome = Outcome(order, self._outcome.number + 1, "under_way", "given")
        self._steps = None
        return self._guarded(now, lambda: self._begin(order))

    def _begin(self, order: Order) -> None:
        if not self.modes.reclaim():
            self._outcome = replace(self._outcome, status="taken_over", reason=self._elsewhere())
            return
        self.commands.begin()
        self.setpoints.begin()
        self.situation.begin_progress()
        if self.exchange is not None and self.exchange.result is None:
            self.situation.out += self.exchange.cancel(self.situation.now)
        self._steps = order.carry_out(self)

    def receive(self, message: Incoming, now: float) -> list[Outgoing]:
        """Take a message of the vehicle; returns what to send."""
        return self._guarded(now, lambda: self._receive(message, now))

    def _receive(self, message: Incoming, now: float) -> None:
        situation, before, was_silent = self.situation, self.state, self._silent
        state = observe(before, message, now, situation.autopilot)
        situation.state = self._with_setpoint_loss(state)
        self._requests.receive(message, now)
        match message:
            case Heartbeat():
                if was_silent:
                    self.counts["link_found"] += 1
                    situation.excuse_standstill()
                self.modes.watch(before)
            case StatusText(_, text):
                situation.note_text(text)
            case CommandAck(_, _, system, component):
                if system in (0, self.source.system) and component in (0, self.source.component):
                    self.commands.acknowledged(message)
            case message if isinstance(message, _MISSION_MESSAGES) and self.exchange is not None:
                situation.out += self.exchange.receive(message, situation.target, now)

    def tick(self, now: float) -> list[Outgoing]:
        """Let time pass; returns what to send."""
        self._due_s = now + _TICK_S
        return self._guarded(now, lambda: self._tick(now))

    def _tick(self, now: float) -> None:
        situation = self.situation
        timeout_s = situation.settings.link_timeout_s
        if situation.state.connected and now - situation.state.heard_s > timeout_s:
            situation.state = without_link(situation.state)
            self.modes.end_setpoint_loss()
            self.counts["link_lost"] += 1
        if self._may_act:
            if self.exchange is not None:
                situation.out += self.exchange.tick(now)
            has_setpoint = self.setpoints.target is not None
            situation.out += self._requests.due(now, has_setpoint=has_setpoint)

    def hand_over(self, hold: Order, now: float) -> list[Outgoing]:
        """Have a vehicle that flies to our setpoints hold by itself; returns what to send.

        One that takes off, comes down or flies a mission does that without us, and one that
        somebody else has is left alone.

        Args:
            hold: The order to hold.
            now: Our time in seconds.
        """
        autopilot, outcome, modes = self.situation.autopilot, self._outcome, self.modes
        ours = self._may_act and modes.own is not None and self.state.flying
        shown = modes.expected or {self.state.mode}
        if not ours or autopilot.guided_mode not in shown or shown - autopilot.orderly_modes:
            return []
        order = outcome.order if outcome.status == "under_way" else None
        if order is not None and order.finishes_alone and not autopilot.streams_setpoints:
            return []
        self._handing_over = True
        return self.give(hold, now)

    @property
    def handing_over(self) -> bool:
        """Whether it is still to be seen that the vehicle holds, after `hand_over`."""
        if not (self._handing_over and self._may_act and self._outcome.status == "under_way"):
            return False
        streams = self.situation.autopilot.streams_setpoints
        return not (self.modes.resting and (streams or self.setpoints.confirmed))

    @property
    def _may_act(self) -> bool:
        """Whether the vehicle can receive messages, and nobody else has it."""
        return self.state.connected and not self.modes.taken_over and not self.modes.doubtful

    @property
    def _silent(self) -> bool:
        return bool(self.state.mode) and not self.state.connected

    def _guarded(self, now: float, happen: Callable[[], None]) -> list[Outgoing]:
        """Let something happen, go on with the order, and return what is to be sent."""
        self.situation.now = now
        try:
            happen()
            if self._may_act:
                self._advance()
        except OrderFailedError as error:
            self._end("failed", str(error), final=error.final)
        except TakenOverError:
            self._end_taken_over()
        except Exception as error:
            # Streamed setpoints go on, and keep the vehicle where it is.
            self.counts["errors"] += 1
            self._defects.log(error)
            self.exchange = None
            if self._outcome.status == "under_way":
                self._end("failed", describe(error))
        sent, self.situation.out[:] = [*self.situation.out], []
        return sent if self._may_act else []

    def _advance(self) -> None:
        if self.modes.lacks_setpoints:
            self._restore_setpoints()
            return
        if self._steps is not None:
            try:
                self._wait(next(self._steps))
            except StopIteration:
                self._end("done", "")
        self.setpoints.send(under_way=self._steps is not None)

    def _wait(self, reason: str) -> None:
        if reason != self._outcome.reason or self._outcome.status != "under_way":
            self._outcome = replace(self._outcome, status="under_way", reason=reason)

    def _end(self, status: Status, reason: str, *, final: bool = False) -> None:
        self._steps = None
        self._outcome = replace(self._outcome, status=status, reason=reason, final=final)
        self.counts[status] += 1

    def _end_taken_over(self) -> None:
        self.modes.release()
        self.exchange = None
        self.setpoints.stop()
        self.situation.out.clear()
        self.situation.state = self._with_setpoint_loss(self.state)
        self._end("taken_over", self._elsewhere() + self.situation.recent_texts())

    def _with_setpoint_loss(self, state: VehicleState) -> VehicleState:
        has_setpoint = self.setpoints.target is not None
        return self.modes.with_setpoint_loss(state, has_setpoint=has_setpoint)

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
            self.setpoints.fly_to(state.lat_deg, state.lon_deg, state.alt_m)
        self.modes.await_guided_mode()
        if self._steps is not None:
            situation.excuse_standstill()
            self._wait(f"setpoints are missing: waiting for {situation.autopilot.guided_mode}")
        self.setpoints.send(under_way=self._steps is not None)

    def _elsewhere(self) -> str:
        state = self.state
        failsafe = f", {state.failsafe} failsafe" if state.failsafe else ""
        return f"in {state.mode or 'no known mode'}{failsafe}"


class Defects:
    """Unexpected exceptions in one part of the program: each kind is logged once.

    Args:
        name: Whose defects they are, for the log.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._logged: set[tuple[type, str, int | None]] = set()

    def log(self, error: Exception) -> None:
        """Log an exception if it is new."""
        if self.is_new(error):
            _logger.error("%s: %s", self._name, describe(error), exc_info=error)

    def is_new(self, error: Exception) -> bool:
        """Return whether no exception of its type has come from the same line before."""
        frames = traceback.extract_tb(error.__traceback__)
        file, line = (frames[-1].filename, frames[-1].lineno) if frames else ("", 0)
        kind = (type(error), file, line)
        new = kind not in self._logged
        self._logged.add(kind)
        return new


def describe(error: Exception) -> str:
    """Return type and text of an exception."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
