# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small, plain YAML files of fields and values, read as YAML 1.2."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, ClassVar

import yaml

from dsse_ros.base.fields import FieldError, shown

MAX_BYTES = 1_000_000
MAX_DEPTH = 8


class LeadingZeroError(FieldError):
    """A whole number that begins with 0: some readers of YAML take it for an octal one."""


def read_yaml(path: str | os.PathLike[str]) -> Any:
    """Return the content of a file, by the core schema of YAML 1.2 (yaml.org/spec/1.2.2, 10.3).

    In this schema `1e3` is a number, and `no`, `1:30` and `2024-01-01` are strings. `010`, which
    other versions read as 8, is refused.

    Raises:
        FieldError: If the file cannot be read, is not YAML, has a key twice, is larger than
            `MAX_BYTES`, or has an alias, a custom tag or deep nesting, which fields never need.
    """
    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise FieldError(f"size must be at most {MAX_BYTES} bytes")
        return parse_yaml(data.decode("utf-8-sig"))
    except OSError as error:
        raise FieldError(str(error.strerror)) from None
    except UnicodeDecodeError:
        raise FieldError("not UTF-8 text") from None
    except FieldError:
        raise
    except ValueError as error:
        # The path is invalid on every file system.
        raise FieldError(str(error)) from None


def parse_yaml(text: str) -> Any:
    """Return the content of a text, see `read_yaml`.

    Raises:
        FieldError: If it is not YAML, or has a duplicate key, an alias or deep nesting.
    """
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise FieldError(f"not YAML: {' '.join(str(error).split())}") from None


class _Loader(yaml.SafeLoader):
    """PyYAML's loader for YAML 1.1, without the features that 1.2 dropped or fields never need."""

    yaml_implicit_resolvers: dict[str, Any] = {}
    yaml_constructors: ClassVar[dict[Any, Any]] = {}
    _depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise FieldError(f"{_line(self.peek_event())}: value must be written out, got an alias")
        if self._depth >= MAX_DEPTH:
            raise FieldError(f"{_line(self.peek_event())}: levels must be at most {MAX_DEPTH}")
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        lines: dict[Hashable, str] = {}
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                raise FieldError(
                    f"{_line(key_node)}: key must be the name of a field, got {shown(key)}"
                )
            if key in lines:
                raise FieldError(f"{shown(key)} is given twice: {lines[key]} and {_line(key_node)}")
            lines[key] = _line(key_node)
        return super().construct_mapping(node, deep)


_LEADING_ZERO = re.compile(r"[-+]?0[0-9]")


def _number(loader: Any, node: Any) -> int | float:
    text = loader.construct_scalar(node)
    if node.tag.endswith(":int") and _LEADING_ZERO.match(text):
        # YAML 1.1, as in ROS, reads 010 as 8, and 1.2 as 10.
        raise LeadingZeroError(
            f"{_line(node)}: a whole number must not begin with 0, got {shown(text)}"
        )
    try:
        if node.tag.endswith(":int"):
            return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
        return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    except ValueError:
        # The tag does not fit, or there are more digits than Python reads.
        raise FieldError(f"{_line(node)}: value must be a number, got {shown(text)}") from None


def _line(place: Any) -> str:
    return f"line {place.start_mark.line + 1}"


def _truth(loader: Any, node: Any) -> bool:
    return bool(loader.construct_scalar(node).lower() == "true")


_TAG = "tag:yaml.org,2002:"
_SCALARS: dict[str, tuple[str, str, Callable[[Any, Any], Any]]] = {
    "null": ("~|null|Null|NULL|", "~nN", lambda loader, node: None),
    "bool": ("true|True|TRUE|false|False|FALSE", "tTfF", _truth),
    "int": ("[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789", _number),
    "float": (
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
        _number,
    ),
}
"""Pattern of a scalar, its possible first characters, and its constructor."""

for _kind, (_pattern, _first, _make) in _SCALARS.items():
    _first_of = [*_first, ""] if _kind == "null" else list(_first)
    _Loader.add_implicit_resolver(_TAG + _kind, re.compile(f"(?:{_pattern})\\Z"), _first_of)
    _Loader.add_constructor(_TAG + _kind, _make)
for _kind in ("str", "seq", "map"):
    _Loader.add_constructor(_TAG + _kind, getattr(_Loader, f"construct_yaml_{_kind}"))
_Loader.add_constructor(None, _Loader.construct_undefined)  # type: ignore[type-var]
