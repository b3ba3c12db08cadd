# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The grid in the map frame."""

import dataclasses
import math

import numpy as np
import pytest
from grid_frames import FRAMES
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.world.scenario.frames import (
    GridFrame,
    cell_to_map,
    flip_y,
    map_positions,
    map_to_cell,
)

SANTOS = GridFrame(8, 130.0, -24.04, -46.17, 0.0, 120.0)


def test_the_south_west_cell_is_at_the_origin_and_the_north_east_cell_opposite():
    assert cell_to_map(SANTOS, 0, 7) == (65.0, 65.0)
    assert cell_to_map(SANTOS, 7, 0) == (975.0, 975.0)


@given(FRAMES, st.data())
def test_a_cell_east_is_plus_x_and_a_cell_north_is_plus_y(frame, data):
    col = data.draw(st.integers(0, frame.grid_size.columns - 1))
    row = data.draw(st.integers(0, frame.grid_size.rows - 1))
    x_m, y_m = cell_to_map(frame, col, row)
    x_east, y_east = cell_to_map(frame, col + 1, row)
    x_north, y_north = cell_to_map(frame, col, row - 1)
    assert (x_east - x_m, y_east - y_m) == (pytest.approx(frame.cell_size_m), 0)
    assert (x_north - x_m, y_north - y_m) == (0, pytest.approx(frame.cell_size_m))


@given(FRAMES, st.integers(0, 399))
def test_rows_count_from_the_north_and_y_from_the_south(frame, row):
    _, y_m = cell_to_map(frame, 0, row)
    middle_m = (row + 0.5) * frame.cell_size_m
    height_m = frame.extent.height
    assert flip_y(height_m, y_m) == pytest.approx(middle_m, abs=1e-9 * height_m)
    assert flip_y(height_m, flip_y(height_m, y_m)) == pytest.approx(y_m)


@given(FRAMES, st.data())
def test_every_cell_comes_back_from_anywhere_well_inside_it(frame, data):
    col = data.draw(st.integers(0, frame.grid_size.columns - 1))
    row = data.draw(st.integers(0, frame.grid_size.rows - 1))
    inside = st.floats(-0.49, 0.49)
    point = cell_to_map(frame, col + data.draw(inside), row + data.draw(inside))
    assert map_to_cell(frame, *point) == (col, row)


@given(FRAMES, st.floats(), st.floats())
def test_any_point_is_in_a_cell_of_the_grid_or_in_none(frame, x_m, y_m):
    width_m, height_m = frame.extent
    cell = map_to_cell(frame, x_m, y_m)
    if cell is None:
        almost = 1 - 1e-12
        assert not (0 <= x_m < width_m * almost and 0 <= y_m < height_m * almost)
    else:
        col, row = cell
        assert frame.grid_size.holds(col, row)
        centre_x, centre_y = cell_to_map(frame, col, row)
        reach_m = frame.cell_size_m * 0.5 + 1e-9 * max(frame.extent)
        assert abs(centre_x - x_m) <= reach_m and abs(centre_y - y_m) <= reach_m


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308, -1e-9, 1040.0])
def test_no_cell_holds_a_point_outside(value):
    assert map_to_cell(SANTOS, value, 10.0) is None
    assert map_to_cell(SANTOS, 10.0, value) is None


@pytest.mark.slow
@given(FRAMES, st.lists(st.tuples(st.integers(0, 399), st.integers(0, 399)), min_size=1))
def test_arrays_of_cells_go_where_the_single_cells_go(frame, cells):
    array = np.array(cells)
    x_m, y_m = cell_to_map(frame, array[:, 0], array[:, 1])
    assert list(zip(x_m, y_m, strict=True)) == [cell_to_map(frame, *cell) for cell in cells]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("grid_size", 0),
        ("cell_size_m", 0.0),
        ("cell_size_m", math.nan),
        ("cell_size_m", math.inf),
        ("origin_lat_deg", 90.1),
        ("origin_lon_deg", math.nan),
        ("origin_alt_m", math.inf),
        ("alt_m", math.nan),
        ("map_frame", ""),
    ],
)
def test_a_grid_that_cannot_be_is_refused_by_the_name_of_its_field(field, value):
    values = {
        "grid_size": 8,
        "cell_size_m": 130.0,
        "origin_lat_deg": 0.0,
        "origin_lon_deg": 0.0,
        "origin_alt_m": 0.0,
        "alt_m": 120.0,
    }
    with pytest.raises(ValueError, match=f"^{field} must be "):
        GridFrame(**{**values, field: value})


@given(FRAMES, st.lists(st.tuples(st.integers(0, 399), st.integers(0, 399)), max_size=8))
def test_positions_are_over_the_cells_at_flight_altitude(frame, cells):
    expected = [(*cell_to_map(frame, *cell), frame.alt_m) for cell in cells]
    assert map_positions(frame, cells) == map_positions(frame, cells, 3) == expected


def test_each_drone_has_its_altitude():
    frame = dataclasses.replace(SANTOS, alts_m=(50.0, 60.0))
    assert [z for _, _, z in map_positions(frame, [(0, 0), (0, 0)])] == [50.0, 60.0]
    assert [z for _, _, z in map_positions(frame, [(0, 0), (0, 0)], drone=1)] == [60.0, 60.0]
    with pytest.raises(ValueError, match="^drones must be 2, got 1$"):
        map_positions(frame, [(0, 0)])
