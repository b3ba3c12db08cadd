# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The steps of orders; each yields, or returns, what it is waiting for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.commands import ARM_DISARM, OrderFailedError, TakenOverError
from dsse_ros.flight.item_messages import mission_messages
from dsse_ros.flight.transfer import Failed
from dsse_ros.flight.upload import VerifiedUpload
from dsse_ros.mission_items.items import (
    NAV_LAND,
    NAV_LOITER_TIME,
    NAV_RETURN_TO_LAUNCH,
    NAV_WAYPOINT,
    MissionItem,
)
from dsse_ros.scenario.geodesy import offset_m

if TYPE_CHECKING:
    from dsse_ros.flight.orders import FlyMission, FlyTrack, MakeReady, TakeOff
    from dsse_ros.flight.vehicle_controller import VehicleController

    ArmingOrder: TypeAlias = MakeReady | TakeOff | FlyMission

STANDING_MPS = 1.0
NEAR_TOP_M = 3.0
"""Tolerance for the end of a climb: positions are late, and altitudes drift."""
_STAYING_M = 5.0
_STREAM_FIRST_S = 1.0
_HOLDING_ITEMS = (NAV_WAYPOINT, NAV_LOITER_TIME, mavlink.MAV_CMD_NAV_DELAY)


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


def enter_guided_mode(controller: VehicleController) -> str:
    """Bring a vehicle in the air into its guided mode, and return what that waits for."""
    situation, modes = controller.situation, controller.modes
    autopilot = situation.autopilot
    modes.check()
    rising = bool(autopilot.take_off_mode) and controller.state.mode == autopilot.take_off_mode
    others = end_of_climb(controller) if rising else ()
    if autopilot.streams_setpoints and not controller.setpoints.streamed_for(_STREAM_FIRST_S):
        modes.allow(controller.state.mode, *others)
        return "sending setpoints"
    return modes.change(autopilot.guided_mode, *others)


def end_of_climb(controller: VehicleController) -> tuple[str, ...]:
    """Return the modes to which a vehicle may change by itself at the top of its take-off.

    Altitudes are above sea level, because home moves. A change further below is a person's.
    """
    situation, autopilot = controller.situation, controller.situation.autopilot
    below_m = situation.take_off_amsl_m - controller.state.alt_amsl_m
    rests = bool(autopilot.take_off_mode) and abs(below_m) <= NEAR_TOP_M
    return (autopilot.resting_mode,) if rests else ()


def stop_at_setpoint(controller: VehicleController) -> Iterator[str]:
    """Stop where the vehicle is now."""
    while controller.state.mode != controller.situation.autopilot.guided_mode:
        yield enter_guided_mode(controller)
    here = (controller.state.lat_deg, controller.state.lon_deg)
    yield from fly_to(controller, *here, controller.state.alt_amsl_m, _STAYING_M)
    while not moving_mps(controller) < STANDING_MPS or distance_m(controller, *here) > _STAYING_M:
        expect_flying(controller)
        away = moving_mps(controller) + distance_m(controller, *here)
        controller.situation.expect_progress("stop", away)
        yield "stopping"


def come_down(
    controller: VehicleController, mode: str, reason: str, from_mode: str
) -> Iterator[str]:
    """Have a vehicle come down by itself, in a mode of its autopilot; see `Return`."""
    # It comes down without a position too, and does not need one of ours.
    while controller.state.armed or controller.state.flying or controller.commands.arming:
        state = controller.state
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


def upload(controller: VehicleController, items: tuple[MissionItem, ...]) -> Iterator[str]:
    """Upload a mission and read it back."""
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
    situation.out += exchange.start(situation.now)
    while exchange.result is None:
        yield f"uploading {len(items)} items"
    if isinstance(exchange.result, Failed):
        changed = ", and the vehicle may hold another mission" if exchange.result.changed else ""
        raise OrderFailedError(exchange.result.reason + changed)
    # Its earlier reports were about another mission.
    situation.state = replace(situation.state, item_current=-1, item_reached=-1, mission_over=False)


def follow_mission(controller: VehicleController, items: tuple[MissionItem, ...]) -> Iterator[str]:
    """Watch a mission that has been started, to its end."""
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
        if reached >= last or (flown and state.mission_over) or (down and comes_down):
            if not comes_down or down:
                return
        elif down:
            raise OrderFailedError(f"disarmed at item {state.item_current} of {last}")
        modes = mission_modes(controller, items)
        for mode in modes:
            # A mode that an item sets may still show under the next order.
            controller.modes.announce(mode)
        controller.modes.allow(*modes)
        if flown and state.mode == controller.situation.autopilot.mission_mode:
            controller.commands.request_speed()
        place = (round(state.lat_deg, 5), round(state.lon_deg, 5), round(state.alt_m))
        stage = (state.item_current, place, state.armed)
        controller.situation.expect_progress(stage, 0.0, patience_s=longest_s)
        yield f"flying item {state.item_current} of {last}"


def mission_modes(
    controller: VehicleController, items: tuple[MissionItem, ...], *, all_items: bool = False
) -> frozenset[str]:
    """Return the modes that the mission sets now, or on its whole way."""
    autopilot, state = controller.situation.autopilot, controller.state
    first, count = (0, len(items)) if all_items else (max(state.item_current, 0), 2)
    modes = {autopilot.mission_mode}
    if state.failsafe in ("", "offboard"):
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


def until_ready(controller: VehicleController, order: ArmingOrder) -> str:
    """Return what keeps a vehicle on the ground from being armed, empty if nothing does."""
    state, autopilot = controller.state, controller.situation.autopilot
    if state.armed:
        return ""
    if autopilot.mode_is_checked and state.mode != autopilot.resting_mode:
        return rest(controller)
    return "" if state.ready else "waiting for the autopilot's checks" + why_not_ready(controller)


def rest(controller: VehicleController) -> str:
    """Bring a vehicle on the ground into its resting mode, or wait until a person does."""
    modes, resting_mode = controller.modes, controller.situation.autopilot.resting_mode
    mode = controller.state.mode
    if modes.allowed is not None and mode in modes.allowed:
        return modes.change(resting_mode)
    return f"waiting for {resting_mode}: it is in {mode}"


def until_take_off(controller: VehicleController, order: ArmingOrder) -> str:
    """Prepare a vehicle to take off; return what it is waiting for, empty if it can."""
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
        return ""
    if order.arm:
        modes.allow(*autopilot.take_off_modes)
        return controller.commands.send_long(ARM_DISARM, "arming", 1.0)
    modes.allow_any()
    return "waiting for somebody to arm it"


def why_not_ready(controller: VehicleController) -> str:
    """Return in brackets why the vehicle is not ready; empty if it has not reported why."""
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
