# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles of a search keep apart, from the first take-off to the last landing."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from virtual_fleet import FRAME, SEARCH, VirtualFleet, VirtualSearch

from dsse_ros.base.fields import FieldError
from dsse_ros.vehicles.control.orders import GoTo, Hold, Land, Order, Return, SearchPlace, TakeOff
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.airspace import AirborneVehicle, Airspace
from dsse_ros.vehicles.fleet.flight_plan import layered
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.mission_items.separation import separation_m
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import map_to_geodetic

# To find a shorter one that fails takes too many flights.
AS_DRAWN = (Phase.explicit, Phase.reuse, Phase.generate)
GAP_M = 3.0
"""Difference in altitude that layers of 5 m leave at least while vehicles fly."""
SLACK_M = 6.0
"""How far two vehicles may be off their lines together."""
LOW = replace(FRAME, alt_m=35.0)
"""The search closer to the ground, for shorter flights."""


class Watch:
    """Looks at how near the vehicles of a fleet come to each other."""

    def __init__(self, fleet: VirtualFleet) -> None:
        self.fleet = fleet
        self.nearest: dict[tuple[int, int], tuple[float, float, float]] = {}
        self.limit_m = separation_m(fleet.frame) - SLACK_M
        self.homes = [one.vehicle.frame.home for one in fleet.flights]

    def places(self) -> list[tuple[float, float, float]]:
        """Return where the vehicles are, in metres about the first home."""
        found = []
        for home, flight in zip(self.homes, self.fleet.flights, strict=True):
            craft, first = flight.vehicle.craft, self.homes[0]
            north_m = (home.lat_deg - first.lat_deg) * 110_769.0
            east_m = (home.lon_deg - first.lon_deg) * 111_320.0 * math.cos(math.radians(24.04))
            found.append((craft.north_m + north_m, craft.east_m + east_m, craft.up_m))
        return found

    def look(self) -> None:
        """Compare all pairs that fly."""
        places = self.places()
        for i, j in itertools.combinations(range(len(places)), 2):
            if any(self.fleet.flights[k].vehicle.landed for k in (i, j)):
                continue
            apart_m = math.dist(places[i][:2], places[j][:2])
            gap_m = abs(places[i][2] - places[j][2])
            homes_m = self.homes_apart_m(i, j)
            limit_m = min(self.limit_m, homes_m - 2.0)
            assert apart_m >= limit_m or gap_m >= GAP_M, (
                f"{i} and {j}: {apart_m:.1f} m and {gap_m:.1f} m apart at {self.fleet.now:.1f} s, "
                f"{places}: {self.fleet.shown()}\n" + "\n".join(self.fleet.log[-30:])
            )

    def homes_apart_m(self, i: int, j: int) -> float:
        """Return how far apart two vehicles stand."""
        a, b = self.homes[i], self.homes[j]
        east_m = (a.lon_deg - b.lon_deg) * 111_320.0 * math.cos(math.radians(24.04))
        return math.hypot((a.lat_deg - b.lat_deg) * 110_769.0, east_m)


def watched(fleet: VirtualFleet) -> Watch:
    """Have each step of a fleet be watched."""
    watch, step = Watch(fleet), fleet.step

    def both() -> None:
        step()
        watch.look()

    fleet.step = both  # type: ignore[method-assign]
    return watch


HOMES = st.lists(
    st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=4, max_size=4, unique=True
).map(lambda places: [(10.0 + 18.0 * x, 10.0 + 18.0 * y) for x, y in places])
CELLS = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=4, max_size=4)


def play(search: VirtualSearch, steps: int, actions: Any) -> None:
    """Move the drones without vehicles, into one cell too."""
    for _ in range(steps):
        search.advance(actions())


@pytest.mark.slow
@settings(max_examples=4, phases=AS_DRAWN)
@given(
    autopilot=st.sampled_from(["ardupilot", "px4"]),
    homes=HOMES,
    cells=CELLS,
    seed=st.integers(0, 2**32),
    data=st.data(),
)
def test_vehicles_that_follow_steps_keep_apart(
    autopilot: str,
    homes: list[tuple[float, float]],
    cells: list[tuple[int, int]],
    seed: int,
    data: st.DataObject,
) -> None:
    fleet = VirtualFleet(4, autopilot, homes_m=homes, seed=seed, frame=LOW, search_altitude=15.0)
    watched(fleet)
    search = fleet.simulate(7, cells, seed=seed)
    ending = data.draw(st.integers(3, 6))
    for step in range(ending):
        fleet.until(lambda: fleet.arrived(search), 2000.0)
        # One whose search ends early flies home among the others.
        if step == ending // 2:
            search.lose(data.draw(st.integers(0, 3)))
        search.advance()
        fleet.publish(search)
    fleet.until(lambda: fleet.arrived(search), 2000.0)
    fleet.finish(search)
    fleet.until(fleet.down, 2000.0)
    fleet.wait(2.0)
    assert fleet.controller.finished


@pytest.mark.slow
@settings(max_examples=4, phases=AS_DRAWN)
@given(
    autopilot=st.sampled_from(["ardupilot", "px4"]),
    homes=HOMES,
    cells=CELLS,
    seed=st.integers(0, 2**32),
    steps=st.integers(1, 8),
)
def test_vehicles_on_missions_keep_apart(
    autopilot: str,
    homes: list[tuple[float, float]],
    cells: list[tuple[int, int]],
    seed: int,
    steps: int,
) -> None:
    fleet = VirtualFleet(
        4, autopilot, homes_m=homes, seed=seed, frame=LOW, mode="mission", search_altitude=15.0
    )
    watched(fleet)
    search = fleet.simulate(7, cells, seed=seed)
    for _ in range(steps):
        search.advance()
    fleet.finish(search)
    fleet.until(lambda: fleet.controller.finished, 4000.0)
    assert fleet.down()
    assert not any(one.lost for one in fleet.controller.dispatchers)


def has_all_start(
    autopilot: str, cells: list[tuple[int, int]], stands: list[tuple[float, float]], drift_m: float
) -> VirtualFleet:
    """Return a fleet that stands near its drones' cells, off its homes, once all have started.

    Args:
        autopilot: Which one.
        cells: Where the drones start, each in one of its own.
        stands: For each vehicle, which drone's cell its home is near, and at which bearing.
        drift_m: How far each stands from its home since it has landed.
    """
    centers = [cell_to_map(LOW, *cell) for cell in cells]
    homes = [
        (centers[int(near)][0] + 27.0 * math.sin(bearing),
         centers[int(near)][1] + 27.0 * math.cos(bearing))
        for near, bearing in stands
    ]  # fmt: skip
    options: Any = {"arm": "false", "frame": LOW, "search_altitude": 15.0}
    fleet = VirtualFleet(len(cells), autopilot, homes_m=homes, **options)
    for flight, (_, bearing) in zip(fleet.flights, stands, strict=True):
        craft = flight.vehicle.craft
        craft.north_m -= drift_m * math.cos(bearing)
        craft.east_m -= drift_m * math.sin(bearing)
    search = fleet.simulate(7, cells)
    fleet.wait(8.0)
    fleet.controller.arm(None, True)
    fleet.until(lambda: fleet.arrived(search), 300.0)
    return fleet


@pytest.mark.slow
@settings(max_examples=6, phases=AS_DRAWN, deadline=None)
@given(
    st.sampled_from(["ardupilot", "px4"]),
    st.lists(
        st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=3, max_size=3, unique=True
    ),
    st.lists(
        st.tuples(st.integers(0, 2), st.floats(-math.pi, math.pi)), min_size=3, max_size=3
    ),
    st.floats(0.0, 20.0),
)  # fmt: skip
@example("ardupilot", [(3, 3), (0, 3), (1, 1)], [(2, 0.0), (1, 0.0), (2, math.pi)], 15.0)
def test_wherever_vehicles_stand_all_of_them_can_start(
    autopilot: str,
    cells: list[tuple[int, int]],
    stands: list[tuple[float, float]],
    drift_m: float,
) -> None:
    fleet = has_all_start(autopilot, cells, stands, drift_m)
    assert not any(one.lost for one in fleet.controller.dispatchers)


def test_who_hovers_over_a_vehicle_that_is_to_take_off_is_named_with_the_distance() -> None:
    ground = airborne("drone0", (100.0, 100.0), 0.0, flying=False, layer_m=60.0)
    up = TakeOff(DATUM_M + 60.0)
    assert admit(up, ground, [airborne("drone1", (119.0, 100.0), 55.0)]) == (
        "waiting for drone1 to be out of the way: it is 19 m away, 30 m are kept: move this "
        "vehicle, or have drone1 return"
    )


DATUM_M = 300.0
"""Layers are above that, not above the sea."""


def airborne(
    name: str,
    place: tuple[float, float],
    alt_m: float,
    order: Order | None = None,
    *,
    layer_m: float = 0.0,
    flying: bool = True,
    velocity_mps: tuple[float, float] = (0.0, 0.0),
) -> AirborneVehicle:
    lat_deg, lon_deg, _ = map_to_geodetic(FRAME, *place, 0.0)
    state = VehicleState(
        connected=True, flying=flying, armed=flying, lat_deg=lat_deg, lon_deg=lon_deg,
        alt_m=alt_m, alt_amsl_m=DATUM_M + alt_m, velocity_mps=velocity_mps,
        home=(lat_deg + (0.0 if name == "drone0" else 0.01), lon_deg, DATUM_M),
    )  # fmt: skip
    frame = replace(FRAME, alt_m=layer_m or alt_m)
    return AirborneVehicle(name, state, place, order, frame, DATUM_M)


def admit(order: Order, one: AirborneVehicle, others: list[AirborneVehicle]) -> Order | str:
    airspace = Airspace({i + 1: other for i, other in enumerate(others)})
    return airspace.admit(0, one, order)


def to(kind: type[GoTo] | type[SearchPlace], cell: tuple[int, int], alt_m: float) -> Order:
    lat_deg, lon_deg, _ = map_to_geodetic(FRAME, *cell_to_map(FRAME, *cell), 0.0)
    if kind is GoTo:
        return GoTo(lat_deg, lon_deg, DATUM_M + alt_m, 10.0)
    return SearchPlace(lat_deg, lon_deg, DATUM_M + alt_m, DATUM_M + 15.0, 5.0, 10.0)


@given(
    st.floats(1.0, 12.0, exclude_min=True), st.floats(-math.pi, math.pi), st.floats(0.0, 5.0),
    st.sampled_from([Return(), Land()]), st.floats(-math.pi, math.pi), st.floats(31.0, 60.0),
)  # fmt: skip
def test_what_a_vehicle_overshoots_is_in_the_distance_that_is_kept(
    speed_mps: float, course: float, near_m: float, order: Order, bearing: float, away_m: float
) -> None:
    other = airborne("drone1", (100.0, 100.0), 30.0, Land())
    home = (100.0 + away_m * math.sin(bearing), 100.0 + away_m * math.cos(bearing))
    here = (home[0] - near_m * math.sin(course), home[1] - near_m * math.cos(course))
    velocity_mps = (speed_mps * math.cos(course), speed_mps * math.sin(course))
    one = airborne("drone0", here, 35.0, velocity_mps=velocity_mps)
    lat_deg, lon_deg, _ = map_to_geodetic(FRAME, *home, 0.0)
    one = replace(one, state=replace(one.state, home=(lat_deg, lon_deg, DATUM_M)))
    if isinstance(admit(order, one, [other]), str):
        return
    # PX4 that is ordered to return at 9.8 m/s as it passes its home flies 10.8 m past it, and
    # descends meanwhile.
    past_m = speed_mps**2 * 10.8 / 9.8**2
    end = (here[0] + past_m * math.sin(course), here[1] + past_m * math.cos(course))
    least_m = min(math.dist(place, (100.0, 100.0)) for place in (here, end))
    assert least_m > separation_m(FRAME) - 0.7


@given(
    st.floats(-math.pi, math.pi), st.floats(5.0, 400.0), st.floats(-math.pi, math.pi),
    st.floats(26.0, 60.0), st.sampled_from([Return(), Land()]),
)  # fmt: skip
def test_where_a_vehicle_arrives_it_may_fly_on_a_little(
    course: float, left_m: float, bearing: float, away_m: float, order: Order
) -> None:
    # Over its own home one comes down through the layer of another that flies home.
    there = (100.0 + away_m * math.sin(bearing), 100.0 + away_m * math.cos(bearing))
    here = (there[0] - left_m * math.sin(course), there[1] - left_m * math.cos(course))
    lat_deg, lon_deg, _ = map_to_geodetic(FRAME, *there, 0.0)
    arrives = airborne("drone1", here, 30.0, GoTo(lat_deg, lon_deg, DATUM_M + 30.0, 5.0))
    arrives = replace(arrives, state=replace(arrives.state, home=(lat_deg, lon_deg, DATUM_M)))
    one = airborne("drone0", (100.0, 100.0), 35.0)
    if isinstance(admit(order, one, [arrives]), str):
        return
    # PX4 at 10 m/s flew 2.9 m past its home before it came back to it.
    past_m = min(2.9, left_m)
    end = (there[0] + past_m * math.sin(course), there[1] + past_m * math.cos(course))
    homes_m = math.inf if isinstance(order, Land) else away_m
    assert math.dist(end, one.place) > min(separation_m(FRAME), homes_m - 1.0) - 0.1


def test_a_vehicle_that_stands_again_may_return() -> None:
    other = airborne("drone1", (100.0, 100.0), 30.0, Land())
    home = map_to_geodetic(FRAME, 140.0, 100.0, 0.0)[:2]
    for speed_mps, waits in ((9.8, True), (5.0, False), (0.0, False)):
        one = airborne("drone0", (140.0, 100.0), 35.0, velocity_mps=(0.0, -speed_mps))
        one = replace(one, state=replace(one.state, home=(*home, DATUM_M)))
        assert isinstance(admit(Return(), one, [other]), str) == waits


def at(*cell: int) -> tuple[float, float]:
    return cell_to_map(FRAME, *cell)


def test_over_a_cell_where_a_lower_one_stays_it_is_searched_from_the_layer() -> None:
    high = airborne("drone0", at(1, 1), 60.0)
    search = to(SearchPlace, (1, 1), 60.0)
    low = airborne("drone1", at(1, 1), 55.0)
    assert isinstance(search, SearchPlace)
    level = replace(search, search_amsl_m=DATUM_M + 60.0)
    assert admit(search, high, [low]) == level
    assert admit(search, high, [airborne("drone1", at(2, 1), 55.0)]) == search
    # The lower one searches below.
    below = to(SearchPlace, (1, 1), 55.0)
    assert admit(below, low, [high]) == below


def test_a_search_waits_for_one_that_passes_and_one_that_passes_for_a_search() -> None:
    high, search = airborne("drone0", at(1, 1), 60.0), to(SearchPlace, (1, 1), 60.0)
    passing = airborne("drone1", at(0, 1), 55.0, to(GoTo, (3, 1), 55.0))
    waits = "waiting for {} to be out of the way"
    assert admit(search, high, [passing]) == waits.format("drone1")
    searching = airborne("drone0", at(1, 1), 30.0, search, layer_m=60.0)
    assert passing.order is not None
    assert admit(passing.order, replace(passing, order=None), [searching]) == (
        waits.format("drone0")
    )
    beside = to(GoTo, (0, 3), 55.0)
    assert admit(beside, replace(passing, order=None), [searching]) == beside


@pytest.mark.parametrize("order", [Return(), Land()])
def test_who_comes_down_waits_for_those_below_and_not_for_those_above(order: Order) -> None:
    high, low = airborne("drone0", at(1, 1), 60.0), airborne("drone1", at(1, 1), 55.0)
    assert isinstance(admit(order, high, [low]), str)
    assert admit(order, low, [high]) == order


def test_nobody_is_sent_across_the_column_in_which_a_recalled_one_comes_down() -> None:
    landing = airborne("drone1", at(1, 1), 60.0, Land())
    low = airborne("drone0", at(0, 1), 55.0)
    assert isinstance(admit(to(GoTo, (3, 1), 55.0), low, [landing]), str)
    beside = to(GoTo, (0, 3), 55.0)
    assert admit(beside, low, [landing]) == beside
    home = map_to_geodetic(FRAME, *at(2, 1), 0.0)[:2]
    returning = airborne("drone1", at(2, 3), 60.0, Return())
    returning = replace(returning, state=replace(returning.state, home=(*home, DATUM_M)))
    assert isinstance(admit(to(GoTo, (3, 1), 55.0), low, [returning]), str)
    assert admit(beside, low, [returning]) == beside


def test_nobody_takes_off_through_one_that_is_there() -> None:
    ground = airborne("drone0", at(1, 1), 0.0, flying=False, layer_m=60.0)
    up = TakeOff(DATUM_M + 60.0)
    assert isinstance(admit(up, ground, [airborne("drone1", at(1, 1), 55.0)]), str)
    assert admit(up, ground, [airborne("drone1", at(2, 1), 55.0)]) == up
    assert admit(up, ground, [airborne("drone1", at(1, 1), 65.0)]) == up


def test_at_one_altitude_nothing_keeps_vehicles_apart_and_nothing_waits() -> None:
    here, there = airborne("drone0", at(1, 1), 60.0), airborne("drone1", at(1, 1), 60.0)
    for order in (to(SearchPlace, (1, 1), 60.0), Return(), Hold()):
        assert admit(order, here, [there]) == order


@pytest.mark.parametrize("alt_m", [5.0, 58.0, 60.0, 300.0])
@pytest.mark.parametrize("layer_m", [60.0, 55.0], ids=["same layer", "another"])
def test_one_whose_intent_is_not_known_takes_the_whole_column(alt_m: float, layer_m: float) -> None:
    here = airborne("drone0", at(0, 1), 60.0)
    unknown = replace(airborne("drone1", at(2, 1), alt_m, layer_m=layer_m), known=False)
    airspace = Airspace({0: here, 1: unknown})
    through, elsewhere = to(GoTo, (3, 1), 60.0), to(GoTo, (0, 3), 60.0)
    for order, free in ((through, False), (elsewhere, True)):
        assert isinstance(airspace.admit(0, here, order), str) != free
        # It may also come while the order is carried out.
        assert (airspace.intruder(0, here, order) is None) == free
    assert isinstance(airspace.admit(0, airborne("drone0", at(2, 1), 60.0), Return()), str)
    known = Airspace({0: here, 1: replace(unknown, known=True, frame=replace(FRAME, alt_m=50.0))})
    assert known.intruder(0, here, through) is None


def test_one_that_may_climb_before_it_returns_takes_the_layers_above() -> None:
    low = airborne("drone1", at(1, 1), 45.0, Return())
    above = to(GoTo, (3, 1), 60.0)
    high = airborne("drone0", at(0, 1), 60.0)
    assert admit(above, high, [low]) == above
    climbs = replace(low, state=replace(low.state, return_alt_m=70.0))
    assert isinstance(admit(above, high, [climbs]), str)


@settings(max_examples=200)
@given(
    st.lists(
        st.tuples(st.integers(0, 3), st.integers(0, 3), st.floats(0, 90), st.integers(0, 6)),
        min_size=1,
        max_size=6,
    ),
    st.integers(0, 6),
)
def test_all_at_once_is_the_same_as_one_after_the_other(
    others: list[tuple[int, int, float, int]], number: int
) -> None:
    orders: list[Order | None] = [
        None, to(GoTo, (2, 2), 55.0), to(SearchPlace, (1, 3), 50.0), Return(), Land(), Hold(),
        TakeOff(DATUM_M + 60.0),
    ]  # fmt: skip
    flying = {
        i + 1: airborne(f"drone{i + 1}", at(col, row), alt_m, orders[k], layer_m=40.0 + i)
        for i, (col, row, alt_m, k) in enumerate(others)
    }
    one, order = airborne("drone0", at(1, 1), 60.0), orders[number] or Hold()
    blocked = isinstance(Airspace(flying).admit(0, one, order), str)
    each = [
        isinstance(Airspace({i: other}).admit(0, one, order), str) for i, other in flying.items()
    ]
    assert blocked == any(each)


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"altitudes": (40.0, 39.0)}, "altitudes must put vehicles at one altitude or 2 m apart"),
        ({"altitude_step": 1.5}, "altitude_step must put vehicles at one altitude or 2 m apart"),
        ({"num_vehicles": 9, "min_altitude": 30.0}, "altitude_step must put vehicles at one"),
        ({"altitudes": (40.0, 40.0)}, ""),
        ({"altitude_step": 2.0}, ""),
    ],
)
def test_layers_are_never_so_near_that_vehicles_in_both_wait_for_each_other(
    fields: dict[str, Any], why: str
) -> None:
    made = BridgeSettings(**{"num_vehicles": 2, **fields})
    if why:
        with pytest.raises(FieldError, match=why):
            layered(FRAME, made, made.vehicles)
    else:
        assert len(layered(FRAME, made, made.vehicles)) == 2


def test_neighbouring_cells_are_far_enough_apart() -> None:
    for cell_m in (5.0, 20.0, 60.0, 130.0, 1000.0):
        frame = GridFrame(4, cell_m, -24.0, -46.0, 0.0, 60.0)
        assert separation_m(frame) <= cell_m / 2 and separation_m(frame) <= 30.0


def test_the_search_is_an_action_of_the_simulations_here() -> None:
    assert VirtualSearch(1, [(0, 0)]).agents().actions[SEARCH] == "search"
