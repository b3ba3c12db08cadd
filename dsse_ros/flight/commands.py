# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands to a vehicle, sent again until their effect is seen, and the modes they bring about.

An acknowledgement proves nothing: an autopilot may acknowledge a command and forget it, and loses
all of them when it restarts.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, field, replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.autopilots import AUTOPILOTS, Autopilot
from dsse_ros.flight.mavlink_messages import (
    CommandAck,
    CommandLong,
    MissionSetCurrent,
    Outgoing,
)
from dsse_ros.flight.mission_messages import Address
from dsse_ros.flight.transfer import Timeouts
from dsse_ros.flight.vehicle_state import VehicleState

DO_SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
DO_CHANGE_SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
MISSION_START = mavlink.MAV_CMD_MISSION_START

_RESULTS = {
    number: entry.name.removeprefix("MAV_RESULT_")
    for number, entry in mavlink.enums["MAV_RESULT"].items()
}
_ACCEPTED, _IN_PROGRESS = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS
_FINAL_RESULTS = frozenset({mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_COMMAND_INT_ONLY})
"""Results that are the same however often a command is sent."""
_DENIED_TRIES = 3
_ACCEPTED_PATIENCE = 3.0
_GROUND_SPEED = float(mavlink.SPEED_TYPE_GROUNDSPEED)
_THROTTLE_UNCHANGED = -1.0
_SPEED_TRIES = 5
_EFFECT_S = 3.0
"""Until a command shows in a heartbeat, even if it was delayed and a heartbeat lost."""
_TEXTS_S = 5.0
"""Status texts that explain a refusal come that shortly before or after it."""
_PROGRESS_M = 0.5
_MODE_RESTORED_S = 5.0
"""How long an autopilot may take to go back to its guided mode once it gets setpoints again."""


@dataclass(frozen=True, kw_only=True)
class ControllerSettings:
    """How a vehicle is flown; times are our wall time unless stated otherwise.

    Attributes:
        autopilot: Which autopilot it has, by its name in `AUTOPILOTS`.
        arm: Whether it may be armed; if not, a take-off waits until someone else has done it.
        speed_mps: Speed over ground to ask for, 0 for the vehicle's own.
        alt_tolerance_m: Difference in altitude at which the vehicle is there.
        position_hz: How often to ask for positions, in the vehicle's time.
        setpoint_hz: Rate of setpoints, where they are streamed.
        link_timeout_s: Time without a heartbeat after which the vehicle is silent.
        command_s: Time after which a command is sent again that has had no effect.
        command_tries: How often it is sent for one order before that fails.
        stall_s: How long an order may make no progress.
        transfer: Time-outs of a mission upload.

    Raises:
        ValueError: If a value is not allowed.
    """

    autopilot: str = "ardupilot"
    arm: bool = False
    speed_mps: float = 0.0
    alt_tolerance_m: float = 3.0
    position_hz: float = 4.0
    setpoint_hz: float = 5.0
    link_timeout_s: float = 5.0
    command_s: float = 1.0
    command_tries: int = 15
    stall_s: float = 60.0
    transfer: Timeouts = Timeouts()

    def __post_init__(self) -> None:
        if self.autopilot not in AUTOPILOTS:
            names = " or ".join(AUTOPILOTS)
            raise ValueError(f"autopilot: {self.autopilot!r} is not allowed; {names}")
        if not 0 <= self.speed_mps <= 100:
            raise ValueError(f"speed_mps: {self.speed_mps!r} is not allowed; 0 to 100")
        needed_hz = max(one.setpoint_rate_hz for one in AUTOPILOTS.values())
        for name, least, most in (
            ("alt_tolerance_m", 0.1, 1000),
            ("position_hz", 0.5, 50),
            ("setpoint_hz", math.nextafter(needed_hz, math.inf), 200),
            ("link_timeout_s", 0.1, 3600),
            ("command_s", 0.01, 3600),
            ("command_tries", 1, 1000),
            ("stall_s", 0.1, 1e6),
        ):
            value = getattr(self, name)
            if not least <= value <= most:
                raise ValueError(f"{name}: {value!r} is not allowed; {least:g} to {most:g}")


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
    """The vehicle is in a mode that we have not set."""


@dataclass
class Situation:
    """What the parts of a controller share.

    Attributes:
        target: The vehicle's autopilot.
        settings: How it is flown.
        state: What the vehicle reports.
        now: Our time in seconds.
        out: Messages to send.
    """

    target: Address
    settings: ControllerSettings
    state: VehicleState = field(default_factory=VehicleState)
    now: float = -math.inf
    out: list[Outgoing] = field(default_factory=list)
    _texts: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=3))
    _best: tuple[object, float] = (None, math.inf)
    _best_since_s: float = 0.0

    @property
    def autopilot(self) -> Autopilot:
        """Which autopilot the vehicle has."""
        return AUTOPILOTS[self.settings.autopilot]

    def note_text(self, text: str) -> None:
        """Take note of a status text."""
        self._texts.append((self.now, text))

    def recent_texts(self) -> str:
        """Return the latest status texts in brackets, to be put behind a reason."""
        texts = [text for time_s, text in self._texts if self.now - time_s <= _TEXTS_S]
        return f" ({'; '.join(texts)})" if texts else ""

    def begin_progress(self) -> None:
        """Watch the progress of another order."""
        self._best = (None, math.inf)
        self.excuse_standstill()

    def excuse_standstill(self) -> None:
        """Count a standstill from now on."""
        self._best_since_s = self.now

    def expect_progress(self, stage: object, distance: float, *, patience_s: float = 0.0) -> None:
        """Watch that a distance shrinks as long as the stage is the same.

        Raises:
            OrderFailedError: If it has not for too long.
        """
        if stage != self._best[0] or distance < self._best[1] - _PROGRESS_M:
            self._best = (stage, distance)
            self.excuse_standstill()
        elif self.now - self._best_since_s > self.settings.stall_s + patience_s:
            stalled_s = self.settings.stall_s + patience_s
            raise OrderFailedError(f"no progress for {stalled_s:g} s{self.recent_texts()}")


class CommandSender:
    """Sends commands again and again until they have an effect.

    Args:
        situation: Of the vehicle.
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._command: CommandLong | MissionSetCurrent | None = None
        self._purpose = ""
        self._due_s = -math.inf
        self._tries: Counter[str] = Counter()
        self._answers: dict[str, tuple[int, str]] = {}
        self._speed_tries = 0
        self._speed_due_s = -math.inf
        self._arming_until_s = -math.inf

    def begin(self) -> None:
        """Forget the commands of the last order."""
        self._command, self._purpose = None, ""
        self._tries.clear()
        self._answers.clear()
        self._speed_tries = _SPEED_TRIES if self._situation.settings.speed_mps > 0 else 0

    def acknowledged(self, ack: CommandAck) -> None:
        """Take a COMMAND_ACK: it may explain why there is no effect."""
        situation = self._situation
        if ack.command == DO_CHANGE_SPEED and ack.result in (_ACCEPTED, *_FINAL_RESULTS):
            self._speed_tries = 0
        command = self._command
        if isinstance(command, CommandLong) and command.command == ack.command:
            refusal = ""
            if ack.result in (_ACCEPTED, _IN_PROGRESS):
                # It takes a while until that shows.
                patient_s = situation.now + _ACCEPTED_PATIENCE * situation.settings.command_s
                self._due_s = max(self._due_s, patient_s)
            else:
                result = _RESULTS.get(ack.result, f"result {ack.result}")
                refusal = f": {result}{situation.recent_texts()}"
            self._answers[self._purpose] = (ack.result, refusal)

    def send(
        self, command: CommandLong | MissionSetCurrent, purpose: str, *, takes_s: float = 0.0
    ) -> str:
        """Send a command if it is time, and return what is being waited for.

        Args:
            command: The command.
            purpose: What it is for; as long as this is the same, it is the same command.
            takes_s: How long its effect takes at least; sent before that, it would start again.

        Raises:
            OrderFailedError: If it was sent often enough, or the vehicle does not know it.
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
            self._due_s = situation.now + max(settings.command_s, takes_s)
            situation.out.append(command)
            if isinstance(command, CommandLong) and command.command in (ARM_DISARM, MISSION_START):
                self._arming_until_s = situation.now + _EFFECT_S
        return purpose + refusal

    def send_long(self, number: int, purpose: str, *parameters: float, takes_s: float = 0.0) -> str:
        """Send a COMMAND_LONG as `send` does."""
        command = CommandLong(self._situation.target, number, *parameters)
        return self.send(command, purpose, takes_s=takes_s)

    @property
    def arming(self) -> bool:
        """Whether it was commanded to arm so lately that its heartbeat need not show it yet."""
        return self._situation.now < self._arming_until_s

    def request_speed(self) -> None:
        """Ask for the speed; that a vehicle flies faster or slower is no failure."""
        situation = self._situation
        due = self._speed_tries > 0 and situation.now >= self._speed_due_s
        if due and situation.state.flying:
            self._speed_tries -= 1
            self._speed_due_s = situation.now + situation.settings.command_s
            speed = (_GROUND_SPEED, situation.settings.speed_mps, _THROTTLE_UNCHANGED)
            situation.out.append(CommandLong(situation.target, DO_CHANGE_SPEED, *speed))


class ModeOwnership:
    """Whether a vehicle is in a mode that we have brought about, or somebody else has taken it.

    Args:
        situation: Of the vehicle.
        commands: What sets modes.
        counts: Where events are counted by a short key.

    Attributes:
        own: Modes in which the vehicle is ours, None if it never was.
        taken_over: Whether somebody else has it; nothing is sent then.
        doubtful: Whether the last heartbeat was in another mode: one may have overtaken another.
    """

    def __init__(self, situation: Situation, commands: CommandSender, counts: Counter[str]) -> None:
        self._situation = situation
        self._commands = commands
        self._counts = counts
        self.own: frozenset[str] | None = None
        self.taken_over = False
        self.doubtful = False
        self._expected: dict[str, float] = {}
        self._setpoint_loss_until_s: float | None = None
        self._disarmed_s = -math.inf

    @property
    def _mode(self) -> str:
        return self._situation.state.mode

    # What we bring about

    def expect(self, mode: str) -> None:
        """Take note that a command will make it change to a mode."""
        self._expected[mode] = self._situation.now + _EFFECT_S

    @property
    def expected(self) -> frozenset[str]:
        """Modes that a command brings about which was sent so lately that they need not show."""
        now = self._situation.now
        return frozenset(mode for mode, until_s in self._expected.items() if now < until_s)

    def claim(self, *modes: str) -> None:
        """Have these modes be ours, and those that a command sent just now still brings about."""
        self.own = frozenset(modes) | self.expected

    def require(self) -> None:
        """Raise a `TakenOverError` if somebody else has set the mode."""
        if self._mode not in (self.own or self._situation.autopilot.orderly_modes):
            raise TakenOverError(self._mode)

    def change(self, mode: str) -> str:
        """Change the mode as `CommandSender.send` does; it must be ours, or on the ground."""
        autopilot = self._situation.autopilot
        self.expect(mode)
        # A take-off ends in the resting mode by itself.
        climbing = bool(self._mode) and self._mode == autopilot.take_off_mode
        self.claim(self._mode, mode, *({autopilot.resting_mode} if climbing else ()))
        parameters = autopilot.mode_parameters(mode)
        return self._commands.send_long(DO_SET_MODE, f"waiting for {mode}", *parameters)

    @property
    def resting(self) -> bool:
        """Whether it is in the resting mode, and is not about to leave it."""
        resting_mode = self._situation.autopilot.resting_mode
        return self._mode == resting_mode and not self.expected - {resting_mode}

    # What we see

    def reclaim(self) -> bool:
        """Return whether the vehicle may be given orders, again if it was taken over."""
        state = self._situation.state
        if self.taken_over:
            if not (state.connected and self._mode in self._situation.autopilot.orderly_modes):
                return False
            self.taken_over = self.doubtful = False
        return True

    def release(self) -> None:
        """Leave the vehicle to those who have set its mode."""
        self.taken_over = True
        self.own = None
        self._expected.clear()
        self.end_setpoint_loss()

    def watch(self, before: VehicleState) -> None:
        """Take a heartbeat: is the mode another than what we and the autopilot have made it?

        Raises:
            TakenOverError: If it is, in two of them.
        """
        situation, autopilot = self._situation, self._situation.autopilot
        state, mode = situation.state, self._mode
        if self.lacks_setpoints:
            self.doubtful = False
            return
        if self._setpoint_loss_until_s is not None and mode == autopilot.guided_mode:
            self._counts["offboard_lost"] += 1
        self.end_setpoint_loss()
        if before.armed and not state.armed:
            self._disarmed_s = situation.now
        if self.taken_over or self.own is None or mode in self.own:
            self.doubtful = False
            return
        just_disarmed = situation.now - self._disarmed_s < autopilot.disarming_s
        if not state.armed and (just_disarmed or mode in autopilot.disarmed_modes):
            self.own |= {mode}
            return
        if self.doubtful:
            raise TakenOverError(mode)
        self.doubtful = True

    # Loss of setpoints

    def with_setpoint_loss(self, state: VehicleState, *, has_setpoint: bool) -> VehicleState:
        """Return the state with the failsafe `offboard` where it may be missing setpoints.

        PX4 does not report that in a message that pymavlink knows. It has left OFFBOARD, or
        whatever it was in before we connected, is critical, and reports no reason: so it has missed
        ours, because we were late, they were lost or we have been restarted. To send them is
        harmless, as in any other mode they have no effect.
        """
        if state.failsafe not in ("critical", "offboard"):
            return state
        wanted = self.own is None or has_setpoint
        elsewhere = state.mode not in (self.own or ())
        missed = (
            not self.taken_over
            and state.flying
            and state.mode in self._situation.autopilot.setpoint_loss_modes
            and ((wanted and elsewhere) or self.lacks_setpoints)
        )
        return replace(state, failsafe="offboard" if missed else "critical")

    @property
    def lacks_setpoints(self) -> bool:
        """Whether it has left the guided mode for lack of setpoints."""
        return self._situation.state.failsafe == "offboard"

    def await_guided_mode(self) -> None:
        """Wait until the autopilot goes back to its guided mode by itself, as setpoints come.

        Raises:
            TakenOverError: If it has not for too long.
        """
        now = self._situation.now
        if self._setpoint_loss_until_s is None:
            self._setpoint_loss_until_s = now + _MODE_RESTORED_S
            if self.own is not None:
                self.own |= {self._situation.autopilot.guided_mode}
        if now > self._setpoint_loss_until_s:
            raise TakenOverError(self._mode)

    def end_setpoint_loss(self) -> None:
        """Take note that setpoints are not missing, or that this cannot be known."""
        self._setpoint_loss_until_s = None
