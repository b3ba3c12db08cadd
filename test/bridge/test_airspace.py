# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles of a search keep apart, from the first take-off to the last landing."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from virtual_fleet import FRAME, SEARCH, VirtualFleet, VirtualSearch

from dsse_ros.bridge.airspace import AirborneVehicle, Airspace
from dsse_ros.flight.orders import GoTo, Hold, Land, Order, Return, SearchPlace, TakeOff
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.mission_items.separation import separation_m
from dsse_ros.scenario.frames import GridFrame, cell_to_map
from dsse_ros.scenario.geodesy import map_to_geodetic

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
    assert not any(one.lost for one in fleet.controller.followers)


DATUM_M = 300.0
"""Layers are above that, not above the sea."""


def flyer(
    name: str,
    place: tuple[float, float],
    alt_m: float,
    order: Order | None = None,
    *,
    layer_m: float = 0.0,
    flying: bool = True,
) -> AirborneVehicle:
    lat_deg, lon_deg, _ = map_to_geodetic(FRAME, *place, 0.0)
    state = VehicleState(
        connected=True, flying=flying, armed=flying, lat_deg=lat_deg, lon_deg=lon_deg,
        alt_m=alt_m, alt_amsl_m=DATUM_M + alt_m,
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


def at(*cell: int) -> tuple[float, float]:
    return cell_to_map(FRAME, *cell)


def test_over_a_cell_where_a_lower_one_stays_it_is_searched_from_the_layer() -> None:
    high = flyer("drone0", at(1, 1), 60.0)
    search = to(SearchPlace, (1, 1), 60.0)
    low = flyer("drone1", at(1, 1), 55.0)
    assert isinstance(search, SearchPlace)
    level = replace(search, search_amsl_m=DATUM_M + 60.0)
    assert admit(search, high, [low]) == level
    assert admit(search, high, [flyer("drone1", at(2, 1), 55.0)]) == search
    # The lower one searches below.
    below = to(SearchPlace, (1, 1), 55.0)
    assert admit(below, low, [high]) == below


def test_a_search_waits_for_one_that_passes_and_one_that_passes_for_a_search() -> None:
    high, search = flyer("drone0", at(1, 1), 60.0), to(SearchPlace, (1, 1), 60.0)
    passing = flyer("drone1", at(0, 1), 55.0, to(GoTo, (3, 1), 55.0))
    waits = "waiting for {} to be out of the way"
    assert admit(search, high, [passing]) == waits.format("drone1")
    searching = flyer("drone0", at(1, 1), 30.0, search, layer_m=60.0)
    assert passing.order is not None
    assert admit(passing.order, replace(passing, order=None), [searching]) == (
        waits.format("drone0")
    )
    beside = to(GoTo, (0, 3), 55.0)
    assert admit(beside, replace(passing, order=None), [searching]) == beside


@pytest.mark.parametrize("order", [Return(), Land()])
def test_who_comes_down_waits_for_those_below_and_not_for_those_above(order: Order) -> None:
    high, low = flyer("drone0", at(1, 1), 60.0), flyer("drone1", at(1, 1), 55.0)
    assert isinstance(admit(order, high, [low]), str)
    assert admit(order, low, [high]) == order


def test_nobody_takes_off_through_one_that_is_there() -> None:
    ground = flyer("drone0", at(1, 1), 0.0, flying=False, layer_m=60.0)
    up = TakeOff(DATUM_M + 60.0)
    assert isinstance(admit(up, ground, [flyer("drone1", at(1, 1), 55.0)]), str)
    assert admit(up, ground, [flyer("drone1", at(2, 1), 55.0)]) == up
    assert admit(up, ground, [flyer("drone1", at(1, 1), 65.0)]) == up


def test_at_one_altitude_nothing_keeps_vehicles_apart_and_nothing_waits() -> None:
    here, there = flyer("drone0", at(1, 1), 60.0), flyer("drone1", at(1, 1), 60.0)
    for order in (to(SearchPlace, (1, 1), 60.0), Return(), Hold()):
        assert admit(order, here, [there]) == order


@pytest.mark.parametrize("alt_m", [5.0, 58.0, 60.0, 300.0])
@pytest.mark.parametrize("layer_m", [60.0, 55.0], ids=["same layer", "another"])
def test_one_whose_intent_is_not_known_takes_the_whole_column(alt_m: float, layer_m: float) -> None:
    here = flyer("drone0", at(0, 1), 60.0)
    unknown = replace(flyer("drone1", at(2, 1), alt_m, layer_m=layer_m), known=False)
    airspace = Airspace({0: here, 1: unknown})
    through, elsewhere = to(GoTo, (3, 1), 60.0), to(GoTo, (0, 3), 60.0)
    for order, free in ((through, False), (elsewhere, True)):
        assert isinstance(airspace.admit(0, here, order), str) != free
        # It may also come while the order is carried out.
        assert (airspace.intruder(0, here, order) == "") == free
    assert isinstance(airspace.admit(0, flyer("drone0", at(2, 1), 60.0), Return()), str)
    known = Airspace({0: here, 1: replace(unknown, known=True, frame=replace(FRAME, alt_m=50.0))})
    assert known.intruder(0, here, through) == ""


def test_one_that_may_climb_before_it_returns_takes_the_layers_above() -> None:
    low = flyer("drone1", at(1, 1), 45.0, Return())
    above = to(GoTo, (3, 1), 60.0)
    high = flyer("drone0", at(0, 1), 60.0)
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
    flyers = {
        i + 1: flyer(f"drone{i + 1}", at(col, row), alt_m, orders[k], layer_m=40.0 + i)
        for i, (col, row, alt_m, k) in enumerate(others)
    }
    one, order = flyer("drone0", at(1, 1), 60.0), orders[number] or Hold()
    blocked = isinstance(Airspace(flyers).admit(0, one, order), str)
    each = [
        isinstance(Airspace({i: other}).admit(0, one, order), str) for i, other in flyers.items()
    ]
    assert blocked == any(each)


def test_neighbouring_cells_are_far_enough_apart() -> None:
    for cell_m in (5.0, 20.0, 60.0, 130.0, 1000.0):
        frame = GridFrame(4, cell_m, -24.0, -46.0, 0.0, 60.0)
        assert separation_m(frame) <= cell_m / 2 and separation_m(frame) <= 30.0


def test_the_search_is_an_action_of_the_simulations_here() -> None:
    assert VirtualSearch(1, [(0, 0)]).agents().actions[SEARCH] == "search"
