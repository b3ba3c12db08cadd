# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a receiver of Cursor on Target gets of a search, over real sockets of this machine."""

from __future__ import annotations

import os
import shutil
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("pytak")

from dsse_ros.base.fields import FieldError
from dsse_ros.screens.tak.picture import FRESH_S, CotPicture
from dsse_ros.screens.tak.sender import CotSender
from dsse_ros.screens.tak.settings import CotSettings
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from dsse_ros.world.scenario.live_texts import ShownContact

FRAME = GridFrame(10, 100.0, -24.0, -46.0, 0.0, 120.0)
INFO = AgentsInfo(("drone0", "drone1"), ("search",), "sea", 0, FRAME, 100, 13.0, 1, 7)
CONTACT = ShownContact(
    "c1", "open", -24.1, -46.2, 0.0, 0.0, 25.0, 60.0, "2026-01-17T14:01Z", 3, 0.4
)
TIMEOUT_S = 10.0
# pytak excludes old versions of TLS by options that Python has replaced.
pytestmark = pytest.mark.filterwarnings("ignore:ssl.OP_NO:DeprecationWarning")


@pytest.fixture
def picture() -> CotPicture:
    """A search with two drones, one of which a vehicle flies, a contact and a map."""
    made = CotPicture()
    made.begin(INFO)
    made.put_drones([(150.0, 250.0, 120.0), (0.0, 0.0, 120.0)])
    made.put_vehicle("drone1", (-24.05, -46.05, 80.0), now_s=100.0)
    made.put_contacts((CONTACT,))
    poc = np.zeros((10, 10), np.float32)
    poc[2, 3], poc[7, 8] = 0.6, 0.4
    made.put_poc(poc)
    return made


def parsed(events: list[bytes]) -> dict[str, ElementTree.Element]:
    """Return events by identity."""
    found = map(ElementTree.fromstring, events)
    return {event.attrib["uid"].removeprefix("dsse_ros.7."): event for event in found}


def place(event: ElementTree.Element) -> tuple[float, float]:
    point = event.find("point")
    assert point is not None
    return float(point.attrib["lat"]), float(point.attrib["lon"])


def test_drones_vehicles_contacts_and_areas_are_where_they_are(picture: CotPicture) -> None:
    events = parsed(picture.events(now_s=101.0))
    assert events.keys() == {"drone0", "drone1", "c1", "poc50.0", "poc90.0", "poc90.1"}
    lat, lon, _ = map_to_geodetic(FRAME, 150.0, 250.0, 0.0)
    # A millionth of a degree is a tenth of a metre.
    assert place(events["drone0"]) == pytest.approx((lat, lon), abs=1e-6)
    assert place(events["drone1"]) == pytest.approx((-24.05, -46.05), abs=1e-6)
    assert [events[name].attrib["how"] for name in ("drone0", "drone1")] == ["m-s", "m-g"]
    contact = events["c1"]
    assert place(contact) == pytest.approx((-24.1, -46.2), abs=1e-6)
    assert contact.find("point").attrib["ce"] == "25.0"  # type: ignore[union-attr]
    assert contact.findtext("detail/remarks") == (
        "open. 3 detections, last 2026-01-17T14:01Z, the person with probability 40%"
    )
    links = events["poc50.0"].findall("detail/link")
    corners = {tuple(map(float, link.attrib["point"].split(","))) for link in links}
    lat, lon, _ = map_to_geodetic(FRAME, np.array([300.0, 400.0]), np.array([700.0, 800.0]), 0.0)
    assert len(links) == 5 and len(corners) == 4
    assert sorted(corners) == [
        pytest.approx((y, x), abs=1e-5) for y in sorted(lat) for x in sorted(lon)
    ]


def test_a_silent_vehicle_gives_way_to_its_drone_and_what_is_gone_is_deleted(
    picture: CotPicture,
) -> None:
    picture.events(now_s=101.0)
    picture.put_contacts((CONTACT._replace(state="dismissed"),))
    events = parsed(picture.events(now_s=100.0 + FRESH_S + 1.0))
    assert events["drone1"].attrib["how"] == "m-s"
    assert "c1" not in events
    gone = events["c1.delete"]
    assert gone.attrib["type"] == "t-x-d-d"
    assert gone.find("detail/link").attrib["uid"] == "dsse_ros.7.c1"  # type: ignore[union-attr]
    assert "c1.delete" not in parsed(picture.events(now_s=102.0))


def test_a_receiver_on_this_machine_gets_them_over_udp(picture: CotPicture) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(TIMEOUT_S)
        url = f"udp://127.0.0.1:{receiver.getsockname()[1]}"
        sender = CotSender(CotSettings(url=url).of_pytak, pytest.fail)
        events = picture.events(now_s=101.0)
        sender.send(events)
        assert [receiver.recv(1 << 16) for _ in events] == events
        sender.close()


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A certificate for 127.0.0.1 that signs itself, and its key."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    folder = tmp_path_factory.mktemp("keys")
    certificate, key = str(folder / "certificate.pem"), str(folder / "key.pem")
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
         "-nodes", "-days", "1", "-subj", "/CN=test", "-addext", "subjectAltName=IP:127.0.0.1",
         "-keyout", key, "-out", certificate],
        check=True, capture_output=True,
    )  # fmt: skip
    os.chmod(key, 0o600)
    return {"certificate": certificate, "key": key, "ca_file": certificate}


@pytest.fixture
def server(keys: dict[str, str]) -> Iterator[tuple[int, list[bytes], threading.Event]]:
    """A server over TLS that wants a certificate: its port, what it got, whether it got any."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(keys["certificate"], keys["key"])
    context.load_verify_locations(keys["ca_file"])
    context.verify_mode = ssl.CERT_REQUIRED
    listening = socket.create_server(("127.0.0.1", 0))
    listening.settimeout(TIMEOUT_S)
    got: list[bytes] = []
    has_all = threading.Event()

    def serve() -> None:
        try:
            connection, _ = listening.accept()
            connection.settimeout(TIMEOUT_S)
            with context.wrap_socket(connection, server_side=True) as secured:
                while b"poc90.1" not in b"".join(got):
                    got.append(secured.recv(1 << 16))
        except OSError:
            got.append(b"")
        has_all.set()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield listening.getsockname()[1], got, has_all
    thread.join(TIMEOUT_S)
    listening.close()


@pytest.mark.slow
def test_a_server_anywhere_gets_them_over_tls(
    picture: CotPicture, keys: dict[str, str],
    server: tuple[int, list[bytes], threading.Event],
) -> None:  # fmt: skip
    port, got, has_all = server
    sender = CotSender(CotSettings(url=f"tls://127.0.0.1:{port}", **keys).of_pytak, pytest.fail)
    events = picture.events(now_s=101.0)
    sender.send(events)
    assert has_all.wait(TIMEOUT_S)
    assert b"".join(got) == b"".join(events)[: len(b"".join(got))]
    sender.close()


@pytest.mark.slow
def test_a_server_that_is_not_whom_its_certificate_names_gets_nothing(
    picture: CotPicture, keys: dict[str, str],
    server: tuple[int, list[bytes], threading.Event],
) -> None:  # fmt: skip
    port, got, has_all = server
    reported: list[str] = []
    sender = CotSender(CotSettings(url=f"tls://localhost:{port}", **keys).of_pytak, reported.append)
    sender.send(picture.events(now_s=101.0))
    assert has_all.wait(TIMEOUT_S)
    sender.close()
    assert got == [b""]
    assert len(reported) == 1 and "certificate verify failed" in reported[0]


@pytest.mark.parametrize(
    "url",
    [
        "", "127.0.0.1:4242", "udp://239.2.3.1:6969", "udp://192.168.1.7:4242", "tcp://0.0.0.0:8087",
        "tcp://tak.example.org:8087", "udp://127.0.0.1", "udp://127.0.0.1:http", "udp://[::1]:4242",
        "udp://localhost@203.0.113.1:4242", "udp://user@127.0.0.1:4242", "udp://127.0.0.1:4242/x",
        "udp+broadcast://127.0.0.1:4242", "tak://127.0.0.1:8089", "wss://tak.example.org:8443/",
        "mqtts://tak.example.org:8883/cot", "file:///tmp/cot.xml", "log://stdout", "udp://127.1:4242",
        "tls://tak.example.org", "tls://user:secret@tak.example.org:8089",
    ],
)  # fmt: skip
def test_nothing_goes_to_another_machine_without_tls(url: str) -> None:
    with pytest.raises(FieldError, match="^url must be udp:// or tcp:// with a loopback"):
        CotSettings(url=url)


@pytest.mark.slow
def test_files_that_tls_cannot_use_are_refused_on_a_line(
    keys: dict[str, str], tmp_path: Path
) -> None:
    url = "tls://tak.example.org:8089"
    open_to_all = tmp_path / "key.pem"
    open_to_all.write_bytes(Path(keys["key"]).read_bytes())
    open_to_all.chmod(0o644)
    for changed, wanted in (
        ({"ca_file": ""}, "ca_file must be a PEM file with tls, got ''"),
        ({"key": str(open_to_all)}, "key: .*: mode must be 600"),
        ({"certificate": "nowhere.pem"}, "cannot be used: .*nowhere.pem"),
        ({"ca_file": keys["key"]}, "certificate, key or ca_file cannot be used: "),
    ):
        with pytest.raises(FieldError, match=wanted) as refused:
            CotSettings(url=url, **keys | changed)
        assert "\n" not in str(refused.value)
