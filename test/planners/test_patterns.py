# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the search patterns in metres."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.world.sensors.search_theory import coverage

Points = NDArray[np.float64]


@st.composite
def patterns(draw: st.DrawFn, kinds: tuple[str, ...] = ("PS", "CS", "SS")) -> SearchPattern:
    """Patterns of up to a hundred lanes."""
    kind = draw(st.sampled_from(kinds))
    spacing = draw(st.floats(1, 1000))
    width = spacing * draw(st.floats(1.1, 40))
    length = width if kind in ("SS", "VS") else width * draw(st.floats(1, 2.5))
    return SearchPattern(
        pattern=kind,
        heading=draw(st.floats(-360, 360)),
        track_spacing=None if kind == "VS" else spacing,
        length=length,
        width=width if kind in ("PS", "CS") else None,
        first_turn=draw(st.sampled_from(["starboard", "port"])),
    )


def in_pattern_frame(pattern: SearchPattern, points: Points) -> Points:
    """Return points as (to the side of the first turn, along the first leg)."""
    heading = np.radians(pattern.heading)
    along = points @ [np.sin(heading), np.cos(heading)]
    to_starboard = points @ [np.cos(heading), -np.sin(heading)]
    return np.stack([to_starboard * (1 if pattern.first_turn == "starboard" else -1), along], 1)


def distances_to(track: Points, points: Points) -> Points:
    """Return the distance of each point (M, 2) to the nearest leg."""
    start, leg = track[:-1, None], np.diff(track, axis=0)[:, None]
    part = ((points - start) * leg).sum(2) / (leg**2).sum(2)
    nearest = start + np.clip(part, 0, 1)[..., None] * leg
    return np.asarray(np.sqrt(((points - nearest) ** 2).sum(2)).min(axis=0))


def lanes_of(pattern: SearchPattern) -> tuple[int, float]:
    """Return how many whole lanes hold the area, and its extent along them."""
    assert pattern.track_spacing is not None
    sides = pattern.length, pattern.width or pattern.length
    along, across = sides[::-1] if pattern.pattern == "CS" else sides
    return int(np.ceil(across / pattern.track_spacing - 1e-9)), along


@given(patterns(("PS", "CS")))
def test_lanes_alternate_one_spacing_apart_from_a_corner_of_the_area(
    pattern: SearchPattern,
) -> None:
    assert pattern.track_spacing is not None
    spacing, (lanes, along) = pattern.track_spacing, lanes_of(pattern)
    points = in_pattern_frame(pattern, pattern.track.points_m)
    side, ahead = points.reshape(lanes, 2, 2).transpose(2, 0, 1)
    middle = (lanes - 1) / 2
    expected = (np.arange(lanes) - middle) * spacing
    assert side == pytest.approx(np.stack([expected, expected], 1), abs=1e-6)
    ends = np.array([-1, 1]) * (along - spacing) / 2
    assert ahead == pytest.approx(np.stack([ends, -ends] * lanes)[:lanes], abs=1e-6)


@given(patterns(("SS",)))
def test_the_legs_of_the_square_grow_by_a_spacing_at_every_second_turn(
    pattern: SearchPattern,
) -> None:
    assert pattern.track_spacing is not None
    lanes, _ = lanes_of(pattern)
    legs = np.diff(in_pattern_frame(pattern, pattern.track.points_m), axis=0)
    lengths = [min(k // 2 + 1, lanes - 1) for k in range(2 * lanes - 1)]
    headings = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)] * lanes)[: len(lengths)]
    expected = headings * np.array(lengths)[:, None] * pattern.track_spacing
    assert legs == pytest.approx(expected, abs=1e-6)
    assert pattern.track.points_m[0].tolist() == [0, 0]


@given(patterns(("VS",)))
def test_a_sector_search_has_three_equilateral_triangles_straight_through_the_datum(
    pattern: SearchPattern,
) -> None:
    radius = pattern.length
    points = in_pattern_frame(pattern, pattern.track.points_m) / radius
    assert points[::3] == pytest.approx(np.zeros((4, 2)), abs=1e-9)
    bearings = np.degrees(np.arctan2(*np.diff(points, axis=0).T)) % 360
    turned = np.array([0, 120, 240, 240, 0, 120, 120, 240, 0])
    assert (bearings - turned + 180) % 360 == pytest.approx(180, abs=1e-6)
    assert pattern.track.length_m == pytest.approx(9 * radius)
    assert pattern.track.area_m2 == pytest.approx(pi * radius**2)


@given(patterns(), st.integers(0, 2**32))
def test_no_place_of_the_area_is_farther_from_the_track_than_a_corner_from_its_lane(
    pattern: SearchPattern, seed: int
) -> None:
    assert pattern.track_spacing is not None
    spacing, (lanes, along), track = pattern.track_spacing, lanes_of(pattern), pattern.track
    half = np.array([lanes * spacing, lanes * spacing if pattern.pattern == "SS" else along]) / 2
    places = np.random.default_rng(seed).uniform(-half, half, (200, 2))
    if pattern.pattern == "SS" and lanes % 2 == 0:
        # Starboard and ahead of the datum there is one lane more, after the last ring.
        places += np.array([1, 1]) * spacing / 2
    distances = distances_to(in_pattern_frame(pattern, track.points_m), places)
    assert distances.max() <= spacing / sqrt(2) * (1 + 1e-9)
    assert track.area_m2 == pytest.approx(4 * half.prod())


@given(patterns(), st.floats(1, 1000))
def test_track_length_and_coverage_are_those_of_the_area_by_hand(
    pattern: SearchPattern, sweep_width: float
) -> None:
    assert pattern.track_spacing is not None
    spacing, track = pattern.track_spacing, pattern.track
    # Half a spacing at both ends of the track lies outside of its lanes.
    assert track.length_m + spacing == pytest.approx(track.area_m2 / spacing)
    factor = coverage(sweep_width, track.length_m, track.area_m2)
    assert factor == pytest.approx(sweep_width / spacing * (1 - spacing**2 / track.area_m2))


def test_a_parallel_track_search_worked_by_hand() -> None:
    track = SearchPattern(pattern="PS", heading=90, track_spacing=100, length=500, width=300).track
    assert np.round(track.points_m, 9).tolist() == [
        *([-200, 100], [200, 100], [200, 0], [-200, 0], [-200, -100], [200, -100]),
    ]
    assert (track.length_m, track.area_m2) == (1400, 150_000)


PS: dict[str, Any] = {"pattern": "PS", "track_spacing": 100, "length": 500, "width": 300}


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"pattern": "XX"}, "pattern must be one of PS, CS, VS, SS, got 'XX'"),
        ({"width": None}, "width must be a finite number > 0 m with pattern PS, got None"),
        ({"pattern": "SS"}, "width must be None with pattern SS, got 300.0"),
        ({"pattern": "VS", "width": None}, "track_spacing must be None with pattern VS, got 100.0"),
        ({"width": 501}, "width must be <= length, 500 m, got 501"),
        ({"track_spacing": 500}, "less than the 500 m along them, got 500"),
        ({"pattern": "CS", "track_spacing": 300}, "less than the 300 m along them, got 300"),
        ({"track_spacing": 0.2}, "track_spacing must be >= 0.3 m, for at most 1000 lanes"),
        ({"heading": float("nan")}, "heading must be a finite number"),
        ({"first_turn": "left"}, "first_turn must be one of starboard, port, got 'left'"),
    ],
)
def test_a_value_that_is_not_allowed_gets_one_line(changed: dict[str, Any], line: str) -> None:
    with pytest.raises(FieldError) as caught:
        SearchPattern(**PS | changed)
    assert line in str(caught.value) and "\n" not in str(caught.value)
