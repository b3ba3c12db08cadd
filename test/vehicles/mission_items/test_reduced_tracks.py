# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks reduced to the cells to fly to."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.vehicles.mission_items.reduced_tracks import corners, stops, without_repeats

STEPS = st.lists(
    st.sampled_from([(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (0, 0)]), min_size=1, max_size=30
)


def flown(steps):
    """Return cells and flags of a drone that moves, or searches where the step is (0, 0)."""
    cells = np.cumsum([(0, 0), *steps], axis=0)
    return cells, np.array([False, *[step == (0, 0) for step in steps]])


@given(STEPS)
def test_every_visit_is_a_stop_with_its_searches(steps):
    cells, searched = flown(steps)
    where, times = stops(cells, searched, merge_legs=False)
    assert where.tolist() == without_repeats(cells).tolist()
    assert times.sum() == searched.sum()
    replayed = [cell for cell, n in zip(where.tolist(), times, strict=True) for _ in range(1 + n)]
    assert replayed == cells.tolist()


@given(STEPS)
def test_a_merged_track_is_the_same_line_with_the_same_searches(steps):
    cells, searched = flown(steps)
    where, times = stops(cells, searched, merge_legs=True)
    assert corners(where).tolist() == corners(cells).tolist()
    searched_cells = [cell for cell, n in zip(where.tolist(), times, strict=True) for _ in range(n)]
    assert searched_cells == cells[searched].tolist()
    # Nothing is left that the line does not need.
    needed = {tuple(cell) for cell in corners(cells).tolist()}
    assert all(n or tuple(cell) in needed for cell, n in zip(where.tolist(), times, strict=True))


def test_one_flag_per_cell_is_wanted():
    with pytest.raises(ValueError, match=r"^searched must be one .* \(2,\), got \(1,\)"):
        stops([(0, 0), (0, 1)], [True], merge_legs=False)


def test_an_empty_track_has_no_stops():
    where, times = stops([], [], merge_legs=True)
    assert where.shape == (0, 2) and times.shape == (0,)


@given(st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=12))
def test_a_track_without_repeats_has_no_equal_neighbours_and_loses_nothing_else(track):
    kept = [tuple(cell) for cell in without_repeats(track).tolist()]
    expected = [cell for index, cell in enumerate(track) if index == 0 or cell != track[index - 1]]
    assert kept == expected


@given(st.lists(st.sampled_from([(-1, 0), (1, 0), (0, 1), (1, 1), (0, 0), (2, 2)]), max_size=20))
def test_the_corners_of_a_track_span_the_same_line(moves):
    track = np.cumsum([(50, 50), *moves], axis=0)
    turns = corners(track)
    walked = [tuple(turns[0].tolist())]
    for start, end in zip(turns[:-1], turns[1:], strict=True):
        steps = int(np.abs(end - start).max())
        walked += [
            tuple((start + (end - start) * k // steps).tolist()) for k in range(1, steps + 1)
        ]
    on_track = {tuple(cell) for cell in track.tolist()}
    assert on_track <= set(walked)
    length = np.abs(np.diff(track, axis=0)).sum()
    assert np.abs(np.diff(turns, axis=0)).sum() == length
    assert walked[-1] == tuple(track[-1].tolist())
