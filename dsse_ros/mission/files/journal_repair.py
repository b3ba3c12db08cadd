# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A copy of a damaged journal of a live search, with which the search goes on."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dsse_ros.base.fields import FieldError
from dsse_ros.base.json_reader import read_json
from dsse_ros.base.whole_files import whole_file
from dsse_ros.mission.files.mission_journal import INPUT, LONGEST_RECORD, MISSION, STEP, Record
from dsse_ros.mission.live.journal import JournalFile, salvage
from dsse_ros.mission.live.records import from_json, to_json
from dsse_ros.mission.live.step_looks import StepLooks


class Repaired(NamedTuple):
    """The copy of a damaged journal.

    Attributes:
        kept: Number of its records.
        lost: What it lacks, a line each.
    """

    kept: int
    lost: list[str]


def repair(path: str | os.PathLike[str], new: str | os.PathLike[str]) -> Repaired:
    """Write a copy of a journal without what is damaged.

    A step whose record is lost counts as one in which nobody looked. What decides about a contact
    or an input that is lost is left out.

    Args:
        path: The journal, which stays as it is.
        new: The copy, which must not exist.

    Raises:
        FieldError: If the journal cannot be read, or the copy cannot be written.
    """
    texts, damage = salvage(path)
    copied = _Copied()
    for number, text in sorted(texts.items()):
        copied.take(number, read_json(text, f"record {number}", LONGEST_RECORD))
    name = f"repaired: {os.fspath(new)!r}"
    if os.path.lexists(new):
        raise FieldError(f"{name} must be a new file")
    try:
        with whole_file(Path(new)) as part:
            file = JournalFile(part, lambda _: None)
            try:
                for record in copied.records:
                    file.append(json.dumps(record, allow_nan=False), time.time_ns())
            finally:
                file.close()
    except OSError as error:
        raise FieldError(f"{name}: {error.strerror}") from None
    places = [f"bytes {begin} to {end - 1} are damaged" for begin, end in damage]
    return Repaired(len(copied.records), places + copied.lost)


class _Copied:
    """The records of a copy that is made.

    Attributes:
        records: So far.
        lost: What is missing among them, a line each.
    """

    def __init__(self) -> None:
        self.records: list[Record] = []
        self.lost: list[str] = []
        self._next = self._steps = 0
        self._mission = -1
        self._ids: set[str] = set()
        self._contacts: set[str] = set()

    def take(self, number: int, record: Record) -> None:
        """Take the record with a number."""
        if number > self._next:
            lost = f"record {self._next}"
            if number > self._next + 1:
                lost = f"records {self._next} to {number - 1}"
            self.lost.append(f"{lost}: not readable")
        self._next = number + 1
        if record["record"] == MISSION:
            self._mission, self._steps = record["mission"], 0
            self._ids, self._contacts = set(), set()
        elif record["mission"] != self._mission:
            self.lost.append(f"record {number}: the beginning of its mission is not readable")
            return
        if record["record"] == STEP:
            self._put_lost_steps(record)
            self._steps = record["step"]
        elif record["record"] == INPUT and (missing := self._lacks(record["input"])):
            self.lost.append(f"record {number}: {record['input']['id']!r} is about {missing}, "
                             "which is not readable")  # fmt: skip
            return
        record.pop("crc32", None)
        self.records.append(record)

    def _put_lost_steps(self, following: Record) -> None:
        for step in range(self._steps + 1, following["step"]):
            self.lost.append(f"step {step}: counts as one in which nobody looked")
            done = from_json(following["looks"])
            assert isinstance(done, StepLooks)
            nobody = done.of_drones(np.zeros(len(done.flown) or 1 + max([0, *done.drones]), bool))
            self.records.append(
                {
                    "record": STEP, "mission": self._mission, "step": step,
                    "looks": to_json(nobody), "row": following["row"],
                }
            )  # fmt: skip

    def _lacks(self, entry: Record) -> str:
        """Return what an input is about and is not there, "" if it is; note a new input."""
        values = entry["values"]
        decides = entry["kind"] in ("confirm", "dismiss", "withdraw")
        for field, known in (("contact", self._contacts), ("input", self._ids)):
            if decides and field in values and values[field] not in known:
                return f"{field} {values[field]}"
        self._ids.add(entry["id"])
        if "contact" in entry["derived"]:
            self._contacts.add(entry["derived"]["contact"])
        return ""
