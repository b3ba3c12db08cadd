# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The journal of a live search loses nothing that was acknowledged, whatever happens to it."""

from __future__ import annotations

import hashlib
import json
import resource
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from benchmarks.live_kills import INPUTS, Killed, digest_of, kill, new_mission
from dsse_ros.cli.replay import main as replay
from dsse_ros.live.beliefs import LiveBeliefs
from dsse_ros.live.journal import TOPIC, JournalFile
from dsse_ros.mission.live_intake import LiveIntake
from dsse_ros.mission.mission_journal import MissionJournal
from dsse_ros.scenario.fields import FieldError
from dsse_ros.scenario.live_texts import Answer

TEXTS = ["{}", json.dumps({"name": "Ærø", "n": 1}), "x" * 300]


def _texts(path: Path, notes: list[str]) -> list[str]:
    file = JournalFile(path, notes.append)
    texts = file.texts
    file.append("more", 9)
    file.close()
    return texts


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "journal.mcap"
    file = JournalFile(path, pytest.fail)
    for number, text in enumerate(TEXTS):
        file.append(text, number)
    file.close()
    return path


def test_readers_of_mcap_read_it_and_it_goes_on_where_it_was_closed(written: Path) -> None:
    notes: list[str] = []
    assert _texts(written, notes) == TEXTS
    assert _texts(written, notes) == [*TEXTS, "more"] and notes == []
    with written.open("rb") as file:
        read = [
            (schema.name if schema else "", channel.topic, message.log_time, message.data)
            for schema, channel, message in make_reader(file).iter_messages()
        ]
    assert [(name, topic) for name, topic, *_ in read] == [("std_msgs/msg/String", TOPIC)] * 5
    assert [data[8:-1].decode() for *_, data in read] == [*TEXTS, "more", "more"]
    assert [time for _, _, time, _ in read] == [0, 1, 2, 9, 9]


def test_a_file_cut_off_anywhere_loses_its_last_record_only(written: Path, tmp_path: Path) -> None:
    content = written.read_bytes()
    for size in range(0, len(content), 7):
        cut, notes = tmp_path / f"{size}.mcap", list[str]()
        cut.write_bytes(content[:size])
        read = _texts(cut, notes)
        assert read == TEXTS[: len(read)]
        assert len(notes) == (size > 0), notes
        assert _texts(cut, notes) == [*read, "more"]


def test_a_file_that_is_in_use_or_no_journal_is_refused(written: Path, tmp_path: Path) -> None:
    used = JournalFile(written, pytest.fail)
    with pytest.raises(FieldError, match="is in use by another process"):
        JournalFile(written, pytest.fail)
    used.close()
    text, bag = tmp_path / "text", tmp_path / "bag.mcap"
    text.write_text("a text, no journal")
    with bag.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/agents", "json", writer.register_schema("s", "", b""))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    for path, reason in ((text, "is not an MCAP file"), (bag, "is not the journal of a live")):
        before = path.read_bytes()
        with pytest.raises(FieldError, match=reason):
            JournalFile(path, pytest.fail)
        assert path.read_bytes() == before


@contextmanager
def _full(path: Path, free: int) -> Iterator[None]:
    """Let no file grow beyond the size of this one by more than some bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + free, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.slow
def test_on_a_full_disk_inputs_are_refused_and_no_step_is_left_out(tmp_path: Path) -> None:
    path, mission = tmp_path / "journal.mcap", new_mission("sea")
    journal = MissionJournal(path, mission, pytest.fail)
    intake = LiveIntake(mission, lambda *_: None, Counter(), journal)
    assert journal.record() == ""

    def put() -> Answer:
        intake.take("searched", json.dumps(INPUTS[7][0][1]))
        (answer,) = intake.decide(1e9)
        return answer

    def step() -> str:
        mission.command_all([0, 0])
        mission.advance("hold")
        intake.clock.set(mission.result.step, mission.result.stamp_ns / 1e9)
        return journal.record()

    assert [step() for _ in range(4)] == [""] * 4
    before = digest_of(mission)
    with _full(path, 60):
        refused = put()
        assert (refused.ok, refused.code) == (False, "not_recorded") and "\n" not in refused.reason
        assert digest_of(mission) == before
        assert "journal: " in step()
    assert put().ok and step() == ""
    journal.close()
    again = new_mission("sea")
    MissionJournal(path, again, pytest.fail).close()
    assert digest_of(again) == digest_of(mission) and again.result.step == 6


@pytest.mark.slow
def test_a_journal_of_another_search_is_refused(tmp_path: Path) -> None:
    path, mission = tmp_path / "journal.mcap", new_mission("sea")
    journal = MissionJournal(path, mission, pytest.fail)
    journal.record()
    journal.close()
    with pytest.raises(FieldError, match=r"journal: .* the snapshot is of a different rules"):
        MissionJournal(path, new_mission("flight"), pytest.fail)


@pytest.mark.slow
def test_a_killed_search_continues_bit_for_bit_and_replay_computes_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    killed = kill("sea", 3, 5, tmp_path)
    assert killed == Killed(3, killed.acknowledged, 0, 0)
    journal, mission = tmp_path / "whole.mcap", new_mission("sea")
    MissionJournal(journal, mission, pytest.fail).close()
    capsys.readouterr()
    assert replay([str(journal)]) == 0
    assert isinstance(mission.beliefs, LiveBeliefs)
    keeper = mission.beliefs.keeper
    digest = hashlib.sha256(keeper.belief.density.tobytes()).hexdigest()
    inputs = "16 detections, 1 dismiss, 1 searched, 1 sighting, 1 weather, 1 withdraw"
    steps = f"mission 1: {len(keeper.steps)} steps, {inputs}"
    assert capsys.readouterr().out == f"{steps}: POS {keeper.pos:.4f}, belief sha256 {digest}\n"
