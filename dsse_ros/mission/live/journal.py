# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An append-only MCAP file of JSON texts, each a `std_msgs/String` on one topic.

Foxglove and `ros2 bag` read it. Records are neither compressed nor in chunks, so that what was
written outlasts the process. Each has its number and a checksum, and a reader knows each other
byte: if one differs, the file is damaged, and nothing of it is used or changed. Only a last record
that was cut off, by a kill or a loss of power, is dropped.
"""

from __future__ import annotations

import fcntl
import os
import re
import stat
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, McapRecord, Message, Schema
from mcap.writer import MCAP0_MAGIC

from dsse_ros.base.fields import FieldError

TOPIC = "/live/journal"
_MESSAGE = struct.Struct("<BQHIQQ4sI")
"""Opcode and length of a record, its channel, number, log time and publish time; encoding and
length of a string in CDR, with the null after it."""
_HEAD_BYTES = 9
"""Opcode and length, which the length does not count."""
_ENCODING = b"\x00\x01\x00\x00"
_HEAD = re.compile(rb"\x05.{8}\x01\x00.{4}(.{8})\1\x00\x01\x00\x00", re.DOTALL)
"""Of a record, up to the encoding."""
_CHECKSUM = re.compile(r', "crc32": (\d+)\}$')
_MOST_ALTERED = 16
"""Bytes by which the beginning of a journal may differ to be one that is damaged."""
_FIRST_BYTES = 200
"""Bytes in which the name of the topic is."""


class JournalFile:
    """A journal, open for this process alone.

    Args:
        path: The file; it is made if it does not exist.
        note: Called with a line if the file was cut off.

    Attributes:
        texts: The texts that were in the file when it was opened.

    Raises:
        FieldError: If it cannot be opened, another process has it open, or it is no journal or
            damaged; it stays as it is.
    """

    def __init__(self, path: str | os.PathLike[str], note: Callable[[str], None]) -> None:
        self._name = f"journal: {os.fspath(path)!r}"
        try:
            self._file = os.open(Path(path), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            try:
                if not stat.S_ISREG(os.fstat(self._file).st_mode):
                    raise FieldError(f"{self._name} must be a regular file")
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                with open(self._file, "rb", closefd=False) as file:
                    data = file.read()
                self.texts, self._end = read_texts(data, self._name, note)
                if self._end < len(data):
                    os.ftruncate(self._file, self._end)
                if not self._end:
                    self._append(_START)
            except BaseException:
                os.close(self._file)
                raise
        except BlockingIOError:
            raise FieldError(f"{self._name} is in use by another process") from None
        except OSError as error:
            raise FieldError(f"{self._name}: {error.strerror}") from None
        self._count = len(self.texts)

    def append(self, text: str, time_ns: int) -> None:
        """Append a text; after an error the file is as before.

        Args:
            text: The text of a JSON object that is not empty.
            time_ns: Wall time.

        Raises:
            OSError: If it cannot be written.
        """
        self._append(_record(text, time_ns, self._count))
        self._count += 1

    def _append(self, data: bytes) -> None:
        content, end = memoryview(data), self._end + len(data)
        try:
            while content:
                content = content[os.pwrite(self._file, content, end - len(content)) :]
        except OSError:
            os.ftruncate(self._file, self._end)
            raise
        self._end = end

    @property
    def end(self) -> tuple[int, int]:
        """Where the next record begins, and how many texts are before it."""
        return self._end, self._count

    def cut_back(self, end: tuple[int, int]) -> None:
        """Remove what was appended after an `end`.

        Raises:
            OSError: If the file cannot be changed.
        """
        os.ftruncate(self._file, end[0])
        self._end, self._count = end

    def sync(self) -> None:
        """Flush the file to disk, so that it survives a loss of power.

        Raises:
            OSError: If it cannot be written.
        """
        os.fsync(self._file)

    def close(self) -> None:
        """End the file, as readers of MCAP expect it."""
        try:
            self._append(_CLOSED)
        finally:
            os.close(self._file)


def _bytes_of(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


_CHANNEL = Channel(1, TOPIC, "cdr", {}, 1)
_START = MCAP0_MAGIC + _bytes_of(
    Header("ros2", "dsse_ros"), Schema(1, b"string data\n", "ros2msg", "std_msgs/msg/String"),
    _CHANNEL,
)  # fmt: skip
_CLOSED = _bytes_of(DataEnd(0), Footer(0, 0, 0)) + MCAP0_MAGIC
"""The end of a file; it goes on before it."""


def _record(text: str, time_ns: int, number: int) -> bytes:
    """Return the record of a text, with a checksum as its last key."""
    sealed = f'{text[:-1]}, "crc32": {zlib.crc32(text.encode(), number)}}}'.encode()
    data = struct.pack("<4sI", _ENCODING, len(sealed) + 1) + sealed + b"\0"
    return _bytes_of(Message(_CHANNEL.id, time_ns, data, time_ns, number))


def texts_of(path: str | os.PathLike[str], note: Callable[[str], None]) -> list[str]:
    """Return the texts of a journal, without opening it for writing.

    Args:
        path: The file.
        note: Called with a line if it is cut off.

    Raises:
        FieldError: If it cannot be read, is no journal, or damaged.
    """
    name = f"journal: {os.fspath(path)!r}"
    return read_texts(_read(path, name), name, note)[0]


def _read(path: str | os.PathLike[str], name: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FieldError(f"{name}: {error.strerror}") from None


def is_journal(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is the journal of a live search."""
    try:
        with Path(path).open("rb") as file:
            return TOPIC.encode() in file.read(_FIRST_BYTES)
    except OSError:
        return False


class _Whole(NamedTuple):
    """A whole record: its text, its number, and where it ends."""

    text: str
    number: int
    end: int


def read_texts(data: bytes, name: str, note: Callable[[str], None]) -> tuple[list[str], int]:
    """Return the texts of a journal, and where the next record begins.

    Args:
        data: Content of the file.
        name: Its name, for errors.
        note: Called with a line if it is cut off.

    Raises:
        FieldError: If it is not a journal, or damaged.
    """
    if len(data) < len(_START) and _START.startswith(data):
        if data:
            note(f"{name} was cut off at byte {len(data)}, before its first record")
        return [], 0
    _check_start(data, name)
    texts: list[str] = []
    at = len(_START)
    while at < len(data) and data[at:] != _CLOSED:
        record = _whole_at(data, at)
        if record is None or record.number != len(texts):
            if record is None and _is_cut_off(data[at:]):
                note(f"{name} was cut off at byte {len(data)}: what follows byte {at} is no whole "
                     f"record and does not count; the {len(texts)} before it do")  # fmt: skip
                break
            raise FieldError(
                f"{name} is damaged at byte {at}, in record {len(texts)}, and stays as it is; "
                "replay --repaired NEW writes a copy without what is damaged"
            )
        texts.append(record.text)
        at = record.end
    return texts, at


def _check_start(data: bytes, name: str) -> None:
    """Check that a file begins as a journal."""
    head = data[: len(_START)]
    altered = [at for at, (has, should) in enumerate(zip(head, _START, strict=False))
               if has != should]  # fmt: skip
    if not altered and len(head) == len(_START):
        return
    if len(head) == len(_START) and len(altered) <= _MOST_ALTERED:
        raise FieldError(
            f"{name} is damaged at byte {altered[0]}, before its first record, and stays as it is; "
            "replay --repaired NEW writes a copy without what is damaged"
        )
    if not data.startswith(MCAP0_MAGIC):
        raise FieldError(f"{name} is not an MCAP file")
    raise FieldError(f"{name} is not the journal of a live search")


def _whole_at(data: bytes, at: int) -> _Whole | None:
    """Return the record that begins at a byte; None if it is not whole there."""
    if at + _MESSAGE.size > len(data):
        return None
    opcode, length, channel, number, logged, published, encoding, size = _MESSAGE.unpack_from(
        data, at
    )
    begin, end = at + _MESSAGE.size, at + _HEAD_BYTES + length
    fixed = (Opcode.MESSAGE, _CHANNEL.id, published, _ENCODING, end, 0)
    # The times are there twice, and the length too.
    if end > len(data) or (opcode, channel, logged, encoding, begin + size, data[end - 1]) != fixed:
        return None
    try:
        sealed = data[begin : end - 1].decode()
    except UnicodeDecodeError:
        return None
    checksum = _CHECKSUM.search(sealed)
    if checksum is None:
        return None
    text = sealed[: checksum.start()] + "}"
    if checksum[1] != str(zlib.crc32(text.encode(), number)):
        return None
    return _Whole(text, number, end)


def _is_cut_off(rest: bytes) -> bool:
    """Return whether what is not a whole record is the begin of one, or the begin of the end.

    After a loss of power a file can be as long as it should be, with zeros for what is missing.
    """
    written = rest.rstrip(b"\0")
    if _CLOSED.startswith(written):
        return True
    if rest[0] != Opcode.MESSAGE:
        return False
    if len(written) < _MESSAGE.size - 4:
        return True
    _, length, *_, size = _MESSAGE.unpack_from(rest.ljust(_MESSAGE.size, b"\0"))
    if not _HEAD.match(rest) or (len(written) >= _MESSAGE.size and
                                 length != _MESSAGE.size - _HEAD_BYTES + size):  # fmt: skip
        return False
    # The last two bytes are a brace and a null.
    end = _HEAD_BYTES + length
    return len(rest) < end or len(written) < end - 1


class Salvaged(NamedTuple):
    """What is left of a damaged journal.

    Attributes:
        texts: The texts of the whole records, by their numbers.
        damage: First byte of each damaged part, and the first one after it.
    """

    texts: dict[int, str]
    damage: list[tuple[int, int]]


def salvage(path: str | os.PathLike[str]) -> Salvaged:
    """Return the whole records of a journal, whatever is between them.

    Raises:
        FieldError: If it cannot be read.
    """
    data = _read(path, f"journal: {os.fspath(path)!r}")
    salvaged = Salvaged({}, [])
    at = len(_START)
    if data[:at] != _START:
        salvaged.damage.append((0, at))
    data = data.removesuffix(_CLOSED)
    while at < len(data):
        record = _whole_at(data, at)
        if record is not None and record.number not in salvaged.texts:
            salvaged.texts[record.number] = record.text
            at = record.end
            continue
        begin = at
        found = (match.start() for match in _HEAD.finditer(data, at + 1))
        at = next((start for start in found if _whole_at(data, start)), len(data))
        salvaged.damage.append((begin, at))
    return salvaged
