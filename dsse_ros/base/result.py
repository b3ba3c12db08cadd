# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The result of a command parser: a value, or the reason for refusing it. Parsers never raise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Accepted(Generic[T]):
    """A command that was understood."""

    value: T


@dataclass(frozen=True)
class Rejected:
    """A command that was refused.

    Attributes:
        code: Short snake_case key that diagnostics count by, such as `not_finite`.
        reason: One line that names the field, its value and what is allowed.
    """

    code: str
    reason: str


Result = Accepted[T] | Rejected
"""`Result[int]` is `Accepted[int] | Rejected`."""
