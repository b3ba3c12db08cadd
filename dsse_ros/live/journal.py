# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An append-only MCAP file of JSON texts, each a `std_msgs/String` on one topic.

Foxglove and `ros2 bag` read it. Records are neither compressed nor in chunks, so that what was
written outlasts the process, and a file that is cut off loses its last record only.
"""

from __future__ import annotations

import fcntl
import os
import struct
from collections.abc import Callable
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, McapRecord, Message, Schema
from mcap.writer import MCAP0_MAGIC

from dsse_ros.scenario.fields import FieldError

TOPIC = "/live/journal"
_HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""
_MESSAGE = struct.Struct("<HIQQ")
"""Channel, number, log time and publish time of a message."""
_CDR = struct.Struct("<4sI")
"""Encoding, little endian, and length of a string in CDR, with the null after it."""
_ENCODING = b"\x00\x01\x00\x00"
_BEFORE_CHANNEL = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL)
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
        FieldError: If it cannot be opened, another process has it open, or it is no journal.
    """

    def __init__(self, path: str | os.PathLike[str], note: Callable[[str], None]) -> None:
        self._name = f"journal: {os.fspath(path)!r}"
        try:
            self._file = os.open(Path(path), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                with open(self._file, "rb", closefd=False) as file:
                    data = file.read()
                self.texts, self._end = read_texts(data, self._name)
                if self._end < len(data):
                    # A closed file has its end after the last message, and goes on before it.
                    if not data.endswith(MCAP0_MAGIC):
                        note(_cut_off(self._name, data))
                    os.ftruncate(self._file, self._end)
                if not self._end:
                    self._append([Header("ros2", "dsse_ros"), _SCHEMA, _CHANNEL], MCAP0_MAGIC)
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
            text: The text.
            time_ns: Wall time.

        Raises:
            OSError: If it cannot be written.
        """
        content = text.encode()
        data = _CDR.pack(_ENCODING, len(content) + 1) + content + b"\0"
        self._append([Message(_CHANNEL.id, time_ns, data, time_ns, self._count)])
        self._count += 1

    def _append(self, records: list[McapRecord], before: bytes = b"") -> None:
        builder = RecordBuilder()
        for record in records:
            record.write(builder)
        content = memoryview(before + builder.end())
        end = self._end + len(content)
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
            self._append([DataEnd(0), Footer(0, 0, 0)])
            os.pwrite(self._file, MCAP0_MAGIC, self._end)
        finally:
            os.close(self._file)


_SCHEMA = Schema(1, b"string data\n", "ros2msg", "std_msgs/msg/String")
_CHANNEL = Channel(1, TOPIC, "cdr", {}, 1)


def texts_of(path: str | os.PathLike[str], note: Callable[[str], None]) -> list[str]:
    """Return the texts of a journal, without opening it for writing.

    Args:
        path: The file.
        note: Called with a line if it is cut off.

    Raises:
        FieldError: If it cannot be read, or is no journal.
    """
    name = f"journal: {os.fspath(path)!r}"
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FieldError(f"{name}: {error.strerror}") from None
    texts, end = read_texts(data, name)
    if end < len(data) and not data.endswith(MCAP0_MAGIC):
        note(_cut_off(name, data))
    return texts


def _cut_off(name: str, data: bytes) -> str:
    return f"{name} was cut off at byte {len(data)}; the rest is read"


def is_journal(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is the journal of a live search."""
    try:
        with Path(path).open("rb") as file:
            return TOPIC.encode() in file.read(_FIRST_BYTES)
    except OSError:
        return False


def read_texts(data: bytes, name: str) -> tuple[list[str], int]:
    """Return the texts of a journal, and where the next record begins.

    Args:
        data: Content of the file; what is not a whole record at its end does not count.
        name: Its name, for errors.

    Raises:
        FieldError: If it is not a journal.
    """
    texts: list[str] = []
    at, is_ours = len(MCAP0_MAGIC), False
    if data[:at] != MCAP0_MAGIC[: len(data)]:
        raise FieldError(f"{name} is not an MCAP file")
    while at + _HEAD.size <= len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        end = at + _HEAD.size + length
        content = data[at + _HEAD.size : end]
        if opcode == Opcode.CHANNEL and end <= len(data):
            is_ours |= TOPIC.encode() in content
        elif not is_ours and opcode not in _BEFORE_CHANNEL:
            raise FieldError(f"{name} is not the journal of a live search")
        if end > len(data) or opcode == Opcode.DATA_END:
            break
        if opcode == Opcode.MESSAGE:
            text = _text_of(content)
            if text is None:
                break
            texts.append(text)
        at = end
    # Without its channel, a journal begins again.
    return texts, at if is_ours else 0


def _text_of(content: bytes) -> str | None:
    """Return the text of a message; None if it is damaged, as after a loss of power."""
    try:
        encoding, length = _CDR.unpack_from(content, _MESSAGE.size)
        text = content[_MESSAGE.size + _CDR.size : -1]
        return text.decode() if (encoding, length) == (_ENCODING, len(text) + 1) else None
    except (struct.error, UnicodeDecodeError):
        return None
