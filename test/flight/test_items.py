# SPDX-License-Identifier: Apache-2.0
"""Items fit the fields of the message."""

import dataclasses
import math

import pytest

from dsse_ros.flight.items import WireItem

ITEM = WireItem(seq=1, frame=6, command=16)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("seq", -1),
        ("seq", 65536),
        ("frame", 256),
        ("command", 65536),
        ("current", -1),
        ("autocontinue", 256),
        ("x", 2**31),
        ("y", -(2**31) - 1),
        ("x", 1.0),
        ("x", math.nan),
        ("param1", "5"),
        ("z", None),
        ("z", 3.5e38),
        ("mission_type", 256),
    ],
)
def test_a_value_that_does_not_fit_its_field_is_refused(field, value):
    with pytest.raises(ValueError, match=f"^{field}: .* is not allowed"):
        dataclasses.replace(ITEM, **{field: value})


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3.4e38, 0])
def test_whatever_float32_holds_is_kept(value):
    item = dataclasses.replace(ITEM, param4=value)
    assert item.param4 == value or math.isnan(value)
