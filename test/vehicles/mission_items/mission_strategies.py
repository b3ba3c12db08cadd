# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Items of missions, sensible or not, for the properties of this folder."""

import math

from hypothesis import strategies as st

from dsse_ros.vehicles.mission_items.items import Home, MissionItem, VehicleMission

NUMBERS = st.floats(-1e6, 1e6)
ITEMS = st.builds(
    MissionItem,
    command=st.integers(0, 65535),
    frame=st.integers(0, 255),
    param1=NUMBERS,
    param2=NUMBERS,
    param3=NUMBERS,
    param4=NUMBERS | st.just(math.nan),
    lat_deg=st.floats(-90, 90),
    lon_deg=st.floats(-180, 180),
    alt_m=NUMBERS,
)
HOMES = st.builds(Home, st.floats(-90, 90), st.floats(-180, 180), st.floats(-400, 9000))
MISSIONS = st.builds(VehicleMission, HOMES, st.lists(ITEMS, max_size=6).map(tuple))
