# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bars of long jobs, on a terminal only: elsewhere, and without tqdm, they say nothing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def progress(items: Iterable[T], label: str, *, total: int | None = None) -> Iterable[T]:
    """Return the items, with a bar and the time left on standard error.

    Args:
        items: What is worked on, one after the other.
        label: What the job is.
        total: How many items there are, where they have no length.
    """
    try:
        from tqdm import tqdm
    except ModuleNotFoundError:
        return items
    # None: shown on a terminal only.
    bar: Iterable[T] = tqdm(
        items, desc=label, total=total, disable=None, leave=False, dynamic_ncols=True
    )
    return bar


def say(line: str) -> None:
    """Print a line at once, above the bar if there is one."""
    try:
        from tqdm import tqdm
    except ModuleNotFoundError:
        print(line, flush=True)
    else:
        with tqdm.external_write_mode():
            print(line, flush=True)
