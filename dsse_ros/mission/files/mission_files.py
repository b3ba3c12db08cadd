# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The files to record and resume a mission, without ROS."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.mission_journal import MissionJournal
from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.world.scenario.frames import GridFrame


class MissionFiles:
    """The log and the snapshot of a mission, each written only if its path is not empty.

    Args:
        record_file: Path of the log of its steps, empty for none.
        snapshot_file: Path of the snapshot of its complete state, empty for none.
        resume: Whether to continue the mission from the snapshot, and the log from its step.
        journal: Path of the journal of a live search, empty for none; a mission in it is continued.
        note: Called with a line if the journal was cut off.

    Attributes:
        journal: The journal, None for none.

    Raises:
        FieldError: If the mission cannot be resumed.
    """

    def __init__(
        self,
        mission: Mission,
        *,
        record_file: str,
        snapshot_file: str,
        snapshot_every: int,
        resume: bool,
        journal: str = "",
        note: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._mission = mission
        self._record_file = record_file
        self._snapshot_file = snapshot_file
        self._snapshot_every = snapshot_every
        self._log: MissionLog | None = None
        if resume:
            try:
                mission.restore(Snapshot.load(snapshot_file))
            except SnapshotError as error:
                raise FieldError(f"snapshot_file: {error}") from None
        self.journal = MissionJournal(journal, mission, note) if journal else None
        # A resumed mission publishes and records its last step again.
        resumed = resume or (self.journal is not None and self.journal.resumed)
        self._resume_at = (mission.number, mission.result.step) if resumed else None

    def open(self, frame: GridFrame) -> None:
        """Open the log, with positions on this grid.

        Raises:
            FieldError: If the log cannot be opened.
        """
        if self._record_file:
            self._log = MissionLog(
                self._record_file,
                frame,
                resume_at=self._resume_at,
                covers=self._mission.env.rules.covers,
                faults=self._mission.result.conditions is not None,
                vehicles=self._mission.env.rules.vehicle_timed_actions,
                metres=self._mission.env.rules.in_metres,
            )

    def record(self) -> str:
        """Record the last step; return why the log or the journal does not have it, else ""."""
        journal = "" if self.journal is None else self.journal.record()
        return journal or self._record()

    def _record(self) -> str:
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
        """Write a snapshot if one is due; return the reason of a failure, empty for none."""
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
        """Close the log and the journal."""
        if self._log is not None:
            self._log.close()
        if self.journal is not None:
            with contextlib.suppress(OSError):
                self.journal.close()


def check_files(*, snapshot_file: str = "", **paths: str) -> None:
    """Raise if a file cannot be written, before anything is compiled.

    Args:
        snapshot_file: Path of the snapshot, which each later one replaces; empty for none.
        paths: Paths of files that grow, by the names of their parameters, empty for none.

    Raises:
        FieldError: If a folder is missing or not writable where a file is made or replaced, or a
            file is not; or if the snapshot exists and is not a regular file.
    """
    for name, path in {"snapshot_file": snapshot_file, **paths}.items():
        if not path:
            continue
        target, replaced = Path(os.path.realpath(path)), name == "snapshot_file"
        if replaced and target.exists() and not target.is_file():
            raise FieldError(f"{name} must be a regular file or a new one, got {path!r}")
        try:
            if replaced or not target.exists():
                with tempfile.TemporaryFile(dir=target.parent):
                    pass
            elif target.is_dir() or not os.access(target, os.W_OK):
                number = errno.EISDIR if target.is_dir() else errno.EACCES
                raise OSError(number, os.strerror(number))
        except OSError as error:
            raise FieldError(f"{name}: {path!r}: {error.strerror}") from None
