# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lockstep steps per second of `sim_node` while `recorder` and `dashboard` follow all of it."""

from __future__ import annotations

import secrets
import shutil
import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.lockstep import DRONES, _environment, _node, _parameters, _take_turns, _write_walk
from benchmarks.processes import BenchmarkError, Process
from dsse_ros.base.private_files import open_private

KINDS = {
    "plain": "alone",
    "recorded": "recorded",
    "dashboard": "and dashboard",
    "page_open": "and its page open",
}
"""Processes next to the simulation and its peer, each with all earlier ones, and their labels."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def measure(
    *, rounds: int, seconds: float, log: Callable[[str], None]
) -> dict[str, dict[str, list[float]]]:
    """Return steps per second by number of drones and `KINDS`, which run in turn."""
    kinds = list(KINDS)
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        log(f"no browser is installed, none of {', '.join(BROWSERS)}: the page is not opened")
        kinds.remove("page_open")
    rates: dict[str, list[float]] = {kind: [] for kind in kinds}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        workload = folder / "walk.npz"
        starts = _write_walk(workload, "paper", DRONES)
        token, token_file = secrets.token_urlsafe(), folder / "token"
        with open_private(token_file) as file:
            file.write(token.encode())
        peers = {}
        for offset, kind in enumerate(kinds):
            domain = _environment(offset)
            port = _free_port()
            if offset >= 1:
                bag = ["--ros-args", "-p", f"bag:={folder / kind}.mcap"]
                stack.enter_context(_node("dsse_ros.ros.nodes.recorder", bag, domain))
            if offset >= 2:
                of_page = ["--ros-args", "-p", f"port:={port}", "-p", f"token_file:={token_file}"]
                stack.enter_context(_node("dsse_ros.ros.nodes.dashboard", of_page, domain))
            stack.enter_context(_node("dsse_ros.ros.nodes.sim_node", _parameters(starts), domain))
            peers[kind] = stack.enter_context(Process("lockstep", environment=domain))
            peers[kind].set_up({"node": "sim_node", "workload": str(workload)})
            peers[kind].rate(seconds)
            if kind == "page_open":
                url = f"http://127.0.0.1:{port}/?token={token}"
                stack.enter_context(_open_page(str(browser), url))
        _take_turns(peers, rounds, seconds, rates)
    shown = "".join(f"{max(found):10.1f} {KINDS[kind]}" for kind, found in rates.items())
    log(f"{DRONES:>7} drones{shown}   steps/s")
    return {str(DRONES): rates}


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def _open_page(browser: str, url: str) -> Iterator[None]:
    """Open the page in a headless browser for the block, and wait until it shows a mission.

    Raises:
        BenchmarkError: If it shows none.
    """
    from playwright.sync_api import Error, sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        try:
            page = opened.new_page(viewport={"width": 1024, "height": 800})
            try:
                page.goto(url)
                page.wait_for_function(
                    "document.querySelector('canvas.mission-map')?.dataset.step >= 0"
                )
            except Error as error:
                raise BenchmarkError(f"the page: {str(error).splitlines()[0]}") from None
            yield
        finally:
            opened.close()
