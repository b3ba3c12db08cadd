# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of where on a track a drone flies to in a step."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.search.step.polylines import along, goal_within_reach, points_at

REACH = 130.0
metres = st.floats(-2000.0, 2000.0)
tracks = st.lists(st.tuples(metres, metres), min_size=2, max_size=6).map(np.array)
winds = st.tuples(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0)).map(np.array)


@settings(max_examples=200, deadline=None)
@given(tracks, st.floats(0.0, 1.0), winds, st.sampled_from([10.0, math.inf]))
def test_the_goal_is_on_the_track_ahead_and_within_reach(
    track: np.ndarray, share: float, carried: np.ndarray, tolerance: float
) -> None:
    flown = share * float(along(track)[-1])
    here = points_at(track, np.array(flown))
    length, goal = goal_within_reach(track, here, flown, REACH, carried, tolerance)
    assert length >= flown
    assert np.array_equal(goal, points_at(track, np.array(length)))
    assert math.hypot(*(goal - here - carried)) <= REACH


@settings(max_examples=200, deadline=None)
@given(tracks, st.floats(0.0, 1.0))
def test_a_straight_flight_to_the_goal_cuts_no_corner_by_more_than_the_tolerance(
    track: np.ndarray, share: float
) -> None:
    lengths = along(track)
    flown = share * float(lengths[-1])
    here = points_at(track, np.array(flown))
    length, goal = goal_within_reach(track, here, flown, REACH, np.zeros(2), 10.0)
    corners = track[(lengths > flown) & (lengths < length)]
    leg = goal - here
    along_leg = np.clip((corners - here) @ leg / max(float(leg @ leg), 1e-12), 0.0, 1.0)
    away = np.hypot(*(corners - here - along_leg[:, None] * leg).T)
    # Corners lie up to half a sample from the points that are tried.
    assert (away <= 10.0 + REACH / 64).all()


def test_a_straight_track_is_flown_as_far_as_the_drone_reaches() -> None:
    track = np.array([[0.0, 0.0], [1000.0, 0.0]])
    length, goal = goal_within_reach(track, track[0], 0.0, REACH, np.array([20.0, 0.0]), 10.0)
    assert 149.9 < length <= 150.0 and goal[1] == 0.0
