# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The smallest areas of the POC, as people see them on a map."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("pytak")

from dsse_ros.screens.tak.areas import MAX_POINTS, outlines, smallest_area
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import geodetic_to_map

FRAME = GridFrame(
    grid_size=12, cell_size_m=100.0, origin_lat_deg=-24.0, origin_lon_deg=-46.0, origin_alt_m=0.0,
    alt_m=100.0,
)  # fmt: skip


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.01, 1.0))
def test_no_smaller_set_of_cells_holds_the_share(seed: int, share: float) -> None:
    poc = np.random.default_rng(seed).dirichlet(np.full(144, 0.3)).reshape(12, 12)
    inside = smallest_area(poc, share)
    assert poc[inside].sum() >= share - 1e-12
    least = poc[inside].min()
    assert poc[inside].sum() - least < share
    assert (poc[~inside] <= least).all()


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_outlines_enclose_the_cells_and_their_holes_alone(seed: int) -> None:
    import shapely

    inside = np.random.default_rng(seed).random((12, 12)) < 0.4
    rings = outlines(FRAME, inside, most=144)
    shapes = []
    for ring in rings:
        assert ring[0] == ring[-1] and len(ring) <= MAX_POINTS
        lat, lon = np.array(ring).T
        east, north, _ = geodetic_to_map(FRAME, lat, lon, 0.0)
        shapes.append(shapely.Polygon(np.stack([east, north], axis=1)))
    areas_m2 = np.array([shape.area for shape in shapes])
    assert (np.diff(areas_m2) < 1.0).all()
    drawn = shapely.union_all(shapes).buffer(1e-3)
    rows, cols = np.indices((12, 12))
    centres = shapely.points((cols + 0.5) * 100.0, (11.5 - rows) * 100.0)
    assert shapely.contains(drawn, centres)[inside].all()
    # Nothing but a hole, which is surrounded, may be enclosed beside them.
    beside = shapely.contains(drawn, centres) & ~inside
    border = np.ones((12, 12), np.bool_)
    border[1:-1, 1:-1] = False
    assert not (beside & border).any()


def test_a_long_outline_keeps_its_shape_and_fits_into_a_datagram() -> None:
    comb = np.zeros((12, 12), np.bool_)
    comb[0], comb[:, ::2] = True, True
    fine = np.kron(comb, np.ones((8, 8), np.bool_))
    frame = GridFrame(96, 10.0, -24.0, -46.0, 0.0, 100.0)
    (ring,) = outlines(frame, fine ^ np.roll(fine, 1, axis=0) | fine, most=1)
    assert 4 < len(ring) <= MAX_POINTS


def test_without_poc_there_is_no_area() -> None:
    assert outlines(FRAME, smallest_area(np.zeros((12, 12)), 0.5), most=5) == []
