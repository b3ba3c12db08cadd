# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle can be ordered to do, and how that is carried out.

Altitudes are metres above its home. An order is carried out by a generator that yields what it is
waiting for: see `Order.carry_out`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.autopilots import offset_m
from dsse_ros.flight.commands import ARM_DISARM, MISSION_START, OrderFailedError
from dsse_ros.flight.mavlink_messages import MissionSetCurrent
from dsse_ros.flight.mission_messages import WireItem
from dsse_ros.flight.transfer import Failed
from dsse_ros.flight.upload import VerifiedUpload
from dsse_ros.flight.vehicle_controller import Order, VehicleController

NAV_WAYPOINT = mavlink.MAV_CMD_NAV_WAYPOINT
NAV_LOITER_TIME = mavlink.MAV_CMD_NAV_LOITER_TIME
NAV_DELAY = mavlink.MAV_CMD_NAV_DELAY
NAV_RETURN_TO_LAUNCH = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
NAV_LAND = mavlink.MAV_CMD_NAV_LAND
NAV_TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF

_MAX_ALT_M = 1e5
_STANDING_MPS = 1.0
_STAYING_M = 5.0
_STREAM_FIRST_S = 1.0
_SEARCH_ALT_M = 1.0
"""Difference in altitude at which the hold of a search begins."""
_LIFT_OFF_S = 4.0
"""Motors spool up, and the autopilot looks whether the vehicle has left the ground."""
_HOLDING_ITEMS = (NAV_WAYPOINT, NAV_LOITER_TIME, NAV_DELAY)


@dataclass(frozen=True)
class TakeOff(Order):
    """Arm if that is allowed, climb straight up; in the air, climb or descend on the spot.

    Raises:
        ValueError: If the altitude is not above home.
    """

    alt_m: float
    finishes_alone: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check("alt_m", self.alt_m, 0.0, _MAX_ALT_M)
        if self.alt_m == 0:
            raise ValueError("alt_m: 0 is not allowed; more than 0")

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        autopilot = controller.situation.autopilot
        yield from _until_position_known(controller)
        if controller.state.flying:
            here = (controller.state.lat_deg, controller.state.lon_deg)
            yield from _fly_to(controller, *here, self.alt_m, math.inf)
            return
        controller.setpoints.stop()
        while not controller.state.flying:
            waiting = _until_take_off(controller)
            if waiting:
                yield waiting
                continue
            if autopilot.take_off_mode:
                controller.modes.expect(autopilot.take_off_mode)
            home_amsl_m = controller.state.alt_amsl_m - controller.state.alt_m
            parameters = autopilot.take_off_parameters(self.alt_m, home_amsl_m)
            yield controller.commands.send_long(
                NAV_TAKEOFF, "taking off", *parameters, takes_s=_LIFT_OFF_S
            )
        tolerance_m = controller.situation.settings.alt_tolerance_m
        while abs(controller.state.alt_m - self.alt_m) > tolerance_m:
            _expect_flying(controller)
            controller.situation.expect_progress("climb", abs(controller.state.alt_m - self.alt_m))
            yield f"climbing to {self.alt_m:g} m"


@dataclass(frozen=True)
class GoTo(Order):
    """Fly to a place and stay there.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Altitude above home.
        radius_m: Horizontal distance at which the vehicle is there.

    Raises:
        ValueError: If it is no place on Earth, or the radius is not above 0.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float
    radius_m: float

    def __post_init__(self) -> None:
        _check_place(self.lat_deg, self.lon_deg, self.alt_m, self.radius_m)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        return _fly_to(controller, self.lat_deg, self.lon_deg, self.alt_m, self.radius_m)


@dataclass(frozen=True)
class Search(Order):
    """Fly to a place, descend, hold and climb back.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Altitude above home before and after.
        search_alt_m: Altitude above home of the hold.
        hold_s: How long to hold there, in the vehicle's own time.
        radius_m: Horizontal distance at which the vehicle is there.

    Raises:
        ValueError: If it is no place on Earth, or a number is not allowed.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float
    search_alt_m: float
    hold_s: float
    radius_m: float

    def __post_init__(self) -> None:
        _check_place(self.lat_deg, self.lon_deg, self.alt_m, self.radius_m)
        _check("search_alt_m", self.search_alt_m, -_MAX_ALT_M, _MAX_ALT_M)
        _check("hold_s", self.hold_s, 0.0, 3600.0)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        place = (self.lat_deg, self.lon_deg)
        yield from _fly_to(controller, *place, self.alt_m, self.radius_m)
        yield from _fly_to(controller, *place, self.search_alt_m, self.radius_m, _SEARCH_ALT_M)
        since_s = controller.state.boot_s
        while controller.state.boot_s - since_s < self.hold_s:
            _expect_flying(controller)
            # A clock that has gone back was restarted.
            since_s = min(since_s, controller.state.boot_s)
            controller.situation.expect_progress("hold", -controller.state.boot_s)
            yield f"holding at {self.search_alt_m:g} m for {self.hold_s:g} s"
        yield from _fly_to(controller, *place, self.alt_m, self.radius_m)


@dataclass(frozen=True)
class Hold(Order):
    """Stop and stay in the air."""

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        autopilot, modes = controller.situation.autopilot, controller.modes
        yield from _until_position_known(controller)
        yield from _until_lift_off_known(controller)
        if not controller.state.flying:
            return
        if autopilot.resting_mode == autopilot.guided_mode:
            yield from _stop_at_setpoint(controller)
            return
        while not modes.resting or not _moving_mps(controller) < _STANDING_MPS:
            if not modes.resting:
                modes.require()
                yield modes.change(autopilot.resting_mode)
                continue
            controller.setpoints.stop()
            modes.claim(autopilot.resting_mode)
            controller.situation.expect_progress("stop", _moving_mps(controller))
            yield "stopping"
        controller.setpoints.stop()


@dataclass(frozen=True)
class Return(Order):
    """Fly home and land there, as the autopilot does it."""

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        return _come_down(controller, "RTL", "returning")


@dataclass(frozen=True)
class Land(Order):
    """Land on the spot."""

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        return _come_down(controller, "LAND", "landing")


@dataclass(frozen=True)
class FlyMission(Order):
    """Upload a mission, read it back, and fly it from its first item to its last.

    Attributes:
        items: The mission, numbered as the vehicle does: with ArduPilot item 0 is home.

    Raises:
        ValueError: If it is empty or not numbered from 0.
    """

    items: tuple[WireItem, ...]

    def __post_init__(self) -> None:
        if not self.items:
            raise ValueError("items: none is not allowed; at least one")
        for index, item in enumerate(self.items):
            if item.seq != index:
                raise ValueError(f"items[{index}].seq: {item.seq} is not allowed; {index} is")

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        autopilot, modes = controller.situation.autopilot, controller.modes
        first, mission_mode = autopilot.first_item, autopilot.mission_mode
        if len(self.items) <= first:
            raise OrderFailedError("the mission has no item but home")
        yield from _until_position_known(controller)
        # Items that are changed while they are flown leave the vehicle with neither mission.
        while controller.state.flying and controller.state.mode != autopilot.resting_mode:
            modes.require()
            yield modes.change(autopilot.resting_mode)
        controller.setpoints.stop()
        yield from _upload(controller, self.items)
        while controller.state.item_current != first:
            command = MissionSetCurrent(controller.situation.target, first)
            yield controller.commands.send(command, "going back to the first item")
        # A short one may be over before its mode is seen.
        while not controller.state.armed or (
            controller.state.mode != mission_mode and controller.state.item_current <= first
        ):
            if controller.state.flying:
                modes.require()
                waiting = modes.change(mission_mode)
                modes.claim(
                    controller.state.mode, *_mission_modes(controller, self.items, whole=True)
                )
                yield waiting
                continue
            waiting = _until_take_off(controller)
            if waiting:
                yield waiting
            elif autopilot.missions_by_command:
                modes.expect(mission_mode)
                modes.claim(autopilot.guided_mode, mission_mode)
                yield controller.commands.send_long(
                    MISSION_START, "starting the mission", takes_s=_LIFT_OFF_S
                )
            else:
                yield modes.change(mission_mode)
        yield from _follow_mission(controller, self.items)


# Parts of orders.


def _fly_to(
    controller: VehicleController,
    lat_deg: float,
    lon_deg: float,
    alt_m: float,
    radius_m: float,
    alt_tolerance_m: float = math.inf,
) -> Iterator[str]:
    """Fly to a setpoint."""
    situation, setpoints = controller.situation, controller.setpoints
    autopilot = situation.autopilot
    alt_tolerance_m = min(alt_tolerance_m, situation.settings.alt_tolerance_m)
    yield from _until_position_known(controller)
    yield from _until_lift_off_known(controller)
    while True:
        _expect_flying(controller)
        setpoints.fly_to(lat_deg, lon_deg, alt_m)
        if controller.state.mode != autopilot.guided_mode:
            yield _enter_guided_mode(controller)
            continue
        controller.modes.claim(autopilot.guided_mode)
        if setpoints.confirmed and not autopilot.paced_setpoints:
            controller.commands.request_speed()
        away_m = _distance_m(controller, lat_deg, lon_deg) if math.isfinite(radius_m) else 0.0
        above_m = abs(controller.state.alt_m - alt_m)
        there = away_m <= radius_m and above_m <= alt_tolerance_m
        if there and setpoints.confirmed and _has_fresh_position(controller):
            return
        situation.expect_progress(setpoints.target, max(away_m - radius_m, 0.0) + above_m)
        yield f"flying to {lat_deg:.6f}, {lon_deg:.6f}, {alt_m:g} m"


def _enter_guided_mode(controller: VehicleController) -> str:
    autopilot = controller.situation.autopilot
    controller.modes.require()
    if controller.state.mode == autopilot.take_off_mode:
        # Let it finish: a setpoint would end the climb.
        controller.situation.expect_progress("take-off", -controller.state.alt_m)
        return "taking off"
    if autopilot.streams_setpoints and not controller.setpoints.streamed_for(_STREAM_FIRST_S):
        return "sending setpoints"
    return controller.modes.change(autopilot.guided_mode)


def _stop_at_setpoint(controller: VehicleController) -> Iterator[str]:
    """Stop where the vehicle is now."""
    while controller.state.mode != controller.situation.autopilot.guided_mode:
        yield _enter_guided_mode(controller)
    here = (controller.state.lat_deg, controller.state.lon_deg)
    yield from _fly_to(controller, *here, controller.state.alt_m, _STAYING_M)
    while (
        not _moving_mps(controller) < _STANDING_MPS or _distance_m(controller, *here) > _STAYING_M
    ):
        _expect_flying(controller)
        away = _moving_mps(controller) + _distance_m(controller, *here)
        controller.situation.expect_progress("stop", away)
        yield "stopping"


def _come_down(controller: VehicleController, mode: str, reason: str) -> Iterator[str]:
    yield from _until_position_known(controller)
    while controller.state.armed or controller.state.flying or controller.commands.arming:
        state = controller.state
        if not state.armed and not state.flying:
            yield "waiting for the effect of arming"
            continue
        if state.mode != mode:
            controller.modes.require()
            yield controller.modes.change(mode)
            continue
        controller.modes.claim(mode)
        controller.setpoints.stop()
        # It climbs, flies, waits and descends: nothing but standing still is no progress.
        place = (round(state.lat_deg, 5), round(state.lon_deg, 5), round(state.alt_m))
        controller.situation.expect_progress((reason, place), 0.0)
        yield reason
    controller.setpoints.stop()


def _upload(controller: VehicleController, items: tuple[WireItem, ...]) -> Iterator[str]:
    situation = controller.situation
    while controller.exchange is not None and controller.exchange.result is None:
        yield "waiting for the end of another upload"
    exchange = VerifiedUpload(
        items,
        situation.target,
        controller.source,
        autopilot=situation.autopilot,
        timeouts=situation.settings.transfer,
    )
    controller.exchange = exchange
    situation.out += exchange.start(situation.now)
    while exchange.result is None:
        yield f"uploading {len(items)} items"
    if isinstance(exchange.result, Failed):
        changed = ", and the vehicle may hold another mission" if exchange.result.changed else ""
        raise OrderFailedError(exchange.result.reason + changed)
    # What it has reported before was about another mission.
    situation.state = replace(situation.state, item_current=-1, item_reached=-1, mission_over=False)


def _follow_mission(controller: VehicleController, items: tuple[WireItem, ...]) -> Iterator[str]:
    last = len(items) - 1
    comes_down = items[last].command in (NAV_RETURN_TO_LAUNCH, NAV_LAND)
    holds_s = [item.param1 for item in items if item.command in _HOLDING_ITEMS]
    longest_s = max((hold_s for hold_s in holds_s if hold_s > 0), default=0.0)
    reached, flown = -1, False
    while True:
        state = controller.state
        flown = flown or state.flying
        if state.item_reached <= max(state.item_current, 0):
            # Reports of an item may get lost, but not for ever: the next one implies it.
            reached = max(reached, state.item_reached, state.item_current - 1)
        down = flown and not state.armed
        if reached >= last or (flown and state.mission_over) or (down and comes_down):
            if not comes_down or down:
                return
        elif down:
            raise OrderFailedError(f"disarmed at item {state.item_current} of {last}")
        controller.modes.claim(*_mission_modes(controller, items))
        if flown and state.mode == controller.situation.autopilot.mission_mode:
            controller.commands.request_speed()
        place = (round(state.lat_deg, 5), round(state.lon_deg, 5), round(state.alt_m))
        stage = (state.item_current, place, state.armed)
        controller.situation.expect_progress(stage, 0.0, patience_s=longest_s)
        yield f"flying item {state.item_current} of {last}"


def _mission_modes(
    controller: VehicleController, items: tuple[WireItem, ...], *, whole: bool = False
) -> frozenset[str]:
    """Return the modes that come about by flying the mission, now or to its end."""
    autopilot, state = controller.situation.autopilot, controller.state
    first, count = (0, len(items)) if whole else (max(state.item_current, 0), 2)
    modes = {autopilot.mission_mode}
    if state.failsafe in ("", "offboard"):
        commands = {item.command for item in items[first : first + count]}
        modes |= {mode for command, mode in autopilot.item_modes.items() if command in commands}
    return frozenset(modes)


def _until_position_known(controller: VehicleController) -> Iterator[str]:
    while not (
        controller.state.connected
        and controller.state.has_position
        and _has_fresh_position(controller)
    ):
        if controller.state.flying:
            controller.situation.expect_progress("position", 0.0)
        yield "waiting for the vehicle's position" + _why_not_ready(controller)


def _until_lift_off_known(controller: VehicleController) -> Iterator[str]:
    """Wait for what an earlier order may have begun; if nothing, it soon disarms itself."""
    while not controller.state.flying and (controller.state.armed or controller.commands.arming):
        controller.situation.expect_progress("lift-off", 0.0)
        yield "waiting for lift-off or disarming"


def _until_take_off(controller: VehicleController) -> str:
    """Bring it to where it can take off, and return what that waits for, empty if nothing."""
    state, modes = controller.state, controller.modes
    autopilot, arm = controller.situation.autopilot, controller.situation.settings.arm
    ours = modes.own is not None and state.mode in modes.own
    resting_mode = autopilot.resting_mode
    if autopilot.mode_is_checked and not state.armed and state.mode != resting_mode:
        if arm or ours:
            return modes.change(resting_mode)
        return f"waiting for {resting_mode}: it is in {state.mode}"
    if not state.armed and not state.ready:
        return "waiting until it is ready" + _why_not_ready(controller)
    if state.mode not in autopilot.take_off_modes:
        if ours or (arm and not state.armed):
            return modes.change(resting_mode)
        return f"waiting for {resting_mode}: it is in {state.mode}"
    modes.claim(*autopilot.take_off_modes)
    if not state.armed:
        if arm:
            return controller.commands.send_long(ARM_DISARM, "arming", 1.0)
        modes.own = None
        return "waiting for somebody to arm it"
    return ""


def _why_not_ready(controller: VehicleController) -> str:
    return f" ({controller.state.unready})" if controller.state.unready else ""


def _has_fresh_position(controller: VehicleController) -> bool:
    """Whether the position is one of the link that is up now."""
    situation = controller.situation
    return situation.now - situation.state.position_s < situation.settings.link_timeout_s


def _moving_mps(controller: VehicleController) -> float:
    return math.hypot(controller.state.speed_mps, controller.state.climb_mps)


def _distance_m(controller: VehicleController, lat_deg: float, lon_deg: float) -> float:
    """Return the horizontal distance to a place, exact enough near to it."""
    here = (controller.state.lat_deg, controller.state.lon_deg)
    return math.hypot(*offset_m((lat_deg, lon_deg), here))


def _expect_flying(controller: VehicleController) -> None:
    if not controller.state.flying:
        texts = controller.situation.recent_texts()
        raise OrderFailedError("the vehicle is not in the air" + texts)


def _check(name: str, value: float, least: float, most: float) -> None:
    if not (math.isfinite(value) and least <= value <= most):
        raise ValueError(f"{name}: {value!r} is not allowed; {least:g} to {most:g}")


def _check_place(lat_deg: float, lon_deg: float, alt_m: float, radius_m: float) -> None:
    _check("lat_deg", lat_deg, -90.0, 90.0)
    _check("lon_deg", lon_deg, -180.0, 180.0)
    _check("alt_m", alt_m, -_MAX_ALT_M, _MAX_ALT_M)
    _check("radius_m", radius_m, 0.0, 1e6)
    if radius_m == 0:
        raise ValueError("radius_m: 0 is not allowed; more than 0")
