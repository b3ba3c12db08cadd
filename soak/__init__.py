# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make soak`: the reliability promises in long runs; the tests check each in a short run."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Most rows fly with the helpers of the tests.
sys.path += [
    str(ROOT / "test" / folder)
    for folder in (
        "ros/nodes",
        "vehicles/control",
        "vehicles/fleet",
        "search/environments",
        "mission/recording",
    )
]
