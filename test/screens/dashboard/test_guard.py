# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may see the page, and who may not."""

from __future__ import annotations

import asyncio
import base64
from pathlib import Path
from typing import Any
from urllib.parse import quote, quote_plus

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.screens.dashboard.guard import COOKIE, Guard
from dsse_ros.screens.dashboard.settings import MIN_TOKEN, DashboardSettings

TOKEN = "correct horse battery"
KNOWN = {"authorization": f"Bearer {TOKEN}"}


async def _app(scope: Any, receive: Any, send: Any) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"page"})


def ask(
    guard: Guard, headers: dict[str, str], query: str = "", kind: str = "http", method: str = "GET"
) -> tuple[int, dict[str, str]]:
    """Status and headers of the answer; 1008 where a WebSocket is refused."""
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": kind, "path": "/", "query_string": query.encode(), "method": method,
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
    }  # fmt: skip
    asyncio.run(guard(scope, None, send))  # type: ignore[arg-type]
    first = sent[0]
    if first["type"] == "websocket.close":
        return first["code"], {}
    return first["status"], {n.decode(): v.decode() for n, v in first["headers"]}


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    ("headers", "allowed"),
    [
        ({"host": "127.0.0.1:8080"}, True),
        ({"host": "localhost:9000"}, True),
        ({"host": "[::1]:8080"}, True),
        ({"host": "LOCALHOST:8080", "origin": "http://localhost:8080"}, True),
        ({"host": "127.0.0.1:8080", "origin": "http://127.0.0.1:8080"}, True),
        ({}, False),
        ({"host": ""}, False),
        ({"host": "evil.example"}, False),
        ({"host": "127.0.0.1.evil.example:8080"}, False),
        ({"host": "192.0.2.1:8080"}, False),
        ({"host": "[::1"}, False),
        ({"host": "127.0.0.1:8080", "origin": "null"}, False),
        ({"host": "127.0.0.1:8080", "origin": "http://evil.example"}, False),
        ({"host": "127.0.0.1:8080", "origin": "http://127.0.0.1:3000"}, False),
        ({"host": "127.0.0.1:8080", "origin": "http://localhost:8080"}, False),
        ({"host": "127.0.0.1:8080", "origin": "file://127.0.0.1:8080"}, False),
    ],
)
def test_a_strange_host_or_origin_is_refused(
    headers: dict[str, str], allowed: bool, kind: str
) -> None:
    status, _ = ask(Guard(_app, token=TOKEN), headers | KNOWN, kind=kind)
    assert status == (200 if allowed else 403 if kind == "http" else 1008)


FETCHED = {"sec-fetch-mode": "no-cors", "sec-fetch-dest": "image"}
OPENED = {"sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}


@pytest.mark.parametrize("site", ["same-origin", "none", "same-site", "cross-site", "else", ""])
@pytest.mark.parametrize(
    "how",
    [
        FETCHED,
        OPENED,
        {},
        {"sec-fetch-mode": "cors", "sec-fetch-dest": "empty"},
        {"sec-fetch-mode": "no-cors", "sec-fetch-dest": "script"},
        {"sec-fetch-mode": "navigate", "sec-fetch-dest": "iframe"},
        {"sec-fetch-mode": "navigate", "sec-fetch-dest": "object"},
        {"sec-fetch-mode": "no-cors", "sec-fetch-dest": "document"},
    ],
    ids=lambda how: "/".join(how.values()),
)
def test_another_site_may_open_the_page_and_have_no_part_of_it(
    site: str, how: dict[str, str]
) -> None:
    headers = {"host": "127.0.0.1:8080", "sec-fetch-site": site, **how}
    ours = site in ("same-origin", "none")
    assert ask(Guard(_app, token=TOKEN), headers | KNOWN)[0] == (
        200 if ours or how is OPENED else 403
    )
    assert ask(Guard(_app, token=TOKEN), headers | KNOWN, method="POST")[0] == (
        200 if ours else 403
    )
    assert ask(Guard(_app, token=TOKEN), headers | KNOWN, kind="websocket")[0] == (
        200 if ours else 1008
    )


def test_what_says_nothing_of_a_site_is_no_page_of_one() -> None:
    assert ask(Guard(_app, token=TOKEN), {"host": "127.0.0.1:8080", **KNOWN})[0] == 200


def test_a_page_for_others_is_asked_for_by_its_names_or_an_address() -> None:
    guard = Guard(_app, names=["ship.example"], any_address=True, token=TOKEN)
    for host, status in (("ship.example:80", 200), ("192.0.2.1:8080", 200), ("evil.example", 403)):
        assert ask(guard, {"host": host, **KNOWN})[0] == status


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_without_the_token_nothing_is_served(kind: str) -> None:
    guard = Guard(_app, token=TOKEN)
    host = {"host": "127.0.0.1:8080"}
    refused = 401 if kind == "http" else 1008
    for headers in (
        {},
        {"authorization": "Bearer wrong"},
        {"authorization": f"Basic {TOKEN}"},
        {"cookie": f"{COOKIE}_8080=wrong"},
        {"cookie": f"{COOKIE}_8080={TOKEN}"},
        {"cookie": 'a="'},
    ):
        assert ask(guard, {**host, **headers}, kind=kind)[0] == refused
    assert ask(guard, host, "token=wrong", kind)[0] == refused
    assert ask(guard, {**host, "authorization": f"Bearer {TOKEN}"}, kind=kind)[0] == 200


def test_the_token_in_the_address_becomes_a_cookie_that_no_script_can_read() -> None:
    guard = Guard(_app, token=TOKEN)
    host = {"host": "127.0.0.1:8080"}
    status, headers = ask(guard, host, f"token={TOKEN.replace(' ', '+')}&a=1")
    assert status == 303 and headers["location"] == "/?a=1"
    cookie, *attributes = headers["set-cookie"].split("; ")
    assert TOKEN not in cookie
    assert {"HttpOnly", "SameSite=strict"} <= set(attributes)
    for kind in ("http", "websocket"):
        assert ask(guard, {**host, "cookie": cookie}, kind=kind)[0] == 200
        # A page on another port of this machine has another token and a cookie of its own.
        refused = 401 if kind == "http" else 1008
        assert ask(guard, {"host": "127.0.0.1:9000", "cookie": cookie}, kind=kind)[0] == refused


@given(st.binary(min_size=12, max_size=24))
def test_a_token_of_base64_opens_the_page_as_typed_and_as_quoted(drawn: bytes) -> None:
    token = base64.b64encode(drawn).decode()
    guard, host = Guard(_app, token=token), {"host": "127.0.0.1:8080"}
    for typed in (token, quote(token), quote_plus(token, safe="")):
        assert ask(guard, host, f"token={typed}")[0] == 303
    assert ask(guard, host, f"token={token[:-5]}")[0] == 401


def test_who_comes_by_a_link_with_the_token_is_led_on_by_a_page_of_ours() -> None:
    guard = Guard(_app, token=TOKEN)
    linked = {"host": "127.0.0.1:8080", "sec-fetch-site": "cross-site", **OPENED}
    query = f"token={TOKEN.replace(' ', '+')}&a=%22%3E%3Cb%3E"
    status, headers = ask(guard, linked, query)
    assert status == 200 and headers["content-type"].startswith("text/html")
    assert ask(guard, {"host": "127.0.0.1:8080", "cookie": headers["set-cookie"]})[0] == 200
    assert ask(guard, {**linked, **FETCHED}, query)[0] == 403


def test_every_answer_forbids_what_comes_from_elsewhere() -> None:
    guard = Guard(_app, token=TOKEN)
    for headers in ({"host": "evil.example"}, {"host": "localhost"}):
        _, answered = ask(guard, headers)
        policy = answered["content-security-policy"]
        assert "default-src 'self'" in policy and "frame-ancestors 'none'" in policy
        assert "http:" not in policy and "*" not in policy
        assert answered["cross-origin-resource-policy"] == "same-origin"


def test_a_page_without_a_file_has_a_new_token_each_time() -> None:
    tokens = {DashboardSettings().read_token() for _ in range(20)}
    assert len(tokens) == 20 and all(len(token) >= MIN_TOKEN for token in tokens)


def test_a_host_that_is_none_gets_one_clear_line() -> None:
    with pytest.raises(FieldError, match="host must be an address of this machine"):
        DashboardSettings(host="")


def token_file(folder: Path, content: str, mode: int = 0o600) -> Path:
    file = folder / "token"
    file.write_text(content, encoding="utf-8")
    file.chmod(mode)
    return file


@pytest.mark.parametrize("content", ["", "short", "é" * MIN_TOKEN, "\n" + "x" * MIN_TOKEN])
def test_a_token_that_is_none_gets_one_clear_line(content: str, tmp_path: Path) -> None:
    file = token_file(tmp_path, content)
    with pytest.raises(FieldError, match="token_file: the first line of .* must have"):
        DashboardSettings(token_file=str(file)).read_token()


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o644])
def test_a_token_that_others_can_read_is_refused(mode: int, tmp_path: Path) -> None:
    file = token_file(tmp_path, TOKEN, mode)
    with pytest.raises(FieldError, match="token_file: .* mode must be 600"):
        DashboardSettings(token_file=str(file)).read_token()


def test_a_token_is_the_first_line_of_its_file(tmp_path: Path) -> None:
    file = token_file(tmp_path, f"{TOKEN}\nmore\n")
    assert DashboardSettings(host="0.0.0.0", token_file=str(file)).read_token() == TOKEN
    for path in (tmp_path / "nowhere", tmp_path):
        with pytest.raises(FieldError, match="token_file: "):
            DashboardSettings(token_file=str(path)).read_token()
