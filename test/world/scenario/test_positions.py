# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Positions are read as people write them, and what is ambiguous is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.results.search_plan.action_plan import position as written
from dsse_ros.world.scenario.place_checks import LAT, place_of
from dsse_ros.world.scenario.positions import position

LISBON = (38 + 40.5 / 60, -(9 + 25.1 / 60))


@pytest.mark.parametrize(
    "text",
    [
        "38 40.5 N 009 25.1 W", "38-40.5N 009-25.1W", "38°40.5'N, 9°25.1'W", "N38 40.5 W9 25.1",
        "9 25.1 w; 38 40.5 n", "38° 40' 30\" N 9° 25' 06\" W", "384030N 0092506W",
        "3840.5N 00925.1W", "38.675, -9.4183333333", "38.675 -9.4183333333", "38:40:30N 9:25:06W",
        "+38 40.5, -9 25.1", "38 - 40.5 N 009 - 25.1 W", " 38.675N 9.4183333333W ",
    ],
)  # fmt: skip
def test_the_usual_forms_are_one_position(text: str) -> None:
    assert position(text) == pytest.approx(LISBON, abs=1e-9)
    assert place_of("base", text) == pytest.approx(LISBON, abs=1e-9)


@given(st.floats(-85, 85), st.floats(-180, 179.99))
def test_what_a_search_action_plan_writes_is_read(lat: float, lon: float) -> None:
    assert position(written(lat, lon)) == pytest.approx((lat, lon), abs=1e-5)


@pytest.mark.parametrize(
    "text",
    [
        "", "38", "38 40.5 N", "38 60 N 9 25 W", "38.5 40 N 9 25 W", "38 40 N 9 25 N", "-38 N 9 W",
        "38 40 9 25", "38 40 X 9 25 W", "N38N 9W", "1e1, 3", "nan, 3", "38,40,9",
    ],
)  # fmt: skip
def test_other_text_is_refused_in_a_line(text: str) -> None:
    with pytest.raises(FieldError) as error:
        place_of("base", text)
    assert str(error.value).startswith("base must be [lat, lon], or text such as 38 40.5 N 009")


def test_a_latitude_off_the_earth_is_refused_however_it_is_written() -> None:
    with pytest.raises(FieldError, match="^lat must be a finite number >= -85 and <= 85 deg, or t"):
        LAT.check("lat", "86 00 N")
