# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How Hypothesis looks for examples, which tests come first, and how memory is measured."""

import contextlib
import faulthandler
import gc
import os
import sys
import tracemalloc
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

FOLDER = Path(__file__).resolve().parent
# For `benchmarks` and `soak`, also where one file is run; behind the installed package.
sys.path.append(str(FOLDER.parent))
# Programs that tests start would find the package of the source tree first, and compile it again.
os.environ["PYTHONSAFEPATH"] = "1"
FIRST = ("test_mavlink_bridge.py", "test_bridge_restarts.py")
"""Of all files those that take longest: by far the most of it they wait for vehicles in flight."""
WAITING = {"ros", "cli", "soak", "control", "dashboard"}
"""Folders whose tests wait for processes most of their time."""

# Where the machine is busy, an example or its making that takes long is no failure.
settings.register_profile(
    "random", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
# The same examples again find nothing new: more of them, others in each run, are tried with
# --hypothesis-profile=random.
settings.register_profile(
    "same", settings.get_profile("random"), derandomize=True, database=None, max_examples=40
)
settings.load_profile("same")

# Python looks for cycles whenever 700 more objects were made than freed, among all that the
# collected tests hold: a tenth of their time. Nodes and programs keep its own numbers.
gc.set_threshold(100_000, 10, 10)


LIMIT_S = 400.0
"""Until a test ends its process: longer than any of them waits for anything."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol() -> Generator[None, object, object]:
    """Fail a test that hangs in C, by the end of its process."""
    faulthandler.dump_traceback_later(LIMIT_S, exit=True, file=sys.__stderr__)
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


LITTLE_BYTES = 1 << 25
"""What a refusal may take, with modules that it is the first to import."""


@pytest.fixture
def little_memory() -> Callable[[], AbstractContextManager[None]]:
    """Return a context in which Python and NumPy ask for little memory, or the test fails."""

    @contextlib.contextmanager
    def measured() -> Iterator[None]:
        tracemalloc.start()
        try:
            yield
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < LITTLE_BYTES

    return measured


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what needs a CUDA device where there is none."""
    if item.get_closest_marker("gpu"):
        from numba import cuda

        if not cuda.is_available():
            pytest.skip("needs a CUDA device")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes long, and mix what waits with what computes, so that no core is idle.

    What waits is over before the end: no worker is left alone with it.
    """

    def waits(path: Path) -> bool:
        return not WAITING.isdisjoint(path.relative_to(FOLDER).parts)

    waiting = {item.path for item in items if waits(item.path)}
    files = list(dict.fromkeys(item.path for item in items))
    places: dict[Path, float] = {}
    for of_kind, until in (
        ([path for path in files if path in waiting], 0.8),
        ([path for path in files if path not in waiting], 1.0),
    ):
        places |= {path: until * i / len(of_kind) for i, path in enumerate(of_kind)}
    items.sort(key=lambda item: -1.0 if item.path.name in FIRST else places[item.path])
