# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that record who controls each vehicle, one per vehicle, for a restarted bridge."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dsse_ros.bridge.custody import Custody
from dsse_ros.bridge.vehicle_custody import FlightRecord
from dsse_ros.scenario.fields import FieldError
from dsse_ros.whole_files import write_whole

UNREADABLE = FlightRecord(custody=Custody.TAKEN)
"""Record of a vehicle whose file cannot be parsed: a person has to look at it."""


def default_directory() -> Path:
    """Return `dsse_ros` in ROS_HOME, by default in ~/.ros."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "dsse_ros"


class FlightRecords:
    """The records of vehicles, by system id; they outlast searches and programs.

    Args:
        directory: Directory of the files; created if it does not exist.
        system_ids: System ids of the vehicles.

    Attributes:
        unreadable: Files that cannot be parsed.

    Raises:
        OSError: If a file cannot be read or written.
        FieldError: If another program has one of the vehicles.
    """

    def __init__(self, directory: Path, system_ids: Iterable[int]) -> None:
        self._directory = directory
        self._locks: list[int] = []
        self._records: dict[int, FlightRecord] = {}
        self.unreadable: list[Path] = []
        directory.mkdir(parents=True, exist_ok=True)
        try:
            for system_id in system_ids:
                self._lock(system_id)
                self._records[system_id] = self._read(system_id)
                # Fail before anything flies if the file cannot be written.
                self._write(system_id)
        except BaseException:
            self.close()
            raise

    def __getitem__(self, system_id: int) -> FlightRecord:
        return self._records[system_id]

    def update(self, records: Mapping[int, FlightRecord]) -> None:
        """Write the records that have changed.

        Raises:
            OSError: If a file cannot be written; the next call tries again.
        """
        for system_id, record in records.items():
            before = self._records[system_id]
            if record != before:
                self._records[system_id] = record
                try:
                    self._write(system_id)
                except OSError:
                    self._records[system_id] = before
                    raise

    def close(self) -> None:
        """Release the locks, so that other programs can have the vehicles."""
        for lock in self._locks:
            os.close(lock)
        self._locks.clear()

    def _path(self, system_id: int) -> Path:
        return self._directory / f"vehicle-{system_id}.json"

    def _lock(self, system_id: int) -> None:
        lock = os.open(self._path(system_id).with_suffix(".lock"), os.O_WRONLY | os.O_CREAT)
        self._locks.append(lock)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FieldError(
                f"state_directory must not be in use by a bridge that has system id {system_id}, "
                f"got {str(self._directory)!r}"
            ) from None

    def _read(self, system_id: int) -> FlightRecord:
        path = self._path(system_id)
        with contextlib.suppress(FileNotFoundError):
            try:
                return _parse(json.loads(path.read_text(encoding="utf-8")))
            except (ValueError, KeyError, TypeError, AttributeError):
                self.unreadable.append(path)
                return UNREADABLE
        return FlightRecord()

    def _write(self, system_id: int) -> None:
        record = self._records[system_id]
        text = json.dumps({**asdict(record), "custody": record.custody.value}, sort_keys=True)
        write_whole(self._path(system_id), text.encode())


def _parse(values: Mapping[str, Any]) -> FlightRecord:
    run_id, mission = values["search"] or (0, 0)
    record = FlightRecord(
        **{name: values[name] for name in asdict(FlightRecord())}
        | {
            "custody": Custody(values["custody"]),
            "search": None if values["search"] is None else (int(run_id), int(mission)),
            "modes": tuple(values["modes"]),
            "alt_m": float(values["alt_m"]),
            "arming_s": float(values["arming_s"]),
        }
    )
    texts = (record.lost, record.end, record.mode, *record.modes)
    if not all(isinstance(text, str) for text in texts):
        raise TypeError("lost, end, mode and modes must be strings")
    if not (isinstance(record.flown, bool) and isinstance(record.arm, bool)):
        raise TypeError("flown and arm must be true or false")
    return record
