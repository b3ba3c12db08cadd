# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The orders to a vehicle, and how each is carried out.

Altitudes are metres above mean sea level, so a home that moves does not change them. An order is
carried out by a generator that yields what it is waiting for: see `Order.carry_out`.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.base.checks import check_number
from dsse_ros.vehicles.autopilots import Failsafe
from dsse_ros.vehicles.control.commands import (
    ARM_DISARM,
    CHANGED_MISSION,
    MISSION_START,
    OrderFailedError,
    TakenOverError,
)
from dsse_ros.vehicles.control.item_messages import mission_messages
from dsse_ros.vehicles.control.paced_setpoint import Place
from dsse_ros.vehicles.control.transfer import Failed
from dsse_ros.vehicles.control.upload import VerifiedUpload, mission_digest
from dsse_ros.vehicles.control.vehicle_controller import Order, VehicleController
from dsse_ros.vehicles.mavlink.messages import MissionSetCurrent
from dsse_ros.vehicles.mission_items.items import (
    NAV_LAND,
    NAV_LOITER_TIME,
    NAV_RETURN_TO_LAUNCH,
    NAV_WAYPOINT,
    MissionItem,
)
from dsse_ros.world.scenario.geodesy import offset_m

NAV_TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF

STANDING_MPS = 1.0
NEAR_TOP_M = 3.0
"""Tolerance for the end of a climb: positions are late, and altitudes drift."""
_STAYING_M = 5.0
_STREAM_FIRST_S = 1.0
_HOLDING_ITEMS = (NAV_WAYPOINT, NAV_LOITER_TIME, mavlink.MAV_CMD_NAV_DELAY)
_MAX_ALT_M = 1e5
_SEARCH_ALT_M = 1.0
"""Difference in altitude at which the hold of a search begins."""
_CLEAR_M = 30.0
"""Altitude above home from which a fixed wing may circle."""
_LIFT_OFF_S = 4.0
"""Motors spool up, and the autopilot looks whether the vehicle has left the ground."""


@dataclass(frozen=True)
class MakeReady(Order):
    """Wait on the ground until the vehicle can be armed, in the mode in which it checks that.

    Attributes:
        arm: Whether it will be armed by us. If not, its mode is somebody else's too.
        from_modes: Modes that may be changed on the ground, even if a person has set them,
            besides those of its start and those from which it takes off.
    """

    arm: bool = True
    from_modes: tuple[str, ...] = ()

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        controller.setpoints.stop()
        allow_present_mode(controller, self)
        yield from until_position_known(controller)
        while waiting := until_ready(controller, self):
            yield waiting


@dataclass(frozen=True)
class TakeOff(Order):
    """Arm, climb straight up; in the air, climb or descend on the spot.

    Attributes:
        alt_amsl_m: Altitude above mean sea level.
        arm: Whether to arm the vehicle; if not, somebody else does.
        from_modes: See `MakeReady`.

    Raises:
        ValueError: If the altitude is not allowed.
    """

    alt_amsl_m: float
    arm: bool = True
    from_modes: tuple[str, ...] = ()
    finishes_alone: ClassVar[bool] = True
    flies_to_setpoints: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("alt_amsl_m", self.alt_amsl_m, -_MAX_ALT_M, _MAX_ALT_M)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        autopilot, modes = controller.situation.autopilot, controller.modes
        allow_present_mode(controller, self)
        yield from until_position_known(controller)
        if controller.state.flying:
            here = (controller.state.lat_deg, controller.state.lon_deg)
            yield from fly_to(controller, *here, self.alt_amsl_m, math.inf)
            return
        controller.setpoints.stop()
        while not controller.state.flying:
            waiting = until_take_off(controller, self)
            if waiting:
                yield waiting
                continue
            if autopilot.take_off_mode:
                if controller.state.mode == autopilot.take_off_mode:
                    # It takes off: another mode is no longer one from which it does.
                    modes.allow(autopilot.take_off_mode)
                    controller.situation.expect_progress("lift-off", 0.0)
                    yield "taking off"
                    continue
                if autopilot.takes_off_by_mode:
                    yield modes.change(autopilot.take_off_mode)
                    continue
                modes.announce(autopilot.take_off_mode)
            home_amsl_m = controller.state.alt_amsl_m - controller.state.alt_m
            controller.situation.take_off_amsl_m = self.alt_amsl_m
            parameters = autopilot.take_off_parameters(self.alt_amsl_m, home_amsl_m)
            yield controller.commands.send_long(
                NAV_TAKEOFF, "taking off", *parameters, takes_s=_LIFT_OFF_S
            )
        tolerance_m = controller.situation.alt_tolerance_m
        while (left_m := abs(controller.state.alt_amsl_m - self.alt_amsl_m)) > tolerance_m:
            expect_flying(controller)
            if autopilot.circles and controller.state.alt_m >= _CLEAR_M:
                # It flies straight on in this mode: the next order has it climb in a circle.
                break
            if autopilot.take_off_mode:
                # Up there it goes to the resting mode by itself; below, a person has set that.
                resting = end_of_climb(controller)
                modes.allow(autopilot.take_off_mode, *resting)
                if controller.state.mode in resting:
                    break
            controller.situation.expect_progress("climb", left_m)
            yield f"climbing to {self.alt_amsl_m:g} m"
        if autopilot.take_off_mode:
            modes.allow(autopilot.take_off_mode, autopilot.resting_mode)


@dataclass(frozen=True)
class GoTo(Order):
    """Fly to a place and stay there.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_amsl_m: Altitude above mean sea level.
        radius_m: Horizontal distance at which the vehicle is there.

    Raises:
        ValueError: If the place is not on Earth, or the radius is not above 0.
    """

    lat_deg: float
    lon_deg: float
    alt_amsl_m: float
    radius_m: float
    flies_to_setpoints: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_place(self.lat_deg, self.lon_deg, self.alt_amsl_m, self.radius_m)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        yield from climb_on_the_spot(controller, self.alt_amsl_m)
        yield from fly_to(controller, self.lat_deg, self.lon_deg, self.alt_amsl_m, self.radius_m)


@dataclass(frozen=True)
class FlyTrack(Order):
    """Fly along a track without a stop; the order is done at its end.

    The vehicle flies on behind the end, so that it need not stop where the next order goes on, and
    stays there then.

    Attributes:
        places: WGS84 latitudes and longitudes, at least two that differ.
        beyond: Latitude and longitude to which it flies on; the end for no farther.
        alt_amsl_m: Altitude above mean sea level.
        speed_mps: Speed over ground.

    Raises:
        ValueError: If a place is not on Earth, all places are the same, or the speed is not above
            0.
    """

    places: tuple[Place, ...]
    beyond: Place
    alt_amsl_m: float
    speed_mps: float
    flies_to_setpoints: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for lat_deg, lon_deg in (*self.places, self.beyond):
            _check_place(lat_deg, lon_deg, self.alt_amsl_m, 1.0)
        check_number("speed_mps", self.speed_mps, 0, 1e3, exclusive=True)
        if len({*self.places}) < 2:
            raise ValueError(f"places must be at least two that differ, got {self.places!r:.60}")

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        yield from climb_on_the_spot(controller, self.alt_amsl_m)
        yield from follow_track(controller, self)


@dataclass(frozen=True)
class SearchPlace(Order):
    """Fly to a place, descend and hold; a vehicle already over the place begins with the descent.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_amsl_m: Altitude above mean sea level of the way there.
        search_amsl_m: Altitude above mean sea level of the hold.
        hold_s: How long to hold there, in the vehicle's own time.
        radius_m: Horizontal distance at which the vehicle is there.

    Raises:
        ValueError: If it is no place on Earth, or a number is not allowed.
    """

    lat_deg: float
    lon_deg: float
    alt_amsl_m: float
    search_amsl_m: float
    hold_s: float
    radius_m: float
    flies_to_setpoints: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_place(self.lat_deg, self.lon_deg, self.alt_amsl_m, self.radius_m)
        check_number("search_amsl_m", self.search_amsl_m, -_MAX_ALT_M, _MAX_ALT_M)
        check_number("hold_s", self.hold_s, 0, 3600)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        place = (self.lat_deg, self.lon_deg)
        yield from until_position_known(controller)
        if distance_m(controller, *place) > self.radius_m:
            yield from climb_on_the_spot(controller, self.alt_amsl_m)
            yield from fly_to(controller, *place, self.alt_amsl_m, self.radius_m)
        yield from fly_to(controller, *place, self.search_amsl_m, self.radius_m, _SEARCH_ALT_M)
        since_s = controller.state.boot_s
        while controller.state.boot_s - since_s < self.hold_s:
            expect_flying(controller)
            # A clock that has gone back was restarted.
            since_s = min(since_s, controller.state.boot_s)
            controller.situation.expect_progress("hold", -controller.state.boot_s)
            yield f"holding at {self.search_amsl_m:g} m for {self.hold_s:g} s"


@dataclass(frozen=True)
class Hold(Order):
    """Stop and stay in the air.

    Attributes:
        from_mode: See `Return`.
    """

    from_mode: str | None = field(default=None, repr=False)
    flies_to_setpoints: ClassVar[bool] = True

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        autopilot, modes = controller.situation.autopilot, controller.modes
        yield from until_position_known(controller)
        yield from until_lift_off_known(controller)
        if not controller.state.flying:
            return
        if autopilot.resting_mode == autopilot.guided_mode:
            yield from stop_at_setpoint(controller, self.from_mode)
            return
        while not modes.resting or not (autopilot.circles or moving_mps(controller) < STANDING_MPS):
            if not modes.resting:
                yield modes.change(autopilot.resting_mode, from_mode=self.from_mode)
                continue
            controller.setpoints.stop()
            modes.allow(autopilot.resting_mode)
            controller.situation.expect_progress("stop", moving_mps(controller))
            yield "stopping"
        controller.setpoints.stand()


@dataclass(frozen=True)
class Return(Order):
    """Fly home and land there, as the autopilot does it.

    Attributes:
        from_mode: Mode that somebody else set, from which the operator may take the vehicle back;
            None if the mode is ours.
    """

    from_mode: str | None = field(default=None, repr=False)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        mode = controller.situation.autopilot.return_mode
        return come_down(controller, mode, "returning", self.from_mode)


@dataclass(frozen=True)
class Land(Order):
    """Land on the spot.

    Attributes:
        from_mode: See `Return`.
    """

    from_mode: str | None = field(default=None, repr=False)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        mode = controller.situation.autopilot.land_mode
        return come_down(controller, mode, "landing", self.from_mode)


@dataclass(frozen=True)
class FlyMission(Order):
    """Upload a mission, read it back, and fly it from its first item to its last.

    Attributes:
        items: The mission, numbered as the vehicle does: with ArduPilot item 0 is home.
        arm: See `TakeOff`.
        from_modes: See `MakeReady`.
        hold_item: Number of an item over home in which it may be ordered to land; -1 for none.

    Raises:
        ValueError: If it is empty, or a value does not fit MAVLink's message.
    """

    items: tuple[MissionItem, ...]
    arm: bool = True
    from_modes: tuple[str, ...] = ()
    hold_item: int = -1

    def __post_init__(self) -> None:
        if not self.items:
            raise ValueError("items must be at least one, got none")
        mission_messages(self.items)

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        autopilot, modes = controller.situation.autopilot, controller.modes
        first, mission_mode = autopilot.first_item, autopilot.mission_mode
        if len(self.items) <= first:
            raise OrderFailedError("the mission has no item but home")
        allow_present_mode(controller, self)
        yield from until_position_known(controller)
        # Items that are changed while they are flown leave the vehicle with neither mission.
        while controller.state.flying and controller.state.mode != autopilot.resting_mode:
            yield modes.change(autopilot.resting_mode)
        controller.setpoints.stop()
        mission = yield from upload(controller, self.items)
        while controller.state.item_current != first:
            command = MissionSetCurrent(*controller.situation.target, first)
            yield controller.commands.send(command, "going back to the first item")
        # A short one may be over before its mode is seen.
        while not controller.state.armed or (
            controller.state.mode != mission_mode and controller.state.item_current <= first
        ):
            if reading := reads_back(controller, mission):
                controller.situation.expect_progress("mission", 0.0)
                yield reading
                continue
            if controller.state.flying:
                changing = modes.change(mission_mode)
                modes.allow(
                    controller.state.mode, *mission_modes(controller, self.items, all_items=True)
                )
                yield changing
                continue
            waiting = until_take_off(controller, self)
            if waiting:
                yield waiting
            elif autopilot.missions_by_command:
                modes.announce(mission_mode)
                modes.allow(autopilot.guided_mode, mission_mode)
                yield controller.commands.send_long(
                    MISSION_START, "starting the mission", takes_s=_LIFT_OFF_S
                )
            else:
                yield modes.change(mission_mode)
        yield from follow_mission(controller, self.items, mission)


def _check_place(lat_deg: float, lon_deg: float, alt_amsl_m: float, radius_m: float) -> None:
    check_number("lat_deg", lat_deg, -90, 90)
    check_number("lon_deg", lon_deg, -180, 180)
    check_number("alt_amsl_m", alt_amsl_m, -_MAX_ALT_M, _MAX_ALT_M)
    check_number("radius_m", radius_m, 0, 1e6, exclusive=True)


# The steps of orders; each yields, or returns, what it is waiting for

ArmingOrder: TypeAlias = MakeReady | TakeOff | FlyMission


def fly_to(
    controller: VehicleController,
    lat_deg: float,
    lon_deg: float,
    alt_amsl_m: float,
    radius_m: float,
    alt_tolerance_m: float = math.inf,
) -> Iterator[str]:
    """Fly to a setpoint, whose altitude is above mean sea level."""
    situation, setpoints = controller.situation, controller.setpoints
    autopilot = situation.autopilot
    alt_tolerance_m = min(alt_tolerance_m, situation.alt_tolerance_m)
    radius_m = max(radius_m, autopilot.circle_m)
    yield from until_position_known(controller)
    yield from until_lift_off_known(controller)
    while True:
        expect_flying(controller)
        setpoints.fly_to(lat_deg, lon_deg, alt_amsl_m)
        if controller.state.mode != autopilot.guided_mode:
            yield enter_guided_mode(controller)
            continue
        controller.modes.allow(autopilot.guided_mode)
        if setpoints.confirmed and not autopilot.paced_setpoints:
            controller.commands.request_speed()
        away_m = distance_m(controller, lat_deg, lon_deg) if math.isfinite(radius_m) else 0.0
        above_m = abs(controller.state.alt_amsl_m - alt_amsl_m)
        there = away_m <= radius_m and above_m <= alt_tolerance_m
        if there and setpoints.confirmed and has_fresh_position(controller):
            return
        situation.expect_progress(setpoints.target, max(away_m - radius_m, 0.0) + above_m)
        yield f"flying to {lat_deg:.6f}, {lon_deg:.6f}, {alt_amsl_m:g} m"


def follow_track(controller: VehicleController, track: FlyTrack) -> Iterator[str]:
    """Fly along a track, and be done at its end, behind which the vehicle may fly on."""
    situation, setpoints = controller.situation, controller.setpoints
    guided_mode, circles = situation.autopilot.guided_mode, situation.autopilot.circles
    yield from until_position_known(controller)
    yield from until_lift_off_known(controller)
    while True:
        expect_flying(controller)
        setpoints.follow(track.places, track.beyond, track.alt_amsl_m, track.speed_mps)
        if controller.state.mode != guided_mode:
            yield enter_guided_mode(controller)
            continue
        controller.modes.allow(guided_mode)
        if circles:
            controller.commands.request_speed()
        left_m = setpoints.left_m
        if left_m <= 0.0:
            return
        situation.expect_progress(setpoints.target, left_m)
        yield f"flying a track of {len(track.places)} places at {track.alt_amsl_m:g} m"


def climb_on_the_spot(controller: VehicleController, alt_amsl_m: float) -> Iterator[str]:
    """Bring a vehicle to its altitude before it flies across the altitudes of others."""
    yield from until_position_known(controller)
    yield from until_lift_off_known(controller)
    state = controller.state
    if abs(state.alt_amsl_m - alt_amsl_m) > controller.situation.alt_tolerance_m:
        yield from fly_to(controller, state.lat_deg, state.lon_deg, alt_amsl_m, math.inf)


def enter_guided_mode(controller: VehicleController, from_mode: str | None = None) -> str:
    """Bring a vehicle in the air into its guided mode, and return what that waits for."""
    situation, modes = controller.situation, controller.modes
    autopilot = situation.autopilot
    if controller.state.mode != from_mode:
        modes.check()
    rising = controller.state.mode == autopilot.take_off_mode
    others = end_of_climb(controller) if rising else ()
    if autopilot.streams_setpoints and not controller.setpoints.streamed_for(_STREAM_FIRST_S):
        modes.allow(controller.state.mode, *others)
        return "sending setpoints"
    return modes.change(autopilot.guided_mode, *others, from_mode=from_mode)


def end_of_climb(controller: VehicleController) -> tuple[str, ...]:
    """Return the modes to which a vehicle may change by itself at the top of its take-off.

    Altitudes are above sea level, because home moves. A change further below is a person's.
    """
    situation, autopilot = controller.situation, controller.situation.autopilot
    below_m = situation.take_off_amsl_m - controller.state.alt_amsl_m
    rests = bool(autopilot.take_off_mode) and abs(below_m) <= NEAR_TOP_M
    return (autopilot.resting_mode,) if rests else ()


def stop_at_setpoint(controller: VehicleController, from_mode: str | None) -> Iterator[str]:
    """Stop where the vehicle is now."""
    while controller.state.mode != controller.situation.autopilot.guided_mode:
        yield enter_guided_mode(controller, from_mode)
    here = (controller.state.lat_deg, controller.state.lon_deg)
    yield from fly_to(controller, *here, controller.state.alt_amsl_m, _STAYING_M)
    while not moving_mps(controller) < STANDING_MPS or distance_m(controller, *here) > _STAYING_M:
        expect_flying(controller)
        away = moving_mps(controller) + distance_m(controller, *here)
        controller.situation.expect_progress("stop", away)
        yield "stopping"


def come_down(
    controller: VehicleController, mode: str, reason: str, from_mode: str | None
) -> Iterator[str]:
    """Have a vehicle come down by itself, in a mode of its autopilot; see `Return`."""
    # It comes down without a position too, and does not need one of ours.
    while (
        controller.state.armed
        or controller.state.flying
        or controller.commands.arming
        or not controller.state.settled
    ):
        state = controller.state
        if not state.settled:
            yield "waiting for what stopped its motors"
            continue
        if not state.armed and not state.flying:
            yield "waiting for the effect of arming"
            continue
        if state.mode != mode:
            yield controller.modes.change(mode, from_mode=from_mode)
            continue
        controller.modes.tolerate(mode)
        if state.has_position:
            # It climbs, flies, waits and descends: only standing still is a lack of progress.
            place = (round(state.lat_deg, 5), round(state.lon_deg, 5), round(state.alt_m))
            controller.situation.expect_progress((reason, place), 0.0)
        yield reason


def upload(
    controller: VehicleController, items: tuple[MissionItem, ...]
) -> Generator[str, None, str]:
    """Upload a mission and read it back; return its digest."""
    situation = controller.situation
    while controller.exchange is not None and controller.exchange.result is None:
        yield "waiting for the end of another upload"
    exchange = VerifiedUpload(
        mission_messages(items, situation.target),
        situation.target,
        controller.source,
        autopilot=situation.autopilot,
        timeouts=situation.settings.transfer,
    )
    controller.exchange = exchange
    changes = situation.state.mission_changes
    situation.out += exchange.start(situation.now)
    while exchange.result is None:
        yield f"uploading {len(items)} items"
    if isinstance(exchange.result, Failed):
        changed = ", and the vehicle may hold another mission" if exchange.result.changed else ""
        raise OrderFailedError(exchange.result.reason + changed)
    # Its earlier reports were about another mission.
    situation.state = replace(situation.state, item_current=-1, item_reached=-1, mission_over=False)
    controller.uploaded = mission_digest(exchange.result.items, situation.autopilot)
    controller.mission_read(exchange.result, changes)
    return controller.uploaded


def reads_back(controller: VehicleController, mission: str) -> str | None:
    """Check that the vehicle still has a mission; return what that waits for, None if for nothing.

    Args:
        controller: The controller of the vehicle.
        mission: Digest of the mission.

    Raises:
        TakenOverError: If it has another one.
    """
    held = controller.state.mission
    if held not in (None, mission):
        raise TakenOverError(CHANGED_MISSION)
    return None if held else "reading its mission back"


def follow_mission(
    controller: VehicleController, items: tuple[MissionItem, ...], mission: str
) -> Iterator[str]:
    """Watch a mission that has been started, to its end; `mission` is its digest."""
    last = len(items) - 1
    comes_down = items[last].command in (NAV_RETURN_TO_LAUNCH, NAV_LAND)
    holds_s = [item.param1 for item in items if item.command in _HOLDING_ITEMS]
    longest_s = max((hold_s for hold_s in holds_s if hold_s > 0), default=0.0)
    reached, flown = -1, False
    while True:
        state = controller.state
        flown = flown or state.flying
        if state.item_reached <= max(state.item_current, 0):
            # A report of an item may get lost; the report of the next item implies it.
            reached = max(reached, state.item_reached, state.item_current - 1)
        down = flown and not state.armed
        if down and not state.settled:
            yield "waiting for what stopped its motors"
            continue
        # Its last item lands it: before that, motors that stop end no mission.
        lands = down and comes_down and reached >= last - 1
        if reached >= last or (flown and state.mission_over) or lands:
            if not comes_down or down:
                return
        elif down:
            raise OrderFailedError(f"disarmed at item {state.item_current} of {last}")
        modes = mission_modes(controller, items)
        for mode in modes:
            # A mode that an item sets may still show under the next order.
            controller.modes.announce(mode)
        controller.modes.allow(*modes)
        place = (round(state.lat_deg, 5), round(state.lon_deg, 5), round(state.alt_m))
        stage = (state.item_current, place, state.armed)
        controller.situation.expect_progress(stage, 0.0, patience_s=longest_s)
        reading = reads_back(controller, mission)
        also = f", {reading}" if reading else ""
        yield f"flying item {state.item_current} of {last}{also}"


def mission_modes(
    controller: VehicleController, items: tuple[MissionItem, ...], *, all_items: bool = False
) -> frozenset[str]:
    """Return the modes that the mission sets now, or on its whole way."""
    autopilot, state = controller.situation.autopilot, controller.state
    first, count = (0, len(items)) if all_items else (max(state.item_current, 0), 2)
    modes = {autopilot.mission_mode}
    if state.failsafe in (None, Failsafe.OFFBOARD):
        commands = {item.command for item in items[first : first + count]}
        modes |= {mode for command, mode in autopilot.item_modes.items() if command in commands}
    return frozenset(modes)


def until_position_known(controller: VehicleController) -> Iterator[str]:
    """Wait for a position of the link that is up now."""
    while not (
        controller.state.connected
        and controller.state.has_position
        and has_fresh_position(controller)
    ):
        if controller.state.flying:
            controller.situation.expect_progress("position", 0.0)
        yield "waiting for the vehicle's position" + why_not_ready(controller)


def until_lift_off_known(controller: VehicleController) -> Iterator[str]:
    """Wait for a take-off that an earlier order may have begun; without one it soon disarms."""
    while not controller.state.flying and (controller.state.armed or controller.commands.arming):
        controller.situation.expect_progress("lift-off", 0.0)
        yield "waiting for lift-off or disarming"


def allow_present_mode(controller: VehicleController, order: ArmingOrder) -> None:
    """Allow the mode in which a vehicle is found on the ground, unless a person has chosen it."""
    autopilot, mode = controller.situation.autopilot, controller.state.mode
    if controller.state.flying or controller.state.armed:
        return
    usual_modes = autopilot.boot_modes | autopilot.take_off_modes
    if order.arm and (mode in usual_modes or mode in order.from_modes):
        controller.modes.allow(mode)
    else:
        controller.modes.allow_any()


def until_ready(controller: VehicleController, order: ArmingOrder) -> str | None:
    """Return what keeps a vehicle on the ground from being armed; None if nothing does."""
    state, autopilot = controller.state, controller.situation.autopilot
    if state.armed:
        return None
    if autopilot.mode_is_checked and state.mode != autopilot.resting_mode:
        return rest(controller)
    return None if state.ready else "waiting for the autopilot's checks" + why_not_ready(controller)


def rest(controller: VehicleController) -> str:
    """Bring a vehicle on the ground into its resting mode, or wait until a person does."""
    modes, resting_mode = controller.modes, controller.situation.autopilot.resting_mode
    mode = controller.state.mode
    if modes.allowed is not None and mode in modes.allowed:
        return modes.change(resting_mode)
    return f"waiting for {resting_mode}: it is in {mode}"


def until_take_off(controller: VehicleController, order: ArmingOrder) -> str | None:
    """Prepare a vehicle to take off; return what it is waiting for, None if it can."""
    if controller.commands.disarmed_itself:
        texts = controller.situation.recent_texts()
        raise OrderFailedError(f"it disarmed itself: its take-off was lost{texts}", final=True)
    if controller.commands.disarmed_again:
        raise TakenOverError("disarmed on the ground")
    if controller.state.armed and order.arm and not controller.commands.arms:
        raise TakenOverError(f"armed by somebody else, in {controller.state.mode}")
    waiting = until_ready(controller, order)
    if waiting:
        return waiting
    state, modes, autopilot = controller.state, controller.modes, controller.situation.autopilot
    if state.mode not in autopilot.take_off_modes:
        return rest(controller)
    if state.armed:
        modes.allow(*autopilot.take_off_modes)
        return None
    if order.arm:
        modes.allow(*autopilot.take_off_modes)
        return controller.commands.send_long(ARM_DISARM, "arming", 1.0)
    modes.allow_any()
    return "waiting for somebody to arm it"


def why_not_ready(controller: VehicleController) -> str:
    """Return, as an appendix in brackets, why the vehicle is not ready if it has reported why."""
    return f" ({controller.state.unready})" if controller.state.unready else ""


def has_fresh_position(controller: VehicleController) -> bool:
    """Whether the position has come recently."""
    situation = controller.situation
    return situation.now - situation.state.position_s < situation.settings.link_timeout_s


def moving_mps(controller: VehicleController) -> float:
    """Return the speed of the vehicle, up and down included; NaN if it is not known."""
    return math.hypot(controller.state.speed_mps, controller.state.climb_mps)


def distance_m(controller: VehicleController, lat_deg: float, lon_deg: float) -> float:
    """Return the horizontal distance to a place, exact enough near to it."""
    here = (controller.state.lat_deg, controller.state.lon_deg)
    return math.hypot(*offset_m((lat_deg, lon_deg), here))


def expect_flying(controller: VehicleController) -> None:
    """Raise an `OrderFailedError` if the vehicle is not in the air."""
    if not controller.state.flying:
        texts = controller.situation.recent_texts()
        raise OrderFailedError("the vehicle is not in the air" + texts)
