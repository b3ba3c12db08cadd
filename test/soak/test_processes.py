# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Processes that are started, stopped and watched."""

from __future__ import annotations

from pathlib import Path

from promises import keep


def test_ten_starts_and_stops_leave_nothing_behind(tmp_path: Path) -> None:
    keep("start_stop", "start_stop", tmp_path)


def test_mission_after_mission_takes_no_more_files_and_threads(tmp_path: Path) -> None:
    keep("endurance", "endurance", tmp_path)
