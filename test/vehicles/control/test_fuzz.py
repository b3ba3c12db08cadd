# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""No message of the MAVLink dialect, with any fields, makes the program fail."""

from __future__ import annotations

import pytest
from fuzz import fuzz


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_no_message_of_a_vehicle_raises_or_sets_an_invalid_position(
    autopilot: str,
) -> None:
    codec, controller = fuzz(10_000, 3, autopilot)
    assert codec["accepted"] > 5_000 and codec["invalid"] > 100 and codec["bad_data"] == 0
    assert controller["errors"] == 0 and controller["done"] + controller["failed"] > 0
