# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that record who controls each vehicle, for a restarted bridge.

A record is named after the vehicle's own id, where it has one, and its system id; else after its
system id and its connection. For each connection, a file keeps which vehicle was seen there last,
and a lock whether a bridge uses it, and when one did.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import re
import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dsse_ros.base.fields import FieldError
from dsse_ros.base.json_reader import read_json
from dsse_ros.base.whole_files import write_whole
from dsse_ros.vehicles.fleet.custody import Custody
from dsse_ros.vehicles.fleet.flight_record import FlightRecord, inherited

UNREADABLE = FlightRecord(custody=Custody.TAKEN)
"""Record of a vehicle whose file cannot be parsed: a person has to look at it."""
FRESH_S = 60.0
"""Time without a bridge after which a vehicle in the air is not flown on."""
_ALIVE_S = 5.0
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_ALIVE_BYTES = 100
_NAME = re.compile(r"\d+-uid-[0-9a-f]+")


def default_directory() -> Path:
    """Return `dsse_ros` in ROS_HOME, by default in ~/.ros."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "dsse_ros"


class FlightRecords:
    """The records of the vehicles; they outlast searches and programs.

    Args:
        directory: Directory of the files; created if it does not exist.
        connections: System id and connection of each vehicle.

    Attributes:
        unreadable: Files that cannot be parsed.

    Raises:
        OSError: If a file cannot be read or written.
        FieldError: If another program has one of the vehicles.
    """

    def __init__(self, directory: Path, connections: Sequence[tuple[int, str]]) -> None:
        self._directory = directory
        self._locks: list[int] = []
        self._fresh: list[bool] = []
        self._system_ids = [system_id for system_id, _ in connections]
        self._places: list[str] = []
        self._names: list[str] = []
        self._records: list[FlightRecord] = []
        self._alive_s = -_ALIVE_S
        self.unreadable: list[Path] = []
        directory.mkdir(parents=True, exist_ok=True)
        try:
            for system_id, connection in connections:
                self._lock(system_id)
                self._places.append(f"{system_id}-{zlib.crc32(connection.encode()):08x}")
                self._names.append(self._seen_at(self._places[-1]))
                self._records.append(self._read(len(self._records)))
                # Fail before anything flies if the file cannot be written.
                self._write(len(self._records) - 1)
            self.keep_alive()
        except BaseException:
            self.close()
            raise

    def __getitem__(self, i: int) -> FlightRecord:
        return self._records[i]

    def identify(self, i: int, uid: str) -> FlightRecord:
        """Return the record of the vehicle that has turned out to be connected.

        Args:
            i: Number of the drone.
            uid: The vehicle's own id; empty if it has none or does not report it, so that it counts
                as the one that was seen last.

        Raises:
            OSError: If a file cannot be read or written.
        """
        name = f"{self._system_ids[i]}-uid-{uid}" if uid else self._names[i]
        if name != self._names[i]:
            before, self._names[i] = self._names[i], name
            new = before == self._places[i] and not self._path(name).exists()
            # A vehicle without a record is the one that was not identified yet.
            if not new:
                self._records[i] = self._read(i)
            self._write(i)
            write_whole(self._directory / f"at-{self._places[i]}.json", json.dumps(name).encode())
        return self._records[i]

    def update(self, i: int, record: FlightRecord) -> None:
        """Write the record of a vehicle if it has changed.

        Raises:
            OSError: If the file cannot be written; the next call tries again.
        """
        before = self._records[i]
        if record != before:
            self._records[i] = record
            try:
                self._write(i)
            except OSError:
                self._records[i] = before
                raise

    def keep_alive(self) -> None:
        """Record that this bridge is there.

        Raises:
            OSError: If a file cannot be written.
        """
        now_s = time.monotonic()
        if now_s - self._alive_s >= _ALIVE_S:
            self._alive_s = now_s
            for lock in self._locks:
                os.pwrite(
                    lock, f"{_boot_id()} {math.floor(now_s)}\n".ljust(_ALIVE_BYTES).encode(), 0
                )

    def close(self) -> None:
        """Release the locks, so that other programs can have the vehicles."""
        for lock in self._locks:
            os.close(lock)
        self._locks.clear()

    def _path(self, name: str) -> Path:
        return self._directory / f"vehicle-{name}.json"

    def _lock(self, system_id: int) -> None:
        path = self._directory / f"vehicle-{system_id}.lock"
        lock = os.open(path, os.O_RDWR | os.O_CREAT)
        self._locks.append(lock)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FieldError(
                f"state_directory must not be in use by a bridge that has system id {system_id}, "
                f"got {str(self._directory)!r}"
            ) from None
        self._fresh.append(_is_fresh(os.pread(lock, _ALIVE_BYTES, 0)))

    def _seen_at(self, place: str) -> str:
        """Return the name of the record of the vehicle that was last seen at a connection."""
        with contextlib.suppress(FileNotFoundError, ValueError):
            name = read_json((self._directory / f"at-{place}.json").read_bytes(), place)
            if isinstance(name, str) and _NAME.fullmatch(name):
                return name
        return place

    def _read(self, i: int) -> FlightRecord:
        path = self._path(self._names[i])
        with contextlib.suppress(FileNotFoundError):
            try:
                record = _parse(read_json(path.read_bytes(), path.name))
                return inherited(record, fresh=self._fresh[i])
            except (ValueError, KeyError, TypeError, AttributeError):
                self.unreadable.append(path)
                return UNREADABLE
        return FlightRecord()

    def _write(self, i: int) -> None:
        record = self._records[i]
        states = {"custody": record.custody.value, "cleared_from": record.cleared_from.value}
        text = json.dumps({**asdict(record), **states}, sort_keys=True)
        write_whole(self._path(self._names[i]), text.encode())


def _boot_id() -> str:
    """Return which boot of the machine this is; empty if that is not known."""
    with contextlib.suppress(OSError):
        return _BOOT_ID.read_text(encoding="ascii").strip()
    return ""


def _is_fresh(alive: bytes) -> bool:
    """Return whether a bridge was there a short time ago, by what it has recorded."""
    try:
        boot_id, time_s = alive.decode("ascii").split()
        ago_s = time.monotonic() - float(time_s)
    except ValueError:
        return False
    return boot_id == _boot_id() and 0.0 <= ago_s <= FRESH_S


def _parse(values: Mapping[str, Any]) -> FlightRecord:
    run_id, mission = values["search"] or (0, 0)
    lat_deg, lon_deg, alt_m = values["home"] or (0.0, 0.0, 0.0)
    record = FlightRecord(
        **{name: values[name] for name in asdict(FlightRecord())}
        | {
            "custody": Custody(values["custody"]),
            "cleared_from": Custody(values["cleared_from"]),
            "search": None if values["search"] is None else (int(run_id), int(mission)),
            "from_modes": tuple(values["from_modes"]),
            "ordered": tuple(values["ordered"]),
            "top_amsl_m": float(values["top_amsl_m"]),
            "looked": int(values["looked"]),
            "home": values["home"] and (float(lat_deg), float(lon_deg), float(alt_m)),
            "items": int(values["items"]),
        }
    )
    texts = (
        record.lost, record.cleared_by, record.cleared_lost, record.end, record.mode, record.plan,
    )  # fmt: skip
    if not all(isinstance(text, str | None) for text in texts):
        raise TypeError("reasons, end, mode and plan must be strings or null")
    if not all(isinstance(mode, str) for mode in (*record.from_modes, *record.ordered)):
        raise TypeError("from_modes and ordered must be strings")
    if not all(isinstance(flag, bool) for flag in (record.flown, record.launched, record.arm)):
        raise TypeError("flown, launched and arm must be true or false")
    return record
