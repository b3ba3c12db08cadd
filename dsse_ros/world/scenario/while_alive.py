# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A cache whose results live as long as the object that they belong to."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


def while_alive(function: Callable[..., T]) -> Callable[..., T]:
    """Return a function that keeps its results as long as its first argument lives.

    Equal first arguments share their results. All arguments must be hashable.
    """
    kept: weakref.WeakKeyDictionary[Any, dict[Any, T]] = weakref.WeakKeyDictionary()

    @functools.wraps(function)
    def caching(first: Any, *others: Any, **named: Any) -> T:
        of_first, key = kept.setdefault(first, {}), (others, tuple(named.items()))
        if key not in of_first:
            of_first[key] = function(first, *others, **named)
        return of_first[key]

    return caching
