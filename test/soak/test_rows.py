# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of promises: each row has a short form in the tests, and results say what they are."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from soak.__main__ import main
from soak.row import Goal, Row, Run
from soak.rows import ROWS
from soak.table import BEGIN, END, PAGE, RESULTS, filled, stated, table

ROOT = Path(__file__).resolve().parents[2]
ELSEWHERE = {
    "big_swarm": "soak/test_traffic.py::test_every_command_of_a_hundred_drones_is_done_in_its_step",
    "late_joiner": "ros/nodes/test_lockstep.py::"
    "test_a_late_joiner_gets_everything_about_the_last_step",
    "planner_killed": "ros/nodes/test_planner_node.py::"
    "test_a_planner_that_was_restarted_goes_on_with_the_mission",
    "node_killed": "ros/nodes/test_snapshots.py::"
    "test_a_mission_that_was_killed_leaves_the_record_of_one_that_was_not",
    "bridge_killed": "ros/nodes/test_bridge_restarts.py::"
    "test_a_bridge_started_again_has_nobody_take_off_who_is_out_of_the_search",
    "huge_worlds": "ros/nodes/test_bad_input.py::test_bad_input_is_refused_on_one_clear_line",
    "hostile_dds": "ros/nodes/test_hostile_messages.py::"
    "test_a_thousand_hostile_messages_change_nothing_and_each_is_counted",
    "hostile_mavlink": "vehicles/control/test_fuzz.py::"
    "test_no_message_of_a_vehicle_raises_or_sets_an_invalid_position",
    "custody": "vehicles/fleet/test_interleavings.py::"
    "test_no_interleaving_arms_takes_off_or_moves_what_it_must_not",
    "fleet": "vehicles/control/test_fleet.py::"
    "test_a_vehicle_that_drops_out_does_not_stop_the_others",
}
"""Rows whose short form is a test of another folder."""


def test_every_row_has_a_short_form() -> None:
    here = "".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    kept = set(re.findall(r'keep\("\w+", "(\w+)"', here))
    kept |= {name for name in ROWS if name.startswith(("fuzz_", "stateful_"))}
    assert kept | set(ELSEWHERE) == set(ROWS) and not kept & set(ELSEWHERE)
    for place in ELSEWHERE.values():
        file, _, test = place.partition("::")
        assert f"def {test}" in (ROOT / "test" / file).read_text()


def test_the_declaration_states_the_figures_of_the_results() -> None:
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    assert set(results) <= set(ROWS)
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else f"Before\n{BEGIN}{END}After\n"
    # It states nothing before it is filled for the first time.
    assert stated(page) in ("", table(results))
    assert stated(filled(page, results)) == table(results)
    assert filled(filled(page, results), results) == filled(page, results)


@pytest.fixture
def row(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Have one row alone, whose figure is the first of these."""
    figures = [7]

    def measure(run: Run) -> dict[str, int]:
        assert run.folder.is_dir() and run.quick
        if figures[0] < 0:
            raise AssertionError("no\nfigure")
        return {"lost": figures[0]}

    made = Row("one", "None is lost", measure, "{lost} lost", (Goal("lost", most=0),))
    monkeypatch.setattr("soak.__main__.ROWS", {"one": made})
    return figures


def test_a_row_is_measured_again_only_if_the_code_has_changed(
    row: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "soak.json"
    arguments = ["--quick", "--out", str(out)]
    monkeypatch.setattr("soak.__main__.BUILD", tmp_path / "build")
    monkeypatch.setattr("soak.__main__.use_defaults_of_dds", lambda: None)
    assert main(arguments) == 1
    assert json.loads(out.read_text())["one"]["missed"] == ["lost <= 0, not 7"]
    row[0] = 0
    assert main(arguments) == 1
    monkeypatch.setattr("soak.__main__.digest", lambda: "another")
    assert main(arguments) == 0
    assert json.loads(out.read_text())["one"]["says"] == "0 lost"
    row[0] = -1
    assert main([*arguments, "--again"]) == 1
    result = json.loads(out.read_text())
    assert result["one"]["missed"] == ["AssertionError: no figure"]
    assert "| None is lost | not measured to its end; MISSED" in table(result)
