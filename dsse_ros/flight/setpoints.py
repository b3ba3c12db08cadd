# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Setpoints that lead a vehicle to a place: streamed, or sent until the vehicle confirms them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from dsse_ros.flight.commands import OrderFailedError, Situation, TakenOverError
from dsse_ros.flight.paced_setpoint import LeadingSetpoint, PacedSetpoint, Place
from dsse_ros.mavlink.messages import SetPositionTarget
from dsse_ros.scenario.geodesy import offset_m

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
_OF_REPOSITIONS = 0.2
"""Share of the rate at which a vehicle gets places that it acknowledges one by one."""


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
        # Whether the vehicle stands by itself, and the target that it has reported there.
        self._stands = False
        self._standing: tuple[float, float, float] | None = None
        self._reported: tuple[float, float, float] | None = None
        self._alike_reports = 0
        self._set_s = 0.0
        self._streaming_since_s = 0.0
        self._due_s = -math.inf
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
        if not reports and state.target_s > self._track_s + _UNREPORTED_S:
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
        self._foreign_reports = self._foreign_reports + 1 if foreign else 0
        if self._foreign_reports >= _FOREIGN_REPORTS:
            raise TakenOverError("sent elsewhere by somebody else")

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
            situation.out.append(self._streamed(self.target))
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
        situation.out.append(self.target)

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


def _are_near(
    target: tuple[float, float, float] | None, other: tuple[float, float, float] | None
) -> bool:
    """Return whether two targets are the same, but for the rounding of messages."""
    if target is None or other is None:
        return target is other
    limits = (_TARGET_DEG, _TARGET_DEG, _TARGET_ALT_M)
    return all(abs(a - b) < limit for a, b, limit in zip(target, other, limits, strict=True))
