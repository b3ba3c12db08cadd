# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every parser of external data: it accepts or refuses any bytes."""

from __future__ import annotations

import array
import atexit
import hashlib
import io
import json
import shutil
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from soak import ROOT

Take = Callable[[bytes], object]
"""Reads bytes; raises only documented exceptions."""


@dataclass(frozen=True)
class Parser:
    """A parser, or several for the same input.

    Attributes:
        reads: Name of the input.
        make: Returns the reader, and bytes that it reads without an error.
        modules: Modules whose coverage guides the search; none may be compiled.
    """

    reads: str
    make: Callable[[], tuple[Take, list[bytes]]]
    modules: tuple[str, ...]


def _yaml() -> tuple[Take, list[bytes]]:
    from dsse_ros.world.scenario.rules import profile
    from dsse_ros.world.scenario.scenario import SPECS, Scenario

    def read(path: Path) -> None:
        scenario = Scenario.read(path)
        grid = SPECS["grid_size"].check("grid_size", scenario.grid_size)
        if (grid is None or grid.longer <= 100) and scenario.zone_size is None:
            scenario.resolve(profile("paper"))

    return _from_file("fuzzed.yaml", read), [
        file.read_bytes() for file in sorted((ROOT / "config").glob("*.yaml"))
    ]


def _geojson() -> tuple[Take, list[bytes]]:
    from dsse_ros.base.grid_shape import GridShape
    from dsse_ros.world.scenario.area import Area, area_mask

    def read(path: Path) -> None:
        area_mask(Area.read(str(path)), False, GridShape.square(8), 130.0, (-24.0, -46.0, 0.0))

    ring = [[-46.0, -24.0], [-45.99, -24.0], [-45.99, -23.99], [-46.0, -23.99], [-46.0, -24.0]]
    polygon = {"type": "Polygon", "coordinates": [ring]}
    feature = {"type": "Feature", "properties": {}, "geometry": polygon}
    several = {"type": "MultiPolygon", "coordinates": [[ring], [ring]]}
    collection = {"type": "FeatureCollection", "features": [feature]}
    return _from_file("fuzzed.geojson", read), [
        json.dumps(geojson).encode() for geojson in (polygon, feature, several, collection)
    ]


def _commands() -> tuple[Take, list[bytes]]:
    from geometry_msgs.msg import PoseStamped
    from rclpy.serialization import deserialize_message, serialize_message
    from std_msgs.msg import Int32MultiArray, String

    from dsse_ros.base.grid_shape import GridShape
    from dsse_ros.mission.run import command_parsers
    from dsse_ros.world.scenario.frames import GridFrame
    from msg_adapters.commands import joint_action_message
    from msg_adapters.poses import pose_from_message

    frame = GridFrame(GridShape.square(8), 130.0, -24.0, -46.0, 0.0, 120.0)
    actions = ("left", "right", "up", "down", "search")
    kinds: list[tuple[Any, Callable[[Any], object]]] = [
        (String, lambda m: command_parsers.parse_action_name(m.data, actions)),
        (PoseStamped, lambda m: command_parsers.parse_goal(pose_from_message(m), frame)),
        (
            Int32MultiArray,
            lambda m: command_parsers.parse_joint_action(
                m.data, 1, 0, actions, [True, False, True]
            ),
        ),
    ]

    def take(data: bytes) -> None:
        kind, parse = kinds[data[0] % len(kinds)] if data else kinds[0]
        try:
            message = deserialize_message(data[1:], kind)
        except Exception:
            # As rclpy drops it before a node sees it; its classes are not public.
            return
        parse(message)

    pose = PoseStamped()
    pose.header.frame_id = "map"
    joint = joint_action_message(1, 0, [1, 2, 3])
    messages = [String(data="left"), pose, joint]
    return take, [bytes([i]) + serialize_message(message) for i, message in enumerate(messages)]


def _observations() -> tuple[Take, list[bytes]]:
    from rclpy.serialization import deserialize_message, serialize_message
    from sensor_msgs.msg import Image, PointCloud2
    from std_msgs.msg import String

    from dsse_ros.world.scenario.agents import agents_from_json
    from msg_adapters.images import image_to_probability
    from msg_adapters.mission_report import mission_report_from_message
    from msg_adapters.step_report import step_report_from_message

    kinds: list[tuple[Any, Callable[[Any], object]]] = [
        (String, lambda message: agents_from_json(message.data)),
        (Image, image_to_probability),
        (PointCloud2, step_report_from_message),
        (PointCloud2, mission_report_from_message),
    ]

    def take(data: bytes) -> None:
        kind, parse = kinds[data[0] % len(kinds)] if data else kinds[0]
        try:
            message = deserialize_message(data[1:], kind)
        except Exception:
            return
        try:
            parse(message)
        except ValueError as error:
            _on_one_line(error)

    flown = _flown().messages
    grid = Image(height=2, width=2, encoding="32FC1", step=8, data=array.array("B", bytes(16)))
    own = [
        bytes([i]) + message.data
        for i, topic in ((0, "/agents"), (2, "/step_report"))
        for message in flown
        if message.topic == topic
    ]
    return take, [*own[:3], bytes([1]) + serialize_message(grid)]


def _mavlink() -> tuple[Take, list[bytes]]:
    import random

    from autopilot.wire import Codec as VehicleCodec
    from autopilot.wire import mavlink
    from fuzz import any_message

    from dsse_ros.vehicles.control.commands import ControllerSettings
    from dsse_ros.vehicles.control.vehicle_controller import VehicleController
    from dsse_ros.vehicles.mavlink.codec import Codec
    from dsse_ros.vehicles.mavlink.messages import Address

    ours, vehicle = Address(245, 191), Address(7, 1)
    settings = ControllerSettings(autopilot="ardupilot")

    def take(data: bytes) -> None:
        codec = Codec(ours, vehicle)
        controller = VehicleController(vehicle, ours, settings)
        half = len(data) // 2
        now = 0.0
        for datagram, part in ((False, data[:half]), (False, data[half:]), (True, data)):
            now += 0.1
            for message in codec.decode(part, now, datagram=datagram):
                for answer in controller.receive(message, now):
                    codec.encode(answer)
        assert not controller.counts["errors"], controller.outcome

    sender, draw = VehicleCodec(7), random.Random(1)
    kinds = list(mavlink.mavlink_map.values())
    frames = [bytes(sender.encode(any_message(kind, draw))) for kind in kinds[::7]]
    return take, [*frames, b"".join(frames[:5])]


def _snapshots() -> tuple[Take, list[bytes]]:
    from dsse_ros.mission.run.mission import Mission
    from dsse_ros.search.environments.factories import parallel_env
    from dsse_ros.search.environments.snapshot import MAGIC, VERSION, Snapshot, SnapshotError

    fields: dict[str, Any] = {"grid_size": 5, "num_drones": 2, "rules": "v2"}
    mission = Mission(parallel_env(**fields), seed=1)
    mission.commands.set_goal(0, (3, 3))
    mission.advance("search")
    body = mission.snapshot().to_bytes().partition(b"\n")[2]
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    names = list(parts)
    twin = Mission(parallel_env(**fields), seed=2)

    def state(mission: Mission) -> tuple[Any, ...]:
        kept = mission.snapshot()
        # The padding between the fields of a structured array is arbitrary.
        parts = {
            (name, field): (array[field] if field else array).tobytes()
            for name, array in kept.arrays.items()
            for field in array.dtype.names or ("",)
        }
        return kept.extra, parts

    def take(data: bytes) -> None:
        # The first byte chooses the part that the others replace; after the last one it is all.
        part, rest = data[0] % (len(names) + 1) if data else 0, data[1:]
        changed = rest if part == len(names) else _zipped(parts | {names[part]: rest})
        # An attacker would adjust the checksum.
        digest = hashlib.sha256(changed).hexdigest()
        before = state(twin)
        try:
            twin.restore(Snapshot.from_bytes(MAGIC + f" {VERSION} {digest}\n".encode() + changed))
        except SnapshotError as error:
            _on_one_line(error)
            assert state(twin) == before, "what was refused has changed the mission"
        else:
            assert len(twin.history) == twin.result.step + 1
            twin.snapshot().to_bytes()
            if not twin.done:
                twin.advance("repeat")
            twin.reset(2)

    count = bytes([len(names)])
    return take, [count + body, *(bytes([i]) + parts[name] for i, name in enumerate(names))]


def _zipped(parts: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return out.getvalue()


def _bags() -> tuple[Take, list[bytes]]:
    from flown import write
    from mcap.writer import Writer

    from dsse_ros.mission.recording.bag import read_bag
    from dsse_ros.mission.recording.bag_replay import Replay

    chunked, flat = _file("seed.mcap"), _file("flat.mcap")
    chunked.unlink(missing_ok=True)
    write(chunked, _flown().messages)
    with flat.open("wb") as file:
        # Without chunks there is neither a checksum nor a compressor between us and the records.
        writer = Writer(file, use_chunking=False, enable_crcs=False)
        writer.start(profile="ros2")
        channels = {
            topic: writer.register_channel(topic, "cdr", writer.register_schema(kind, "", b""))
            for topic, kind in sorted(
                {(message.topic, message.type_name) for message in _flown().messages}
            )
        }
        for message in _flown().messages:
            writer.add_message(
                channels[message.topic], message.log_time_ns, message.data, message.log_time_ns
            )
        writer.finish()
    take = _from_file("fuzzed.mcap", lambda path: list(Replay(read_bag(path)).missions()))
    return take, [chunked.read_bytes(), flat.read_bytes()]


@cache
def _flown() -> Any:
    """Return a short mission with all its messages."""
    from flown import Flown

    flown = Flown(grid_size=4, num_drones=2)
    flown.fly(3)
    return flown


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="dsse_ros_soak_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _file(name: str) -> Path:
    return _folder() / name


def _from_file(name: str, read: Callable[[Path], object]) -> Take:
    """Return what writes bytes to a file and reads it; a refusal must be on one line."""
    from dsse_ros.base.fields import FieldError

    path = _file(name)

    def take(data: bytes) -> None:
        path.write_bytes(data)
        try:
            read(path)
        except FieldError as error:
            _on_one_line(error)

    return take


def _on_one_line(error: Exception) -> None:
    assert "\n" not in str(error), f"a reason on several lines: {error}"


PARSERS = {
    "yaml": Parser(
        "scenarios in YAML",
        _yaml,
        (
            "dsse_ros.world.scenario.yaml_file",
            "dsse_ros.world.scenario.scenario",
            "dsse_ros.base.fields",
        ),
    ),
    "geojson": Parser("areas in GeoJSON", _geojson, ("dsse_ros.world.scenario.area",)),
    "commands": Parser(
        "commands",
        _commands,
        ("dsse_ros.mission.run.command_parsers", "dsse_ros.world.scenario.frames"),
    ),
    "observations": Parser(
        "agents, maps and reports",
        _observations,
        (
            "dsse_ros.world.scenario.agents",
            "msg_adapters.step_report",
            "dsse_ros.world.scenario.json_keys",
        ),
    ),
    "mavlink": Parser(
        "MAVLink bytes",
        _mavlink,
        ("dsse_ros.vehicles.mavlink.codec", "dsse_ros.vehicles.control.vehicle_controller"),
    ),
    "snapshots": Parser(
        "snapshots",
        _snapshots,
        ("dsse_ros.search.environments.snapshot", "dsse_ros.mission.run.mission"),
    ),
    "bags": Parser(
        "bags", _bags, ("dsse_ros.mission.recording.bag", "dsse_ros.mission.recording.bag_replay")
    ),
}
