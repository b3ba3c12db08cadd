# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""JSON from others is finite, bounded and can be written again, and nothing else reads JSON."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.json_reader import DEEPEST, read_json

PACKAGE = Path(__file__).resolve().parents[2] / "dsse_ros"
VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(1 << 63), 1 << 64)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@given(VALUES, st.booleans())
def test_what_can_be_written_is_read_and_what_is_read_can_be_written(
    value: Any, ascii_only: bool
) -> None:
    text = json.dumps(value, ensure_ascii=ascii_only, allow_nan=False)
    assert read_json(text, "value") == value
    assert read_json(b"\xef\xbb\xbf" + text.encode(), "value") == value


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not JSON: Expecting value"),
        ("{'a': 1}", "not JSON"),
        ("[1e999]", "numbers must be finite, got 1e999"),
        ('{"select": {"time": -1e999}}', "numbers must be finite, got -1e999"),
        ("[NaN]", "numbers must be finite, got NaN"),
        ("[-Infinity]", "numbers must be finite, got -Infinity"),
        ("1" + "0" * 400, "numbers must be finite, got 1000"),
        ("9" * 5000, "numbers must be finite, got 9999"),
        ('{"a": 1, "b": 2, "a": 1}', "keys of an object must differ, got 'a' twice"),
        (r'["\ud800"]', "must not have half of a surrogate pair"),
        (r'{"\udfff": 1}', "must not have half of a surrogate pair"),
        (b'["\xff"]', "must be UTF-8, got byte 2"),
        ("[" * (DEEPEST + 2) + "]" * (DEEPEST + 2), "at most 64 objects and lists in each other"),
        ("[" * 975 + "]" * 975, "at most 64 objects and lists in each other"),
        ('{"a":' * 980 + "1" + "}" * 980, "at most 64 objects and lists in each other"),
        ("[" * 100_000, "at most 64 objects and lists in each other"),
    ],
)  # fmt: skip
def test_other_text_is_refused_in_one_line(text: str | bytes, reason: str) -> None:
    with pytest.raises(ValueError) as refused:
        read_json(text, "message")
    line = str(refused.value)
    assert line.startswith("message: ") and reason in line
    assert "\n" not in line and len(line) < 160


def test_a_text_is_as_long_and_as_deep_as_allowed_and_not_more() -> None:
    deepest = "[" * DEEPEST + "1" + "]" * DEEPEST
    assert json.dumps(read_json(deepest, "message", len(deepest))) == deepest
    with pytest.raises(ValueError, match=r"^message: JSON must have at most 9 characters, got 10$"):
        read_json('"12345678"', "message", 9)


def test_an_integer_that_no_array_holds_is_a_float() -> None:
    assert read_json(str(10**30), "message") == 1e30
    assert isinstance(read_json(str(10**30), "message"), float)


def test_all_json_of_others_is_read_by_one_reader() -> None:
    readers = {
        (file.relative_to(PACKAGE).as_posix(), ast.unparse(node))
        for file in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in ("load", "loads")
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id == "json"
    }
    # Others only copy or convert what the program itself has just written.
    others = {
        (file, call) for file, call in readers if "dumps(" not in call and "to_geojson" not in call
    }
    assert {file for file, _ in others} <= {
        "base/json_reader.py",
        "base/extras.py",  # of an installed package, by pip
    }
