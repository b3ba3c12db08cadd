# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The orders to a vehicle, and how each is carried out.

Altitudes are metres above mean sea level, so a home that moves does not change them. An order is
carried out by a generator that yields what it is waiting for: see `Order.carry_out`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.checks import check_number
from dsse_ros.flight.commands import MISSION_START, OrderFailedError
from dsse_ros.flight.item_messages import mission_messages
from dsse_ros.flight.order_steps import (
    STANDING_MPS,
    allow_present_mode,
    climb_on_the_spot,
    come_down,
    distance_m,
    end_of_climb,
    expect_flying,
    fly_to,
    follow_mission,
    follow_track,
    mission_modes,
    moving_mps,
    stop_at_setpoint,
    until_lift_off_known,
    until_position_known,
    until_ready,
    until_take_off,
    upload,
)
from dsse_ros.flight.paced_setpoint import Place
from dsse_ros.flight.vehicle_controller import Order, VehicleController
from dsse_ros.mavlink.messages import MissionSetCurrent
from dsse_ros.mission_items.items import MissionItem

NAV_TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF

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
    """Stop and stay in the air."""

    def carry_out(self, controller: VehicleController) -> Iterator[str]:
        """See `Order`."""
        autopilot, modes = controller.situation.autopilot, controller.modes
        yield from until_position_known(controller)
        yield from until_lift_off_known(controller)
        if not controller.state.flying:
            return
        if autopilot.resting_mode == autopilot.guided_mode:
            yield from stop_at_setpoint(controller)
            return
        while not modes.resting or not (autopilot.circles or moving_mps(controller) < STANDING_MPS):
            if not modes.resting:
                yield modes.change(autopilot.resting_mode)
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
        from_mode: Mode that somebody else may have set, and that an operator takes it from; empty
            if it is ours.
    """

    from_mode: str = ""

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

    from_mode: str = ""

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
        yield from upload(controller, self.items)
        while controller.state.item_current != first:
            command = MissionSetCurrent(*controller.situation.target, first)
            yield controller.commands.send(command, "going back to the first item")
        # A short one may be over before its mode is seen.
        while not controller.state.armed or (
            controller.state.mode != mission_mode and controller.state.item_current <= first
        ):
            if controller.state.flying:
                waiting = modes.change(mission_mode)
                modes.allow(
                    controller.state.mode, *mission_modes(controller, self.items, all_items=True)
                )
                yield waiting
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
        yield from follow_mission(controller, self.items)


def _check_place(lat_deg: float, lon_deg: float, alt_amsl_m: float, radius_m: float) -> None:
    check_number("lat_deg", lat_deg, -90, 90)
    check_number("lon_deg", lon_deg, -180, 180)
    check_number("alt_amsl_m", alt_amsl_m, -_MAX_ALT_M, _MAX_ALT_M)
    check_number("radius_m", radius_m, 0, 1e6, exclusive=True)
