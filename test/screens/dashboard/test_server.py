# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page as a server: what it answers to whom, and where it does not start."""

from __future__ import annotations

import os
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from rig import Rig
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from dsse_ros.screens.dashboard.settings import MIN_TOKEN

pytestmark = pytest.mark.slow


def get(url: str, **headers: str) -> int:
    request = urllib.request.Request(url, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def bearer(address: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {address.partition('token=')[2]}"}


def test_a_strange_host_or_origin_gets_nothing(address: str, url: str) -> None:
    known = bearer(address)
    assert get(url, **known) == 200
    assert get(url, Host="evil.example", **known) == 403
    assert get(url, Origin="http://evil.example", **known) == 403
    assert get(url, Origin=url.rstrip("/"), **known) == 200


def test_another_user_of_the_machine_gets_nothing(address: str, url: str, rig: Rig) -> None:
    """Who knows no more than the port, and what all can read: the graph, /rosout and logs."""
    assert get(url) == get(f"{url}_nicegui_ws/socket.io/?EIO=4&transport=polling") == 401
    assert get(f"{url}?token=") == get(f"{url}?token=wrong") == 401
    token = address.partition("token=")[2]
    assert len(token) >= MIN_TOKEN
    logs = Path(os.environ.get("ROS_LOG_DIR", Path.home() / ".ros" / "log"))
    own = [log for log in logs.glob("*.log") if "dashboard" in log.read_text(errors="replace")]
    assert own and not any(token in log.read_text(errors="replace") for log in own)
    (dashboard,) = (process for process in rig.processes if address in process.output)
    assert token not in Path(f"/proc/{dashboard.child.pid}/cmdline").read_text()


def test_a_strange_origin_gets_no_web_socket(address: str, url: str) -> None:
    place = urlsplit(url).netloc
    socket = f"ws://{place}/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    known: dict[str, Any] = {"open_timeout": 60, "additional_headers": bearer(address)}
    with connect(socket, origin=f"http://{place}", **known) as ours:  # type: ignore[arg-type]
        assert str(ours.recv(60)).startswith("0{")
    for origin in ("http://evil.example", "null", "http://localhost:1"):
        with pytest.raises(InvalidStatus, match="403"):
            connect(socket, origin=origin, **known)  # type: ignore[arg-type]
    with pytest.raises(InvalidStatus, match="403"):
        connect(socket, origin=f"http://{place}", open_timeout=60)  # type: ignore[arg-type]


def test_a_port_that_is_taken_gets_one_clear_line(rig: Rig, url: str) -> None:
    port = urlsplit(url).port
    process = rig.start("dashboard", {"port": port})
    assert process.wait() == 2
    (line,) = process.output.splitlines()
    assert line == f"dashboard: port: {port} cannot be bound: Address already in use"
