# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Particles begin where and when the law of each kind of sighting says."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsse_ros.world.drift.flow import constant_flow
from dsse_ros.world.drift.kernels import degrees_per_metre
from dsse_ros.world.drift.leeway import LeewayClass, PossibleObject, leeway_class
from dsse_ros.world.drift.sightings import (
    Bearing,
    Seen,
    SeenArea,
    SeenRaster,
    Sighting,
    Voyage,
    WayPoint,
    draw_sightings,
)
from dsse_ros.world.drift.tracks import NINETY_NINE_PERCENT, Drift, drift_tracks

COUNT = 100_000
HOUR_S = 3600.0
OPENDRIFT = json.loads(
    (Path(__file__).parents[2] / "oracles" / "data" / "opendrift_seeds.json").read_text()
)["rows"]


def drawn(seen: Seen, count: int = COUNT) -> NDArray[np.float64]:
    return draw_sightings([seen], np.zeros(count, np.int64), np.random.default_rng(1))


def metres(rows: NDArray[np.float64], lat_deg: float, lon_deg: float) -> NDArray[np.float64]:
    """Metres to the east and to the north of a place nearby, (2, M)."""
    lat_per_m, lon_per_m = degrees_per_metre(rows[:, 0])
    return np.stack([(rows[:, 1] - lon_deg) / lon_per_m, (rows[:, 0] - lat_deg) / lat_per_m])


def moments(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return values.mean(axis=1), np.cov(values)


def ring_moments(ring: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Area, and integrals of x, y, x^2, y^2 and x y over the inside of a ring of (y, x)."""
    (y, x), (v, u) = np.array(ring).T, np.roll(np.array(ring), -1, axis=0).T
    cross = x * v - u * y
    parts = [
        cross / 2, (x + u) * cross / 6, (y + v) * cross / 6, (x * x + x * u + u * u) * cross / 12,
        (y * y + y * v + v * v) * cross / 12, (x * v + 2 * x * y + 2 * u * v + u * y) * cross / 24,
    ]  # fmt: skip
    return np.sum(parts, axis=1) * np.sign(np.sum(cross))


def test_places_in_an_area_are_uniform_in_it_and_none_is_in_a_hole() -> None:
    outer = [(0.0, 0.0), (0.0, 0.3), (0.25, 0.3), (0.1, 0.15), (0.2, 0.0)]
    hole = [(0.02, 0.05), (0.02, 0.1), (0.08, 0.12)]
    area, x, y, xx, yy, xy = ring_moments(outer) - ring_moments(hole)
    rows = drawn(SeenArea(0.0, polygons=((tuple(outer), tuple(hole)),)))
    # Near the equator a degree has one length.
    mean, cov = moments(rows[:, 1::-1].T)
    wanted = np.array([x, y]) / area
    second = np.array([[xx, xy], [xy, yy]]) / area
    assert mean == pytest.approx(wanted, abs=4 * 0.1 / math.sqrt(COUNT))
    assert cov == pytest.approx(second - np.outer(wanted, wanted), rel=0.015, abs=2e-5)
    shapely = pytest.importorskip("shapely")
    inside = shapely.Polygon(outer, [hole]).buffer(1e-9)
    assert shapely.contains_xy(inside, rows[:, 0], rows[:, 1]).all()
    # Far from the equator, areas count, not degrees.
    tall = drawn(SeenArea(0.0, polygons=((((60.0, 0.0), (60.0, 1.0), (64.0, 1.0), (64.0, 0.0)),),)))
    south = math.sin(math.radians(62)) - math.sin(math.radians(60))
    north = math.sin(math.radians(64)) - math.sin(math.radians(62))
    assert (tall[:, 0] < 62).mean() == pytest.approx(south / (south + north), abs=0.006)


def test_a_raster_gives_each_cell_its_share() -> None:
    weights = np.array([[0.0, 1.0, 0.0], [2.0, 0.0, 5.0]])
    rows = drawn(SeenRaster(0.0, 1.0, 0.0, 10.0, 12.0, 20.0, 23.0, weights))
    found = np.histogram2d(rows[:, 0], rows[:, 1], bins=(2, 3), range=((10, 12), (20, 23)))[0]
    assert found[::-1] / COUNT == pytest.approx(weights / 8, abs=0.006)
    assert rows[:, 1][rows[:, 0] > 11].mean() == pytest.approx(21.5, abs=0.02)


def test_an_accident_on_a_voyage_is_where_the_vessel_was_at_its_time() -> None:
    points = (
        WayPoint(38.0, -9.0, 0.0, 0.0), WayPoint(38.4, -9.5, 4 * HOUR_S, 2000.0),
        WayPoint(38.4, -8.5, 6 * HOUR_S, 2000.0),
    )  # fmt: skip
    rows = drawn(Voyage(0.0, way_points=points, leg_weights=(1.0, 3.0)))
    time_s = rows[:, 2]
    on_first = time_s < 4 * HOUR_S
    assert on_first.mean() == pytest.approx(0.25, abs=0.006)
    assert time_s[on_first].mean() == pytest.approx(2 * HOUR_S, rel=0.01)
    assert time_s[~on_first].std() == pytest.approx(2 * HOUR_S / math.sqrt(12), rel=0.01)
    assert rows[on_first, 0] == pytest.approx(38 + time_s[on_first] / HOUR_S * 0.1, abs=1e-4)
    assert rows[~on_first, 1] == pytest.approx(-9.5 + time_s[~on_first] / HOUR_S * 0.5 - 2.0)
    assert rows[on_first, 3] == pytest.approx(time_s[on_first] / HOUR_S * 500)


@pytest.mark.parametrize("lon_deg", [20.0, 179.99])
def test_places_on_a_bearing_have_the_moments_of_its_sector(lon_deg: float) -> None:
    near, far, half = 5000.0, 20_000.0, math.radians(15)
    seen = Bearing(0.0, 1.0, 0.0, 50.0, lon_deg, 90.0, 15.0, near, far)
    east, north = metres(drawn(seen), 50.0, lon_deg)
    mean = 2 / 3 * (far**3 - near**3) / (far**2 - near**2) * math.sin(half) / half
    square, turn = (near**2 + far**2) / 4, math.sin(2 * half) / (2 * half)
    assert east.mean() == pytest.approx(mean, rel=0.003)
    assert north.mean() == pytest.approx(0.0, abs=40)
    assert east.std() == pytest.approx(math.sqrt(square * (1 + turn) - mean**2), rel=0.01)
    assert north.std() == pytest.approx(math.sqrt(square * (1 - turn)), rel=0.01)


def mirrored(category: LeewayClass) -> LeewayClass:
    """The class as OpenDrift up to 1.14.12 has it, whose right is left."""
    right, left = (
        part._replace(slope_pct=-part.slope_pct, offset_cmps=-part.offset_cmps)
        for part in (category.right, category.left)
    )
    return category._replace(right=right, left=left)


def of_opendrift(row: dict[str, Any]) -> Seen:
    """What it was seeded with; its radius is a standard deviation."""
    if row["seed"] == "polygon":
        ring = ((-0.2, -30.2), (-0.2, -29.8), (0.3, -29.8), (-0.1, -30.0), (0.2, -30.2))
        return SeenArea(0.0, polygons=((ring,),))
    start = WayPoint(-0.2, -30.3, 0.0, 1000.0 * NINETY_NINE_PERCENT)
    end = WayPoint(0.3, -29.9, 6 * HOUR_S, 4000.0 * NINETY_NINE_PERCENT)
    return Voyage(0.0, way_points=(start, end), leg_weights=(1.0,))


@pytest.mark.parametrize("row", OPENDRIFT, ids=lambda row: f"{row['seed']}-{row['class']}")
def test_voyages_and_areas_drift_as_opendrifts_cones_and_polygons(row: dict[str, Any]) -> None:
    wind = constant_flow("wind", 10.0, 270.0)
    objects = (PossibleObject(mirrored(leeway_class(row["class"]))),)
    drift = Drift(objects, wind, constant_flow("current", 0.0, 0.0), jibing_per_hour=0.0)
    times_s = np.array([12 * HOUR_S])
    rng = np.random.default_rng(3)
    tracks = drift_tracks(drift, [of_opendrift(row)], times_s, COUNT, rng, step_s=600.0)
    places = np.stack([tracks.lats_deg[0], tracks.lons_deg[0]], axis=1)
    mean, cov = moments(metres(places, 0.0, -30.0))
    std = np.sqrt(np.diag(cov))
    (east, east_std), (north, north_std) = row["east_m"], row["north_m"]
    assert std == pytest.approx([east_std, north_std], rel=0.01)
    # Both are samples: the mean of one has an error of a 316th of the spread.
    assert mean == pytest.approx([east, north], abs=0.01 * max(east_std, north_std))
    assert cov[0, 1] / std.prod() == pytest.approx(row["correlation"], abs=0.01)


def test_sightings_of_several_kinds_share_the_particles_by_weight() -> None:
    area = SeenArea(5.0, 3.0, 0.0, ((((1.0, 1.0), (1.0, 2.0), (2.0, 2.0)),),))
    seen = [Sighting(0.0, 0.0, 7.0), area]
    rows = draw_sightings(seen, np.array([0, 1, 1, 1]), np.random.default_rng(0))
    assert rows[0].tolist() == list(seen[0]) and (rows[1:, 2] == 5.0).all()
    assert (rows[1:, :2] >= 1.0).all()
