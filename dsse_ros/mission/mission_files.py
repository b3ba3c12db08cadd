# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The files that a mission is recorded in and resumed from, without ROS."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from dsse_ros.mission.mission import Mission
from dsse_ros.mission.mission_log import MissionLog
from dsse_ros.search import FieldError, Snapshot, SnapshotError
from msg_adapters.frames import GridFrame


class MissionFiles:
    """The log of a mission and its snapshot; either is kept only where it has a name.

    Args:
        mission: The mission.
        record_file: Log of its steps, empty for none.
        snapshot_file: Its whole state, empty for none.
        snapshot_every: Steps from one snapshot to the next.
        resume: Whether the mission goes on from the snapshot, now, and the log from its step.

    Raises:
        FieldError: If no snapshot can be written there, or the mission cannot be resumed.
    """

    def __init__(
        self,
        mission: Mission,
        *,
        record_file: str,
        snapshot_file: str,
        snapshot_every: int,
        resume: bool,
    ) -> None:
        self._mission = mission
        self._record_file = record_file
        self._snapshot_file = snapshot_file
        self._snapshot_every = snapshot_every
        self._log: MissionLog | None = None
        if snapshot_file:
            _check_snapshot_file(snapshot_file)
        if resume:
            try:
                mission.restore(Snapshot.load(snapshot_file))
            except SnapshotError as error:
                raise FieldError(f"snapshot_file: {error}") from None
        # The step that a mission resumes from is published, and recorded, once more.
        self._resume_at = (mission.number, mission.result.step) if resume else None

    def open(self, frame: GridFrame) -> None:
        """Open the log, whose places lie on this grid.

        Raises:
            FieldError: If that is not possible.
        """
        if self._record_file:
            self._log = MissionLog(
                self._record_file,
                frame,
                resume_at=self._resume_at,
                covers=self._mission.env.rules.covers,
                faults=self._mission.result.conditions is not None,
            )

    def record(self) -> str:
        """Record the last step; returns why the log ends here, empty if it goes on."""
        if self._log is None:
            return ""
        try:
            self._log.write(self._mission, self._mission.result)
        except OSError as error:
            with contextlib.suppress(OSError):
                self._log.close()
            self._log = None
            return (
                f"record_file: {self._record_file!r}: {error.strerror}; "
                "the rest of the mission is not recorded"
            )
        return ""

    def save(self) -> str:
        """Write a snapshot if it is time for one; returns why that failed, empty if it did not."""
        if not self._snapshot_file or self._mission.result.step % self._snapshot_every:
            return ""
        if self._log is not None:
            self._log.sync()
        try:
            self._mission.snapshot().save(self._snapshot_file)
        except OSError as error:
            return f"snapshot_file: {self._snapshot_file!r}: {error.strerror}"
        return ""

    def close(self) -> None:
        """Close the log."""
        if self._log is not None:
            self._log.close()


def _check_snapshot_file(path: str) -> None:
    """Raise if no snapshot can be written there.

    Raises:
        FieldError: If its folder cannot be written to, or it is there and no regular file.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise FieldError(f"snapshot_file: {path!r} is not allowed; a regular file or a new one")
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise FieldError(f"snapshot_file: {path!r}: {error.strerror}") from None
