# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands of many drones, and in any order."""

from __future__ import annotations

from pathlib import Path

from promises import keep


def test_every_command_of_a_hundred_drones_is_done_in_its_step(tmp_path: Path) -> None:
    keep("traffic", "load", tmp_path)


def test_doubled_and_shuffled_commands_are_applied_once_or_refused(tmp_path: Path) -> None:
    keep("traffic", "duplicates", tmp_path)


def test_a_clock_that_jumps_ends_nothing(tmp_path: Path) -> None:
    keep("clocks", "clock", tmp_path)
