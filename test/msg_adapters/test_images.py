# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The exact probability map as an image."""

import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sensor_msgs.msg import Image

from msg_adapters.images import image_to_probability, probability_image
from msg_adapters.stamps import header, to_stamp

STAMP = to_stamp(13)
MATRICES = hnp.arrays(
    np.float32, hnp.array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.floats(width=32)
)


def image_of(matrix):
    return probability_image(header("map", STAMP), matrix)


@given(MATRICES)
def test_every_bit_of_the_map_comes_back(matrix):
    message = image_of(matrix)
    assert (message.encoding, message.is_bigendian, message.step) == (
        "32FC1",
        0,
        4 * matrix.shape[1],
    )
    assert image_to_probability(message).tobytes() == matrix.tobytes()


def test_row_0_of_the_image_is_north():
    matrix = np.zeros((3, 3), dtype=np.float32)
    matrix[0] = 1
    assert np.frombuffer(image_of(matrix).data, dtype="<f4")[:3].tolist() == [1, 1, 1]


@given(MATRICES)
def test_a_view_of_a_map_gives_the_same_image_as_a_copy(matrix):
    assert image_of(matrix[::-1].T) == image_of(matrix[::-1].T.copy())


@pytest.mark.slow
@given(MATRICES, st.integers(0, 9))
def test_big_endian_and_padded_images_are_read_too(matrix, padding):
    message = image_of(matrix)
    rows = matrix.astype(">f4").view(np.uint8)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=7)
    message.is_bigendian = 1
    message.step += padding
    message.data = array.array("B", padded.tobytes())
    read = image_to_probability(message)
    assert read.dtype == np.float32 and read.dtype.isnative
    np.testing.assert_array_equal(read, matrix)


def test_the_map_read_is_read_only():
    with pytest.raises(ValueError, match="read-only"):
        image_to_probability(image_of(np.zeros((2, 2), dtype=np.float32)))[0, 0] = 1


def test_a_map_that_is_no_matrix_is_refused():
    with pytest.raises(ValueError, match=r"^probability must be a matrix, got \(3,\)"):
        probability_image(header("map", STAMP), np.zeros(3, dtype=np.float32))


UINT32 = st.integers(0, 6) | st.integers(0, 2**32 - 1)


@given(
    st.builds(
        Image,
        encoding=st.sampled_from(["32FC1"] * 4 + ["mono8"]) | st.text(),
        width=UINT32,
        height=UINT32,
        step=UINT32,
        is_bigendian=st.integers(0, 255),
        data=st.binary(max_size=80).map(lambda data: array.array("B", data)),
    )
)
def test_a_hostile_image_is_a_map_or_one_clear_line(message):
    try:
        matrix = image_to_probability(message)
    except ValueError as error:
        fields = ("encoding", "width x height", "step", "data")
        assert str(error).startswith(tuple(f"{field} must be " for field in fields))
        assert len(str(error).splitlines()) == 1
    else:
        assert matrix.shape == (message.height, message.width)
