# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands to a vehicle, repeated until their effect is seen.

An acknowledgement proves nothing: an autopilot may acknowledge a command and forget it, and it
forgets all commands when it restarts.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots import AUTOPILOTS, Autopilot
from dsse_ros.vehicles.control.transfer import Timeouts
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    CommandAck,
    CommandLong,
    MissionSetCurrent,
    Outgoing,
    command_long,
    enum_name,
)

DO_SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
DO_CHANGE_SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
MISSION_START = mavlink.MAV_CMD_MISSION_START

_ACCEPTED, _IN_PROGRESS = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS
ACCEPTED = frozenset({_ACCEPTED, _IN_PROGRESS})
"""Results of a command that is carried out."""
_FINAL_RESULTS = frozenset({mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_COMMAND_INT_ONLY})
"""Results that are the same however often a command is sent."""
_DENIED_TRIES = 3
OVERTAKEN_S = 1.5
"""How much later a heartbeat may arrive than a reply that was sent after it."""
_ACCEPTED_PATIENCE = 3.0
_AIRSPEED = float(mavlink.SPEED_TYPE_AIRSPEED)
_GROUND_SPEED = float(mavlink.SPEED_TYPE_GROUNDSPEED)
_THROTTLE_UNCHANGED = -1.0
_SPEED_TRIES = 5
_DISARM_DELAY_S = 10.0
"""Vehicle time after which one that does not take off disarms itself, if it has not reported it."""
_SEEN_S = 2.0
"""How much shorter that time may seem: both its ends are seen at 1 Hz."""
EFFECT_S = 3.0
"""Time until a heartbeat shows a command, even if it was delayed and a heartbeat was lost."""
_TEXTS_S = 5.0
"""Time before or after a refusal in which status texts explain it."""
_PROGRESS_M = 0.5


@dataclass(frozen=True, kw_only=True)
class ControllerSettings:
    """How a vehicle is flown; times are our wall time unless stated otherwise.

    Values are checked where a person gives them: see `BridgeSettings`.

    Attributes:
        autopilot: Name of its autopilot in `AUTOPILOTS`.
        speed_mps: Ground speed to request, of a fixed wing airspeed; 0 for the vehicle's own.
        alt_tolerance_m: Difference in altitude at which a vehicle that can hover has arrived.
        recovery_alt_m: Altitude above home below which a vehicle that has left its guided mode for
            lack of setpoints is left to land.
        position_hz: Rate of positions to request, in the vehicle's time.
        setpoint_hz: Rate of setpoints, where they are streamed.
        link_timeout_s: Time without a heartbeat after which the vehicle is silent.
        command_s: Time after which a command without an effect is sent again.
        command_tries: How often a command is sent before its order fails.
        stall_s: How long an order may make no progress.
        transfer: Time-outs of a mission upload.
    """

    autopilot: str = "ardupilot"
    speed_mps: float = 0.0
    alt_tolerance_m: float = 3.0
    recovery_alt_m: float = 10.0
    position_hz: float = 4.0
    setpoint_hz: float = 5.0
    link_timeout_s: float = 5.0
    command_s: float = 1.0
    command_tries: int = 15
    stall_s: float = 60.0
    transfer: Timeouts = Timeouts()


CHANGED_MISSION = "its mission was changed"
"""What somebody else has done with a vehicle whose mission is not ours."""


class OrderFailedError(Exception):
    """An order cannot be carried out.

    Args:
        reason: One line for people.
        final: Whether the same order would fail again.
    """

    def __init__(self, reason: str, *, final: bool = False) -> None:
        super().__init__(reason)
        self.final = final


class TakenOverError(Exception):
    """Another person, or a failsafe, controls the vehicle.

    Args:
        what: The sign of it; None for a mode that we have not set.
    """

    def __init__(self, what: str | None = None) -> None:
        super().__init__(what)
        self.what = what


@dataclass
class Situation:
    """State that the parts of a controller share.

    Attributes:
        target: The vehicle's autopilot.
        settings: How it is flown.
        state: What the vehicle reports.
        now: Our time in seconds.
        out: Messages to send.
        take_off_amsl_m: Altitude above mean sea level at which its last take-off ends; NaN if there
            was none.
    """

    target: Address
    settings: ControllerSettings
    state: VehicleState = field(default_factory=VehicleState)
    now: float = -math.inf
    out: list[Outgoing] = field(default_factory=list)
    take_off_amsl_m: float = math.nan
    _texts: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=3))
    _best: tuple[object, float] = (None, math.inf)
    _best_since_s: float = 0.0

    @property
    def autopilot(self) -> Autopilot:
        """Which autopilot the vehicle has."""
        return AUTOPILOTS[self.settings.autopilot]

    @property
    def alt_tolerance_m(self) -> float:
        """Difference in altitude at which the vehicle has arrived."""
        return max(self.settings.alt_tolerance_m, self.autopilot.alt_error_m)

    def note_text(self, text: str) -> None:
        """Take note of a status text."""
        # ArduPilot says of every item that its mission was changed.
        if self._texts and self._texts[-1][1] == text:
            self._texts.pop()
        self._texts.append((self.now, text))

    def recent_texts(self) -> str:
        """Return the latest status texts in brackets, to append to a reason."""
        texts = [text for time_s, text in self._texts if self.now - time_s <= _TEXTS_S]
        return f" ({'; '.join(dict.fromkeys(texts))})" if texts else ""

    def begin_progress(self) -> None:
        """Begin to watch the progress of an order."""
        self._best = (None, math.inf)
        self.restart_stall_timer()

    def restart_stall_timer(self) -> None:
        """Count the time without progress from now on."""
        self._best_since_s = self.now

    def expect_progress(self, stage: object, distance: float, *, patience_s: float = 0.0) -> None:
        """Check that a distance shrinks while the stage stays the same.

        Raises:
            OrderFailedError: If it has not shrunk for too long.
        """
        if stage != self._best[0] or distance < self._best[1] - _PROGRESS_M:
            self._best = (stage, distance)
            self.restart_stall_timer()
        elif self.now - self._best_since_s > self.settings.stall_s + patience_s:
            stalled_s = self.settings.stall_s + patience_s
            raise OrderFailedError(f"no progress for {stalled_s:g} s{self.recent_texts()}")


class CommandSender:
    """Repeats commands until they have an effect.

    Args:
        situation: The situation of the vehicle.

    Attributes:
        arms: Whether our command has armed the vehicle, if it is armed.
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._command: CommandLong | MissionSetCurrent | None = None
        self._purpose = ""
        self._due_s = -math.inf
        self._tries: Counter[str] = Counter()
        self._answers: dict[str, tuple[int, str]] = {}
        self._effect_s = -math.inf
        self._speed_tries = 0
        self._speed_due_s = -math.inf
        self._arming_until_s = -math.inf
        self._was_armed = False
        self._heartbeats_since_arming: int | None = None
        self._armed_s = -math.inf
        self._armed_boot_s = math.nan
        self.arms = False

    def begin(self) -> None:
        """Forget the commands of the last order."""
        self._was_armed = False
        self._heartbeats_since_arming = None
        self._command, self._purpose = None, ""
        self._tries.clear()
        self._answers.clear()
        self._speed_tries = _SPEED_TRIES if self._situation.settings.speed_mps > 0 else 0

    def acknowledged(self, ack: CommandAck) -> None:
        """Handle a COMMAND_ACK, which may explain why there is no effect."""
        situation = self._situation
        if ack.command == DO_CHANGE_SPEED and ack.result in (_ACCEPTED, *_FINAL_RESULTS):
            self._speed_tries = 0
        command = self._command
        if isinstance(command, CommandLong) and command.command == ack.command:
            refusal = ""
            self._due_s = max(self._due_s, self._effect_s)
            if ack.command == ARM_DISARM:
                self.arms = ack.result in (_ACCEPTED, _IN_PROGRESS)
                if ack.result == _ACCEPTED:
                    self._heartbeats_since_arming = 0
                    self._armed_s = situation.now
            if ack.result in (_ACCEPTED, _IN_PROGRESS):
                # The effect takes a while to show.
                patient_s = situation.now + _ACCEPTED_PATIENCE * situation.settings.command_s
                self._due_s = max(self._due_s, patient_s)
            else:
                result = enum_name("MAV_RESULT", ack.result)
                refusal = f": {result}{situation.recent_texts()}"
            self._answers[self._purpose] = (ack.result, refusal)

    def send(
        self, command: CommandLong | MissionSetCurrent, purpose: str, *, takes_s: float = 0.0
    ) -> str:
        """Send a command if it is due, and return what it is waiting for.

        Args:
            command: The command.
            purpose: What it is for; the same purpose means the same command.
            takes_s: How long its effect takes at least; sent before that, it would start again. If
                it is not answered, it is sent again after half of that.

        Raises:
            OrderFailedError: If all tries are used, or the vehicle does not support it.
        """
        situation, settings = self._situation, self._situation.settings
        if purpose != self._purpose:
            self._purpose = purpose
            self._due_s = situation.now
        self._command = command
        result, refusal = self._answers.get(purpose, (None, ""))
        if result in _FINAL_RESULTS:
            raise OrderFailedError(f"{purpose}{refusal}", final=True)
        if situation.now >= self._due_s:
            tries = settings.command_tries
            if result == mavlink.MAV_RESULT_DENIED:
                tries = min(tries, _DENIED_TRIES)
            if self._tries[purpose] >= tries:
                raise OrderFailedError(f"{purpose}: no effect after {tries} tries{refusal}")
            self._tries[purpose] += 1
            # If no answer comes, it or the answer was lost: a vehicle that waits on the ground for
            # its take-off disarms itself after 10 s.
            self._due_s = situation.now + max(settings.command_s, takes_s / 2)
            self._effect_s = situation.now + takes_s
            situation.out.append(command)
            if isinstance(command, CommandLong) and command.command in (ARM_DISARM, MISSION_START):
                self.arms = True
                self._arming_until_s = situation.now + EFFECT_S
        return purpose + refusal

    def send_long(self, number: int, purpose: str, *parameters: float, takes_s: float = 0.0) -> str:
        """Send a COMMAND_LONG as `send` does."""
        command = command_long(self._situation.target, number, *parameters)
        return self.send(command, purpose, takes_s=takes_s)

    def watch_arming(self) -> None:
        """Handle a heartbeat, which shows whether the vehicle is armed."""
        state = self._situation.state
        if state.armed:
            if not self._was_armed:
                self._armed_boot_s = state.boot_s
            self._was_armed = True
            return
        if self._was_armed:
            self.arms = False
        if self._heartbeats_since_arming is not None:
            late = self._situation.now - self._armed_s > OVERTAKEN_S
            self._heartbeats_since_arming += 2 if late else 1

    @property
    def disarmed_again(self) -> bool:
        """Whether it was armed during this order and no longer is.

        After it has accepted the command to arm, two heartbeats without the flag show that, or one
        that cannot be from before.
        """
        if self._situation.state.armed:
            return False
        return self._was_armed or (self._heartbeats_since_arming or 0) >= 2

    @property
    def disarmed_itself(self) -> bool:
        """Whether it stood armed so long that it has disarmed itself."""
        state = self._situation.state
        delay_s = _DISARM_DELAY_S if math.isnan(state.disarm_delay_s) else state.disarm_delay_s
        stood_s = state.boot_s - self._armed_boot_s
        return self.disarmed_again and 0.0 < delay_s <= stood_s + _SEEN_S

    @property
    def arming(self) -> bool:
        """Whether it was commanded to arm so recently that its heartbeat may not show it yet."""
        return self._situation.now < self._arming_until_s

    def request_speed(self) -> None:
        """Request the speed; a vehicle that flies at another one has not failed."""
        situation = self._situation
        due = self._speed_tries > 0 and situation.now >= self._speed_due_s
        if due and situation.state.flying:
            self._speed_tries -= 1
            self._speed_due_s = situation.now + situation.settings.command_s
            kind = _AIRSPEED if situation.autopilot.circles else _GROUND_SPEED
            speed = (kind, situation.settings.speed_mps, _THROTTLE_UNCHANGED)
            situation.out.append(command_long(situation.target, DO_CHANGE_SPEED, *speed))
