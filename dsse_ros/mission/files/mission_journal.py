# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The journal of a live search: its missions, their steps and their inputs, each when it came.

A mission is taken up from it bit for bit: its belief from the looks and inputs, its world from the
state after the last step. Each record is a JSON text with `record`: `mission` begins a mission,
`step` has the looks of a step, `input` an input, and `state` a change between steps. All have the
number of their `mission`.
"""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import os
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.json_reader import read_json
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.live_search import Entry, LiveSearch
from dsse_ros.mission.live.records import from_json, to_json, to_text
from dsse_ros.mission.live.step_looks import StepLooks
from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.world.scenario.agents import definition_from, definition_values
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.json_keys import Keys
from dsse_ros.world.scenario.scenario import ResolvedScenario

MISSION, STEP, INPUT, STATE = "mission", "step", "input", "state"
LONGEST_RECORD = 1 << 30
"""Characters of a record."""
Record = dict[str, Any]


class MissionJournal:
    """Keeps the missions of a live search in a file.

    Args:
        path: The file; the last mission in it is taken up.
        mission: The mission, which has no truth, and a belief.
        note: Called with a line if the file was cut off.

    Attributes:
        resumed: Whether a mission was taken up.

    Raises:
        FieldError: If the file cannot be used, or is of another search.
    """

    def __init__(
        self, path: str | os.PathLike[str], mission: Mission, note: Callable[[str], None]
    ) -> None:
        assert isinstance(mission.beliefs, LiveBeliefs)
        self._mission, self._beliefs = mission, mission.beliefs
        # It needs an extra, which a search without a journal does not.
        from dsse_ros.mission.live.journal import JournalFile

        self._file = JournalFile(path, note)
        # What could not be written yet: a step must not be left out.
        self._waiting: list[str] = []
        self._last = (0, 0)
        self._points = [0] * len(mission.tracks)
        try:
            records = last_mission(self._file.texts)
            self.resumed = bool(records)
            if records:
                self._resume(records)
        except ValueError as error:
            self._file.close()
            raise FieldError(f"journal: {os.fspath(path)!r}: {error}") from None
        self._file.texts.clear()

    def _resume(self, records: list[Record]) -> None:
        mission = self._mission
        snapshot = snapshot_of(records, mission.history)
        snapshot.check(mission.env.snapshot().identity, {})
        mission.restore(snapshot)
        self._last = mission.number, mission.result.step
        self._points = [len(track) for track in mission.tracks]
        if self._beliefs.live_search.over:
            end_found(mission)

    def write(self, entry: Entry) -> None:
        """Append an input.

        Raises:
            OSError: If it cannot be written; the journal is as before.
        """
        self._flush()
        self._append({"record": INPUT, "input": to_json(entry)})

    @property
    def end(self) -> tuple[int, int]:
        """Where the next record begins, for `cut_back`."""
        return self._file.end

    def cut_back(self, end: tuple[int, int]) -> None:
        """Remove what was written after an `end`.

        Raises:
            OSError: If the file cannot be changed.
        """
        self._file.cut_back(end)

    def sync(self) -> None:
        """Flush the file to disk, so that it survives a loss of power.

        Raises:
            OSError: If it cannot be written.
        """
        self._file.sync()

    def record(self) -> str:
        """Append the last step, or what has changed since; return why it cannot, "" if it can."""
        mission = self._mission
        at, last = (mission.number, mission.result.step), self._last
        if at[0] != last[0]:
            self._points = [0] * len(mission.tracks)
            self._wait({"record": MISSION, **self._header()})
        elif at != last:
            looks = to_json(self._beliefs.live_search.steps[-1])
            self._wait(
                {"record": STEP, "step": at[1], "looks": looks, "row": self._row(), **self._state()}
            )
        else:
            self._wait({"record": STATE, **self._state()})
        self._last = at
        try:
            self._flush()
        except OSError as error:
            return f"journal: {error.strerror}; inputs are refused until it can be written"
        return ""

    def _header(self) -> Record:
        mission = self._mission
        definition = SearchDefinition(mission.env.rules, mission.env.mission_scenario)
        identity = mission.env.snapshot().identity
        return {
            "definition": definition_values(definition),
            "identity": identity, **self._state(),
        }  # fmt: skip

    def _state(self) -> Record:
        """Return the mission without its past, and the places that its tracks have gained."""
        mission = self._mission
        snapshot = mission.snapshot(past=False)
        packed = Snapshot({}, snapshot.arrays, snapshot.extra).to_bytes()
        gained = [track[begin:] for track, begin in zip(mission.tracks, self._points, strict=True)]
        self._points = [len(track) for track in mission.tracks]
        return {"state": base64.b64encode(zlib.compress(packed)).decode(), "tracks": gained}

    def _row(self) -> str:
        """Return the row of the step before the last in the history, which changes no more."""
        return base64.b64encode(self._mission.history[-2].tobytes()).decode()

    def _text(self, record: Record) -> str:
        return json.dumps({**record, "mission": self._mission.number}, allow_nan=False)

    def _wait(self, record: Record) -> None:
        self._waiting.append(self._text(record))

    def _flush(self) -> None:
        while self._waiting:
            self._file.append(self._waiting[0], time.time_ns())
            del self._waiting[0]

    def _append(self, record: Record) -> None:
        self._file.append(self._text(record), time.time_ns())

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def end_found(mission: Mission) -> None:
    """End a live mission, because everybody was found."""
    assert isinstance(mission.beliefs, LiveBeliefs)
    mission.beliefs.end()
    terminated, _ = mission.env.flags
    terminated[mission.lost] = True
    mission.result = dataclasses.replace(mission.result, terminated=terminated)


def take_entry(mission: Mission, entry: Entry) -> None:
    """Have a live mission take up an accepted input again."""
    assert isinstance(mission.beliefs, LiveBeliefs)
    mission.beliefs.live_search.apply(entry)
    take_changes(mission)


def take_changes(mission: Mission) -> None:
    """Have a live mission take up what inputs have changed: its map, and perhaps its end."""
    assert isinstance(mission.beliefs, LiveBeliefs)
    mission.belief_map = None
    if mission.beliefs.live_search.over and not mission.done:
        end_found(mission)


def last_mission(texts: Iterable[str]) -> list[Record]:
    """Return the records of the last mission of a journal, none if it has none.

    Raises:
        ValueError: If a text is not a record.
    """
    records: list[Record] = []
    for number, text in enumerate(texts):
        try:
            record = read_json(text, f"record {number}", LONGEST_RECORD)
            kind = record["record"]
            if kind not in (MISSION, STEP, INPUT, STATE) or not (records or kind == MISSION):
                raise ValueError
        except (KeyError, TypeError, ValueError):
            raise ValueError(f"record {number} is not of a live search") from None
        if kind == MISSION:
            records = []
        records.append(record)
    return records


def history_of(records: Iterable[Record]) -> list[StepLooks | Entry]:
    """Return the looks and inputs of a mission.

    Raises:
        ValueError: If a record is damaged.
    """
    found = {STEP: "looks", INPUT: "input"}
    return [
        from_json(record[found[record["record"]]])
        for record in records
        if record["record"] in found
    ]


def snapshot_of(records: list[Record], history: NDArray[Any]) -> Snapshot:
    """Return the snapshot of a mission after its last record.

    Args:
        records: Of the mission.
        history: Rows of a mission's history, for their type.

    Raises:
        ValueError: If a record is damaged.
    """
    try:
        with_state = [record for record in records if "state" in record]
        last = Snapshot.from_bytes(zlib.decompress(base64.b64decode(with_state[-1]["state"])))
        tracks: list[list[Any]] = [[] for _ in with_state[0]["tracks"]]
        for record in with_state:
            for track, gained in zip(tracks, record["tracks"], strict=True):
                track += gained
        rows = b"".join(base64.b64decode(record["row"]) for record in records if "row" in record)
        past = {
            "history": np.frombuffer(rows, history.dtype).reshape(-1, history.shape[1]),
            "belief_records": np.frombuffer(to_text(history_of(records)).encode(), np.uint8),
        }
        extra = {**last.extra, "tracks": tracks}
        return Snapshot(records[0]["identity"], {**last.arrays, **past}, extra)
    except SnapshotError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, zlib.error) as error:
        raise ValueError(f"a record is damaged: {error}") from None


class Replayed(NamedTuple):
    """The last mission of a journal, computed again from its looks and inputs.

    Attributes:
        number: Of the mission.
        steps: Number of its steps.
        inputs: Number of its inputs by kind.
        pos: POS at its end.
        sha256: Digest of the belief at its end, equal wherever the journal is the same.
    """

    number: int
    steps: int
    inputs: Counter[str]
    pos: float
    sha256: str


def replayed(path: str | os.PathLike[str], note: Callable[[str], None]) -> Replayed | None:
    """Compute the belief of the last mission of a journal again; None if it has no mission.

    Args:
        path: The journal, which stays as it is.
        note: Called with a line if it is cut off.

    Raises:
        FieldError: If it cannot be read, or is no journal.
    """
    from dsse_ros.mission.live.journal import texts_of

    name = f"journal: {os.fspath(path)!r}"
    try:
        records = last_mission(texts_of(path, note))
        if not records:
            return None
        definition = definition_from(Keys(records[0]["definition"], "definition"), None, None)
        scenario = definition.scenario
        assert isinstance(scenario, ResolvedScenario)
        live_search = LiveSearch(scenario, definition.rules)
        live_search.repeat(history := history_of(records))
    except (KeyError, ValueError) as error:
        raise FieldError(str(error) if name in str(error) else f"{name}: {error}") from None
    return Replayed(
        records[0]["mission"], len(live_search.steps),
        Counter(record.kind for record in history if isinstance(record, Entry)), live_search.pos,
        hashlib.sha256(live_search.belief.density.tobytes()).hexdigest(),
    )  # fmt: skip
