# SPDX-License-Identifier: Apache-2.0
"""No message of the dialect, whatever is in its fields, harms the program."""

from __future__ import annotations

import pytest
from fuzz import fuzz


@pytest.mark.parametrize("dialect", ["ardupilot", "px4"])
def test_whatever_a_vehicle_says_nothing_is_raised_or_believed_that_cannot_be(
    dialect: str,
) -> None:
    heard, became = fuzz(10_000, 1, dialect)
    assert heard["accepted"] > 5_000 and heard["invalid"] > 100 and heard["bad_data"] == 0
    assert became["errors"] == 0 and became["done"] + became["failed"] > 0
