# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Typed access to what `read_json` returns."""

from __future__ import annotations

from typing import Any, NoReturn

from dsse_ros.base.fields import shown

LONGEST_TEXT = 1000
"""Characters of a text: names of frames, drones and actions are much shorter."""


class Keys:
    """Typed access to the keys of a JSON object.

    Every error is a ValueError of one line that names the key, its value and what is allowed.

    Args:
        document: What should be the object.
        where: Its name in errors.

    Attributes:
        where: Its name in errors.
    """

    def __init__(self, document: Any, where: str) -> None:
        if not isinstance(document, dict):
            raise ValueError(f"{where} must be an object, got {shown(document)}")
        self._document = document
        self.where = where

    def has(self, key: str) -> bool:
        """Return whether there is a value of a key."""
        return key in self._document

    def value(self, key: str) -> Any:
        """Return the value of a key, whatever it is."""
        if key not in self._document:
            raise ValueError(f"{self.where}.{key}: missing")
        return self._document[key]

    def inner(self, key: str) -> Keys:
        """Return access to an object in this one."""
        return Keys(self.value(key), f"{self.where}.{key}")

    def entries(self, key: str, length: int | None = None) -> list[Any]:
        """Return a list, of this length if one is given."""
        value = self.value(key)
        if not isinstance(value, list) or length not in (None, len(value)):
            self.refuse(key, "a list" if length is None else f"a list of {length}")
        return list(value)

    def text(self, key: str, *, may_be_empty: bool = False) -> str:
        """Return a text."""
        value = self.value(key)
        if not _is_text(value) or not (value or may_be_empty):
            most = f"of at most {LONGEST_TEXT} characters in UTF-8"
            self.refuse(key, f"a text {most}" if may_be_empty else f"a text {most}, not empty")
        return str(value)

    def names(self, key: str, *, may_be_none: bool = False) -> tuple[str, ...]:
        """Return distinct texts that are not empty; at least one, unless `may_be_none`."""
        value = self.value(key)
        names = value if isinstance(value, list) else []
        are_names = all(_is_text(name) and name for name in names)
        is_list = isinstance(value, list) and (names or may_be_none)
        if not is_list or not are_names or len(set(names)) != len(names):
            self.refuse(key, "a list of different names")
        return tuple(names)

    def integer(self, key: str, least: int | None, most: int | None = None) -> int:
        """Return a whole number within these limits."""
        value = self.value(key)
        if isinstance(value, bool) or not isinstance(value, int):
            self.refuse(key, "a whole number")
        if least is not None and value < least:
            self.refuse(key, f"at least {least}")
        if most is not None and value > most:
            self.refuse(key, f"at most {most}")
        return int(value)

    def flag(self, key: str, *, default: bool) -> bool:
        """Return true or false, the default where the key is missing."""
        value = self._document.get(key, default)
        if not isinstance(value, bool):
            self.refuse(key, "true or false")
        return bool(value)

    def number(self, key: str) -> float:
        """Return a finite number."""
        value = self.value(key)
        if not _is_finite(value):
            self.refuse(key, "a finite number")
        return float(value)

    def refuse(self, key: str, wanted: str) -> NoReturn:
        """Raise the error that says what was wanted instead of the value of a key."""
        value = shown(self._document[key])
        raise ValueError(f"{self.where}.{key} must be {wanted}, got {value}")


def _is_text(value: Any) -> bool:
    """Return whether a value is a text that ROS can send: no lone surrogates, no NUL."""
    if not isinstance(value, str) or len(value) > LONGEST_TEXT or "\0" in value:
        return False
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_finite(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    # An integer may be too large for a float.
    return abs(value) <= 1e300
