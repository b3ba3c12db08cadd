# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a page of another site can do with the live page in a real browser: open it, and no more."""

from __future__ import annotations

import http.server
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from rig import TIMEOUT_S, Rig

pytestmark = pytest.mark.slow

TRIES = """
async (page) => {
  const tried = (element, attribute, address) => new Promise((resolve) => {
    element.onload = () => resolve('loaded');
    element.onerror = () => resolve('refused');
    element[attribute] = address;
    document.body.append(element);
  });
  const socket = page.replace('http', 'ws') + '_nicegui_ws/socket.io/?EIO=4&transport=websocket';
  const poll = page + '_nicegui_ws/socket.io/?EIO=4&transport=polling';
  const found = {};
  const image = PARTS_IMAGE;
  found.image = await tried(new Image(), 'src', image);
  found.script = await tried(document.createElement('script'), 'src', PARTS_JS);
  const style = document.createElement('link');
  style.rel = 'stylesheet';
  found.style = await tried(style, 'href', PARTS_CSS);
  found.poll = await tried(document.createElement('script'), 'src', poll);
  found.fetch = await fetch(page, {mode: 'no-cors'}).then(() => 'sent', () => 'refused');
  found.cors = await fetch(page).then(() => 'read', () => 'refused');
  await tried(document.createElement('iframe'), 'src', page);
  found.socket = await new Promise((resolve) => {
    const opened = new WebSocket(socket);
    opened.onopen = () => resolve('opened');
    opened.onerror = () => resolve('refused');
  });
  return found;
}
"""


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[int]:
    """Port of a server with another page."""

    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            body = b"<!doctype html><title>elsewhere</title><body><a id=link>there</a></body>"
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None:
            """Log nothing."""

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_port
    server.shutdown()
    server.server_close()


@pytest.fixture
def tab(browser: Any) -> Iterator[Any]:
    context = browser.new_context()
    context.set_default_timeout(TIMEOUT_S * 1000)
    yield context.new_page()
    context.close()


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1"])
def test_another_site_has_no_part_of_the_page_and_may_link_to_it(
    host: str, elsewhere: int, address: str, url: str, tab: Any
) -> None:
    # The page as it is meant to be, and what it consists of.
    answers: list[Any] = []
    tab.on("response", lambda answer: answers.append(answer))
    tab.goto(address)
    tab.get_by_text("Waiting for a simulation").wait_for()
    assert tab.url == url
    parts = {answer.url for answer in answers if answer.ok}
    of_page = {
        kind: next(part for part in sorted(parts) if urlsplit(part).path.endswith(ends))
        for kind, ends in {"JS": ".js", "CSS": ".css"}.items()
    }
    of_page["IMAGE"] = f"{url}favicon.ico"
    assert tab.request.get(of_page["IMAGE"]).ok
    assert parts and all(answer.ok or answer.status in (101, 303, 304, 404) for answer in answers)
    # The image of the map comes over the WebSocket, as part of a frame.
    # localhost is another site than 127.0.0.1; of the same site another port is another origin.
    tab.goto(f"http://{host}:{elsewhere}/")
    answers.clear()
    tries = TRIES
    for kind, part in of_page.items():
        tries = tries.replace(f"PARTS_{kind}", repr(part))
    found = tab.evaluate(tries, url)
    refused = ("image", "script", "style", "poll", "fetch", "cors", "socket")
    assert {name: found[name] for name in refused} == dict.fromkeys(refused, "refused")
    asked = [answer for answer in answers if answer.url.startswith(url)]
    assert {one.status for one in asked} == {403}
    assert all("Waiting" not in frame.content() for frame in tab.frames)
    # A link with the token opens it, and it works as ever: what it says comes over its WebSocket.
    tab.evaluate("(page) => { document.getElementById('link').href = page; }", address)
    tab.get_by_role("link").click()
    tab.get_by_text("Waiting for a simulation").wait_for()
    assert tab.url == url


def test_the_token_of_a_file_is_not_printed_and_can_be_typed(
    rig: Rig, tab: Any, tmp_path: Path
) -> None:
    token = "a-token-of-24-characters"
    file = tmp_path / "token"
    file.write_text(f"{token}\n", encoding="utf-8")
    file.chmod(0o600)
    process = rig.start("dashboard", {"port": 0, "token_file": str(file)})
    served = rig.until(lambda: re.search(r"page at (\S+)", process.output), "a page")
    assert served is not None and token not in process.output
    tab.goto(served[1])
    for typed, then in (("wrong", "The token is wrong"), (token, "Waiting for a simulation")):
        tab.get_by_label("Token").fill(typed)
        tab.get_by_role("button", name="Open").click()
        tab.get_by_text(then).wait_for()
    assert tab.url == served[1]


def test_two_pages_of_a_machine_keep_their_tokens_apart(
    address: str, url: str, rig: Rig, tab: Any
) -> None:
    process = rig.start("dashboard", {"port": 0})
    served = rig.until(lambda: re.search(r"page at (\S+)", process.output), "a page")
    assert served is not None
    for link in (address, served[1], url, served[1].partition("?")[0]):
        tab.goto(link)
        tab.get_by_text("Waiting for a simulation").wait_for()
