# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rectangles are apart when they are, and overlap when they do."""

from __future__ import annotations

import shapely
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.planners.search_plan.rectangles import Rectangle, gap_m

rectangles = st.builds(
    Rectangle, st.floats(-500, 500), st.floats(-500, 500), st.floats(0, 360), st.floats(10, 800),
    st.floats(10, 800),
)  # fmt: skip


@given(rectangles, rectangles)
def test_rectangles_overlap_if_and_only_if_shapely_says_so(a: Rectangle, b: Rectangle) -> None:
    shared = shapely.Polygon(a.corners).intersection(shapely.Polygon(b.corners)).area
    gap = gap_m(a, b)
    if gap >= 0:
        assert shared < 1e-3
    if gap < -1e-2:
        assert shared > 0


@given(rectangles)
def test_a_rectangle_has_its_area_and_contains_its_corners_and_no_point_beyond(
    area: Rectangle,
) -> None:
    assert abs(shapely.Polygon(area.corners).area - area.area_m2) < 1e-6 * area.area_m2
    middle = (area.east, area.south)
    assert area.contains(middle + 0.999 * (area.corners - middle)).all()
    assert not area.contains(middle + 1.001 * (area.corners - middle)).any()
