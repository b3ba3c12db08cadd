# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles fly in layers, none of which is below or above what is allowed, and keep apart."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.cli import export_mission
from dsse_ros.planners.registry import COVERAGE_PLANNERS, PLANNER_NAMES
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.vehicles.fleet.vehicle_missions import FlightSettings, layers, search_missions
from dsse_ros.vehicles.mission_items.items import NAV_WAYPOINT, Home, VehicleMission
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from dsse_ros.world.scenario.scenario import scenario_frame

FRAME = GridFrame(10, 130.0, -24.0, -46.0, 0.0, 120.0)


@given(
    st.integers(1, 250),
    st.floats(0.0, 100.0),
    st.just(-1.0) | st.floats(0.0, 20.0),
    st.floats(1, 300),
)
def test_layers_are_as_far_apart_as_asked_and_none_is_too_low(
    vehicles: int, lowest_m: float, step_m: float, alt_m: float
) -> None:
    frame = GridFrame(10, 130.0, -24.0, -46.0, 0.0, alt_m)
    settings = FlightSettings(altitude_step=step_m)
    room_m = max(alt_m - lowest_m, 0.0)
    try:
        altitudes = [one.alt_m for one in layers(frame, settings, vehicles, lowest_m)]
    except FieldError as error:
        assert step_m >= 0 and step_m * (vehicles - 1) > room_m
        assert "altitude_step" in str(error) and "\n" not in str(error)
        return
    assert len(altitudes) == vehicles and altitudes[0] == alt_m
    assert min(altitudes) >= min(lowest_m, alt_m) - 1e-9
    steps = [high - low for high, low in zip(altitudes, altitudes[1:], strict=False)]
    wanted = min(5.0, room_m / max(vehicles - 1, 1)) if step_m < 0 else step_m
    assert steps == pytest.approx([wanted] * (vehicles - 1), abs=1e-6)


def test_the_error_says_how_much_room_there_is() -> None:
    with pytest.raises(FieldError, match="must be at most 27.5 m for 5 vehicles .* got 30$"):
        layers(FRAME, FlightSettings(altitude_step=30.0), 5)


@dataclass(frozen=True)
class Path:
    """What a mission flies, in metres about the origin, worked out from its items alone.

    Attributes:
        corners: (K, 3) places at its waypoints: east, north, up.
        holds: (K,) times that it stays there.
    """

    corners: NDArray[np.float64]
    holds: NDArray[np.float64]

    def samples(self, step_m: float) -> NDArray[np.float64]:
        """Return (M, 4) places along the path with the lowest and highest altitude there."""
        found = []
        for start, end in itertools.pairwise(self.corners):
            low_m, high_m = sorted((start[2], end[2]))
            level_m = math.dist(start[:2], end[:2])
            # None climbs or descends on its way.
            assert level_m < 0.01 or high_m - low_m < 0.01
            share = np.linspace(0.0, 1.0, 2 + int(level_m / step_m))[:, None]
            places = start[:2] + share * (end - start)[:2]
            found.append(np.column_stack([places, np.tile([low_m, high_m], (len(places), 1))]))
        return np.unique(np.concatenate(found).round(3), axis=0)

    def at(self, speed_mps: float, step_s: float) -> NDArray[np.float64]:
        """Return (T, 3) places over time, at one speed in any direction."""
        way_s = np.linalg.norm(np.diff(self.corners, axis=0), axis=1) / speed_mps
        arrivals_s = np.concatenate([[0.0], np.cumsum(self.holds[:-1] + way_s)])
        times_s = np.column_stack([arrivals_s, arrivals_s + self.holds]).ravel()
        now_s = np.arange(0.0, times_s[-1], step_s)
        twice = np.repeat(self.corners, 2, axis=0)
        return np.column_stack([np.interp(now_s, times_s, axis) for axis in twice.T])


def path_of(mission: VehicleMission, frame: GridFrame) -> Path:
    """Return what a mission flies from above its home to there again, at its altitude."""
    # The radii of WGS 84 along and across the meridian.
    lat, e2 = math.radians(frame.origin_lat_deg), 6.69437999014e-3
    across_m = 6_378_137.0 / math.sqrt(1.0 - e2 * math.sin(lat) ** 2)
    along_m = across_m * (1.0 - e2) / (1.0 - e2 * math.sin(lat) ** 2)
    north_m, east_m = math.radians(along_m), math.radians(across_m * math.cos(lat))

    def place(at: Any, alt_m: float) -> tuple[float, float, float]:
        return (
            (at.lon_deg - frame.origin_lon_deg) * east_m,
            (at.lat_deg - frame.origin_lat_deg) * north_m,
            alt_m,
        )

    waypoints = [item for item in mission.items if item.command == NAV_WAYPOINT]
    home = place(mission.home, frame.alt_m)
    corners = [home, *(place(item, item.alt_m) for item in waypoints), home]
    return Path(np.array(corners), np.array([0.0, *(item.param1 for item in waypoints), 0.0]))


def gaps_m(ours: NDArray[Any], theirs: NDArray[Any], limit_m: float) -> NDArray[np.float64]:
    """Return the differences in altitude, of samples that are horizontally nearer than a limit."""
    away_m = np.hypot(*(ours[:, None, :2] - theirs[None, :, :2]).transpose(2, 0, 1))
    i, j = np.nonzero(away_m < limit_m)
    over_m = np.maximum(ours[i, 2] - theirs[j, 3], theirs[j, 2] - ours[i, 3])
    return np.maximum(over_m, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("planner", PLANNER_NAMES)
@settings(max_examples=8)
@given(
    size=st.integers(5, 8),
    cell_m=st.sampled_from([10.0, 40.0, 60.0, 130.0]),
    drones=st.integers(2, 5),
    seed=st.integers(0, 2**32),
    speed_mps=st.floats(2.0, 25.0),
    flight=st.builds(
        FlightSettings,
        search_altitude=st.floats(1.0, 130.0),
        altitude_step=st.sampled_from([-1.0, 2.0, 5.0, 20.0]),
        merge_legs=st.booleans(),
    ),
    data=st.data(),
)
def test_vehicles_on_missions_keep_apart_whenever_each_of_them_is_where(
    planner: str,
    size: int,
    cell_m: float,
    drones: int,
    seed: int,
    speed_mps: float,
    flight: FlightSettings,
    data: st.DataObject,
) -> None:
    profile = "coverage" if planner in COVERAGE_PLANNERS else "v2"
    search: dict[str, Any] = (
        {"person_pod_multipliers": [0.5 if planner == "onnx" else 0.1]} if profile == "v2" else {}
    )
    env = parallel_env(
        rules=profile, grid_size=size, cell_size=cell_m, num_drones=drones, timestep_limit=40,
        altitude=120.0, **search,
    )  # fmt: skip
    cells, searched, _ = export_mission.search(env, planner, seed, {})
    tracks = [(cells[:, i], searched[:, i]) for i in range(drones)]
    frames = layers(scenario_frame(env.scenario), flight, drones)
    # As mission files, below the first cell of each, and as the bridge flies them.
    homes: list[Home | None] = [None] * drones
    from_home = data.draw(st.booleans())
    if from_home:
        spot = st.tuples(st.integers(-20, 40), st.integers(-20, 40))
        places = data.draw(st.lists(spot, min_size=drones, max_size=drones, unique=True))
        homes = [Home(*map_to_geodetic(frames[0], 5.0 * x, 5.0 * y, 0.0)) for x, y in places]
    missions = search_missions(
        frames, tracks, flight, homes, [speed_mps] * drones, 600.0 if from_home else 0.0
    )
    limit_m = min(30.0, cell_m / 2)
    paths = [path_of(one, frame) for one, frame in zip(missions, frames, strict=True)]
    samples = [path.samples(limit_m / 4) for path in paths]
    # The Earth is no plane, and samples are some metres apart.
    near_m, far_m = 0.99 * limit_m, 1.03 * limit_m
    for i, j in itertools.combinations(range(drones), 2):
        layer_gap_m = abs(frames[i].alt_m - frames[j].alt_m)
        assert layer_gap_m > 0
        # At whatever times they are where.
        assert gaps_m(samples[i], samples[j], near_m).min(initial=np.inf) >= layer_gap_m - 1e-6
        ours, theirs = (paths[k].at(speed_mps, 0.2 * limit_m / speed_mps) for k in (i, j))
        both = min(len(ours), len(theirs))
        away_m = np.hypot(*(ours[:both] - theirs[:both])[:, :2].T)
        over_m = abs(ours[:both, 2] - theirs[:both, 2])
        assert (over_m[away_m < near_m] >= layer_gap_m - 1e-6).all()
    # A search is flown without its descent only where somebody lower passes.
    for i, (track, flags) in enumerate(tracks):
        if flight.search_altitude >= frames[i].alt_m:
            continue
        lower = [samples[j] for j in range(drones) if frames[j].alt_m < frames[i].alt_m]
        low = paths[i].corners[paths[i].corners[:, 2] < frames[i].alt_m - 0.01]
        for col, row in {tuple(cell) for cell in track[flags].tolist()}:
            here = np.array([(col + 0.5) * cell_m, (size - row - 0.5) * cell_m])
            descends = len(low) > 0 and (np.hypot(*(low[:, :2] - here).T) < 0.2 * cell_m).any()
            passed = [np.hypot(*(one[:, :2] - here).T).min() < far_m for one in lower]
            assert descends or any(passed)
