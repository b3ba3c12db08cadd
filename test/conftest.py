# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How Hypothesis looks for examples, which tests come first, and how memory is measured."""

import contextlib
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

FOLDER = Path(__file__).resolve().parent
FIRST = ("test_mavlink_bridge.py", "test_bridge_restarts.py")
"""Of all files those that take longest: by far the most of it they wait for vehicles in flight."""

# Where the machine is busy, an example or its making that takes long is no failure.
settings.register_profile(
    "random", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
# Another example in each run is tried with --hypothesis-profile=random.
settings.register_profile("same", settings.get_profile("random"), derandomize=True, database=None)
settings.load_profile("same")


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


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes long, so that no worker is left alone with it at the end."""

    def rank(item: pytest.Item) -> int:
        if item.path.name in FIRST:
            return 0
        has_nodes = item.path.relative_to(FOLDER).parts[0] in ("nodes", "cli", "ros_env", "soak")
        return 1 if has_nodes or item.get_closest_marker("slow") else 2

    ranks: dict[Path, int] = {}
    for item in items:
        ranks[item.path] = min(ranks.get(item.path, 2), rank(item))
    items.sort(key=lambda item: ranks[item.path])
