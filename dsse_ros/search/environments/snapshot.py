# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A complete state as a file: versioned, with a checksum, written atomically."""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.base.json_reader import read_json
from dsse_ros.base.whole_files import write_whole
from dsse_ros.world.scenario.array_files import array_header

MAGIC = b"dsse_ros snapshot"
VERSION = 4
_LONGEST_HEAD = 200
"""Upper bound for the bytes of the first line."""


class SnapshotError(ValueError):
    """A snapshot that cannot be used; the message is one line."""


@dataclass(frozen=True)
class Snapshot:
    """Arrays by name, and the scenario and rules that they belong to.

    Attributes:
        identity: JSON values by part (scenario, rules) and name; the state to restore must have
            equal ones.
        arrays: Arrays without objects; structured arrays are allowed.
        extra: Additional JSON values from the caller.
    """

    identity: dict[str, dict[str, Any]]
    arrays: dict[str, NDArray[Any]]
    extra: dict[str, Any] = field(default_factory=dict)

    def to_bytes(self) -> bytes:
        """Return a first line with magic, version and SHA-256, then the content."""
        content = io.BytesIO()
        meta = json.dumps({"identity": self.identity, "extra": self.extra}, sort_keys=True)
        np.savez(content, allow_pickle=False, **{"meta": np.array(meta)}, **self.arrays)  # type: ignore[arg-type]
        body = content.getvalue()
        digest = hashlib.sha256(body).hexdigest()
        return MAGIC + f" {VERSION} {digest}\n".encode() + body

    @classmethod
    def from_bytes(cls, data: bytes) -> Snapshot:
        """Return the snapshot from the result of `to_bytes`.

        Raises:
            SnapshotError: If the data is of another kind or version, or damaged.
        """
        head, _, body = data.partition(b"\n")
        digest = _digest_of(head)
        if hashlib.sha256(body).hexdigest() != digest:
            raise SnapshotError("the snapshot is damaged: its checksum does not match")
        try:
            _check_sizes(body)
            with np.load(io.BytesIO(body), allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            meta = read_json(str(arrays.pop("meta")), "meta")
            identity = {part: dict(values) for part, values in meta["identity"].items()}
            return cls(identity, arrays, dict(meta["extra"]))
        except Exception as error:
            # NumPy and zipfile raise errors of many types for a maliciously crafted file.
            reason = reason_of(error)
            raise SnapshotError(f"the snapshot cannot be read: {reason}") from None

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file so that a crash leaves the old or the new file, never a partial one.

        A symbolic link stays; its target is written.

        Raises:
            OSError: If the file cannot be written.
        """
        write_whole(Path(os.path.realpath(path)), self.to_bytes())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Snapshot:
        """Return the snapshot in a file.

        Raises:
            SnapshotError: If the file cannot be read or is not a complete snapshot.
        """
        try:
            with Path(path).open("rb") as file:
                # A file that is not a snapshot can be of any length, so check its first line first.
                data = file.readline(_LONGEST_HEAD)
                _digest_of(data.rstrip(b"\n"))
                data += file.read()
            return cls.from_bytes(data)
        except OSError as error:
            raise SnapshotError(f"{os.fspath(path)!r}: {error.strerror}") from None
        except ValueError as error:
            # A `SnapshotError`, or the path contains a null character.
            raise SnapshotError(f"{os.fspath(path)!r}: {error}") from None

    def check(self, identity: dict[str, dict[str, Any]], arrays: dict[str, NDArray[Any]]) -> None:
        """Raise unless the snapshot fits a state of this identity and these arrays.

        Raises:
            SnapshotError: If the snapshot belongs to another scenario or other rules.
        """
        for part, values in identity.items():
            theirs = self.identity.get(part, {})
            names = [name for name in values if theirs.get(name) != values[name]]
            if names:
                raise SnapshotError(f"the snapshot is of a different {part}: {', '.join(names)}")
        for name, array in arrays.items():
            stored = self.arrays.get(name)
            if stored is None or stored.shape != array.shape or stored.dtype != array.dtype:
                raise SnapshotError(f"the snapshot is of a different shape: {name} differs")


def _digest_of(head: bytes) -> str:
    """Return the checksum in the first line of a snapshot.

    Raises:
        SnapshotError: If the line is of another kind or version.
    """
    if not head.startswith(MAGIC + b" "):
        raise SnapshotError("not a snapshot of dsse_ros")
    version, _, digest = head[len(MAGIC) + 1 :].decode("ascii", "replace").partition(" ")
    if version != str(VERSION):
        raise SnapshotError(f"version of the snapshot must be {VERSION}, got {version[:20]!r}")
    return digest


def _check_sizes(body: bytes) -> None:
    """Raise if the arrays in an archive take more memory than the archive itself.

    `to_bytes` does not compress. NumPy allocates the size stated in the header of an array.
    """
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        parts = archive.infolist()
        if any(part.compress_type != zipfile.ZIP_STORED for part in parts):
            raise ValueError("arrays must be uncompressed")
        if sum(part.file_size for part in parts) > len(body):
            raise ValueError("arrays must not be larger than the file")
        for part in parts:
            with archive.open(part) as file:
                shape, dtype = array_header(file)
                stated, there = math.prod(shape) * dtype.itemsize, part.file_size - file.tell()
                if stated != there:
                    raise ValueError(f"{part.filename} must be {there} bytes, got {stated}")
