# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nothing is sent to a place where a vehicle may not be."""

import dataclasses
import itertools
import math

import pymap3d
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mission_strategies import ITEMS

from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.vehicles.fleet.fence import (
    Fence,
    check_item,
    check_mission,
    check_place,
    check_search,
    check_take_off,
)
from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, Home, MissionItem, VehicleMission
from dsse_ros.vehicles.mission_items.track_missions import TrackStyle, track_mission
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import geodetic_to_map, map_to_geodetic

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 120.0)
SIDE_M = 2600.0
MARGIN_M = 200.0
FENCE = Fence(FRAME, MARGIN_M, min_amsl_m=10.0, max_amsl_m=120.0)
COMMANDS = st.sampled_from([16, 22])
INSIDE_M = st.floats(-MARGIN_M + 0.1, SIDE_M + MARGIN_M - 0.1)
FAR_M = st.floats(MARGIN_M + 0.1, 4e5)


def waypoint(x_m=1300.0, y_m=1300.0, **values):
    lat_deg, lon_deg, _ = map_to_geodetic(FRAME, x_m, y_m, 0.0)
    known = {"command": 16, "frame": 0, "param4": math.nan, "alt_m": 120.0}
    return MissionItem(**{**known, "lat_deg": lat_deg, "lon_deg": lon_deg, **values})


def code(item, fence=FENCE):
    checked = check_item(item, fence)
    return checked.code if isinstance(checked, Rejected) else None


@given(INSIDE_M, INSIDE_M, st.floats(10, 120), COMMANDS)
def test_an_item_inside_is_accepted(x_m, y_m, alt_m, command):
    item = waypoint(x_m, y_m, alt_m=alt_m, command=command)
    assert check_item(item, FENCE) == Accepted(item)
    assert check_place(item.lat_deg, item.lon_deg, alt_m, FENCE) == Accepted(
        (item.lat_deg, item.lon_deg, alt_m)
    )


@given(FAR_M, st.floats(-4e5, 4e5), st.booleans(), st.booleans(), COMMANDS)
def test_an_item_outside_is_refused(beyond_m, along_m, low, swap, command):
    across_m = -beyond_m if low else SIDE_M + beyond_m
    x_m, y_m = (along_m, across_m) if swap else (across_m, along_m)
    item = waypoint(x_m, y_m, command=command)
    assert code(item) == "outside_fence"
    checked = check_place(item.lat_deg, item.lon_deg, 120.0, FENCE)
    assert isinstance(checked, Rejected) and checked.code == "outside_fence"


@given(st.floats(-90, 90), st.floats(-180, 180))
def test_all_the_rest_of_the_earth_is_outside(lat_deg, lon_deg):
    assume(abs(lat_deg + 24.03) > 0.02 or abs(lon_deg + 46.16) > 0.03)
    assert code(waypoint(lat_deg=lat_deg, lon_deg=lon_deg)) == "outside_fence"


@pytest.mark.slow
@given(st.integers(0, 19), st.integers(0, 19))
def test_no_vehicle_is_sent_over_a_cell_outside_the_area_but_may_take_off_there(col, row):
    area = tuple("1" * row_of + "0" * (20 - row_of) for row_of in range(20))
    fence = dataclasses.replace(FENCE, area=area)
    x_m, y_m = (col + 0.5) * 130.0, (19 - row + 0.5) * 130.0
    item = waypoint(x_m, y_m)
    place = (item.lat_deg, item.lon_deg, 120.0)
    wanted = None if col < row else "outside_fence"
    assert code(item, fence) == wanted
    checked = check_place(*place, fence)
    assert (checked.code if isinstance(checked, Rejected) else None) == wanted
    assert check_take_off(*place, fence) == Accepted(place)
    assert code(waypoint(x_m, y_m, command=22), fence) is None


def test_the_place_straight_through_the_earth_is_outside():
    origin = (FRAME.origin_lat_deg, FRAME.origin_lon_deg, FRAME.origin_alt_m)
    up_m, alt_m = -12.7e6, 0.0
    for _ in range(20):
        up_m += alt_m
        lat_deg, lon_deg, alt_m = pymap3d.enu2geodetic(1300.0, 1300.0, up_m, *origin)
    x_m, y_m, _ = geodetic_to_map(FRAME, lat_deg, lon_deg, 0.0)
    assert (x_m, y_m) == pytest.approx((1300.0, 1300.0), abs=1e-2)
    assert code(waypoint(lat_deg=lat_deg, lon_deg=lon_deg)) == "outside_fence"


@given(st.floats(-1e9, 9.99) | st.floats(120.01, 1e9))
def test_an_item_too_high_or_too_low_is_refused(alt_m):
    assert code(waypoint(alt_m=alt_m)) == "altitude"
    assert code(waypoint(alt_m=alt_m, command=22)) == "altitude"


@given(
    st.sampled_from(["param1", "param2", "param3", "lat_deg", "lon_deg", "alt_m"]),
    st.sampled_from([math.nan, math.inf, -math.inf]),
    COMMANDS,
)
def test_what_is_not_finite_is_refused(field, value, command):
    item = dataclasses.replace(waypoint(command=command), **{field: value})
    assert code(item) == "not_finite"


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_an_open_yaw_is_nan_and_nothing_else(value):
    assert code(waypoint(param4=value)) == "not_finite"
    assert code(MissionItem(20, FRAME_MISSION, param4=math.nan)) == "not_finite"


@pytest.mark.parametrize(
    ("field", "value"), [("lat_deg", 100.0), ("lat_deg", -90.01), ("lon_deg", 313.83)]
)
def test_a_place_that_is_not_on_the_earth_is_refused(field, value):
    assert code(dataclasses.replace(waypoint(), **{field: value})) == "not_on_earth"


@given(st.integers(1, 255), COMMANDS)
def test_an_altitude_above_anything_but_the_sea_is_refused(frame, command):
    assert code(waypoint(frame=frame, command=command)) == "unknown_frame"


@given(st.integers(0, 65535).filter(lambda command: command not in (16, 20, 22, 178)))
def test_a_command_that_is_never_sent_is_refused(command):
    assert code(waypoint(command=command, param4=0.0)) == "unknown_command"


def test_a_parameter_that_no_command_has_is_refused():
    assert code(waypoint(param1=1e7)) == "bad_parameter"


def test_a_return_needs_no_place():
    assert code(MissionItem(20, FRAME_MISSION)) is None
    assert code(MissionItem(20, 0)) == code(MissionItem(20, 7)) == "unknown_frame"


@given(
    ITEMS, st.sampled_from([16, 20, 22]), st.sampled_from([0, 2]), INSIDE_M, INSIDE_M,
    st.floats(-50, 200),
)  # fmt: skip
def test_what_is_accepted_can_be_flown_and_what_can_be_flown_is_accepted(
    item, command, frame, x_m, y_m, alt_m
):
    lat_deg, lon_deg, _ = map_to_geodetic(FRAME, x_m, y_m, 0.0)
    near = dataclasses.replace(
        item, command=command, frame=frame, param4=0.0, lat_deg=lat_deg, lon_deg=lon_deg,
        alt_m=alt_m,
    )  # fmt: skip
    fits = frame == 2 if command == 20 else frame == 0 and 10.0 <= alt_m <= 120.0
    assert (code(near) is None) == fits


def test_a_mission_is_refused_by_its_first_bad_item():
    mission = track_mission(FRAME, [(0, 0), (1, 0)], style=TrackStyle(datum_amsl_m=0.0))
    items = [*mission.numbered(home_first=True), waypoint(9000.0), waypoint(alt_m=500.0)]
    checked = check_mission(items, FENCE, home_first=True)
    assert isinstance(checked, Rejected)
    assert checked.code == "outside_fence" and checked.reason.startswith("item 5: ")


def test_home_is_checked_where_a_mission_has_it_and_nowhere_else():
    items = track_mission(FRAME, [(0, 0)], style=TrackStyle(datum_amsl_m=0.0)).numbered(
        home_first=True
    )
    assert check_mission(items, FENCE, home_first=True) == Accepted(tuple(items))
    without = check_mission(items, FENCE, home_first=False)
    # Home is on the ground.
    assert isinstance(without, Rejected) and without.reason.startswith("item 0: altitude must be")
    far = VehicleMission(Home(0.0, 0.0, 0.0), tuple(items[1:])).numbered(home_first=True)
    for spoilt, wanted in (
        (far, "outside_fence"),
        (items[1:], "unknown_command"),
        ([waypoint(frame=3), *items[1:]], "unknown_frame"),
        ([dataclasses.replace(items[0], lat_deg=math.nan), *items[1:]], "not_finite"),
    ):
        checked = check_mission(spoilt, FENCE, home_first=True)
        assert isinstance(checked, Rejected) and checked.code == wanted
        assert checked.reason.startswith("item 0: ") and "None" not in checked.reason


NOWHERE = dataclasses.replace(FENCE, area=("0" * 20,) * 20)


@pytest.mark.parametrize(
    ("item", "wanted", "reason"),
    [
        (
            waypoint(command=17, param4=0.0),
            "unknown_command",
            "command must be take-off, speed, waypoint or return, got 17",
        ),
        (waypoint(frame=3), "unknown_frame", "frame must be 0, above the sea, got 3"),
        (waypoint(param1=math.nan), "not_finite", "param1 must be a finite number, got nan"),
        (waypoint(param2=2e6), "bad_parameter", "param2 must be -1e+06 to 1e+06, got 2000000.0"),
        (waypoint(lat_deg=math.inf), "not_finite", "lat_deg must be a finite number, got inf"),
        (waypoint(lat_deg=91.0), "not_on_earth", "lat_deg must be -90 to 90, got 91.0"),
        (waypoint(lon_deg=180.5), "not_on_earth", "lon_deg must be -180 to 180, got 180.5"),
        (
            waypoint(alt_m=121.0),
            "altitude",
            "altitude must be 10 to 120 m above the sea, got 121.0",
        ),
        (
            waypoint(lat_deg=0.0, lon_deg=0.0),
            "outside_fence",
            "place must be within 200 m of the search area, got (0.0000000, 0.0000000)",
        ),
    ],
)
def test_a_refusal_says_the_field_its_value_and_what_is_allowed(item, wanted, reason):
    assert check_item(item, FENCE) == Rejected(wanted, reason)


def test_a_cell_outside_the_area_is_refused_by_its_place_and_its_column_and_row():
    item = waypoint(1235.0, 1235.0)
    assert check_item(item, NOWHERE) == Rejected(
        "outside_fence",
        "place must be in a cell of the area that is searched, got "
        f"({item.lat_deg:.7f}, {item.lon_deg:.7f}) in cell [9, 10]",
    )


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("index", range(3))
def test_a_place_that_is_not_finite_is_refused_by_its_field(index, value):
    place = [waypoint().lat_deg, waypoint().lon_deg, 120.0]
    place[index] = value
    name = ("lat_deg", "lon_deg", "altitude")[index]
    refused = Rejected("not_finite", f"{name} must be a finite number, got {value!r}")
    assert check_place(*place, FENCE) == check_take_off(*place, FENCE) == refused


def test_a_parameter_at_its_limit_and_a_return_come_back_as_they_are():
    for item in (waypoint(param1=1e6), waypoint(param2=-1e6), MissionItem(20, FRAME_MISSION)):
        assert check_item(item, FENCE) == Accepted(item)


@pytest.mark.parametrize(
    "values", [(0.0, 0.0, 0.0), (0.5, 0.5, 0.5), (1e6, 0.0, 1e5), (1e6, 1e5, 1e5)]
)
def test_a_fence_may_be_as_small_and_as_large_as_it_says(values):
    fence = Fence(FRAME, *values)
    assert (fence.margin_m, fence.min_amsl_m, fence.max_amsl_m) == values


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ((1e6 + 0.5, 0.0, 120.0), "margin_m must be 0 to 1e+06, got 1000000.5"),
        (
            (0.0, 0.0, 1e5 + 0.5),
            "max_amsl_m must be -100000 to 100000, got 100000.5",
        ),
        ((0.0, 50.0, 40.0), "min_amsl_m must be -100000 to 40, got 50.0"),
    ],
)
def test_a_fence_that_cannot_be_is_refused_by_its_field(values, reason):
    with pytest.raises(ValueError) as raised:
        Fence(FRAME, *values)
    assert str(raised.value) == reason


@pytest.mark.parametrize("values", [(-1.0, 0.0, 120.0), (math.nan, 0.0, 120.0), (0.0, 50.0, 40.0)])
def test_a_fence_that_holds_nothing_is_refused(values):
    with pytest.raises(ValueError, match=" must be "):
        Fence(FRAME, *values)


@given(st.floats(1.0, 3e4), st.floats(-math.pi, math.pi), st.floats(500.0, 2e4))
def test_no_place_beyond_the_circle_is_allowed_whatever_the_search_is(
    away_m: float, bearing: float, radius_m: float
) -> None:
    assume(abs(away_m - radius_m) > 5.0)
    x_m, y_m = 1300.0 + away_m * math.cos(bearing), 1300.0 + away_m * math.sin(bearing)
    middle = map_to_geodetic(FRAME, 1300.0, 1300.0, 0.0)[:2]
    fence = dataclasses.replace(FENCE, margin_m=1e6, center=middle, radius_m=radius_m)
    item = waypoint(x_m, y_m)
    assert (code(item, fence) is None) == (away_m < radius_m)
    for check in (check_place, check_take_off):
        checked = check(item.lat_deg, item.lon_deg, 120.0, fence)
        assert isinstance(checked, Accepted) == (away_m < radius_m)


def test_a_place_beyond_the_circle_is_refused_by_the_circle():
    fence = dataclasses.replace(FENCE, center=(-24.04, -46.17), radius_m=500.0)
    item = waypoint(600.0, 0.0)
    reason = "place must be within 500 m of (-24.0400000, -46.1700000), the middle of the fence"
    got = f"got ({item.lat_deg:.7f}, {item.lon_deg:.7f})"
    assert check_item(item, fence) == Rejected("outside_fence", f"{reason}, {got}")


@pytest.mark.parametrize(
    ("origin", "why"),
    [((-24.04, -46.17), ""), ((-24.045, -46.17), ""), ((-24.1, -46.17), "got 2500"),
     ((-22.99, -43.99), "got 2500"), ((24.04, 133.83), "got 2500")],
)  # fmt: skip
def test_a_search_must_lie_in_the_circle_with_all_of_its_corners(
    origin: tuple[float, float], why: str
) -> None:
    middle = map_to_geodetic(FRAME, 1300.0, 1300.0, 0.0)[:2]
    frame = dataclasses.replace(FRAME, origin_lat_deg=origin[0], origin_lon_deg=origin[1])
    trouble = check_search(Fence(frame, 500.0, 10.0, 120.0, center=middle, radius_m=2500.0))
    assert bool(trouble) == bool(why) and why in (trouble or "")
    assert not trouble or trouble.startswith("fence_radius must ")


@pytest.mark.parametrize("corner", itertools.product((0.0, SIDE_M), repeat=2))
def test_a_search_lies_in_the_circle_to_its_very_corners(corner: tuple[float, float]) -> None:
    away_m = math.copysign(700.0, 1300.0 - corner[0]), math.copysign(700.0, 1300.0 - corner[1])
    middle = map_to_geodetic(FRAME, 1300.0 + away_m[0], 1300.0 + away_m[1], 0.0)[:2]
    for more_m, lies in ((0.5, True), (-0.5, False)):
        fence = dataclasses.replace(FENCE, center=middle, radius_m=math.hypot(2e3, 2e3) + more_m)
        assert (check_search(fence) is None) == lies
