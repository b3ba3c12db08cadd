# SPDX-License-Identifier: Apache-2.0
"""How orders are carried out: generators that yield what they wait for, and end when it is done."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.helm import (
    ARM_DISARM,
    MISSION_START,
    Helm,
    NotOursError,
    OrderFailedError,
)
from dsse_ros.flight.mavlink_messages import MissionSetCurrent
from dsse_ros.flight.mission_messages import Address, WireItem
from dsse_ros.flight.orders import FlyMission, GoTo, Hold, Land, Order, Return, Search, TakeOff
from dsse_ros.flight.transfer import Failed
from dsse_ros.flight.upload import VerifiedUpload

Maneuver = Iterator[str]

NAV_WAYPOINT = mavlink.MAV_CMD_NAV_WAYPOINT
NAV_LOITER_TIME = mavlink.MAV_CMD_NAV_LOITER_TIME
NAV_DELAY = mavlink.MAV_CMD_NAV_DELAY
NAV_RETURN_TO_LAUNCH = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
NAV_LAND = mavlink.MAV_CMD_NAV_LAND
NAV_TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF

_STANDING_MPS = 1.0
_STAYING_M = 5.0
_STREAM_FIRST_S = 1.0
_SEARCH_ALT_M = 1.0
"""Difference in altitude at which the hold of a search begins."""
_LIFT_OFF_S = 4.0
"""Motors spool up, and the vehicle looks whether it has left the ground."""


def maneuver(helm: Helm, order: Order, source: Address) -> Maneuver:
    """Return how an order is carried out.

    It is advanced whenever something was heard and now and then besides; it raises
    `OrderFailedError` or `NotOursError`.
    """
    match order:
        case TakeOff(alt_m):
            return _take_off(helm, alt_m)
        case GoTo():
            return _go_to(helm, order.lat_deg, order.lon_deg, order.alt_m, order.radius_m)
        case Search():
            return _search(helm, order)
        case Hold():
            return _hold(helm)
        case Return():
            return _come_down(helm, "RTL", "returns")
        case Land():
            return _come_down(helm, "LAND", "lands")
        case FlyMission(items):
            return _fly_mission(helm, items, source)


def _take_off(helm: Helm, alt_m: float) -> Maneuver:
    yield from _until_known(helm)
    if helm.state.flying:
        yield from _go_to(helm, helm.state.lat_deg, helm.state.lon_deg, alt_m, math.inf)
        return
    helm.set_point = None
    while not helm.state.flying:
        waiting = _ready_for_take_off(helm)
        if waiting:
            yield waiting
            continue
        if helm.px4:
            helm.expect_mode("TAKEOFF")
        parameters = _take_off_parameters(helm, alt_m)
        yield helm.command(NAV_TAKEOFF, "takes off", *parameters, takes_s=_LIFT_OFF_S)
    while abs(helm.state.alt_m - alt_m) > helm.settings.alt_tolerance_m:
        _expect_flying(helm)
        helm.expect_nearer("climb", abs(helm.state.alt_m - alt_m))
        yield f"climbs to {alt_m:g} m"


def _go_to(
    helm: Helm,
    lat_deg: float,
    lon_deg: float,
    alt_m: float,
    radius_m: float,
    alt_tolerance_m: float = math.inf,
) -> Maneuver:
    alt_tolerance_m = min(alt_tolerance_m, helm.settings.alt_tolerance_m)
    yield from _until_known(helm)
    yield from _until_up_or_not(helm)
    place = f"flies to {lat_deg:.6f}, {lon_deg:.6f}, {alt_m:g} m"
    while True:
        _expect_flying(helm)
        helm.aim(lat_deg, lon_deg, alt_m)
        if helm.state.mode != helm.guided:
            yield _guide(helm)
            continue
        helm.claim(helm.guided)
        if helm.confirmed and not helm.px4:
            helm.keep_speed()
        away_m = helm.distance_m(lat_deg, lon_deg) if math.isfinite(radius_m) else 0.0
        above_m = abs(helm.state.alt_m - alt_m)
        there = away_m <= radius_m and above_m <= alt_tolerance_m
        if there and helm.confirmed and _saw_position(helm):
            return
        helm.expect_nearer(helm.set_point, max(away_m - radius_m, 0.0) + above_m)
        yield place


def _search(helm: Helm, order: Search) -> Maneuver:
    place = (order.lat_deg, order.lon_deg)
    yield from _go_to(helm, *place, order.alt_m, order.radius_m)
    yield from _go_to(helm, *place, order.search_alt_m, order.radius_m, _SEARCH_ALT_M)
    since_s = helm.state.boot_s
    while helm.state.boot_s - since_s < order.hold_s:
        _expect_flying(helm)
        # A clock that has gone back began anew.
        since_s = min(since_s, helm.state.boot_s)
        helm.expect_nearer("hold", -helm.state.boot_s)
        yield f"holds at {order.search_alt_m:g} m for {order.hold_s:g} s"
    yield from _go_to(helm, *place, order.alt_m, order.radius_m)


def _hold(helm: Helm) -> Maneuver:
    yield from _until_known(helm)
    yield from _until_up_or_not(helm)
    if not helm.state.flying:
        return
    if helm.px4:
        while not helm.rests or not _moving_mps(helm) < _STANDING_MPS:
            if not helm.rests:
                _expect_ours(helm)
                yield helm.set_mode("HOLD")
                continue
            helm.set_point = None
            helm.claim("HOLD")
            helm.expect_nearer("stop", _moving_mps(helm))
            yield "comes to a stop"
        helm.set_point = None
        return
    while helm.state.mode != helm.guided:
        yield _guide(helm)
    here = (helm.state.lat_deg, helm.state.lon_deg)
    yield from _go_to(helm, *here, helm.state.alt_m, _STAYING_M)
    while not _moving_mps(helm) < _STANDING_MPS or helm.distance_m(*here) > _STAYING_M:
        _expect_flying(helm)
        helm.expect_nearer("stop", _moving_mps(helm) + helm.distance_m(*here))
        yield "comes to a stop"


def _come_down(helm: Helm, mode: str, what: str) -> Maneuver:
    yield from _until_known(helm)
    while helm.state.armed or helm.state.flying or helm.arming:
        state = helm.state
        if not state.armed and not state.flying:
            yield "waits whether it has been armed"
            continue
        if state.mode != mode:
            _expect_ours(helm)
            yield helm.set_mode(mode)
            continue
        helm.claim(mode)
        helm.set_point = None
        # It climbs, flies, waits and descends: nothing but standing still is no progress.
        place = (round(state.lat_deg, 5), round(state.lon_deg, 5), round(state.alt_m))
        helm.expect_nearer((what, place), 0.0)
        yield what
    helm.set_point = None


def _fly_mission(helm: Helm, items: tuple[WireItem, ...], source: Address) -> Maneuver:
    first = 0 if helm.px4 else 1
    if len(items) <= first:
        raise OrderFailedError("the mission has no item but home")
    yield from _until_known(helm)
    # Items that are changed while they are flown leave the vehicle with neither mission.
    while helm.state.flying and helm.state.mode != helm.resting:
        _expect_ours(helm)
        yield helm.set_mode(helm.resting)
    helm.set_point = None
    yield from _upload(helm, items, source)
    while helm.state.item_current != first:
        yield helm.ask(MissionSetCurrent(helm.target, first), "goes back to the first item")
    # A short one may be over before its mode is seen.
    while not helm.state.armed or (
        helm.state.mode != helm.running and helm.state.item_current <= first
    ):
        if helm.state.flying:
            _expect_ours(helm)
            waiting = helm.set_mode(helm.running)
            helm.claim(helm.state.mode, *_mission_modes(helm, items, whole=True))
            yield waiting
            continue
        waiting = _ready_for_take_off(helm)
        if waiting:
            yield waiting
        elif helm.px4:
            yield helm.set_mode(helm.running)
        else:
            helm.expect_mode(helm.running)
            helm.claim(helm.guided, helm.running)
            yield helm.command(MISSION_START, "starts the mission", takes_s=_LIFT_OFF_S)
    yield from _follow_mission(helm, items)


def _upload(helm: Helm, items: tuple[WireItem, ...], source: Address) -> Maneuver:
    while helm.exchange is not None and helm.exchange.result is None:
        yield "waits for the end of another upload"
    exchange = VerifiedUpload(
        items,
        helm.target,
        source,
        dialect=helm.settings.dialect,
        timeouts=helm.settings.transfer,
    )
    helm.exchange = exchange
    helm.out += exchange.start(helm.now)
    while exchange.result is None:
        yield f"uploads {len(items)} items"
    if isinstance(exchange.result, Failed):
        changed = ", and the vehicle may hold another mission" if exchange.result.changed else ""
        raise OrderFailedError(exchange.result.reason + changed)
    # What it has said before was about another mission.
    helm.state = replace(helm.state, item_current=-1, item_reached=-1, mission_over=False)


def _follow_mission(helm: Helm, items: tuple[WireItem, ...]) -> Maneuver:
    last = len(items) - 1
    comes_down = items[last].command in (NAV_RETURN_TO_LAUNCH, NAV_LAND)
    longest_s = max((i.param1 for i in items if i.command in _WAITS and i.param1 > 0), default=0.0)
    reached, flown = -1, False
    while True:
        state = helm.state
        flown = flown or state.flying
        if state.item_reached <= max(state.item_current, 0):
            # Reports of an item may get lost, but not for ever: the next one tells as much.
            reached = max(reached, state.item_reached, state.item_current - 1)
        down = flown and not state.armed
        if reached >= last or (flown and state.mission_over) or (down and comes_down):
            if not comes_down or down:
                return
        elif down:
            raise OrderFailedError(f"disarmed at item {state.item_current} of {last}")
        helm.claim(*_mission_modes(helm, items))
        if flown and state.mode == helm.running:
            helm.keep_speed()
        place = (round(state.lat_deg, 5), round(state.lon_deg, 5), round(state.alt_m))
        stage = (state.item_current, place, state.armed)
        helm.expect_nearer(stage, 0.0, patience_s=longest_s)
        yield f"flies item {state.item_current} of {last}"


_WAITS = (NAV_WAYPOINT, NAV_LOITER_TIME, NAV_DELAY)


def _mission_modes(
    helm: Helm, items: tuple[WireItem, ...], *, whole: bool = False
) -> frozenset[str]:
    """Return the modes that come about by flying the mission, now or to its end."""
    first, count = (0, len(items)) if whole else (max(helm.state.item_current, 0), 2)
    modes = {helm.running}
    if helm.px4 and helm.state.failsafe in ("", "offboard"):
        commands = {item.command for item in items[first : first + count]}
        if NAV_RETURN_TO_LAUNCH in commands:
            modes.add("RTL")
        if NAV_LAND in commands:
            modes.add("LAND")
    return frozenset(modes)


# Steps that they have in common.


def _until_known(helm: Helm) -> Maneuver:
    while not (helm.state.connected and helm.state.has_position and _saw_position(helm)):
        if helm.state.flying:
            helm.expect_nearer("position", 0.0)
        yield "waits for the vehicle's position" + _unready(helm)


def _until_up_or_not(helm: Helm) -> Maneuver:
    """Wait for what an earlier order may have begun; if nothing, it soon disarms itself."""
    while not helm.state.flying and (helm.state.armed or helm.arming):
        helm.expect_nearer("lift-off", 0.0)
        yield "waits whether it takes off"


def _saw_position(helm: Helm) -> bool:
    """Whether the position is one of the link that is up now."""
    return helm.now - helm.state.position_s < helm.settings.link_timeout_s


def _moving_mps(helm: Helm) -> float:
    return math.hypot(helm.state.speed_mps, helm.state.climb_mps)


def _expect_flying(helm: Helm) -> None:
    if not helm.state.flying:
        raise OrderFailedError("the vehicle is not in the air" + helm.said_lately())


def _expect_ours(helm: Helm) -> None:
    mode = helm.state.mode
    if mode not in (helm.own_modes or helm.handed_over):
        raise NotOursError(mode)


def _guide(helm: Helm) -> str:
    """Have it take set-points."""
    _expect_ours(helm)
    if helm.px4 and helm.state.mode == "TAKEOFF":
        # Let it finish: a set-point would end the climb.
        helm.expect_nearer("take-off", -helm.state.alt_m)
        return "takes off"
    if helm.px4 and not helm.streaming_for(_STREAM_FIRST_S):
        return "sends set-points"
    return helm.set_mode(helm.guided)


def _ready_for_take_off(helm: Helm) -> str:
    """Bring it to where it can take off, and return what that waits for, empty if nothing."""
    state, arm = helm.state, helm.settings.arm
    good_modes = helm.handed_over | {"TAKEOFF"} if helm.px4 else helm.handed_over
    if helm.px4 and not state.armed and state.mode != helm.resting:
        # Its checks are those of its mode, and in OFFBOARD without setpoints they fail.
        if arm or (helm.own_modes is not None and state.mode in helm.own_modes):
            return helm.set_mode(helm.resting)
        return f"waits for {helm.resting}: it is in {state.mode}"
    if not state.armed and not state.ready:
        return "waits until it is ready" + _unready(helm)
    if state.mode not in good_modes:
        if arm and not state.armed:
            return helm.set_mode(helm.resting)
        if helm.own_modes is not None and state.mode in helm.own_modes:
            return helm.set_mode(helm.resting)
        return f"waits for {helm.resting}: it is in {state.mode}"
    helm.claim(*good_modes)
    if not state.armed:
        if arm:
            return helm.command(ARM_DISARM, "arms", 1.0)
        helm.own_modes = None
        return "waits for somebody to arm it"
    return ""


def _unready(helm: Helm) -> str:
    return f" ({helm.state.unready})" if helm.state.unready else ""


def _take_off_parameters(helm: Helm, alt_m: float) -> tuple[float, ...]:
    if not helm.px4:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, alt_m)
    # Above the sea, whatever is said; where it stands, and its nose as it is.
    alt_amsl_m = helm.state.alt_amsl_m - helm.state.alt_m + alt_m
    return (0.0, 0.0, 0.0, math.nan, math.nan, math.nan, alt_amsl_m)
