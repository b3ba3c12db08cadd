# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is known of the vehicles of a mission, in a file for a bridge that is started again."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from dsse_ros.flight.vehicle_follower import FlightRecord

_KEPT = 100
"""Files of earlier missions that are kept."""


def default_directory() -> Path:
    """Return where ROS programs keep what is theirs: ROS_HOME, by default ~/.ros."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "dsse_ros"


class FlightRecords:
    """The records of one mission's vehicles, by the names of their drones.

    Args:
        directory: Where the files are; made if it is not there.
        run_id: Identity of the simulation.
        mission: Number of the mission.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If it holds something else.
    """

    def __init__(self, directory: Path, run_id: int, mission: int) -> None:
        directory.mkdir(parents=True, exist_ok=True)
        self._path = directory / f"flight-{run_id:010d}-{mission:010d}.json"
        self._records: dict[str, FlightRecord] = {}
        with contextlib.suppress(FileNotFoundError):
            self._records = _parse(self._path.read_text(encoding="utf-8"), self._path)
        self._write()
        self._prune()

    def __getitem__(self, name: str) -> FlightRecord:
        return self._records.get(name, FlightRecord())

    def update(self, records: Mapping[str, FlightRecord]) -> None:
        """Keep what is new.

        Raises:
            OSError: If the file cannot be written; what is new is kept for the next time.
        """
        if any(self[name] != record for name, record in records.items()):
            before, self._records = self._records, self._records | dict(records)
            try:
                self._write()
            except OSError:
                self._records = before
                raise

    def _write(self) -> None:
        text = json.dumps({name: asdict(one) for name, one in sorted(self._records.items())})
        directory = self._path.parent
        with tempfile.NamedTemporaryFile("w", dir=directory, delete=False, suffix=".part") as file:
            try:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
                os.replace(file.name, self._path)
            except BaseException:
                os.unlink(file.name)
                raise

    def _prune(self) -> None:
        files = sorted(
            self._path.parent.glob("flight-*.json"), key=lambda file: file.stat().st_mtime
        )
        for file in files[:-_KEPT]:
            file.unlink(missing_ok=True)


def _parse(text: str, path: Path) -> dict[str, FlightRecord]:
    try:
        return {
            str(name): FlightRecord(
                took_off=_flag(one["took_off"]),
                lost=str(one["lost"]),
                taken_over=_flag(one["taken_over"]),
            )
            for name, one in json.loads(text).items()
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path}: {error!r} is not allowed; a file of this program is") from None


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"{value!r}")
    return value
