# SPDX-License-Identifier: Apache-2.0
"""What maneuvers have in hand: the vehicle's state, commands that are repeated, and a set-point."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.mavlink_messages import (
    CommandAck,
    CommandLong,
    MissionSetCurrent,
    Outgoing,
    SetPositionTarget,
)
from dsse_ros.flight.mission_messages import Address
from dsse_ros.flight.modes import mode_parameters
from dsse_ros.flight.paced_setpoint import PacedSetpoint
from dsse_ros.flight.transfer import Exchange, Timeouts
from dsse_ros.flight.upload import Dialect
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
_HOPELESS = frozenset({mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_COMMAND_INT_ONLY})
"""Results that are the same however often a command is sent."""
_DENIED_TRIES = 3
_ACCEPTED_PATIENCE = 3.0
_GROUND_SPEED = float(mavlink.SPEED_TYPE_GROUNDSPEED)
_UNCHANGED = -1.0
_SPEED_TRIES = 5
_PX4_NEEDS_HZ = 2
_COMES_S = 3.0
"""Until a command shows in a heartbeat, even if it was delayed and a heartbeat lost."""
_TARGET_DEG = 1e-5
_TARGET_ALT_M = 1.0
_TARGET_STALE_S = 5.0
_NEARER_M = 0.5
_HOME_GAIN = 0.05
_METRES_PER_DEGREE = 111_195.0
# Words that explain a refusal come just before or after it.
_WORDS_S = 5.0


@dataclass(frozen=True, kw_only=True)
class PilotSettings:
    """How a vehicle is flown; times are ours unless they say otherwise.

    Attributes:
        dialect: Whose autopilot it is.
        arm: Whether it may be armed; if not, a take-off waits until someone else has done it.
        speed_mps: Speed over ground to ask for, 0 for the vehicle's own.
        alt_tolerance_m: Difference in altitude at which the vehicle is there.
        position_hz: How often to ask for positions, in the vehicle's time.
        set_point_hz: How often PX4 is told where to fly; it needs more than 2 in its own time.
        link_timeout_s: Time without a heartbeat after which the vehicle is silent.
        command_s: Time after which a command is sent again that has had no effect.
        command_tries: How often it is sent for one order before that fails.
        stall_s: How long an order may get no nearer to its end.
        transfer: How patient an upload is.

    Raises:
        ValueError: If a value is not allowed.
    """

    dialect: Dialect = "ardupilot"
    arm: bool = False
    speed_mps: float = 0.0
    alt_tolerance_m: float = 3.0
    position_hz: float = 4.0
    set_point_hz: float = 5.0
    link_timeout_s: float = 5.0
    command_s: float = 1.0
    command_tries: int = 15
    stall_s: float = 60.0
    transfer: Timeouts = Timeouts()

    def __post_init__(self) -> None:
        if self.dialect not in ("ardupilot", "px4"):
            raise ValueError(f"dialect: {self.dialect!r} is not allowed; ardupilot or px4")
        if not 0 <= self.speed_mps <= 100:
            raise ValueError(f"speed_mps: {self.speed_mps!r} is not allowed; 0 to 100")
        for name, least, most in (
            ("alt_tolerance_m", 0.1, 1000),
            ("position_hz", 0.5, 50),
            ("set_point_hz", math.nextafter(_PX4_NEEDS_HZ, math.inf), 200),
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


class NotOursError(Exception):
    """The vehicle is in somebody else's hands."""


class Helm:
    """Says what is to be said, again and again until it has an effect.

    Attributes:
        state: What the vehicle says of itself.
        now: Our time.
        out: What to send.
        own_modes: Modes in which the vehicle is ours, None if it never was.
        exchange: Of missions, if there has been one.
        set_point: Where it is told to fly.
    """

    def __init__(self, target: Address, settings: PilotSettings) -> None:
        self.settings = settings
        self.target = target
        self.state = VehicleState()
        self.now = -math.inf
        self.out: list[Outgoing] = []
        self.own_modes: frozenset[str] | None = None
        self.exchange: Exchange | None = None
        self.set_point: SetPositionTarget | None = None
        self._paced: PacedSetpoint | None = None
        self._home_alt_m = math.nan
        self._words: deque[tuple[float, str]] = deque(maxlen=3)
        self._set_point_since_s = 0.0
        self._set_point_due_s = -math.inf
        self._set_point_tries = 0
        self._speed_tries = 0
        self._speed_due_s = -math.inf
        self._command: Outgoing | None = None
        self._asking = ""
        self._command_due_s = -math.inf
        self._command_tries: Counter[str] = Counter()
        self._answers: dict[str, tuple[int, str]] = {}
        self._best: tuple[object, float] = (None, math.inf)
        self._best_since_s = 0.0
        self._streaming_since_s = 0.0
        self._expected: dict[str, float] = {}
        self._arming_until_s = -math.inf

    @property
    def px4(self) -> bool:
        """Whether it is PX4."""
        return self.settings.dialect == "px4"

    @property
    def guided(self) -> str:
        """The mode in which it flies to set-points."""
        return "OFFBOARD" if self.px4 else "GUIDED"

    @property
    def resting(self) -> str:
        """The mode in which it waits for us."""
        return "HOLD" if self.px4 else "GUIDED"

    @property
    def running(self) -> str:
        """The mode in which it flies a mission."""
        return "MISSION" if self.px4 else "AUTO"

    @property
    def handed_over(self) -> frozenset[str]:
        """Modes in which anybody would take it for ours."""
        return frozenset({self.guided, self.resting})

    # Orders

    def begin(self) -> None:
        """Forget what the last order was about."""
        self._command, self._asking = None, ""
        self._command_tries.clear()
        self._answers.clear()
        if not self.px4:
            # PX4 needs a stream of them; others are told of each order's anew.
            self.set_point = None
        self._speed_tries = _SPEED_TRIES if self.settings.speed_mps > 0 else 0
        self._best = (None, math.inf)
        self.be_patient()
        if self.exchange is not None and self.exchange.result is None:
            self.out += self.exchange.cancel(self.now)

    def be_patient(self) -> None:
        """Count a standstill from now on."""
        self._best_since_s = self.now

    def let_go(self) -> None:
        """Say no more of anything."""
        self.own_modes = None
        self._expected.clear()
        self.exchange = None
        self.set_point = None
        self.out.clear()

    # What is heard

    def words(self, text: str) -> None:
        """Take note of what it says in words."""
        self._words.append((self.now, text))

    def said_lately(self) -> str:
        """Return what it has said in words lately, to be put behind a reason."""
        texts = [text for said_s, text in self._words if self.now - said_s <= _WORDS_S]
        return f" ({'; '.join(texts)})" if texts else ""

    def acknowledged(self, ack: CommandAck) -> None:
        """Take note of an answer to a command; it proves nothing."""
        if ack.command == DO_CHANGE_SPEED and ack.result in (_ACCEPTED, *_HOPELESS):
            self._speed_tries = 0
        command = self._command
        if isinstance(command, CommandLong) and command.command == ack.command:
            refusal = ""
            if ack.result in (_ACCEPTED, _IN_PROGRESS):
                # It takes a while until that shows.
                patient_s = self.now + _ACCEPTED_PATIENCE * self.settings.command_s
                self._command_due_s = max(self._command_due_s, patient_s)
            else:
                result = _RESULTS.get(ack.result, f"result {ack.result}")
                refusal = f": {result}{self.said_lately()}"
            self._answers[self._asking] = (ack.result, refusal)

    # Commands

    def ask(self, said: CommandLong | MissionSetCurrent, what: str, *, takes_s: float = 0.0) -> str:
        """Send a command now and then, and return what is being waited for.

        Args:
            said: The command.
            what: What it is for; as long as this is the same, it is the same command.
            takes_s: How long its effect takes at least; again before that, it would begin anew.

        Raises:
            OrderFailedError: If it was sent often enough, or the vehicle does not know it.
        """
        if what != self._asking:
            self._asking = what
            self._command_due_s = self.now
        self._command = said
        result, refusal = self._answers.get(what, (None, ""))
        if result in _HOPELESS:
            raise OrderFailedError(f"{what}{refusal}", final=True)
        if self.now >= self._command_due_s:
            tries = self.settings.command_tries
            if result == mavlink.MAV_RESULT_DENIED:
                tries = min(tries, _DENIED_TRIES)
            if self._command_tries[what] >= tries:
                raise OrderFailedError(f"{what}: no effect, asked {tries} times{refusal}")
            self._command_tries[what] += 1
            self._command_due_s = self.now + max(self.settings.command_s, takes_s)
            self.out.append(said)
            if isinstance(said, CommandLong) and said.command in (ARM_DISARM, MISSION_START):
                self._arming_until_s = self.now + _COMES_S
        return what + refusal

    def command(self, number: int, what: str, *parameters: float, takes_s: float = 0.0) -> str:
        """Send a COMMAND_LONG as `ask` does."""
        return self.ask(CommandLong(self.target, number, *parameters), what, takes_s=takes_s)

    def expect_mode(self, mode: str) -> None:
        """Take note that a command will make it change to a mode."""
        self._expected[mode] = self.now + _COMES_S

    def claim(self, *modes: str) -> None:
        """Have these modes be ours, and those that a command sent just now still brings about."""
        self.own_modes = frozenset(modes) | self.coming

    @property
    def coming(self) -> frozenset[str]:
        """Modes that a command brings about which was sent so lately that they need not show."""
        return frozenset(mode for mode, until_s in self._expected.items() if self.now < until_s)

    @property
    def rests(self) -> bool:
        """Whether it is in the mode in which it waits for us, and is not about to leave it."""
        return self.state.mode == self.resting and not self.coming - {self.resting}

    @property
    def arming(self) -> bool:
        """Whether it was told to arm so lately that it need not have said yet that it has."""
        return self.now < self._arming_until_s

    def set_mode(self, mode: str) -> str:
        """Change the mode as `ask` does; it must be ours, or on the ground."""
        self.expect_mode(mode)
        # A take-off of PX4 ends in HOLD by itself.
        natural = {"HOLD"} if self.state.mode == "TAKEOFF" else set()
        self.claim(self.state.mode, mode, *natural)
        parameters = mode_parameters(mode, self.settings.dialect)
        return self.command(DO_SET_MODE, f"waits for {mode}", *map(float, parameters))

    # Set-points

    def aim(self, lat_deg: float, lon_deg: float, alt_m: float) -> None:
        """Have it fly to a place, and say so until it does."""
        set_point = SetPositionTarget(self.target, lat_deg, lon_deg, float(alt_m))
        if self.set_point is None:
            self._streaming_since_s = self.now
        if set_point != self.set_point:
            self.set_point = set_point
            self._set_point_since_s = self.now
            self._set_point_due_s = self.now
            self._set_point_tries = 0

    @property
    def confirmed(self) -> bool:
        """Whether the vehicle says that it flies to the set-point.

        PX4 says nothing of set-points in OFFBOARD.
        """
        if self.px4:
            return self.state.mode == self.guided
        target, set_point, state = self.state.target, self.set_point, self.state
        if target is None or set_point is None or state.target_s <= self._set_point_since_s:
            return False
        alt_amsl_m = set_point.alt_m + state.alt_amsl_m - state.alt_m
        return (
            self.now - state.target_s < _TARGET_STALE_S
            and abs(target[0] - set_point.lat_deg) < _TARGET_DEG
            and abs(target[1] - set_point.lon_deg) < _TARGET_DEG
            and abs(target[2] - alt_amsl_m) < _TARGET_ALT_M
        )

    def streaming_for(self, seconds: float) -> bool:
        """Whether there have been set-points for that long."""
        return self.set_point is not None and self.now - self._streaming_since_s >= seconds

    @property
    def due_s(self) -> float:
        """When the set-point is to be said again."""
        return self._set_point_due_s if self.set_point is not None else math.inf

    def keep_set_point(self, *, under_way: bool) -> None:
        """Say the set-point again if it is time.

        Args:
            under_way: Whether an order is; PX4 has to be told after it too.

        Raises:
            OrderFailedError: If the vehicle does not take it up.
        """
        if self.set_point is None or self.now < self._set_point_due_s:
            return
        pause_s = 1 / self.settings.set_point_hz if self.px4 else self.settings.command_s
        self._set_point_due_s = self.now + pause_s
        if self.px4:
            self.out.append(self._for_px4(self.set_point))
        elif under_way and self.state.mode == self.guided:
            if self.confirmed:
                self._set_point_tries = 0
                return
            if self._set_point_tries >= self.settings.command_tries:
                fence = ": its own geofence is enabled" if self.state.fenced else ""
                raise OrderFailedError(
                    f"the vehicle does not take up its target{fence}{self.said_lately()}"
                )
            self._set_point_tries += 1
            self.out.append(self.set_point)

    def _for_px4(self, target: SetPositionTarget) -> SetPositionTarget:
        """Return the setpoint by which PX4 flies to a target, at the speed that is asked for.

        Its altitude is above the sea, since PX4 takes that above home with the wrong sign for the
        height of home over the origin of its estimate. It moves its home by a metre up and down in
        the first minutes of a flight, hence the mean.
        """
        state, speed_mps = self.state, self.settings.speed_mps
        if not state.has_position:
            return target
        if speed_mps > 0:
            if state.mode != self.guided:
                # It stays where it is until it is seen to follow.
                self._paced = None
                target = replace(target, lat_deg=state.lat_deg, lon_deg=state.lon_deg)
            else:
                if self._paced is None or self._paced.target != target:
                    self._paced = PacedSetpoint(target, speed_mps, state)
                target = self._paced.advance(state)
        home_m = state.alt_amsl_m - state.alt_m
        if not math.isfinite(self._home_alt_m):
            self._home_alt_m = home_m
        self._home_alt_m += _HOME_GAIN * (home_m - self._home_alt_m)
        return replace(target, alt_m=target.alt_m + self._home_alt_m, above_sea=True)

    def keep_speed(self) -> None:
        """Ask for the speed; what it flies faster or slower than that is no failure."""
        if self._speed_tries > 0 and self.now >= self._speed_due_s and self.state.flying:
            self._speed_tries -= 1
            self._speed_due_s = self.now + self.settings.command_s
            speed = (_GROUND_SPEED, self.settings.speed_mps, _UNCHANGED)
            self.out.append(CommandLong(self.target, DO_CHANGE_SPEED, *speed))

    # Progress

    def distance_m(self, lat_deg: float, lon_deg: float) -> float:
        """Return the horizontal distance to a place, exact enough near to it."""
        north = (lat_deg - self.state.lat_deg) * _METRES_PER_DEGREE
        east = ((lon_deg - self.state.lon_deg + 180) % 360 - 180) * _METRES_PER_DEGREE
        return math.hypot(north, east * math.cos(math.radians(lat_deg)))

    def expect_nearer(self, stage: object, distance: float, *, patience_s: float = 0.0) -> None:
        """Watch that a distance shrinks as long as the stage is the same.

        Raises:
            OrderFailedError: If it has not for too long.
        """
        if stage != self._best[0] or distance < self._best[1] - _NEARER_M:
            self._best = (stage, distance)
            self.be_patient()
        elif self.now - self._best_since_s > self.settings.stall_s + patience_s:
            stalled_s = self.settings.stall_s + patience_s
            raise OrderFailedError(f"no progress for {stalled_s:g} s{self.said_lately()}")
