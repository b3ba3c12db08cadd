# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Intake of the inputs of a live search, without ROS: each gets an answer."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dsse_ros.base.defects import reason_of
from dsse_ros.base.json_reader import read_json
from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.mission.files.mission_journal import MissionJournal, take_changes
from dsse_ros.mission.live.admission import Admission, Clocks
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.clock import StepClock
from dsse_ros.mission.live.inputs import LONGEST_TEXT, Input, parse, read
from dsse_ros.mission.live.live_search import Entry
from dsse_ros.mission.live.records import read_back
from dsse_ros.mission.run.mission import Mission
from dsse_ros.world.scenario.live_texts import Answer

_LONGEST_ID = 100


class LiveIntake:
    """Passes inputs to the live search of a mission, and its entries to a journal.

    `take` puts an input in line, `decide` answers all that are.

    Args:
        mission: The mission; its scenario has no truth, and a belief follows it.
        warn: Logs a line of a kind.
        rejected: Counts the refused inputs by code.
        journal: Where accepted inputs are kept before they are answered; None for nowhere.

    Attributes:
        clock: Stamps of the steps.
    """

    def __init__(
        self,
        mission: Mission,
        warn: Callable[[str, str], None],
        rejected: Counter[str],
        journal: MissionJournal | None = None,
    ) -> None:
        assert isinstance(mission.beliefs, LiveBeliefs)
        self._mission, self._beliefs, self._warn = mission, mission.beliefs, warn
        self.clock = StepClock(mission.env.scenario.step_duration_s)
        self._journal = journal
        self._rejected = rejected
        self._line: list[tuple[str, str, Result[Input]]] = []

    def take(self, kind: str, text: str) -> None:
        """Put the JSON text of an input in line."""
        parsed = parse(kind, text)
        input_id = parsed.value.id if isinstance(parsed, Accepted) else _id_of(text)
        self._line.append((kind, input_id, parsed))

    def take_values(self, kind: str, values: Mapping[str, Any]) -> None:
        """Put the fields of an input in line."""
        self._line.append((kind, str(values.get("id", ""))[:_LONGEST_ID], read(kind, values)))

    def refuse(self, kind: str, input_id: str, rejected: Rejected) -> None:
        """Put an input in line that is refused already."""
        self._line.append((kind, input_id[:_LONGEST_ID], rejected))

    def decide(self, stamp_s: float) -> list[Answer]:
        """Decide about the inputs in line; return the answers.

        Args:
            stamp_s: The node's clock.
        """
        line, self._line = self._line, []
        if not line:
            return []
        live_search = self._beliefs.live_search
        pos, poc = live_search.pos, live_search.belief.poc()
        clocks = Clocks(self.clock.now_s, stamp_s, self.clock.of_stamp)
        answers, entries = [], []
        begin = None if self._journal is None else self._journal.end
        for kind, input_id, parsed in line:
            answer, entry = self._decide_one(kind, input_id, parsed, clocks)
            answers.append(answer)
            if entry is not None:
                entries.append(entry)
        if begin is not None and entries and (failed := self._sync(begin)):
            self._beliefs.reset([entry for entry in live_search.history if entry not in entries])
            answers = [_refused(answer, failed) if answer.ok else answer for answer in answers]
        live_search = self._beliefs.live_search
        moved = 0.5 * float(np.abs(live_search.belief.poc() - poc).sum())
        take_changes(self._mission)
        changes: dict[str, Any] = {
            "pos_before": pos, "pos_after": live_search.pos, "poc_moved": moved,
        }  # fmt: skip
        for answer in answers:
            self._log(answer)
        return [answer._replace(**changes) if answer.ok else answer for answer in answers]

    def _decide_one(
        self, kind: str, input_id: str, parsed: Result[Input], clocks: Clocks
    ) -> tuple[Answer, Entry | None]:
        """Decide about an input; return the answer, and the entry of a new one that is accepted."""
        live_search, answer = self._beliefs.live_search, Answer(input_id, kind)
        if isinstance(parsed, Rejected):
            return _refused(answer, parsed), None
        admission = Admission(live_search)
        checked = admission.check(parsed.value, clocks)
        if isinstance(checked, Rejected):
            left_out = None
            if kind == "detection" and checked.code == "too_many" and not self._mission.done:
                left_out = admission.left_out(parsed.value, clocks)
            return _refused(answer, checked), left_out and self._take_up(left_out)
        entry = checked.value
        if entry is None:
            return answer._replace(code="again"), None
        if self._mission.done:
            return _refused(answer, Rejected("mission_over", "the mission is over")), None
        try:
            entry = read_back(entry)
        except (RecursionError, ValueError) as error:
            return _refused(answer, Rejected("bad_value", reason_of(error))), None
        if failed := self._write(entry):
            return _refused(answer, failed), None
        live_search.apply(entry)
        contact = entry.derived.get("contact", entry.values.get("contact", ""))
        return answer._replace(contact=contact, input=entry.values.get("input", "")), entry

    def _take_up(self, entry: Entry) -> Entry | None:
        """Apply an entry that no answer names; return None if the journal cannot keep it."""
        if self._write(entry):
            return None
        self._beliefs.live_search.apply(entry)
        return entry

    def _write(self, entry: Entry) -> Rejected | None:
        """Append an entry to the journal; return why it cannot."""
        try:
            if self._journal is not None:
                self._journal.write(entry)
        except OSError as error:
            return _not_recorded(error)
        return None

    def _sync(self, begin: tuple[int, int]) -> Rejected | None:
        """Flush the entries to disk; if that fails, remove them and return why."""
        assert self._journal is not None
        try:
            self._journal.sync()
        except OSError as error:
            with contextlib.suppress(OSError):
                self._journal.cut_back(begin)
            return _not_recorded(error)
        return None

    def _log(self, answer: Answer) -> None:
        if not answer.ok:
            self._rejected[answer.code] += 1
            self._warn(answer.code, f"live/{answer.kind}: {answer.reason}")

    def contacts(self) -> list[dict[str, Any]]:
        """Return the contacts for JSON, at the places to which the sea has moved them."""
        live_search, names = self._beliefs.live_search, self._mission.env.possible_agents
        shown = []
        for contact in live_search.contacts.by_name.values():
            last, x, y = live_search.contact_now(contact, self.clock.now_s)
            lat, lon = live_search.lat_lon(x, y)
            shown.append(
                {
                    "contact": contact.name, "state": contact.state, "lat": lat, "lon": lon,
                    "x": x, "y": y, "radius": last.radius_m, "time": last.time_s,
                    "utc": live_search.utc(last.time_s), "detections": len(contact.detections),
                    "probability": live_search.probability(contact),
                    "drones": [names[drone] for drone in contact.drones],
                }
            )  # fmt: skip
        return shown


def _refused(answer: Answer, rejected: Rejected) -> Answer:
    return Answer(answer.id, answer.kind, ok=False, code=rejected.code, reason=rejected.reason)


def _not_recorded(error: OSError) -> Rejected:
    return Rejected("not_recorded", f"journal cannot be written: {error.strerror}")


def _id_of(text: str) -> str:
    """Return the id in a text that was refused, "" if it has none."""
    try:
        stated = read_json(text, "input", LONGEST_TEXT)["id"]
    except (KeyError, TypeError, ValueError):
        return ""
    return stated[:_LONGEST_ID] if isinstance(stated, str) and stated.isprintable() else ""
