# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Offers something by a name of its own, for as long as it is tested."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


@contextmanager
def registered(registry: dict[str, T], thing: T) -> Iterator[str]:
    """Have a registry offer a thing while the block lasts; yields its name there."""
    name = "under_test"
    assert name not in registry, f"{name} is registered already"
    registry[name] = thing
    try:
        yield name
    finally:
        del registry[name]
