# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The picture of an incident has its shore, wind and current."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from dsse_ros.scenario.sea_state import SeaState
from dsse_ros.view.mission_view import MissionView
from dsse_ros.view.picture import SIZE_IN, Picture
from dsse_ros.view.sea_chart import flow_labels

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
    figure = Figure(SIZE_IN)
    Picture(figure).draw(view)
    return figure, figure.axes[0]


def test_wind_is_named_by_where_it_comes_from_and_current_by_where_it_flows() -> None:
    assert [label for _, label in flow_labels(SEA)] == [
        "wind 4.2 m/s (8.2 kn) from 135°", "current 0.5 m/s (1.0 kn) toward 180°",
    ]  # fmt: skip
    assert flow_labels(SeaState((0.0, 0.0), None)) == []


def test_the_arrows_point_to_where_the_flows_go() -> None:
    _, axes = drawn(replace(VIEW, sea=SEA))
    arrows = [text for text in axes.texts if getattr(text, "arrow_patch", None)]
    (wind, current) = (np.subtract(arrow.xy, arrow.xyann) for arrow in arrows[:2])
    assert wind / np.hypot(*wind) == pytest.approx((-(0.5**0.5), 0.5**0.5))
    assert current / np.hypot(*current) == pytest.approx((0.0, -1.0))


def test_the_land_is_on_the_map_in_km() -> None:
    _, axes = drawn(replace(VIEW, sea=SEA))
    (land,) = [one for one in axes.collections if isinstance(one, PolyCollection)]
    vertices = land.get_paths()[0].vertices
    assert vertices[:3] == pytest.approx(RING / 1000.0)


def test_a_search_without_an_incident_has_none_of_it() -> None:
    _, axes = drawn(VIEW)
    assert not any("wind" in text.get_text() for text in axes.texts)
    assert not [
        path for one in axes.collections if isinstance(one, PolyCollection)
        for path in one.get_paths()
    ]  # fmt: skip
