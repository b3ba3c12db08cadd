# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Progress bars of long jobs, on terminals with tqdm only."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def progress(items: Iterable[T], label: str, *, total: int | None = None) -> Iterable[T]:
    """Return the items, with a bar and the time left on standard error.

    Args:
        items: The items of the job.
        label: Name of the job.
        total: Number of items, if they have no length.
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
