# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Grids on the Earth for properties."""

from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.frames import GridFrame

FRAMES = st.builds(
    GridFrame,
    grid_size=st.builds(GridShape, st.integers(1, 400), st.integers(1, 400)),
    cell_size_m=st.floats(0.5, 500),
    origin_lat_deg=st.floats(-80, 80),
    origin_lon_deg=st.floats(-180, 180),
    origin_alt_m=st.floats(-100, 3000),
    alt_m=st.floats(0, 500),
    map_frame=st.sampled_from(["map", "sea"]),
    frame_prefix=st.sampled_from(["", "a/"]),
)
