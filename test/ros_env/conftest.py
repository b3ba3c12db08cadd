# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A domain with nodes in it, as the tests of the nodes have it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "nodes"))

from rig import ENVIRONMENT, Rig  # noqa: E402

os.environ.update(ENVIRONMENT)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A domain of its own, in which nodes can be started; they are stopped at the end."""
    made = Rig(tmp_path_factory.mktemp("rig"))
    try:
        yield made
    finally:
        made.close()
