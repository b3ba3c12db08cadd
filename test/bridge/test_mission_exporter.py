# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each finished search becomes mission files; what cannot be written is named once."""

from __future__ import annotations

from pathlib import Path

import pytest
from virtual_fleet import VirtualSearch

from dsse_ros.bridge.mission_exporter import MissionExporter
from dsse_ros.bridge.settings import BridgeSettings

NAMES = ["drone0.plan", "drone0.waypoints", "drone1.plan", "drone1.waypoints"]


class Export:
    """An exporter and a simulation of two drones."""

    def __init__(self, folder: Path, **settings: object) -> None:
        self.log: list[tuple[str, str]] = []
        given = BridgeSettings(mode="export", export_directory=str(folder), **settings)  # type: ignore[arg-type]
        self.exporter = MissionExporter(given, lambda level, line: self.log.append((level, line)))
        self.search = VirtualSearch(7, [(0, 3), (2, 3)])

    def publish(self) -> None:
        """Publish all that a late listener gets."""
        exporter, search = self.exporter, self.search
        assert not exporter.set_publishers(1)
        exporter.take_agents(search.agents(), 0.0)
        exporter.take_report(search.stamp_ns, search.last, 0.0)
        if search.over:
            exporter.take_mission_report(search.stamp_ns, search.mission_report(), 0.0)
        exporter.turn(1.0)

    def fly(self) -> None:
        """Do three steps of the search, and end it."""
        for _ in range(3):
            self.search.advance()
            self.publish()
        self.search.end()
        self.publish()


def test_nothing_is_written_before_the_search_is_over(tmp_path: Path) -> None:
    export = Export(tmp_path)
    export.publish()
    assert not export.exporter.finished and not list(tmp_path.iterdir())


def test_each_search_is_written_and_the_next_one_replaces_it(tmp_path: Path) -> None:
    export = Export(tmp_path / "missions")
    export.fly()
    assert export.exporter.finished
    files = sorted((tmp_path / "missions").iterdir())
    assert [file.name for file in files] == NAMES
    assert export.log == [("info", f"4 files in {tmp_path / 'missions'}")]
    for file in files:
        file.unlink()
    export.search.reset()
    export.publish()
    assert not export.exporter.finished
    export.fly()
    assert export.exporter.finished
    assert sorted(file.name for file in (tmp_path / "missions").iterdir()) == NAMES


def test_altitudes_without_room_are_refused_once(tmp_path: Path) -> None:
    export = Export(tmp_path, altitude_step=50.0)
    export.fly()
    export.publish()
    ((level, line),) = export.log
    assert level == "error" and line.endswith(": nothing is written")
    assert not export.exporter.finished and not list(tmp_path.iterdir())
    assert export.exporter.trouble(2.0) == line


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    export = Export(file / "missions")
    export.fly()
    assert export.log == [
        ("error", f"export_directory: {str(file / 'missions')!r}: Not a directory")
    ]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_missions_are_numbered_for_the_autopilot(tmp_path: Path, autopilot: str) -> None:
    export = Export(tmp_path, autopilot=autopilot)
    export.fly()
    items = (tmp_path / "drone0.waypoints").read_text(encoding="utf-8").splitlines()[1:]
    take_off = next(i for i, line in enumerate(items) if line.split("\t")[3] == "22")
    assert take_off == {"ardupilot": 1, "px4": 0}[autopilot]
