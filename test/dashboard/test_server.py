# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page as a server: what it answers to whom, and where it does not start."""

from __future__ import annotations

import urllib.error
import urllib.request
from urllib.parse import urlsplit

import pytest
from rig import Rig
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

pytestmark = pytest.mark.slow


def get(url: str, **headers: str) -> int:
    request = urllib.request.Request(url, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def test_a_strange_host_or_origin_gets_nothing(url: str) -> None:
    assert get(url) == 200
    assert get(url, Host="evil.example") == 403
    assert get(url, Origin="http://evil.example") == 403
    assert get(url, Origin=url.rstrip("/")) == 200


def test_a_strange_origin_gets_no_web_socket(url: str) -> None:
    place = urlsplit(url).netloc
    socket = f"ws://{place}/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    with connect(socket, origin=f"http://{place}", open_timeout=60) as ours:  # type: ignore[arg-type]
        assert str(ours.recv(60)).startswith("0{")
    for origin in ("http://evil.example", "null", "http://localhost:1"):
        with pytest.raises(InvalidStatus, match="403"):
            connect(socket, origin=origin, open_timeout=60)  # type: ignore[arg-type]


def test_a_port_that_is_taken_gets_one_clear_line(rig: Rig, url: str) -> None:
    port = urlsplit(url).port
    process = rig.start("dashboard", {"port": port})
    assert process.wait() == 2
    (line,) = process.output.splitlines()
    assert line == f"dashboard: port: {port} cannot be bound: Address already in use"
