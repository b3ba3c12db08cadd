# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Setpoints that lead a vehicle to a place: streamed, or sent until the vehicle confirms them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

from dsse_ros.vehicles.autopilots import Autopilot
from dsse_ros.vehicles.control.commands import OrderFailedError, Situation, TakenOverError
from dsse_ros.vehicles.control.paced_setpoint import LeadingSetpoint, PacedSetpoint, Place
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.mavlink.events import EventMessage
from dsse_ros.vehicles.mavlink.messages import Heartbeat, Incoming, SetPositionTarget
from dsse_ros.world.scenario.geodesy import offset_m

_TARGET_DEG = 1e-5
_TARGET_ALT_M = 1.0
_TARGET_STALE_S = 5.0
_FOREIGN_REPORTS = 2
"""Reports of another target that prove it: one may have been overtaken by a confirmation."""
_ALIKE_REPORTS = 2
"""Further reports of a target that prove that a vehicle stands there."""
_MOVED_M = 15.0
_UNREPORTED_S = 3.0
"""Time without a report of the target after which the vehicle flies to none."""
_BETWEEN_TRACKS_S = 1.0
"""Time up to which a track goes on from the last one."""
_GAP_S = 0.5
"""Time without a setpoint after which a vehicle may have missed some: PX4 needs 2 a second."""
_LACKING_S = 0.9
"""Time without a setpoint up to which no vehicle lacks any: PX4's COM_OF_LOSS_T is 1 s."""
_RECENT_S = 3.0
"""How much later a heartbeat may show the failsafe that missing setpoints have caused."""
_QUIET_S = 0.75
"""Time without a message after which the link may have lost setpoints: positions come at 4 Hz."""
_SENT = 64
"""Targets that are remembered: after a cut of the uplink a vehicle flies to one of before."""
_OF_REPOSITIONS = 0.2
"""Share of the rate at which a vehicle gets places that it acknowledges one by one."""


class SetpointStreamer:
    """Keeps a vehicle on its way to a place: by a stream of setpoints, or until it confirms one.

    Args:
        situation: The situation of the vehicle.

    Attributes:
        target: Where it is to fly; None for nowhere.
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._autopilot = situation.autopilot
        self.target: SetPositionTarget | None = None
        # Whether the vehicle stands by itself, and the target that it has reported there.
        self._stands = False
        self._standing: tuple[float, float, float] | None = None
        self._reported: tuple[float, float, float] | None = None
        self._alike_reports = 0
        self._set_s = 0.0
        self._streaming_since_s = 0.0
        self._due_s = -math.inf
        # When the last streamed setpoint was sent, and one after a gap in the stream.
        self._sent_s = self._gap_s = -math.inf
        self._tries = 0
        # Whether the vehicle has confirmed the target, and how often it has named another since.
        self._was_confirmed = False
        self._foreign_reports = 0
        self._paced: PacedSetpoint | None = None
        # Whether the target is the end of a track, and since when it was that of one.
        self._on_track, self._track_s = False, -math.inf
        # Where the setpoint was on the last track, and when it was left.
        self._left_place: Place | None = None
        self._left_s = -math.inf
        # The last targets that were sent, each once.
        self._sent: deque[tuple[float, float, float]] = deque(maxlen=_SENT)

    def begin(self, *, to_setpoints: bool) -> None:
        """Forget the target of the last order.

        A stream of setpoints that must not end has the vehicle stay where it is.

        Args:
            to_setpoints: Whether the next order has the vehicle fly to setpoints too.
        """
        state = self._situation.state
        streams = self._autopilot.streams_setpoints and self.target is not None
        if streams and to_setpoints and state.has_position:
            self.fly_to(state.lat_deg, state.lon_deg, state.alt_amsl_m)
        else:
            self.stop()

    def stop(self) -> None:
        """Send no more setpoints."""
        self._leave_track()
        self.target, self._stands = None, False

    def stand(self) -> None:
        """Send no more setpoints to a vehicle that stays where it is in its resting mode."""
        self.stop()
        self._stands, self._foreign_reports, self._alike_reports = True, 0, 0
        self._standing = self._reported = None

    @property
    def expects_reports(self) -> bool:
        """Whether the vehicle should report where it flies to."""
        return (self.target is not None and not self._on_track) or self._stands

    def fly_to(self, lat_deg: float, lon_deg: float, alt_amsl_m: float) -> None:
        """Have the vehicle fly to a place, at an altitude above mean sea level."""
        self._leave_track()
        self._aim((lat_deg, lon_deg), alt_amsl_m)

    def _leave_track(self) -> None:
        if self._on_track and self._paced is not None:
            self._left_place, self._left_s = self._paced.place, self._situation.now
        if self._on_track:
            self._on_track, self._paced = False, None

    def _aim(self, place: Place, alt_amsl_m: float) -> SetPositionTarget:
        """Set the target, and return it; one that is the same stays as it is."""
        now = self._situation.now
        target = SetPositionTarget(
            self._situation.target, *place, float(alt_amsl_m),
            repositions=self._autopilot.repositions,
        )  # fmt: skip
        if self.target is None:
            self._streaming_since_s = now
        self._stands = False
        if target == self.target:
            return self.target
        self.target = target
        self._set_s = self._due_s = now
        self._tries = 0
        self._was_confirmed, self._foreign_reports = False, 0
        return target

    def follow(
        self, places: Sequence[Place], beyond: Place, alt_amsl_m: float, speed_mps: float
    ) -> None:
        """Have the vehicle fly along a track, without a stop where it goes on from another one.

        Args:
            places: At least two, not all the same.
            beyond: Where it flies on to, in the direction of the last leg, and stays.
            alt_amsl_m: Altitude above mean sea level.
            speed_mps: Speed over ground, more than 0.
        """
        before = self.target
        target = self._aim(beyond, alt_amsl_m)
        if self._on_track and target is before:
            return
        self._leave_track()
        now, boot_s = self._situation.now, self._situation.state.boot_s
        goes_on = now - self._left_s <= _BETWEEN_TRACKS_S
        last = self._left_place if goes_on else None
        kind = LeadingSetpoint if self._autopilot.circles else PacedSetpoint
        self._paced, self._on_track = kind(target, speed_mps, places, boot_s, last), True
        if not goes_on:
            self._track_s = now

    @property
    def left_m(self) -> float:
        """How far the vehicle still has to fly to the end of the track that it follows."""
        # The last place is the one behind that end.
        return math.inf if self._paced is None else self._paced.at_place_m(-2) - self._paced.flown_m

    def watch_reports(self) -> None:
        """Handle a report of the target.

        Raises:
            TakenOverError: If somebody else has given the vehicle another target than the one that
                it had confirmed.
        """
        state, autopilot = self._situation.state, self._autopilot
        reports = autopilot.streams_setpoints or autopilot.repositions or not self._on_track
        late = state.target_s > self._track_s + _UNREPORTED_S
        if not reports and late and not self._is_own(state.target):
            # It reports none while it flies to positions with velocities.
            raise TakenOverError("sent elsewhere by somebody else")
        if self._stands and state.mode == autopilot.resting_mode:
            if self._standing is None:
                # The first reports may be of the order before, or of the way to a stop.
                alike = _are_near(self._reported, state.target)
                self._alike_reports = self._alike_reports + 1 if alike else 0
                self._reported = state.target
                self._standing = state.target if self._alike_reports >= _ALIKE_REPORTS else None
            else:
                self._count_report(foreign=not _are_near(self._standing, state.target))
        if not self._is_reported:
            return
        if self.confirmed:
            self._was_confirmed = True
        self._count_report(
            foreign=self._was_confirmed and not self.confirmed and state.target_s > self._set_s
        )

    def _count_report(self, *, foreign: bool) -> None:
        foreign = foreign and not self._is_own(self._situation.state.target)
        self._foreign_reports = self._foreign_reports + 1 if foreign else 0
        if self._foreign_reports >= _FOREIGN_REPORTS:
            raise TakenOverError("sent elsewhere by somebody else")

    def _is_own(self, target: tuple[float, float, float] | None) -> bool:
        """Return whether a target is one that was sent, which may have come late, or last."""
        return target is not None and any(_are_near(target, sent) for sent in self._sent)

    def _remember(self, sent: SetPositionTarget) -> SetPositionTarget:
        place = (sent.lat_deg, sent.lon_deg, sent.alt_amsl_m)
        if not self._sent or not _are_near(place, self._sent[-1]):
            self._sent.append(place)
        return sent

    def watch_position(self, *, under_way: bool) -> None:
        """Handle a position.

        Args:
            under_way: Whether an order is; after it, the vehicle stays at the target.

        Raises:
            TakenOverError: If somebody else moves it without a target, by velocities.
        """
        situation, state = self._situation, self._situation.state
        if under_way or not (self._is_reported and self._was_confirmed):
            return
        assert self.target is not None
        here = (state.lat_deg, state.lon_deg)
        away = offset_m((self.target.lat_deg, self.target.lon_deg), here)
        unreported = situation.now - state.target_s > _UNREPORTED_S
        if unreported and math.hypot(*away) > _MOVED_M:
            raise TakenOverError("moved by somebody else")

    @property
    def _is_reported(self) -> bool:
        """Whether the vehicle should report to fly to the target."""
        guided = self._situation.state.mode == self._autopilot.guided_mode
        return self.target is not None and guided and not self._streams

    @property
    def _streams(self) -> bool:
        """Whether setpoints are sent all the time, not only until one is confirmed."""
        return self._autopilot.streams_setpoints or self._on_track

    @property
    def deadline(self) -> float:
        """When the next setpoint is due."""
        return self._due_s if self.target is not None else math.inf

    @property
    def were_missed(self) -> bool:
        """Whether the stream has just had a gap, or has not begun."""
        now = self._situation.now
        return now - self._sent_s > _GAP_S or now - self._gap_s < _RECENT_S

    @property
    def are_streamed(self) -> bool:
        """Whether a vehicle that receives our setpoints lacks none."""
        return self._situation.now - self._sent_s < _LACKING_S

    def streamed_for(self, seconds: float) -> bool:
        """Whether there have been setpoints for that long."""
        return self.target is not None and self._situation.now - self._streaming_since_s >= seconds

    @property
    def confirmed(self) -> bool:
        """Whether the vehicle flies to the target; by its own report, if it sends any."""
        now, state, target = self._situation.now, self._situation.state, self.target
        if self._streams:
            return state.mode == self._autopilot.guided_mode
        if target is None or state.target_s <= self._set_s:
            return False
        wanted = (target.lat_deg, target.lon_deg, target.alt_amsl_m)
        return now - state.target_s < _TARGET_STALE_S and _are_near(state.target, wanted)

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
        if self._streams:
            rate_hz = settings.setpoint_hz * (
                _OF_REPOSITIONS if self._autopilot.repositions else 1.0
            )
            self._due_s = situation.now + 1 / rate_hz
            guided = situation.state.mode == self._autopilot.guided_mode
            if guided and situation.now - self._sent_s > _GAP_S:
                self._gap_s = situation.now
            self._sent_s = situation.now
            situation.out.append(self._remember(self._streamed(self.target)))
            return
        self._due_s = situation.now + settings.command_s
        if not under_way or situation.state.mode != self._autopilot.guided_mode:
            return
        if self.confirmed:
            self._tries = 0
            return
        if self._foreign_reports and situation.now - situation.state.target_s < _TARGET_STALE_S:
            # The next report decides whether somebody else has sent it elsewhere.
            return
        if self._tries >= settings.command_tries:
            fence = ": its own geofence is enabled" if situation.state.fenced else ""
            raise OrderFailedError(
                f"the vehicle does not accept its target{fence}{situation.recent_texts()}"
            )
        self._tries += 1
        situation.out.append(self._remember(self.target))

    def _streamed(self, target: SetPositionTarget) -> SetPositionTarget:
        """Return the setpoint that leads to the target, at the requested speed."""
        state, speed_mps = self._situation.state, self._situation.settings.speed_mps
        if not state.has_position:
            return target
        place = (state.lat_deg, state.lon_deg)
        paced = speed_mps > 0 and self._autopilot.paced_setpoints
        if not (paced or self._on_track):
            return target
        if state.mode != self._autopilot.guided_mode:
            # Hold its position until its mode shows that it follows setpoints.
            if not self._on_track:
                self._paced = None
            return replace(target, lat_deg=state.lat_deg, lon_deg=state.lon_deg)
        if self._paced is None or self._paced.target != target:
            self._paced = PacedSetpoint(target, speed_mps, [place], state.boot_s)
        setpoint = self._paced.advance(place, state.boot_s)
        if self._on_track and setpoint.velocity_mps is None and not self._autopilot.circles:
            # Without a velocity ArduCopter would fly to it in another way.
            return replace(setpoint, velocity_mps=(0.0, 0.0))
        return setpoint


class MissedSetpoints:
    """Knows whether a vehicle in a failsafe has missed setpoints.

    We have sent none for a while, or none yet; the link was silent; or the vehicle reports that it
    lacks them while we send them, and nothing else. If since then another check fails as well, it
    may be that failsafe which has the vehicle.

    Args:
        autopilot: Which autopilot it has.
        setpoints: What sends them.
    """

    def __init__(self, autopilot: Autopilot, setpoints: SetpointStreamer) -> None:
        self._event = autopilot.setpoint_loss_event
        self._setpoints = setpoints
        self._known = False
        self._failed_before: frozenset[str] = frozenset()
        self._message_s = self._quiet_s = self._reported_s = -math.inf

    def watch(
        self, message: Incoming, before: VehicleState, state: VehicleState, now: float
    ) -> bool:
        """Take a message; return whether the failsafe that is active comes of missing setpoints.

        Args:
            message: The message.
            before: What the vehicle reported before.
            state: What it reports.
            now: Our time in seconds.
        """
        if now - self._message_s > _QUIET_S:
            self._quiet_s = now
        self._message_s = now
        if isinstance(message, EventMessage) and message.id == self._event:
            # Once we have stopped, its report has that reason, whatever the first one was.
            self._reported_s = now if self._setpoints.are_streamed else self._reported_s
        if not isinstance(message, Heartbeat):
            return self._comes_of_it(state)
        if not state.failsafe:
            # None of these checks has brought about a failsafe.
            self._failed_before = state.failed_checks
        if not before.failsafe:
            self._known = now - self._quiet_s < _RECENT_S or self._setpoints.were_missed
        reported = now - self._reported_s < _RECENT_S and not state.unready
        self._known = state.failsafe is not None and (self._known or reported)
        return self._comes_of_it(state)

    def _comes_of_it(self, state: VehicleState) -> bool:
        return self._known and state.failed_checks <= self._failed_before


def _are_near(
    target: tuple[float, float, float] | None, other: tuple[float, float, float] | None
) -> bool:
    """Return whether two targets are the same, but for the rounding of messages."""
    if target is None or other is None:
        return target is other
    limits = (_TARGET_DEG, _TARGET_DEG, _TARGET_ALT_M)
    return all(abs(a - b) < limit for a, b, limit in zip(target, other, limits, strict=True))
