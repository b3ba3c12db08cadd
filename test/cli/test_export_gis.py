# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""GIS files from the command line, of a recorded mission or of a search."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gpxpy")
pytest.importorskip("shapely")
rasterio = pytest.importorskip("rasterio")
from dsse_ros.cli.export_gis import main  # noqa: E402
from dsse_ros.cli.export_mission import search  # noqa: E402
from dsse_ros.results.report.logs import read_csv  # noqa: E402
from dsse_ros.search.environments.parallel_env import SearchEnv  # noqa: E402
from dsse_ros.world.scenario.rules import profile  # noqa: E402
from dsse_ros.world.scenario.scenario import Scenario  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
FILES = ["mission.kml", "poc.tif", "pod.tif", "tracks.gpx"]


def test_without_a_file_a_planner_searches_and_the_search_is_recorded(tmp_path: Path) -> None:
    assert main(["--scenario", "sitl", "--seed", "2", "--out", str(tmp_path / "a")]) == 0
    scenario = Scenario.from_yaml(ROOT / "config" / "sitl.yaml")
    cells, searched, _ = search(SearchEnv(scenario, profile("paper")), "belief", 2, {})
    (record,) = read_csv(tmp_path / "a" / "mission.csv")
    assert np.array_equal(record.cells, cells) and np.array_equal(record.searched, searched)
    recorded = str(tmp_path / "a" / "mission.csv")
    assert main([recorded, "--steps", "0", "3", "--out", str(tmp_path / "b")]) == 0
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == FILES
    with rasterio.open(tmp_path / "b" / "poc.tif") as raster:
        assert raster.descriptions == ("POC after step 0", "POC after step 3")


def test_the_points_of_an_incident_have_the_time_of_the_search(tmp_path: Path) -> None:
    limit = ["--ros-args", "-p", "scenario.timestep_limit:=5", "-p", "scenario.particles:=500"]
    assert main(["--scenario", "kayak", "--out", str(tmp_path), *limit]) == 0
    text = (tmp_path / "tracks.gpx").read_text()
    times = [datetime.fromisoformat(stamp[:26]) for stamp in text.split("<time>")[2:8]]
    (record,) = read_csv(tmp_path / "mission.csv")
    steps = {round((b - a).total_seconds(), 3) for a, b in zip(times, times[1:], strict=False)}
    assert times[0] > datetime.fromisoformat("2026-01-17T14:00")
    assert steps == {round(record.scenario.step_duration_s, 3)}


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["nowhere.csv"], "file: 'nowhere.csv': No such file"),
        (["--steps", "999"], "steps must be recorded steps, 0 to"),
        (["--scenario", "nowhere"], "scenario: 'nowhere' is not a file"),
    ],
)
def test_what_is_not_allowed_gets_one_line(
    arguments: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith(f"export_gis: {line}") and printed.count("\n") == 1
