# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Grids for the properties of this folder: `st.from_type(GridFrame)`; helpers can be imported."""

import sys
from pathlib import Path

from hypothesis import strategies as st

from msg_adapters.frames import GridFrame

sys.path.insert(0, str(Path(__file__).parent))


st.register_type_strategy(
    GridFrame,
    st.builds(
        GridFrame,
        grid_size=st.integers(1, 400),
        cell_size_m=st.floats(0.5, 500),
        origin_lat_deg=st.floats(-80, 80),
        origin_lon_deg=st.floats(-180, 180),
        origin_alt_m=st.floats(-100, 3000),
        alt_m=st.floats(0, 500),
        map_frame=st.sampled_from(["map", "sea"]),
        frame_prefix=st.sampled_from(["", "a/"]),
    ),
)
