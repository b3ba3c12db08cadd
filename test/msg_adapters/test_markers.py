# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search as markers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from visualization_msgs.msg import Marker

from dsse_ros.mission_items.tracks import corners, without_repeats
from dsse_ros.scenario.frames import GridFrame, cell_to_map
from msg_adapters.markers import drone_color, marker_array
from msg_adapters.stamps import to_stamp

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 120.0)
STAMP = to_stamp(0)
CELLS = st.tuples(st.integers(0, 19), st.integers(0, 19))
TRACKS = st.lists(CELLS, max_size=12)


def scene(**changes):
    arguments = {
        "drone_cells": [(1, 2), (5, 5)],
        "names": ["drone0", "drone1"],
        "tracks": [[(0, 2), (1, 2)], [(5, 5)]],
        "live": [True, False],
        "datum": (9.5, 9.5),
        "radius_cells": 2.5,
    }
    return marker_array(FRAME, STAMP, **{**arguments, **changes}).markers


def of(markers, namespace):
    return [marker for marker in markers if marker.ns == namespace]


def test_the_first_marker_deletes_what_an_earlier_mission_left():
    actions = [marker.action for marker in scene()]
    assert actions[0] == Marker.DELETEALL and set(actions[1:]) == {Marker.ADD}


def test_the_same_thing_has_the_same_name_in_every_message():
    def keys(markers):
        return [(marker.ns, marker.id) for marker in markers[1:]]

    assert len(set(keys(scene()))) == len(keys(scene()))
    moved = scene(drone_cells=[(7, 7), (0, 0)], datum=(3, 3), radius_cells=9)
    assert keys(moved) == keys(scene())


def test_a_drone_stands_over_its_cell_with_its_name_above():
    markers = scene()
    body, label = of(markers, "drones")[1], of(markers, "names")[1]
    x_m, y_m = cell_to_map(FRAME, 5, 5)
    assert (body.pose.position.x, body.pose.position.y, body.pose.position.z) == (x_m, y_m, 120.0)
    assert label.text == "drone1" and label.pose.position.z > body.pose.position.z
    assert body.header.frame_id == "map" and body.header.stamp == STAMP


def test_drones_differ_in_colour_and_one_out_of_the_search_is_grey():
    colors = np.array([drone_color(number) for number in range(12)])
    distances = np.abs(colors[:, None] - colors[None]).max(axis=-1)
    assert distances[~np.eye(12, dtype=bool)].min() > 0.05
    alive, out = (marker.color for marker in of(scene(), "drones"))
    assert (alive.r, alive.g, alive.b) == pytest.approx(drone_color(0))
    assert out.r == out.g == out.b


@pytest.mark.parametrize("kind", ["given", "left out"])
def test_persons_are_shown_only_when_given(kind):
    persons = of(scene(person_cells=[(3, 3), (4, 4)], found=[True, False]), "persons")
    if kind == "left out":
        assert of(scene(), "persons") == []
    else:
        assert len(persons) == 2 and persons[0].color != persons[1].color
        x_m, y_m = cell_to_map(FRAME, 3, 3)
        assert (persons[0].pose.position.x, persons[0].pose.position.y) == (x_m, y_m)


def test_the_circle_has_its_radius_about_the_datum_and_closes():
    (circle,) = of(scene(), "circle")
    x_m, y_m = cell_to_map(FRAME, 9.5, 9.5)
    for point in circle.points:
        assert math.hypot(point.x - x_m, point.y - y_m) == pytest.approx(2.5 * 130)
    first, last = circle.points[0], circle.points[-1]
    assert (first.x, first.y) == pytest.approx((last.x, last.y))
    assert of(scene(radius_cells=None), "circle") == []
    assert of(scene(datum=None), "datum") == of(scene(datum=None), "circle") == []


def test_a_line_always_has_two_points_and_a_width():
    for marker in scene():
        if marker.type == Marker.LINE_STRIP:
            assert len(marker.points) >= 2 and marker.scale.x > 0


@given(TRACKS)
def test_a_track_is_drawn_through_the_cells_in_which_it_turns(track):
    flown = of(scene(drone_cells=[(0, 0)], names=["drone0"], live=[True], tracks=[track]), "tracks")
    turns = corners(track)
    if len(turns) < 2:
        assert flown == []
    else:
        expected = [(*cell_to_map(FRAME, *cell), 120.0) for cell in turns.tolist()]
        assert [(point.x, point.y, point.z) for point in flown[0].points] == expected


@given(TRACKS)
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


def test_a_wrong_number_of_names_is_refused():
    with pytest.raises(ValueError, match="zip"):
        scene(names=["drone0"])
