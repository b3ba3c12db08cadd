# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The journal of a live search loses nothing that was acknowledged, whatever happens to it."""

from __future__ import annotations

import hashlib
import json
import os
import resource
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from benchmarks.live_kills import INPUTS, Killed, digest_of, kill, new_mission
from dsse_ros.base.fields import FieldError
from dsse_ros.cli.replay import main as replay
from dsse_ros.mission.files.mission_journal import MissionJournal
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.journal import TOPIC, JournalFile, read_texts, salvage
from dsse_ros.mission.run.live_intake import LiveIntake
from dsse_ros.mission.run.mission import Mission
from dsse_ros.world.scenario.live_texts import Answer

MORE = '{"more": 0}'
TEXTS = [
    json.dumps(values, ensure_ascii=False) for values in ({"a": 1}, {"n": "Ærø"}, {"x": "y" * 300})
]


def _texts(path: Path, notes: list[str]) -> list[str]:
    file = JournalFile(path, notes.append)
    texts = file.texts
    file.append(MORE, 9)
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
    assert _texts(written, notes) == [*TEXTS, MORE] and notes == []
    with written.open("rb") as file:
        read = [
            (schema.name if schema else "", channel.topic, message.log_time, message.data)
            for schema, channel, message in make_reader(file).iter_messages()
        ]
    assert [(name, topic) for name, topic, *_ in read] == [("std_msgs/msg/String", TOPIC)] * 5
    values = [json.loads(data[8:-1]) for *_, data in read]
    assert all(value.pop("crc32") >= 0 for value in values)
    assert values == [json.loads(text) for text in (*TEXTS, MORE, MORE)]
    assert [time for _, _, time, _ in read] == [0, 1, 2, 9, 9]


def _ends(path: Path) -> list[int]:
    """Return the bytes at which the records of `written` end, and the beginning before them."""
    file = JournalFile(path, pytest.fail)
    ends = [file.end[0]]
    for number, text in enumerate(TEXTS):
        file.append(text, number)
        ends.append(file.end[0])
    file.close()
    return ends


@pytest.mark.parametrize("filled", [False, True])
def test_a_file_cut_off_anywhere_loses_its_last_record_only(
    filled: bool, written: Path, tmp_path: Path
) -> None:
    content, ends = written.read_bytes(), _ends(tmp_path / "whole.mcap")
    for size in range(ends[0], len(content)) if filled else range(len(content)):
        cut, notes = tmp_path / "cut.mcap", list[str]()
        left = content[:size] + bytes(len(content) - size if filled else 0)
        cut.write_bytes(left)
        read = _texts(cut, notes)
        # The last byte of a record is a null.
        end = size + 1 if filled else size
        assert read == TEXTS[: max(sum(at <= end for at in ends) - 1, 0)]
        if filled:
            assert len(notes) == (left != content)
        else:
            assert len(notes) == (size not in (0, *ends))
        assert _texts(cut, notes) == [*read, MORE]


@pytest.mark.parametrize("closed", [True, False])
def test_no_damaged_byte_loses_anything_without_a_word(closed: bool, written: Path) -> None:
    data = written.read_bytes()
    data = data if closed else data[:-37]
    for at in range(len(data)):
        for wrong in {data[at] ^ 0xFF, data[at] ^ 0x01, 0, 0xFF} - {data[at]}:
            notes: list[str] = []
            damaged = data[:at] + bytes([wrong]) + data[at + 1 :]
            try:
                texts, _ = read_texts(damaged, "journal: 'j'", notes.append)
            except FieldError as error:
                assert "\n" not in str(error) and "is damaged at byte" in str(error), error
                continue
            # It looks as if it was cut off.
            assert len(notes) == 1 and texts in (TEXTS, TEXTS[:-1]), (at, wrong)


def test_a_damaged_journal_stays_as_it_is_and_whole_records_are_salvaged(written: Path) -> None:
    whole, data = salvage(written), written.read_bytes()
    assert whole == ({0: TEXTS[0], 1: TEXTS[1], 2: TEXTS[2]}, [])
    at = data.index("Ærø".encode())
    written.write_bytes(damaged := data[:at] + b"\xff" + data[at + 1 :])
    with pytest.raises(FieldError, match=r"damaged at byte \d+, in record 1, and stays as it is; "):
        JournalFile(written, pytest.fail)
    assert written.read_bytes() == damaged
    texts, ((begin, end),) = salvage(written)
    assert texts == {0: TEXTS[0], 2: TEXTS[2]} and begin < at < end


@pytest.mark.parametrize("kind", ["device", "pipe"])
def test_a_journal_is_a_regular_file(kind: str, tmp_path: Path) -> None:
    path = Path(os.devnull)
    if kind == "pipe":
        path = tmp_path / "pipe"
        os.mkfifo(path)
    with pytest.raises(FieldError, match="^journal: .* must be a regular file$"):
        JournalFile(path, pytest.fail)


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
    live_search = mission.beliefs.live_search
    digest = hashlib.sha256(live_search.belief.density.tobytes()).hexdigest()
    inputs = "16 detections, 1 dismiss, 1 searched, 1 sighting, 1 weather, 1 withdraw"
    steps = f"mission 1: {len(live_search.steps)} steps, {inputs}"
    assert (
        capsys.readouterr().out == f"{steps}: POS {live_search.pos:.4f}, belief sha256 {digest}\n"
    )


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["sea", "flight"])
def test_a_search_goes_on_without_any_one_of_its_records(
    rules: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, mission = tmp_path / "journal.mcap", new_mission(rules)
    ends = _keep_some(path, mission)
    data = path.read_bytes()
    for number, (begin, end) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
        at = (begin + end) // 2
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        with pytest.raises(FieldError, match=f"damaged at byte {begin}, in record {number}"):
            MissionJournal(path, new_mission(rules), pytest.fail)
        new = tmp_path / f"repaired{number}.mcap"
        assert replay(["--repaired", str(new), str(path)]) == 0
        *lines, last = capsys.readouterr().out.splitlines()
        assert lines[0] == f"bytes {begin} to {end - 1} are damaged"
        empty = sum(" counts as one in which nobody looked" in line for line in lines)
        without = sum(" is about " in line for line in lines)
        again = new_mission(rules)
        journal = MissionJournal(new, again, pytest.fail)
        journal.close()
        assert isinstance(again.beliefs, LiveBeliefs)
        live_search = again.beliefs.live_search
        assert journal.resumed == (number > 0)
        if number > 0:
            assert last == f"{len(ends) - 2 + empty - without} records in {new}"
            assert again.result.step == len(live_search.steps)
            # One record of eight is damaged.
            assert len(live_search.entries) + len(live_search.steps) == 7 + empty - without
        assert replay(["--repaired", str(new), str(path)]) == 2
        assert "must be a new file" in capsys.readouterr().err


def _keep_some(path: Path, mission: Mission) -> list[int]:
    """Keep four steps with an input each; return where the records begin and end."""
    journal = MissionJournal(path, mission, pytest.fail)
    intake = LiveIntake(mission, lambda *_: None, Counter(), journal)
    ends = [journal.end[0]]
    inputs = {
        1: ("detection", {"id": "d", "x": 300.0, "y": 400.0, "radius": 60.0, "drone": 0}),
        2: ("dismiss", {"id": "no", "contact": "c1"}),
        3: ("withdraw", {"id": "yes", "input": "no"}),
        4: ("detection", {"id": "e", "x": 500.0, "y": 400.0, "radius": 60.0, "drone": 1}),
    }
    for step in range(5):
        assert journal.record() == ""
        ends.append(journal.end[0])
        intake.clock.set(step, mission.result.stamp_ns / 1e9)
        if step in inputs:
            intake.take(inputs[step][0], json.dumps(inputs[step][1]))
            (answer,) = intake.decide(mission.result.stamp_ns / 1e9)
            assert answer.ok, answer
            ends.append(journal.end[0])
        if step < 4:
            mission.command_all([[0.5, 0.5]] * 2 if mission.env.rules.in_metres else [0, 0])
            mission.advance("hold")
    journal.close()
    return ends
