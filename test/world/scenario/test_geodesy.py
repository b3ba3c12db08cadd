# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Map frame to WGS84, checked by the formulas of the ellipsoid."""

import dataclasses
import math

import numpy as np
import pymap3d
import pytest
from grid_frames import FRAMES
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import (
    cell_fix,
    cell_to_geodetic,
    geodetic_to_map,
    map_in_earth,
    map_to_geodetic,
)

SANTOS = GridFrame(8, 130.0, -24.04, -46.17, 0.0, 120.0)
DISTANCES_M = st.floats(-50_000, 50_000)
HEIGHTS_M = st.floats(-100, 1000)

# WGS84 (NIMA TR8350.2): the defining axis and flattening.
SEMI_MAJOR_M = 6378137.0
FLATTENING = 1 / 298.257223563


def ecef(lat_deg, lon_deg, alt_m):
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    eccentricity2 = FLATTENING * (2 - FLATTENING)
    normal_m = SEMI_MAJOR_M / math.sqrt(1 - eccentricity2 * math.sin(lat) ** 2)
    return np.array(
        [
            (normal_m + alt_m) * math.cos(lat) * math.cos(lon),
            (normal_m + alt_m) * math.cos(lat) * math.sin(lon),
            (normal_m * (1 - eccentricity2) + alt_m) * math.sin(lat),
        ]
    )


def axes(frame):
    """Return the directions east, north and up at the origin in ECEF."""
    lat, lon = math.radians(frame.origin_lat_deg), math.radians(frame.origin_lon_deg)
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    return east, np.cross(up, east), up


def off_m(frame, fix, x_m, y_m, z_m):
    """Return how far a fix is from east x, north y and z above the sea, by the formulas."""
    lat_deg, lon_deg, alt_m = fix
    east, north, _ = axes(frame)
    origin = ecef(frame.origin_lat_deg, frame.origin_lon_deg, frame.origin_alt_m)
    surface = ecef(lat_deg, lon_deg, frame.origin_alt_m) - origin
    height_m = alt_m - frame.origin_alt_m
    return np.linalg.norm([surface @ east - x_m, surface @ north - y_m, height_m - z_m])


@given(FRAMES, DISTANCES_M, DISTANCES_M, HEIGHTS_M)
def test_a_fix_is_the_point_of_the_ellipsoids_formulas_to_a_millimetre(frame, x_m, y_m, z_m):
    fix = map_to_geodetic(frame, x_m, y_m, z_m)
    assert off_m(frame, fix, x_m, y_m, z_m) < 1e-3


@given(FRAMES, st.integers(0, 400), st.integers(0, 400))
def test_a_drone_flies_as_high_above_the_sea_50_km_away_as_over_the_origin(frame, col, row):
    frame = dataclasses.replace(frame, grid_size=401, cell_size_m=130.0)
    assert cell_fix(frame, 0, col, row)[2] == pytest.approx(frame.origin_alt_m + frame.alt_m)


@given(FRAMES, DISTANCES_M, DISTANCES_M, HEIGHTS_M)
def test_a_point_comes_back_from_its_fix_to_a_millimetre(frame, x_m, y_m, z_m):
    fix = map_to_geodetic(frame, x_m, y_m, z_m)
    assert geodetic_to_map(frame, *fix) == pytest.approx((x_m, y_m, z_m), abs=1e-3)


@given(FRAMES)
def test_the_origin_of_the_map_is_the_given_place(frame):
    lat_deg, lon_deg, alt_m = map_to_geodetic(frame, 0.0, 0.0, 0.0)
    assert lat_deg == pytest.approx(frame.origin_lat_deg, abs=1e-9)
    assert math.remainder(lon_deg - frame.origin_lon_deg, 360) == pytest.approx(0, abs=1e-9)
    assert alt_m == pytest.approx(frame.origin_alt_m, abs=1e-6)


@given(FRAMES)
def test_east_is_more_longitude_and_north_more_latitude(frame):
    lat_deg, lon_deg, _ = map_to_geodetic(frame, 0.0, 0.0, 0.0)
    _, lon_east, _ = map_to_geodetic(frame, 130.0, 0.0, 0.0)
    lat_north, _, _ = map_to_geodetic(frame, 0.0, 130.0, 0.0)
    assert math.remainder(lon_east - lon_deg, 360) > 0
    assert lat_north > lat_deg


@pytest.mark.slow
@given(FRAMES, st.lists(st.tuples(DISTANCES_M, DISTANCES_M, HEIGHTS_M), min_size=1, max_size=5))
def test_arrays_give_what_single_points_give(frame, points):
    x_m, y_m, z_m = np.array(points).T
    fixes = np.array(map_to_geodetic(frame, x_m, y_m, z_m)).T
    singles = np.array([map_to_geodetic(frame, *point) for point in points])
    np.testing.assert_allclose(fixes, singles, rtol=0, atol=1e-9)


def test_one_height_serves_an_array_of_points():
    lats, lons, alts = map_to_geodetic(SANTOS, np.array([0.0, 130.0]), np.zeros(2), 120.0)
    assert lats.shape == lons.shape == alts.shape == (2,)
    assert alts == pytest.approx([120.0, 120.0], abs=0.01)


def test_single_points_are_python_floats():
    assert {type(value) for value in map_to_geodetic(SANTOS, 1, 2, 3)} == {float}
    assert {type(value) for value in geodetic_to_map(SANTOS, -24, -46, 0)} == {float}


@given(FRAMES, st.data())
def test_the_fix_of_a_cell_is_that_of_its_centre_at_flight_altitude(frame, data):
    col = data.draw(st.integers(0, frame.grid_size.columns - 1))
    row = data.draw(st.integers(0, frame.grid_size.rows - 1))
    fix = cell_fix(frame, 0, col, row)
    assert fix == cell_to_geodetic(frame, col, row, frame.alt_m)
    expected = (*cell_to_map(frame, col, row), frame.alt_m)
    assert geodetic_to_map(frame, *fix) == pytest.approx(expected, abs=1e-3)


@pytest.mark.slow
def test_100_000_points_within_50_km_come_back_within_2_cm_at_latitudes_to_80_degrees():
    draw = np.random.default_rng(0)
    for lat_deg, lon_deg in zip(
        np.linspace(-80, 80, 100), draw.uniform(-180, 180, 100), strict=True
    ):
        frame = GridFrame(8, 130.0, lat_deg, lon_deg, draw.uniform(-100, 3000), 120.0)
        bearing, distance_m = draw.uniform(0, 2 * math.pi, 1000), draw.uniform(0, 50_000, 1000)
        points = np.array(
            [distance_m * np.sin(bearing), distance_m * np.cos(bearing), draw.uniform(0, 500, 1000)]
        )
        fixes = map_to_geodetic(frame, *points)
        assert (
            np.linalg.norm(np.array(geodetic_to_map(frame, *fixes)) - points, axis=0).max() < 0.02
        )
        for fix, point in zip(np.array(fixes).T[:50], points.T, strict=False):
            assert off_m(frame, fix, *point) < 0.02
        # What goes over the wire is rounded to 1e-7 degrees, 1.1 cm.
        sent = (np.round(fixes[0] * 1e7) / 1e7, np.round(fixes[1] * 1e7) / 1e7, fixes[2])
        assert np.linalg.norm(np.array(geodetic_to_map(frame, *sent)) - points, axis=0).max() < 0.02


@given(st.integers(0, 7), st.integers(1, 7))
def test_one_cell_to_the_east_is_130_m_on_the_tangent_plane_at_the_origin(row, col):
    frame = GridFrame(8, 130.0, -24.0, -46.17, 0.0, 120.0)
    places = [cell_to_geodetic(frame, col - 1, row, 0.0), cell_to_geodetic(frame, col, row, 0.0)]
    west, east = (ecef(*place) for place in places)
    axis_east, axis_north, _ = axes(frame)
    assert (east - west) @ axis_east == pytest.approx(130.0, abs=1e-3)
    assert (east - west) @ axis_north == pytest.approx(0.0, abs=1e-3)


@given(
    lat_deg=st.floats(-85, 85), lon_deg=st.floats(-180, 180), alt_m=st.floats(-100, 3000),
    x_m=st.floats(0, 4000), y_m=st.floats(0, 4000),
)  # fmt: skip
def test_the_map_lies_on_the_earth_where_its_points_have_their_coordinates(
    lat_deg, lon_deg, alt_m, x_m, y_m
):
    frame = GridFrame(31, 130.0, lat_deg, lon_deg, alt_m, 120.0)
    position, turn = map_in_earth(frame)
    # A point of the tangent plane.
    lat, lon, alt = pymap3d.enu2geodetic(x_m, y_m, 50.0, lat_deg, lon_deg, alt_m)
    moved = np.add(position, rotated(turn, (x_m, y_m, 50.0)))
    np.testing.assert_allclose(moved, pymap3d.geodetic2ecef(lat, lon, alt), atol=1e-3)
    assert np.linalg.norm(turn) == pytest.approx(1.0)


def rotated(turn, point):
    """Return a point turned by a quaternion x y z w."""
    *axis, w = turn
    return np.add(point, 2 * np.cross(axis, np.cross(axis, point) + np.multiply(w, point)))
