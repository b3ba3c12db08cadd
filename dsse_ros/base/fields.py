# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checked fields: the allowed values of scenarios and rules, stated once as data.

The same data validates Python arguments and YAML, and describes the ROS parameters.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import numbers
import re
from collections.abc import Collection, Iterable, Mapping, Set
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol

import numpy as np

from dsse_ros.base.grid_shape import GridExtent, GridShape

Kind = Literal[
    "bool",
    "int",
    "float",
    "str",
    "vector",
    "cell",
    "cells",
    "floats",
    "ints",
    "names",
    "grid",
    "extent",
    "custom",
]


class FieldError(ValueError):
    """A value that is not allowed; the message is one line: "field must be ..., got ..."."""


class CustomField(Protocol):
    """A value that a class of its own reads: a file, an array, a mapping or a text.

    Attributes:
        ALLOWED: The allowed values, as text.
        IN_MESSAGE: The values that a message may have, as text.
        IS_FILE: Whether a text is the path of a file.
    """

    ALLOWED: ClassVar[str]
    IN_MESSAGE: ClassVar[str]
    IS_FILE: ClassVar[bool]

    @classmethod
    def read(cls, value: Any) -> CustomField:
        """Return the value from any of its forms.

        Raises:
            FieldError: If it is none of them.
        """
        ...

    @classmethod
    def may_be_sent(cls, value: Any) -> bool:
        """Return whether a message may have this value: it names no file that nobody vouches for.

        A mapping has the form of `to_json`.
        """
        ...

    def to_json(self) -> dict[str, Any]:
        """Return the form in a message."""
        ...

    def to_text(self) -> str:
        """Return the form as a parameter."""
        ...

    @property
    def identity(self) -> Any:
        """JSON without names of files; equal for equal values."""
        ...


_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Control characters, and lone surrogates, which can be neither drawn nor sent."""


@dataclass(frozen=True)
class Spec:
    """Type and limits of one field.

    Attributes:
        kind: bool, int, float, str; `vector` is a pair of floats, `cell` a pair of integers
            (col, row), `cells` a list of cells, `grid` a `GridShape`, also given as the integer of
            a square, `extent` a `GridExtent`, also given as the number of a square, `floats`,
            `ints` and `names` are lists, `custom` is any value that `reader` reads.
        doc: One sentence for users, without the unit.
        unit: Unit of the value or of each element, "" if it has none.
        low: Smallest allowed value, inclusive.
        high: Largest allowed value, inclusive.
        above: Values must be greater than this.
        choices: The allowed values of a `str` field, empty for any.
        optional: Whether None ("derive it" or "the profile's default") is allowed; an empty text
            is then the None of a `custom` field.
        reader: Class of the value of a `custom` field.
    """

    kind: Kind
    doc: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    above: float = -math.inf
    choices: Collection[str] = ()
    optional: bool = False
    reader: type[CustomField] | None = None

    def allowed(self) -> str:
        """Return the allowed values as text."""
        if self.reader is not None:
            return self.reader.ALLOWED
        noun = {
            "bool": "true or false",
            "int": "an integer",
            "float": "a finite number",
            "str": "a string without control characters",
            "vector": "two finite numbers [x, y]",
            "cell": "a cell [col, row] of two integers",
            "cells": "a list of cells [col, row]",
            "grid": "an integer, or two [columns, rows], each",
            "extent": "a number, or two [width, height], each",
            "floats": "a list of finite numbers",
            "ints": "a list of integers",
            "names": "a list of names",
        }[self.kind]
        if self.choices:
            return "one of " + ", ".join(self.choices)
        bounds = []
        if self.above > -math.inf:
            bounds.append(f"> {shown_number(self.above)}")
        if self.low > -math.inf:
            bounds.append(f">= {shown_number(self.low)}")
        if self.high < math.inf:
            bounds.append(f"<= {shown_number(self.high)}")
        return " ".join(filter(None, (noun, " and ".join(bounds), self.unit)))

    def check(self, name: str, value: Any) -> Any:
        """Return the value in its canonical Python type.

        Raises:
            FieldError: If the value is not allowed.
        """
        empty = self.kind == "custom" and isinstance(value, str) and not value
        if self.optional and (value is None or empty):
            return None
        if self.reader is not None:
            return self.reader.read(value)
        try:
            return self._convert(value)
        except (TypeError, ValueError, OverflowError):
            raise FieldError(f"{name} must be {self.allowed()}, got {shown(value)}") from None

    def _convert(self, value: Any) -> Any:
        match self.kind:
            case "bool":
                if not isinstance(value, bool | np.bool_):
                    raise TypeError
                return bool(value)
            case "int":
                return self._integer(value)
            case "float":
                return self._number(value)
            case "str":
                if isinstance(value, bool | np.bool_):
                    # YAML and ROS parse true and false as booleans.
                    value = str(value).lower()
                    if not self.choices:
                        raise TypeError
                if not isinstance(value, str) or (self.choices and value not in self.choices):
                    raise TypeError
                if _NOT_IN_XML.search(value):
                    raise TypeError
                return value
            case "vector":
                x, y = _elements(value)
                return (self._number(x), self._number(y))
            case "cell":
                return self._cell(value)
            case "grid":
                if isinstance(value, numbers.Integral):
                    return GridShape.square(self._integer(value))
                columns, rows = _elements(value)
                return GridShape(self._integer(columns), self._integer(rows))
            case "extent":
                if isinstance(value, numbers.Real):
                    return GridExtent(self._number(value), self._number(value))
                width, height = _elements(value)
                return GridExtent(self._number(width), self._number(height))
            case "cells":
                return tuple(self._cell(item) for item in _elements(value))
            case "floats":
                return tuple(self._number(item) for item in _elements(value))
            case "ints":
                return tuple(self._integer(item) for item in _elements(value))
            case "names":
                items = tuple(_elements(value))
                if not all(isinstance(item, str) for item in items):
                    raise TypeError
                return items
            case "custom":
                raise TypeError

    def _cell(self, value: Any) -> tuple[int, int]:
        col, row = _elements(value)
        return (self._integer(col), self._integer(row))

    def _integer(self, value: Any) -> int:
        if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Integral):
            raise TypeError
        return self._bounded(int(value))

    def _number(self, value: Any) -> float:
        if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
            raise TypeError
        if not math.isfinite(value):
            raise ValueError
        return self._bounded(float(value))

    def _bounded(self, value: Any) -> Any:
        if not (self.low <= value <= self.high and value > self.above):
            raise ValueError
        return value


def shown_number(value: float) -> str:
    """Return a number as people write it: `100000000` rather than `1e+08`."""
    return str(int(value)) if abs(value) < 1e19 and value == int(value) else f"{value:g}"


def shown(value: Any) -> str:
    """Return the value on one line of bounded length."""
    try:
        text = " ".join(repr(value).split())
    except (RecursionError, ValueError):
        # Python refuses to print integers with thousands of digits.
        text = f"<{type(value).__name__}>"
    return text if len(text) <= 80 else text[:77] + "..."


def _elements(value: Any) -> list[Any]:
    # The order of a set differs between processes.
    if isinstance(value, str | bytes | Mapping | Set) or not isinstance(value, Iterable):
        raise TypeError
    return list(value)


def field(kind: Kind, doc: str, default: Any = dataclasses.MISSING, **limits: Any) -> Any:
    """Return a dataclass field that carries its `Spec`; a default of None makes it optional."""
    spec = Spec(kind, doc, optional=default is None, **limits)
    return dataclasses.field(default=default, metadata={"spec": spec})


def specs(cls: type) -> dict[str, Spec]:
    """Return the `Spec` of each checked field of a dataclass, in order."""
    return {f.name: f.metadata["spec"] for f in dataclasses.fields(cls) if "spec" in f.metadata}


def check_all(instance: Any, cls: type | None = None) -> None:
    """Check the fields of this frozen dataclass and store the canonical values.

    Raises:
        FieldError: If a value is not allowed.
    """
    for name, spec in specs(cls or type(instance)).items():
        object.__setattr__(instance, name, spec.check(name, getattr(instance, name)))


def check_known(
    what: str,
    names: Iterable[Any],
    known: Iterable[str],
    full_names: Mapping[str, str] | None = None,
    noun: str = "a field",
) -> None:
    """Raise for the first name that is not a known field, and suggest the nearest known one.

    Args:
        what: What the fields are of, for the error.
        names: The names to check.
        known: The known names.
        full_names: Names without their group, with the full ones to suggest.
        noun: What the names are names of, for the error.

    Raises:
        FieldError: If a name is unknown.
    """
    known, full_names = sorted(set(known)), full_names or {}
    for name in names:
        if name not in known:
            # A key of YAML need not be a string.
            to_match = [*known, *full_names]
            near = difflib.get_close_matches(name, to_match, n=1) if isinstance(name, str) else []
            hint = (
                f"did you mean {full_names.get(near[0], near[0])}?"
                if near
                else f"known are {', '.join(known) or 'none'}"
            )
            raise FieldError(f"{shown(name)} is not {noun} of {what}; {hint}")
