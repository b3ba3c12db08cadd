# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search as markers."""

import math

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from msg_adapters.markers import (
    Scene,
    ShownDrone,
    ShownFlow,
    ShownPerson,
    ShownSighting,
    drone_color,
    marker_array,
)
from msg_adapters.stamps import header, to_stamp

STAMP = to_stamp(0)


def at(col, row, z_m=0.0):
    """Where a cell of a grid of 20 x 20 cells of 130 m is."""
    return (col + 0.5) * 130.0, (19.5 - row) * 130.0, z_m


DRONES = (
    ShownDrone("drone0", at(1, 2, 120.0), (at(0, 2, 120.0), at(1, 2, 120.0)), live=True),
    ShownDrone("drone1", at(5, 5, 120.0), (at(5, 5, 120.0),), live=False),
)
SCENE = Scene(130.0, 2600.0, 2600.0, DRONES, datum=at(9.5, 9.5), radius_m=325.0)


def shown(**changes):
    return marker_array(header("map", STAMP), SCENE._replace(**changes)).markers


def of(markers, namespace):
    return [marker for marker in markers if marker.ns == namespace]


def test_the_first_marker_deletes_what_an_earlier_mission_left():
    actions = [marker.action for marker in shown()]
    assert actions[0] == Marker.DELETEALL and set(actions[1:]) == {Marker.ADD}


def test_the_same_thing_has_the_same_name_in_every_message():
    def keys(markers):
        return [(marker.ns, marker.id) for marker in markers[1:]]

    assert len(set(keys(shown()))) == len(keys(shown()))
    drones = [drone._replace(position=at(7, 7, 60.0)) for drone in DRONES]
    moved = shown(drones=drones, datum=at(3, 3), radius_m=1170.0)
    assert keys(moved) == keys(shown())


def test_a_drone_stands_over_its_cell_with_its_name_above():
    markers = shown()
    body, label = of(markers, "drones")[1], of(markers, "names")[1]
    place = body.pose.position
    assert (place.x, place.y, place.z) == at(5, 5, 120.0)
    assert label.text == "drone1" and label.pose.position.z > body.pose.position.z
    assert body.header.frame_id == "map" and body.header.stamp == STAMP


def test_drones_differ_in_colour_and_one_out_of_the_search_is_grey():
    colors = np.array([drone_color(number) for number in range(12)])
    distances = np.abs(colors[:, None] - colors[None]).max(axis=-1)
    assert distances[~np.eye(12, dtype=bool)].min() > 0.05
    alive, out = (marker.color for marker in of(shown(), "drones"))
    assert (alive.r, alive.g, alive.b) == pytest.approx(drone_color(0))
    assert out.r == out.g == out.b


@pytest.mark.parametrize("kind", ["given", "left out"])
def test_persons_are_shown_only_when_given(kind):
    people = [ShownPerson(at(3, 3), True), ShownPerson(at(4, 4), False)]
    persons = of(shown(persons=people), "persons")
    if kind == "left out":
        assert of(shown(), "persons") == []
    else:
        assert len(persons) == 2 and persons[0].color != persons[1].color
        place = persons[0].pose.position
        assert (place.x, place.y, place.z) == at(3, 3)


def test_the_circle_has_its_radius_about_the_datum_and_closes():
    (circle,) = of(shown(), "circle")
    x_m, y_m, _ = at(9.5, 9.5)
    for point in circle.points:
        assert math.hypot(point.x - x_m, point.y - y_m) == pytest.approx(325.0)
    first, last = circle.points[0], circle.points[-1]
    assert (first.x, first.y) == pytest.approx((last.x, last.y))
    assert of(shown(radius_m=None), "circle") == []
    assert of(shown(datum=None), "datum") == of(shown(datum=None), "circle") == []


def test_a_line_always_has_two_points_and_a_width():
    for marker in shown():
        if marker.type == Marker.LINE_STRIP:
            assert len(marker.points) >= 2 and marker.scale.x > 0


def test_a_track_is_drawn_through_its_corners():
    (flown,) = of(shown(), "tracks")
    assert [(point.x, point.y, point.z) for point in flown.points] == list(DRONES[0].track)


def test_wind_current_and_the_last_known_position_are_named_at_their_places():
    flows = [ShownFlow("wind", (8.0, 0.0), "a wind"), ShownFlow("current", (0.0, 0.5), "a current")]
    seen = ShownSighting(at(3, 4), 0.0, "LKP")
    ring = np.array([(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)])
    markers = shown(flows=flows, sightings=[seen], shore=[ring])
    wind, current = (of(markers, kind)[0].points for kind in ("wind", "current"))
    assert (wind[0].x, wind[0].y) == (1300.0, 1300.0)
    assert (wind[1].x, current[1].y) == (1300.0 + 480.0, 1300.0 + 300.0)
    names = of(markers, "sea_names")
    assert [name.text for name in names] == ["a wind", "a current", "LKP"]
    assert len({name.id for name in names}) == 3
    (shore,) = of(markers, "shore")
    assert [(point.x, point.y) for point in shore.points] == [(0, 0), (9, 0), (9, 9), (0, 0)]
    place, around = of(markers, "lkp")
    assert (place.pose.position.x, place.pose.position.y, 0.0) == seen.position
    # Even an exact one has a circle that is seen.
    assert math.dist((around.points[0].x, around.points[0].y), seen.position[:2]) > 30.0
