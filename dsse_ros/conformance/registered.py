# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Temporary registration under a unique name, for tests."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


@contextmanager
def registered(registry: MutableMapping[str, T], thing: T) -> Iterator[str]:
    """Register a thing during the block; yield its name."""
    name = "under_test"
    assert name not in registry, f"{name} is registered already"
    registry[name] = thing
    try:
        yield name
    finally:
        del registry[name]
