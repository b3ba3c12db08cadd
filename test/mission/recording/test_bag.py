# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bags as other readers see them, cut off bags, and files that are none."""

from __future__ import annotations

import io
import random
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flown import Flown, write
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Footer, Header
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.recording.bag import MAX_CHUNK_BYTES, BagWriter, Recorded, read_bag
from msg_adapters.step_report import step_report_from_message

PER_CHUNK = 7


@pytest.fixture(scope="module")
def messages() -> list[Recorded]:
    flown = Flown()
    flown.fly(40)
    flown.publish("/diagnostics", DiagnosticArray(status=[DiagnosticStatus(name="a node")]))
    return flown.messages


@pytest.fixture(scope="module")
def bag(messages: list[Recorded], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bag")
    return write(folder / "bag.mcap", messages, per_chunk=PER_CHUNK)


def test_what_is_written_is_read(bag: Path, messages: list[Recorded]) -> None:
    assert list(read_bag(bag)) == messages


def test_a_folder_of_rosbag2_is_read(bag: Path, messages: list[Recorded]) -> None:
    assert list(read_bag(bag.parent)) == messages


def compressed(folder: Path, messages: list[Recorded], mode: CompressionMode) -> Path:
    """Write a bag as rosbag2 does with a compression mode of zstd."""
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = Writer2(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for message in messages:
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    message.topic, message.type_name, typestore=store
                )
            writer.write(connections[message.topic], message.log_time_ns, message.data)
    return folder


def test_a_bag_of_compressed_messages_is_read(messages: list[Recorded], tmp_path: Path) -> None:
    folder = compressed(tmp_path / "bag", messages, CompressionMode.MESSAGE)
    read = [(recorded.topic, recorded.type_name, recorded.data) for recorded in read_bag(folder)]
    assert read == [(message.topic, message.type_name, message.data) for message in messages]


def test_a_bag_that_is_compressed_as_a_whole_is_refused_by_that_name_until_it_is_decompressed(
    messages: list[Recorded], tmp_path: Path
) -> None:
    folder = compressed(tmp_path / "bag", messages, CompressionMode.FILE)
    (whole,) = folder.glob("*.zstd")
    for path in (folder, whole):
        with pytest.raises(FieldError, match=r"bag\.mcap\.zstd' is compressed with the comp"):
            list(read_bag(path))
    with whole.open("rb") as source, whole.with_suffix("").open("wb") as target:
        zstandard.ZstdDecompressor().copy_stream(source, target)
    assert [recorded.data for recorded in read_bag(folder)] == [
        message.data for message in messages
    ]


def test_rosbags_reads_the_same(bag: Path, messages: list[Recorded]) -> None:
    with AnyReader([bag]) as reader:
        assert reader.message_count == len(messages)
        read = [
            (connection.topic, connection.msgtype, time_ns, bytes(data))
            for connection, time_ns, data in reader.messages()
        ]
        reports = [
            bytes(reader.deserialize(data, connection.msgtype).data)  # type: ignore[attr-defined]
            for connection, _, data in reader.messages()
            if connection.topic == "/step_report"
        ]
    assert read == [(m.topic, m.type_name, m.log_time_ns, m.data) for m in messages]
    own = [step_report_from_message(m.message) for m in messages if m.topic == "/step_report"]
    assert reports == [report.tobytes() for report in own]


def test_mcap_reads_the_same_by_its_index(bag: Path, messages: list[Recorded]) -> None:
    with bag.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == len(messages)
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
        assert [
            (channel.topic, message.data, message.publish_time)
            for _, channel, message in reader.iter_messages()
        ] == [(m.topic, m.data, m.publish_time_ns) for m in messages]


def test_the_schemas_decode_every_message(bag: Path, messages: list[Recorded]) -> None:
    with bag.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = [message for *_, message in reader.iter_decoded_messages()]
    for found, recorded in zip(decoded, messages, strict=True):
        for name in recorded.message.get_fields_and_field_types():
            value = getattr(recorded.message, name)
            if isinstance(value, str | int | float):
                assert getattr(found, name) == value


def test_a_bag_cut_off_anywhere_is_read_to_its_last_whole_chunk(
    bag: Path, messages: list[Recorded], tmp_path: Path
) -> None:
    content = bag.read_bytes()
    with bag.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    first = summary.chunk_indexes[0]
    begin = first.chunk_start_offset + first.chunk_length
    cut = tmp_path / "cut.mcap"
    lengths = set()
    places = random.Random(1).sample(range(begin, len(content)), 100)
    for place in sorted(places):
        cut.write_bytes(content[:place])
        read = list(read_bag(cut))
        assert read == messages[: len(read)]
        assert len(read) % PER_CHUNK == 0 or len(read) == len(messages)
        lengths.add(len(read))
    assert len(lengths) > 8


def test_what_is_flushed_can_be_read_before_the_bag_is_closed(
    messages: list[Recorded], tmp_path: Path
) -> None:
    path = tmp_path / "open.mcap"
    writer = BagWriter(path)
    topic = writer.add_topic("/agents", "std_msgs/msg/String")
    agents = messages[0]
    times = {"log_time_ns": agents.log_time_ns, "publish_time_ns": agents.publish_time_ns}
    writer.write(topic, agents.data, **times)
    writer.flush()
    writer.write(topic, agents.data, **times)
    assert [recorded.message for recorded in read_bag(path)] == [agents.message]
    writer.close()
    assert len(list(read_bag(path))) == 2


def test_a_file_that_exists_is_kept(bag: Path) -> None:
    before = bag.read_bytes()
    with pytest.raises(FieldError, match="bag must be a new file, got "):
        BagWriter(bag)
    assert bag.read_bytes() == before


def test_a_file_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="No such file or directory"):
        BagWriter(tmp_path / "no" / "bag.mcap")


def test_a_full_disk_is_an_error_and_what_was_flushed_can_be_read(
    messages: list[Recorded], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "full.mcap"
    writer = BagWriter(path)
    topic = writer.add_topic("/agents", "std_msgs/msg/String")
    agents = messages[0]
    times = {"log_time_ns": agents.log_time_ns, "publish_time_ns": agents.publish_time_ns}
    writer.write(topic, agents.data, **times)
    writer.flush()
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no device that is always full")
    device = full.open("wb")
    monkeypatch.setattr(writer._writer, "_Writer__stream", device)
    writer.write(topic, agents.data, **times)
    with pytest.raises(OSError, match="No space left"):
        writer.flush()
    with pytest.raises(OSError, match="No space left"):
        device.close()
    writer.abandon()
    assert len(list(read_bag(path))) == 1


@pytest.mark.parametrize("name", ["nothing/msg/Such", "std_msgs/msg/Nothing", "String", ""])
def test_a_type_that_is_not_known_is_named_when_the_message_is_wanted(
    name: str, messages: list[Recorded]
) -> None:
    with pytest.raises(FieldError, match="type must be .*, got '"):
        _ = replace(messages[0], type_name=name).message


def test_bytes_that_are_no_message_are_refused(messages: list[Recorded]) -> None:
    report = next(message for message in messages if message.topic == "/step_report")
    with pytest.raises(FieldError, match="/step_report: no sensor_msgs/msg/PointCloud2"):
        _ = replace(report, data=report.data[:20]).message


def test_a_message_of_no_channel_is_damage(tmp_path: Path) -> None:
    content = struct.pack("<HIQQ", 7, 0, 1, 1)
    message = b"\x05" + struct.pack("<Q", len(content)) + content
    (tmp_path / "bag.mcap").write_bytes(MCAP0_MAGIC + message + MCAP0_MAGIC)
    with pytest.raises(FieldError, match="damaged: a message comes before its channel, 7"):
        list(read_bag(tmp_path / "bag.mcap"))


def test_an_end_in_the_midst_of_the_magic_bytes_is_no_bag(bag: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(io.BytesIO(bag.read_bytes()).read(5))
    with pytest.raises(FieldError, match="none of the topics"):
        list(read_bag(cut))


def bag_of(folder: Path, *records: Any) -> Path:
    """A bag of these records, whole with its end."""
    builder = RecordBuilder()
    Header(profile="ros2", library="").write(builder)
    for record in records:
        if isinstance(record, bytes):
            builder.write(record)
        else:
            record.write(builder)
    DataEnd(data_section_crc=0).write(builder)
    Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
    path = folder / "bag.mcap"
    path.write_bytes(MCAP0_MAGIC + builder.end() + MCAP0_MAGIC)
    return path


def chunk_of(compression: str, data: bytes, size: int) -> Chunk:
    return Chunk(
        compression=compression, data=data, message_start_time=0, message_end_time=0,
        uncompressed_crc=0, uncompressed_size=size,
    )  # fmt: skip


def states_much(zstd: bytes) -> bytes:
    """A frame of zstd whose header states 4 GB (RFC 8878, 3.1.1.1)."""
    at = 5 + (not zstd[4] & 0x20)
    assert zstd[4] >> 6 == 2 and struct.unpack_from("<I", zstd, at)[0] == len(MUCH)
    return zstd[:at] + struct.pack("<I", 2**32 - 1) + zstd[at + 4 :]


MUCH = bytes(10**8)


@pytest.mark.parametrize(
    ("chunk", "says"),
    [
        (
            lambda: chunk_of("zstd", zstandard.compress(MUCH), MAX_CHUNK_BYTES + 1),
            f"has a chunk of {MAX_CHUNK_BYTES + 1} bytes; at most {MAX_CHUNK_BYTES} are allowed",
        ),
        (lambda: chunk_of("lz4", lz4.frame.compress(MUCH), 2**60), "are allowed"),
        (lambda: chunk_of("zstd", zstandard.compress(MUCH), 1000), "is damaged before byte"),
        (lambda: chunk_of("zstd", states_much(zstandard.compress(MUCH)), 1000), "is damaged"),
        (lambda: chunk_of("lz4", lz4.frame.compress(MUCH), 1000), "is damaged before byte"),
        (lambda: chunk_of("", b"x" * 1001, 1000), "is damaged before byte"),
        (lambda: chunk_of("zstd", b"none", 1000), "is damaged before byte"),
        (lambda: chunk_of("brotli", b"none", 4), "is damaged before byte"),
        # Lengths within a record that are larger than the record, and than the file.
        (lambda: b"\x06" + struct.pack("<QQQQII", 36, 0, 0, 100, 0, 2**32 - 1), "is damaged"),
        (lambda: b"\x06" + struct.pack("<QQQQIIQ", 40, 0, 0, 8, 0, 0, 2**62), "is damaged"),
        (lambda: chunk_of("", b"\x03" + struct.pack("<QHI", 6, 1, 2**32 - 1), 15), "is damaged"),
    ],
)
def test_a_bag_takes_no_more_memory_than_it_states(
    chunk: Any, says: str, tmp_path: Path, little_memory: Any
) -> None:
    path = bag_of(tmp_path, chunk())
    assert path.stat().st_size < 10**6
    with little_memory(), pytest.raises(FieldError, match=says) as refusal:
        list(read_bag(path))
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
@pytest.mark.parametrize(("compression", "count"), [("", 1000), ("zstd", 90_000), ("lz4", 1000)])
def test_a_bag_of_any_compression_is_read_message_by_message(
    compression: str, count: int, tmp_path: Path, little_memory: Any
) -> None:
    path = tmp_path / "another.mcap"
    kinds = {"": CompressionType.NONE, "zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4}
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 24, compression=kinds[compression])
        writer.start(profile="ros2", library="")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        topic = writer.register_channel("/agents", "cdr", schema)
        for number in range(count):
            writer.add_message(topic, number, b"", number)
        writer.finish()
    with little_memory():
        # Of 90 000 in one chunk of 3 MB, one object for each would take 45 MB.
        assert sum(1 for _ in read_bag(path)) == count
