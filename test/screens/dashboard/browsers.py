# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A real browser where there is one, and what axe finds in its pages."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from typing import Any

import pytest
from rig import TIMEOUT_S


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


def violations(page: Any) -> list[tuple[str, list[str]]]:
    """Return the rules of axe-core that a page breaks, and the elements that break them."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    found = axe.Axe().run(page).response["violations"]
    return [(rule["id"], [node["html"] for node in rule["nodes"]]) for rule in found]


def choose_option(page: Any, select: str, option: str) -> None:
    """Choose an option of a list, which an update of the page closes when its options change."""
    from playwright.sync_api import TimeoutError as Late

    chosen = page.get_by_role("option", name=option, exact=True)
    end_s, patience_ms = time.monotonic() + TIMEOUT_S, 5000
    while True:
        page.get_by_role("combobox", name=select).click()
        try:
            chosen.click(timeout=patience_ms)
            return
        except Late:
            if time.monotonic() > end_s:
                raise
            page.keyboard.press("Escape")
            # On a busy machine a click may take longer.
            patience_ms *= 2


@pytest.fixture(scope="module")
def page(browser: Any, address: str) -> Iterator[Any]:
    """The page in a browser of 1400 by 900 pixels."""
    context = browser.new_context(viewport={"width": 1400, "height": 900}, reduced_motion="reduce")
    context.set_default_timeout(TIMEOUT_S * 1000)
    opened = context.new_page()
    opened.goto(address)
    yield opened
    context.close()
