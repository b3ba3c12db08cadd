# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bags: MCAP files with the profile `ros2`, as rosbag2 writes and reads them."""

from __future__ import annotations

import contextlib
import os
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import InvalidMagic, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from rclpy.serialization import deserialize_message

from dsse_ros.base.defects import reason_of
from dsse_ros.base.fields import FieldError
from dsse_ros.base.message_types import message_class
from dsse_ros.mission.recording.offered_qos import KEY
from dsse_ros.mission.recording.schemas import definition
from msg_adapters.topics import EACH_DRONE, topic_of

_OF_A_MISSION = ("agents", "step_report", "mission_report")
"""Last parts of the names of topics, one of which is in each bag of a mission."""
_CHUNK_BYTES = 1 << 20
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
MAX_CHUNK_BYTES = 1 << 29
"""Bytes of the largest chunk that is uncompressed: one message is the map of the largest grid."""


@dataclass(frozen=True)
class Recorded:
    """A message in a bag.

    Attributes:
        topic: Its topic.
        type_name: Type of the message, such as `std_msgs/msg/String`.
        log_time_ns: Wall time at which it was received.
        publish_time_ns: Wall time at which it was published.
        data: The message in CDR.
        offered_qos: YAML of the quality of service that the publishers offered; see `offered_qos`.
    """

    topic: str
    type_name: str
    log_time_ns: int
    publish_time_ns: int
    data: bytes
    offered_qos: str = ""

    @property
    def time_ns(self) -> int:
        """Wall time at which it was published, or received if that is unknown."""
        return self.publish_time_ns or self.log_time_ns

    @cached_property
    def message(self) -> Any:
        """The message as an rclpy class.

        Raises:
            FieldError: If its type is not installed, or the bytes are not such a message.
        """
        kind = message_class(self.type_name)
        try:
            return deserialize_message(self.data, kind)
        except Exception as error:
            # The classes of rclpy's errors are not public.
            reason = reason_of(error)
            raise FieldError(f"{self.topic}: no {self.type_name}: {reason}") from None


class BagWriter:
    """Writes a bag.

    What is flushed outlasts the process: the file can be read without having been closed.

    Args:
        path: The file, which must not exist.

    Raises:
        FieldError: If it exists or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._file: BinaryIO = Path(path).open("xb")  # noqa: SIM115
        except FileExistsError:
            raise FieldError(f"bag must be a new file, got {os.fspath(path)!r}") from None
        except OSError as error:
            raise FieldError(f"bag: {os.fspath(path)!r}: {error.strerror}") from None
        self._writer = Writer(self._file, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="dsse_ros")
        self._schemas: dict[str, int] = {}

    def add_topic(
        self, topic: str, type_name: str, offered_qos: str = "", type_hash: str = ""
    ) -> int:
        """Return the number of a topic for `write`.

        Args:
            offered_qos: YAML of what its publishers offer.
            type_hash: Hash of the type (REP-2016), if it is known.

        Raises:
            FieldError: If the type is not installed.
        """
        schema = self._schemas.get(type_name)
        if schema is None:
            text = definition(type_name).encode()
            schema = self._writer.register_schema(type_name, "ros2msg", text)
            self._schemas[type_name] = schema
        # What rosbag2 of Jazzy writes.
        metadata = {KEY: offered_qos, "topic_type_hash": type_hash}
        return self._writer.register_channel(topic, "cdr", schema, metadata)

    def write(
        self, topic: int, data: bytes, *, log_time_ns: int, publish_time_ns: int, sequence: int = 0
    ) -> None:
        """Add a message; times are wall time.

        Raises:
            OSError: If the file cannot be written.
        """
        self._writer.add_message(topic, log_time_ns, data, publish_time_ns, sequence)

    def flush(self) -> None:
        """End the chunk that is being filled, and hand all of it to the system.

        Raises:
            OSError: If the file cannot be written.
        """
        self._writer.flush()

    def close(self) -> None:
        """End the file with its index.

        Raises:
            OSError: If it cannot be written; what was flushed can be read.
        """
        try:
            self._writer.finish()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is, after an error."""
        with contextlib.suppress(OSError):
            self._file.close()


def read_bag(
    path: str | os.PathLike[str], on_cut_off: Callable[[str], None] = lambda _: None
) -> Iterator[Recorded]:
    """Yield the messages of a mission's bag in the order in which they were recorded.

    A bag that is cut off is read to the end of its last whole chunk.

    Args:
        path: An MCAP file, or a folder of rosbag2 with some.
        on_cut_off: Called with a line on where a file is cut off.

    Raises:
        FieldError: If it cannot be read, is not an MCAP file, is damaged, or has no mission in it.
    """
    of_mission = False
    cut_off = ""

    def note(where: str) -> None:
        nonlocal cut_off
        cut_off = f"; it {where}"
        on_cut_off(f"bag: {str(file)!r} {where}")

    for file in _files(Path(path)):
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in _records(file, note):
            match record:
                case Schema():
                    schemas[record.id] = record
                case Channel():
                    channels[record.id] = record
                    of_mission |= record.topic.rpartition("/")[2] in _OF_A_MISSION
                case Message():
                    channel = channels.get(record.channel_id)
                    if channel is None:
                        raise FieldError(
                            f"bag: {os.fspath(path)!r} is damaged: a message comes before its "
                            f"channel, {record.channel_id}"
                        )
                    yield Recorded(
                        channel.topic,
                        schemas[channel.schema_id].name if channel.schema_id in schemas else "",
                        record.log_time,
                        record.publish_time,
                        _message(record.data, os.fspath(path)),
                        channel.metadata.get(KEY, ""),
                    )
    if not of_mission:
        raise FieldError(
            f"bag: {os.fspath(path)!r} has none of the topics {', '.join(_OF_A_MISSION)}{cut_off}"
        )


def of_searches(
    messages: Iterable[Recorded], names: Iterable[str]
) -> Iterator[tuple[str, str, Recorded]]:
    """Yield the messages of topics of searches, each after its namespace and its name in it.

    A namespace ends with a slash. A topic with another type belongs to other software.
    """
    wanted = "|".join(names).replace(EACH_DRONE, r"drone\d+/")
    pattern = re.compile(f"(.*/)({wanted})")
    for recorded in messages:
        match = pattern.fullmatch(recorded.topic)
        if match is not None and recorded.type_name == topic_of(match[2]).type_name:
            yield match[1], match[2], recorded


def _files(path: Path) -> list[Path]:
    """Return the MCAP files of a bag."""
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"))
    for compressed in sorted(path.glob("*.mcap.zstd")):
        if compressed.with_suffix("") not in files:
            raise _compressed(compressed)
    if not files:
        raise FieldError(f"bag: {str(path)!r} is a folder without an MCAP file")
    return files


def _compressed(path: Path) -> FieldError:
    return FieldError(
        f"bag: {str(path)!r} is compressed with the compression mode FILE of rosbag2; decompress "
        "it with zstd -d"
    )


def _records(path: Path, on_cut_off: Callable[[str], None]) -> Iterator[McapRecord]:
    """Yield the records of a file up to its end, or to where it is cut off, which is passed on."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(size - len(MCAP0_MAGIC), 0))
            ended = file.read() == MCAP0_MAGIC
            file.seek(0)
            if file.read(len(_ZSTD_MAGIC)) == _ZSTD_MAGIC:
                raise _compressed(path)
            file.seek(0)
            bounded: Any = _Bounded(file, size)
            reader = StreamReader(bounded, emit_chunks=True, record_size_limit=size)
            records = _flat(reader.records, f"bag: {str(path)!r}")
            while True:
                try:
                    record = next(records)
                except FieldError:
                    raise
                except InvalidMagic:
                    raise FieldError(f"bag: {str(path)!r} is not an MCAP file") from None
                except Exception as error:
                    # Of struct, of the decompressors, of mcap: a record that is not whole. In a
                    # file that is cut off, or still written, it is the last one and not all there.
                    last = file.tell() >= size or isinstance(error, RecordLengthLimitExceeded)
                    if last and not ended:
                        on_cut_off(f"is cut off at byte {size}")
                        return
                    at = file.tell()
                    raise FieldError(f"bag: {str(path)!r} is damaged before byte {at}") from None
                if isinstance(record, DataEnd):
                    if not ended:
                        on_cut_off(f"is cut off at byte {size}, after its last message")
                    return
                yield record
    except OSError as error:
        raise FieldError(f"bag: {str(path)!r}: {error.strerror}") from None


def _message(data: bytes, name: str) -> bytes:
    """Return a message in CDR, which the compression mode MESSAGE of rosbag2 has compressed."""
    # CDR never begins like this.
    if not data.startswith(_ZSTD_MAGIC):
        return data
    try:
        reader = zstandard.ZstdDecompressor().stream_reader(data)
        content: bytes = reader.read(MAX_CHUNK_BYTES + 1)
    except zstandard.ZstdError:
        raise FieldError(f"bag: {name!r} is damaged: a message cannot be decompressed") from None
    if len(content) > MAX_CHUNK_BYTES:
        raise FieldError(
            f"bag: {name!r} has a message of more than the {MAX_CHUNK_BYTES} bytes allowed"
        )
    return content


class _Bounded:
    """A file that is never read beyond its end: a length in it may be any number."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size

    def read(self, length: int) -> bytes:
        return self._file.read(min(length, self._size - self._file.tell()))


def _flat(records: Iterator[McapRecord], name: str) -> Iterator[McapRecord]:
    """Yield records, and the records in a chunk instead of the chunk.

    Raises:
        FieldError: If a chunk is too large; it begins with the name of the bag.
        Exception: If one is damaged.
    """
    for record in records:
        if not isinstance(record, Chunk):
            yield record
            continue
        if record.uncompressed_size > MAX_CHUNK_BYTES:
            raise FieldError(
                f"{name} has a chunk of {record.uncompressed_size} bytes; at most "
                f"{MAX_CHUNK_BYTES} are allowed"
            )
        content = ReadDataStream(BytesIO(_uncompressed(record)))
        while content.count < record.uncompressed_size:
            opcode, length = content.read1(), content.read8()
            match opcode:
                case Opcode.SCHEMA:
                    yield Schema.read(content)
                case Opcode.CHANNEL:
                    yield Channel.read(content)
                case Opcode.MESSAGE:
                    yield Message.read(content, length)
                case _:
                    content.read(length)


def _uncompressed(chunk: Chunk) -> bytes:
    """Return the content of a chunk, without taking more memory than it states."""
    size = chunk.uncompressed_size
    match chunk.compression:
        case "":
            content: bytes = chunk.data
        case "zstd":
            content = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
        case "lz4":
            content = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, size + 1)
        case _:
            raise ValueError(f"compression {chunk.compression!r}")
    if len(content) != size:
        raise ValueError(f"{len(content)} bytes instead of {size}")
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise ValueError("its checksum does not match")
    return content
