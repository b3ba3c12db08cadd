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
from collections.abc import Collection
from html import escape
from urllib.parse import urlencode, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("127.0.0.1", "::1", "localhost")
COOKIE = "dsse_ros_dashboard"
"""Start of the cookie's name; the port follows, because browsers share cookies among ports."""
_OWN_SITES = ("same-origin", "none")
"""Sec-Fetch-Site of this page itself, and of typed addresses and bookmarks. Programs send no such
header, nor do browsers to a page of another machine without TLS."""
HEADERS = {
    # Vue compiles the templates of NiceGUI's components in the browser; all of it is served here.
    "content-security-policy": "default-src 'self'; script-src 'self' 'unsafe-inline' "
    "'unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self'; object-src 'none'; base-uri 'self'; "
    "form-action 'self'; frame-ancestors 'none'",
    # Without TLS, browsers do not send a page of another machine the requesting site.
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


_ASK = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>dsse_ros: token</title>
<style>
main {{ font: 16px/1.5 system-ui; max-width: 34em; margin: 2em auto; padding: 0 1em }}
</style>
<main>
<h1>Live page of dsse_ros</h1>
<p>{reason}This page commands missions and vehicles. Open the address that <code>dashboard</code> or
<code>make sim VIEW=1</code> has printed, or enter its token.</p>
<form action="/">
<label>Token <input name="token" type="password" required style="font: inherit"></label>
<button style="font: inherit">Open</button>
</form>
</main>
</html>
"""


class Guard:
    """Refuses requests with a foreign Host, Origin or site, and requests without the token.

    A link on another site may open the page as a whole. A page of another site may not embed a part
    of it. Starlette's `TrustedHostMiddleware` checks neither Origin nor IPv6 addresses.

    Args:
        app: Receives the requests that are not refused.
        token: Required as `?token=`, as `Authorization: Bearer`, or as the cookie that `?token=`
            sets.
        names: Allowed hosts besides loopback, without a port because it may be forwarded.
        any_address: Whether any IP address is an allowed host. DNS rebinding needs a name.
    """

    def __init__(
        self, app: ASGIApp, *, token: str, names: Collection[str] = (), any_address: bool = False
    ) -> None:
        self._app = app
        self._names = {name.lower() for name in (*LOOPBACK, *names)}
        self._any_address = any_address
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it with 403 or 401."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        answer = self._own_answer(HTTPConnection(scope))
        if answer is not None and scope["type"] == "websocket":
            # This answers the handshake with 403 (ASGI, "Close - send event").
            await send({"type": "websocket.close", "code": 1008})
        else:
            await (answer or self._app)(scope, receive, send_with_headers)

    def _own_answer(self, request: HTTPConnection) -> Response | None:
        """Return the guard's own answer to a request; None if the request may pass."""
        if reason := self._foreign(request):
            return PlainTextResponse(f"{reason}\n", 403)
        # In a query, a plus means a space; many type it as the plus of base64.
        shown, wanted = (
            text.replace("+", " ") for text in (request.query_params.get("token", ""), self._token)
        )
        if request["type"] == "http" and _equal(shown, wanted):
            return _welcome(request, self._token)
        if _is_known(request, self._token):
            return None
        return HTMLResponse(_ASK.format(reason="The token is wrong. " if shown else ""), 401)

    def _foreign(self, request: HTTPConnection) -> str:
        """Return what is foreign about a request, "" for nothing."""
        host = request.headers.get("host", "")
        if not self._is_ours(host):
            return f"Host {host!r} is not this page's"
        own_origins = [f"{scheme}://{host.lower()}" for scheme in ("http", "https")]
        origin = request.headers.get("origin", own_origins[0])
        if origin.lower() not in own_origins:
            return f"Origin {origin!r} is not this page's"
        if not _is_own_site(request) and not _is_opened(request):
            site = request.headers["sec-fetch-site"]
            return f"Sec-Fetch-Site {site!r} may link to this page but not embed a part of it"
        return ""

    def _is_ours(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
            if name in self._names:
                return True
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return self._any_address


def _is_known(request: HTTPConnection, token: str) -> bool:
    scheme, _, credentials = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer" and _equal(credentials.strip(), token):
        return True
    return _equal(request.cookies.get(_cookie_name(request), ""), _cookie_for(token))


def _welcome(request: HTTPConnection, token: str) -> Response:
    """Set the cookie, and lead to the page without the token in its address."""
    query = urlencode([item for item in request.query_params.multi_items() if item[0] != "token"])
    location = f"/{request['path'].lstrip('/')}" + (f"?{query}" if query else "")
    answer: Response = RedirectResponse(location, 303)
    if not _is_own_site(request):
        # After a link on another site, a browser withholds the cookie along a redirect.
        answer = HTMLResponse(
            f'<!doctype html><meta http-equiv="refresh" content="0;url={escape(location)}">'
        )
    answer.set_cookie(_cookie_name(request), _cookie_for(token), httponly=True, samesite="strict")
    return answer


def _is_own_site(request: HTTPConnection) -> bool:
    return request.headers.get("sec-fetch-site", "none") in _OWN_SITES


def _is_opened(request: HTTPConnection) -> bool:
    """Return whether a browser opens the page as a whole, as from a link."""
    return (
        request["type"] == "http"
        and request["method"] in ("GET", "HEAD")
        and request.headers.get("sec-fetch-mode") == "navigate"
        and request.headers.get("sec-fetch-dest") == "document"
    )


def _equal(offered: str, wanted: str) -> bool:
    return hmac.compare_digest(offered.encode(), wanted.encode())


def _cookie_name(request: HTTPConnection) -> str:
    """Return the name of the cookie, with the port that the browser knows."""
    return f"{COOKIE}_{urlsplit('//' + request.headers['host']).port or 80}"


def _cookie_for(token: str) -> str:
    """Return the value of the cookie: not the token, which may be valid elsewhere too."""
    return hmac.new(token.encode(), COOKIE.encode(), hashlib.sha256).hexdigest()
