# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Progress bars of long jobs, on terminals with tqdm only."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
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


@contextlib.contextmanager
def progress_to(total: int, label: str) -> Iterator[Callable[[int], None]]:
    """Show a bar and the time left on standard error during the block.

    Args:
        total: Number at the end of the bar.
        label: Name of the job.

    Yields:
        A function that moves the bar to a number.
    """
    try:
        from tqdm import tqdm
    except ModuleNotFoundError:
        yield lambda done: None
        return
    with tqdm(desc=label, total=total, disable=None, leave=False, dynamic_ncols=True) as bar:
        yield lambda done: bar.update(done - bar.n) and None


def say(line: str) -> None:
    """Print a line at once, above the bar if there is one."""
    try:
        from tqdm import tqdm
    except ModuleNotFoundError:
        print(line, flush=True)
    else:
        with tqdm.external_write_mode():
            print(line, flush=True)
