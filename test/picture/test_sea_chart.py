# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The picture of an incident has its shore, wind, current and sightings."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.picture.mission_view import MissionView
from dsse_ros.picture.picture import WIDE, Picture
from dsse_ros.picture.sea_chart import CornerRow, corner_rows
from dsse_ros.world.scenario.sea_state import LastKnownPosition, SeaState

RING = np.array([[0.0, 0.0], [400.0, 0.0], [0.0, 300.0]])
SEA = SeaState((-3.0, 3.0), (0.0, -0.5), (RING,))
VIEW = MissionView(
    probability=np.full((9, 9), 1 / 81, np.float32),
    tracks=np.zeros((1, 1, 2), int),
    alive=np.ones(1, bool),
    persons=np.zeros((0, 2), int),
    found=np.zeros(0, bool),
    datum=None,
    step=0,
    timestep_limit=9,
    cell_size_m=130.0,
)


def drawn(view: MissionView) -> tuple[Figure, Any]:
    """Return the figure of a view, and the axes of its map."""
    figure = Figure(WIDE.size_in)
    Picture(figure).draw(view)
    return figure, figure.axes[0]


def test_wind_is_named_by_where_it_comes_from_and_current_by_where_it_flows() -> None:
    assert [row.label for row in corner_rows(SEA, GridExtent(1000.0, 1000.0))] == [
        "wind 4.2 m/s (8.2 kn) from 135°", "current 0.5 m/s (1.0 kn) toward 180°",
    ]  # fmt: skip
    assert corner_rows(SeaState((0.0, 0.0), None), GridExtent(1000.0, 1000.0)) == []


def test_a_sighting_is_a_fix_in_its_circle_or_an_arrow_to_where_it_is_off_the_map() -> None:
    on = LastKnownPosition(400.0, 900.0, 200.0, "LKP 13:20Z")
    off = LastKnownPosition(585.0, -2415.0, 300.0, "LKP 12:05Z")
    sea = SeaState(sightings=(on, off))
    assert corner_rows(sea, GridExtent(9 * 130.0, 9 * 130.0)) == [
        CornerRow("lkp", 0.0, -3000.0, "LKP 12:05Z: 3.0 km, 180° from the centre")
    ]
    _, axes = drawn(replace(VIEW, sea=sea))
    texts = {text.get_text(): text for text in axes.texts}
    assert texts["LKP 13:20Z"].xy == (0.4, 0.9) and "LKP 12:05Z" not in texts
    far = [np.hypot(line.get_xdata() - 0.4, line.get_ydata() - 0.9) for line in axes.lines]
    assert any(len(ring) > 20 and np.allclose(ring, 0.2) for ring in far)


@pytest.mark.slow
@pytest.mark.parametrize("x", [10.0, 600.0, 1160.0])
@pytest.mark.parametrize("y", [10.0, 600.0, 1160.0])
def test_no_label_of_a_sighting_is_cut(x: float, y: float) -> None:
    seen = LastKnownPosition(x, y, 100.0, "LKP 13:20Z, 25%")
    figure, axes = drawn(replace(VIEW, sea=SeaState(sightings=(seen, seen))))
    figure.draw_without_rendering()
    box = axes.get_window_extent()
    labels = [text.get_window_extent() for text in axes.texts if "LKP" in text.get_text()]
    assert len(labels) == 2
    for label in labels:
        assert box.x0 <= label.x0 and label.x1 <= box.x1
        assert box.y0 <= label.y0 and label.y1 <= box.y1


def test_the_arrows_point_to_where_the_flows_go() -> None:
    _, axes = drawn(replace(VIEW, sea=SEA))
    arrows = [text for text in axes.texts if getattr(text, "arrow_patch", None)]
    (wind, current) = (np.subtract(arrow.xy, arrow.xyann) for arrow in arrows[:2])
    assert wind / np.hypot(*wind) == pytest.approx((-(0.5**0.5), 0.5**0.5))
    assert current / np.hypot(*current) == pytest.approx((0.0, -1.0))


def test_the_land_is_on_the_map_in_km() -> None:
    _, axes = drawn(replace(VIEW, sea=SEA))
    (land,) = [
        collection for collection in axes.collections if isinstance(collection, PolyCollection)
    ]
    vertices = land.get_paths()[0].vertices
    assert vertices[:3] == pytest.approx(RING / 1000.0)


def test_a_search_without_an_incident_has_none_of_it() -> None:
    _, axes = drawn(VIEW)
    assert not any("wind" in text.get_text() for text in axes.texts)
    assert not [
        path for collection in axes.collections if isinstance(collection, PolyCollection)
        for path in collection.get_paths()
    ]  # fmt: skip
