# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Definitions of message types as text, by their names in ROS."""

from __future__ import annotations

import importlib
import os
import re
from functools import cache
from pathlib import Path

from dsse_ros.base.message_types import not_installed, parts_of

_SEPARATOR = "=" * 80
# A field's type, without what makes an array or a bounded text of it.
_FIELD = re.compile(r"^[ \t]*([A-Za-z]\w*(?:/\w+)*)", re.MULTILINE)
_PRIMITIVES = frozenset(
    {"bool", "byte", "char", "string", "wstring", "float32", "float64"}
    | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
)


@cache
def definition(type_name: str) -> str:
    """Return the `ros2msg` definition of a message type: its own text, then that of each it needs.

    The form is that of MCAP's `ros2msg` schemas (mcap.dev/spec/registry#ros2msg).

    Raises:
        FieldError: If the type, or one that it needs, is not installed.
    """
    found = {type_name: _text(type_name)}
    waiting = [type_name]
    while waiting:
        current = waiting.pop(0)
        for needed in _needed(current, found[current]):
            if needed not in found:
                found[needed] = _text(needed)
                waiting.append(needed)
    own, *others = found.items()
    parts = [own[1]]
    for name, text in others:
        package, kind = parts_of(name)
        parts.append(f"{_SEPARATOR}\nMSG: {package}/{kind}\n{text}")
    return "\n".join(parts)


def _needed(type_name: str, text: str) -> list[str]:
    """Return the message types of the fields in a definition."""
    package, _ = parts_of(type_name)
    names = []
    for field in _FIELD.findall(text):
        if field not in _PRIMITIVES:
            owner, _, kind = field.rpartition("/")
            names.append(f"{owner.partition('/')[0] or package}/msg/{kind}")
    return names


@cache
def _text(type_name: str) -> str:
    package, name = parts_of(type_name)
    for prefix in _prefixes(package):
        path = prefix / "share" / package / "msg" / f"{name}.msg"
        if path.is_file():
            return path.read_text(encoding="utf-8").rstrip("\n") + "\n"
    raise not_installed(type_name)


def _prefixes(package: str) -> list[Path]:
    """Return where a package may be installed: where its module is, and what ament knows."""
    try:
        module = importlib.import_module(package)
    except ImportError:
        return []
    # lib/python3.x/site-packages/<package>/__init__.py
    above = Path(module.__file__ or "").resolve().parents[4:5]
    ament = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [*above, *(Path(prefix) for prefix in ament if prefix)]
