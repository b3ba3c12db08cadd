# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that are lost, values that make no sense, and messages that mean no good."""

from __future__ import annotations

from pathlib import Path

from promises import keep


def test_a_mission_whose_files_are_lost_says_so_and_goes_on(tmp_path: Path) -> None:
    keep("files", "files_lost", tmp_path)


def test_values_that_make_no_sense_are_refused_at_start_and_at_run_time(tmp_path: Path) -> None:
    keep("parameters", "parameters", tmp_path)


def test_two_thousand_hostile_messages_change_nothing_and_take_no_memory(tmp_path: Path) -> None:
    keep("hostile", "hostile_adapters", tmp_path)


def test_hostile_inputs_to_a_live_search_end_no_node_and_each_is_answered(tmp_path: Path) -> None:
    keep("hostile", "hostile_live", tmp_path)
