# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A domain, a dashboard in it, and a browser where there is one."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).resolve().parents[1] / "nodes")]

from rig import ENVIRONMENT, Rig, rig_of_module  # noqa: E402, F401

os.environ.update(ENVIRONMENT)


@pytest.fixture(scope="module")
def url(rig: Rig) -> str:
    """Address of a page that shows the missions of the domain."""
    process = rig.start("dashboard", {"port": 0})
    served = rig.until(lambda: re.search(r"page at (\S+)", process.output), "a page")
    assert served is not None
    return served[1]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium without a window."""
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        pytest.skip(f"no browser is installed: none of {', '.join(names)}")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield started
        started.close()
