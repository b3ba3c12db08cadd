# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Access control of the page: an ASGI middleware for HTTP and WebSocket.

Any other page of the same browser can reach a page on loopback: with a name that resolves to
127.0.0.1 (DNS rebinding), from a script, or as an image. The guard therefore always checks Host and
Origin and, if a browser sends no Origin, its Sec-Fetch headers (W3C, "Fetch Metadata Request
Headers").
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
from collections.abc import Awaitable, Callable, Collection, MutableMapping
from html import escape
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LOOPBACK = ("127.0.0.1", "::1", "localhost")
COOKIE = "dsse_ros_dashboard"
_OWN_SITES = ("same-origin", "none")
"""Sec-Fetch-Site of this page, and of people: an address that was typed, a bookmark. What is no
browser, and a browser that asks for a page of another machine without TLS, sends none."""
HEADERS = {
    # Vue compiles the templates of NiceGUI's components in the browser; all of it is served here.
    "content-security-policy": "default-src 'self'; script-src 'self' 'unsafe-inline' "
    "'unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self'; object-src 'none'; base-uri 'self'; "
    "form-action 'self'; frame-ancestors 'none'",
    # Of a page of another machine, without TLS, browsers do not say which site asks for it.
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


class Guard:
    """Refuses requests with a foreign Host, Origin or site, and without the token if there is one.

    A link on another site may open the page as a whole. A page of another site may not embed a part
    of it.

    Args:
        app: Gets what is not refused.
        names: Hosts by which the page may be asked for, beside those of loopback; a port does not
            matter, as a forwarded one is another.
        any_address: Whether any IP address may be the Host: a browser that was led astray by a name
            sends that name.
        token: What has to be shown as `?token=`, `Authorization: Bearer` or the cookie that the
            former leaves behind; None for nothing.
    """

    def __init__(
        self, app: App, *, names: Collection[str] = (), any_address: bool = False,
        token: str | None = None,
    ) -> None:  # fmt: skip
        self._app = app
        self._names = {name.lower() for name in (*LOOPBACK, *names)}
        self._any_address = any_address
        self._token = None if token is None else token.encode()
        self._cookie = "" if token is None else _cookie_for(token)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it with 403 or 401."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value for name, value in scope["headers"]}
        if reason := self._strange(scope, headers):
            await _refuse(scope, send, 403, reason)
            return
        if self._token is not None:
            given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token")
            if given and scope["type"] == "http" and self._is_token(given[-1].encode("latin-1")):
                await self._welcome(scope, headers, send)
                return
            if not self._is_known(headers):
                reason = (
                    "the token is missing or wrong: open the page once with ?token=... at its end"
                )
                await _refuse(scope, send, 401, reason)
                return
        await self._app(scope, receive, _with_headers(send))

    def _strange(self, scope: Scope, headers: dict[str, bytes]) -> str:
        """Return what is strange about a request, empty for nothing."""
        host = headers.get("host", b"").decode("latin-1")
        if not self._is_ours(host):
            return f"Host {host!r} is not this page's"
        if "origin" in headers:
            origin = headers["origin"].decode("latin-1")
            if origin.lower() not in (f"http://{host.lower()}", f"https://{host.lower()}"):
                return f"Origin {origin!r} is not this page's"
        site = headers.get("sec-fetch-site", b"none").decode("latin-1")
        if site not in _OWN_SITES and not _is_opened(scope, headers):
            return f"Sec-Fetch-Site {site!r} may open this page and have no part of it"
        return ""

    def _is_ours(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in self._names:
            return True
        if not self._any_address:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def _is_token(self, given: bytes) -> bool:
        return self._token is not None and hmac.compare_digest(given, self._token)

    def _is_known(self, headers: dict[str, bytes]) -> bool:
        scheme, _, given = headers.get("authorization", b"").partition(b" ")
        if scheme.lower() == b"bearer" and self._is_token(given.strip()):
            return True
        try:
            cookies = SimpleCookie(headers.get("cookie", b"").decode("latin-1"))
        except CookieError:
            return False
        known = cookies.get(COOKIE)
        return known is not None and hmac.compare_digest(
            known.value.encode(), self._cookie.encode()
        )

    async def _welcome(self, scope: Scope, headers: dict[str, bytes], send: Send) -> None:
        """Keep in a cookie that the token was shown, and lead to the page without it."""
        query = parse_qs(scope["query_string"].decode("latin-1"))
        query.pop("token")
        target = scope["path"] + (f"?{urlencode(query, doseq=True)}" if query else "")
        cookie = f"{COOKIE}={self._cookie}; Path=/; HttpOnly; SameSite=Strict"
        location = "/" + target.lstrip("/")
        if headers.get("sec-fetch-site", b"none").decode("latin-1") in _OWN_SITES:
            await _answer(send, 303, "", {"location": location, "set-cookie": cookie})
            return
        # Along a redirect a browser that came by a link of another site keeps the cookie back.
        page = f'<!doctype html><meta http-equiv="refresh" content="0;url={escape(location)}">'
        kind = {"content-type": "text/html; charset=utf-8", "set-cookie": cookie}
        await _answer(send, 200, page, kind)


def _is_opened(scope: Scope, headers: dict[str, bytes]) -> bool:
    """Return whether a browser opens what it asks for as a page of its own, as by a link."""
    return (
        scope["type"] == "http"
        and scope["method"] in ("GET", "HEAD")
        and headers.get("sec-fetch-mode") == b"navigate"
        and headers.get("sec-fetch-dest") == b"document"
    )


def _cookie_for(token: str) -> str:
    """Return what the cookie holds: not the token itself, which may be good elsewhere too."""
    return hmac.new(token.encode(), COOKIE.encode(), hashlib.sha256).hexdigest()


def _with_headers(send: Send) -> Send:
    """Return a `send` that adds `HEADERS` to what is answered."""
    added = [(name.encode(), value.encode()) for name, value in HEADERS.items()]

    async def wrapped(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *added]}
        await send(message)

    return wrapped


async def _refuse(scope: Scope, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        # Before it is accepted, this answers the handshake with 403 (ASGI, "Close - send event").
        await send({"type": "websocket.close", "code": 1008, "reason": reason[:100]})
    else:
        await _answer(send, status, f"{reason}\n")


async def _answer(
    send: Send, status: int, text: str, headers: dict[str, str] | None = None
) -> None:
    found = {"content-type": "text/plain; charset=utf-8", **HEADERS, **(headers or {})}
    pairs = [(name.encode(), value.encode("latin-1")) for name, value in found.items()]
    await send({"type": "http.response.start", "status": status, "headers": pairs})
    await send({"type": "http.response.body", "body": text.encode()})
