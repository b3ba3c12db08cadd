# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The probability map as an occupancy grid."""

import array
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from msg_adapters.occupancy import (
    SCALINGS,
    matrix_to_map_rows,
    occupancy_grid,
    occupancy_to_array,
    probability_to_occupancy,
)
from msg_adapters.stamps import header, to_stamp

FRAME = ("map", 130.0)
STAMP = to_stamp(26 * 10**9)
SIZES = st.integers(1, 12)


def maps(elements):
    shapes = st.tuples(SIZES, SIZES)
    return hnp.arrays(np.float32, shapes, elements=elements)


PROBABILITIES = st.floats(0, 1, width=32)
ANY = st.floats(0, width=32) | st.just(math.nan)


def expected_level(p, largest, scaling):
    """Return the unrounded value of the formula, in double precision."""
    if scaling == "linear":
        return 100 * p
    if scaling == "max":
        return 100 * p / largest
    return 1 + 99 * max(0.0, 1 + math.log10(p / largest) / 6)


@given(maps(PROBABILITIES), st.sampled_from(SCALINGS))
def test_each_cell_is_its_formula_rounded_and_at_least_one_if_possible_at_all(matrix, scaling):
    occupancy = probability_to_occupancy(matrix, scaling)
    assert occupancy.shape == matrix.shape and occupancy.dtype == np.int8
    largest = float(matrix.max())
    for p, value in zip(matrix.ravel().tolist(), occupancy.ravel().tolist(), strict=True):
        if p == 0:
            assert value == 0
        else:
            level = expected_level(p, largest, scaling)
            # Float32 may round a tie to the other side.
            assert 1 <= value <= 100
            assert abs(value - level) <= 0.5 + 1e-3 or (value == 1 and level < 0.5)


@given(maps(PROBABILITIES), st.sampled_from(["max", "log"]))
def test_the_most_probable_cell_is_full(matrix, scaling):
    occupancy = probability_to_occupancy(matrix, scaling)
    assert occupancy.max() == (100 if matrix.max() > 0 else 0)
    np.testing.assert_array_equal(occupancy[matrix == matrix.max()], occupancy.max())


@pytest.mark.slow
@given(maps(ANY), st.sampled_from(SCALINGS))
@example(np.array([[3.4e38, 1e-45]], dtype=np.float32), "linear")
@example(np.array([[3.4e38, 1e-45]], dtype=np.float32), "log")
@example(np.array([[1e-45, 0.0]], dtype=np.float32), "max")
@example(np.array([[1e-45, math.nan, math.inf]], dtype=np.float32), "max")
@example(np.array([[math.inf, 0.0]], dtype=np.float32), "linear")
def test_any_float_gives_a_value_that_a_map_may_have(matrix, scaling):
    occupancy = probability_to_occupancy(matrix, scaling)
    assert occupancy.min() >= -1 and occupancy.max() <= 100
    np.testing.assert_array_equal(occupancy == -1, np.isnan(matrix))
    np.testing.assert_array_equal(occupancy == 0, matrix == 0)
    assert (occupancy[matrix == np.inf] == 100).all()


@given(maps(PROBABILITIES | st.just(math.nan)))
def test_an_unknown_cell_changes_no_other(matrix):
    known = np.nan_to_num(matrix, nan=0.0)
    occupancy = probability_to_occupancy(matrix)
    clean = probability_to_occupancy(known)
    difference = occupancy.astype(int) - clean
    # The map with unknown cells is scaled in double precision: ties may round otherwise.
    assert abs(difference[~np.isnan(matrix)]).max(initial=0) <= 1


@pytest.mark.parametrize("scaling", SCALINGS)
def test_a_map_larger_than_a_block_is_as_its_parts(scaling):
    matrix = np.random.default_rng(1).random((700, 700), dtype=np.float32)
    matrix[0, 0] = 1.0
    grid = probability_to_occupancy(matrix, scaling)
    part = matrix[600:650].copy()
    part[0, 0] = 1.0
    np.testing.assert_array_equal(
        grid[600:650].ravel()[1:], probability_to_occupancy(part, scaling).ravel()[1:]
    )


def test_the_map_given_is_left_alone_even_when_read_only():
    matrix = np.array([[0.5, math.nan], [0.25, 0.0]], dtype=np.float32)
    matrix.flags.writeable = False
    before = matrix.tobytes()
    for scaling in SCALINGS:
        probability_to_occupancy(matrix, scaling)
    assert matrix.tobytes() == before


@pytest.mark.slow
@given(SIZES, st.data())
def test_the_message_has_a_cell_where_its_map_coordinates_say(size, data):
    col, row = data.draw(st.integers(0, size - 1)), data.draw(st.integers(0, size - 1))
    matrix = np.zeros((size, size), dtype=np.float32)
    matrix[row, col] = 0.5
    frame = GridFrame(len(matrix), 130.0, 0.0, 0.0, 0.0, 0.0)
    message = occupancy_grid(header(frame.map_frame, STAMP), frame.cell_size_m, matrix)
    x_m, y_m = cell_to_map(frame, col, row)
    # As a reader of the message does: from the origin's corner, x along a row.
    east = int(x_m // message.info.resolution)
    north = int(y_m // message.info.resolution)
    assert message.data[north * message.info.width + east] == 100
    assert sum(message.data) == 100


@given(maps(PROBABILITIES), st.sampled_from(SCALINGS))
def test_a_reader_gets_the_occupancy_with_row_0_north(matrix, scaling):
    message = occupancy_grid(header("map", STAMP), 130.0, matrix, scaling)
    np.testing.assert_array_equal(
        occupancy_to_array(message), probability_to_occupancy(matrix, scaling)
    )


def test_cells_outside_the_area_are_unknown():
    area = np.array([[True, False], [True, True]])
    matrix = np.array([[0.5, 0.0], [0.5, 0.0]], np.float32)
    message = occupancy_grid(header("map", STAMP), 130.0, matrix, area=area)
    np.testing.assert_array_equal(occupancy_to_array(message), [[100, -1], [100, 0]])


def test_the_message_says_where_and_when_the_map_is():
    message = occupancy_grid(header("map", STAMP), 130.0, np.zeros((3, 3)))
    assert message.header.frame_id == "map"
    assert message.header.stamp == message.info.map_load_time == STAMP
    assert (message.info.width, message.info.height) == (3, 3)
    assert message.info.resolution == 130.0
    position, orientation = message.info.origin.position, message.info.origin.orientation
    assert (position.x, position.y, position.z) == (0, 0, 0)
    assert (orientation.x, orientation.y, orientation.z, orientation.w) == (0, 0, 0, 1)
    assert isinstance(message.data, array.array)


def test_an_unknown_scaling_or_a_foreign_shape_is_refused():
    with pytest.raises(ValueError, match="^scaling must be .* max, linear, log, got 'cubic'"):
        probability_to_occupancy(np.zeros((2, 2), dtype=np.float32), "cubic")
    with pytest.raises(ValueError, match=r"^probability must be .*, got \(6,\)"):
        occupancy_grid(header("map", STAMP), 130.0, np.zeros(6))


@given(st.integers(0, 5), st.integers(0, 5), st.integers(0, 30))
def test_a_message_of_the_wrong_size_is_refused(width, height, cells):
    message = occupancy_grid(header("map", STAMP), 130.0, np.zeros((1, 1)))
    message.info.width, message.info.height = width, height
    message.data = array.array("b", bytes(cells))
    if cells == width * height:
        assert occupancy_to_array(message).shape == (height, width)
    else:
        with pytest.raises(ValueError, match="^data must be "):
            occupancy_to_array(message)


@given(st.integers(1, 20))
def test_the_flip_puts_the_southern_row_first_and_undoes_itself(size):
    matrix = np.arange(size * size).reshape(size, size)
    rows = matrix_to_map_rows(matrix)
    np.testing.assert_array_equal(rows[0], matrix[-1])
    np.testing.assert_array_equal(matrix_to_map_rows(rows), matrix)


@given(st.integers(1, 20), st.data())
def test_the_flipped_matrix_has_a_cell_where_its_map_coordinates_say(size, data):
    frame = GridFrame(size, 1.0, 0.0, 0.0, 0.0, 0.0)
    col, row = data.draw(st.integers(0, size - 1)), data.draw(st.integers(0, size - 1))
    matrix = np.zeros((size, size))
    matrix[row, col] = 1
    x_m, y_m = cell_to_map(frame, col, row)
    assert matrix_to_map_rows(matrix)[int(y_m), int(x_m)] == 1
