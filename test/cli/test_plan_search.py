# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The program `plan_search` writes a plan that is the same for the same seed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from dsse_ros.cli.plan_search import main
from dsse_ros.planners.search_plan import optimiser

ROOT = Path(__file__).resolve().parents[2]
UNITS = str(ROOT / "examples" / "kayak_units.yaml")
KAYAK = f"--scenario={ROOT / 'config' / 'kayak.yaml'}"


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(optimiser, "DIVISION_GENERATIONS", 2)
    monkeypatch.setattr(optimiser, "MOVE_GENERATIONS", 1)


def test_the_same_seed_writes_the_same_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("first", "again"):
        assert main([UNITS, KAYAK, f"--out={tmp_path / name}", "--seed=3", "--minutes=60"]) == 0
    printed = capsys.readouterr().out
    assert "SEARCH ACTION PLAN" in printed
    assert "POS of all units" in printed
    written = sorted(path.name for path in (tmp_path / "first").iterdir())
    assert {"plan.txt", "plan.json", "plan.geojson", "plan.kml", "plan.gpx", "plan.png"} < set(
        written
    )
    assert {"drone0.plan", "drone0.waypoints", "helicopter.plan"} < set(written)
    for name in written:
        first, again = ((tmp_path / run / name).read_bytes() for run in ("first", "again"))
        assert first == again, name
    assert json.loads((tmp_path / "first" / "drone0.plan").read_text())["fileType"] == "Plan"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([UNITS, "--scenario=santos"], "scenario must have an incident, got 'santos'"),
        (["none.yaml"], "none.yaml: No such file or directory"),
        ([UNITS, "--minutes=0"], "minutes must be > 0 and <= 1440, got 0"),
        ([UNITS, "--minutes=1", "--seed=1"], "ready must be from 2026-01-17T14:00:00Z to before"),
        ([UNITS, "--begins=2026-01-17T13:00Z"], "begins must be at least 2026-01-17T14:00:00Z"),
        ([UNITS, "--after", UNITS], "kayak_units.yaml: plan: not JSON"),
        ([UNITS, "--seed=-1"], "seed must be an integer >= 0 and <= 4611686018427387904, got -1"),
    ],
)
def test_bad_input_is_refused_in_a_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main([KAYAK, *arguments, f"--out={tmp_path}"]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1


def test_units_without_time_are_refused_in_a_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    units = tmp_path / "units.yaml"
    units.write_text("units: [{name: far, speed: 10, base: [-23.0, -46.3]}]")
    assert main([str(units), KAYAK, f"--out={tmp_path}"]) == 2
    assert "units must have time to reach the search area" in capsys.readouterr().err


def test_objects_that_sensors_tell_apart_are_refused_in_a_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scenario = yaml.safe_load((ROOT / "config" / "kayak.yaml").read_text())
    del scenario["incident"]["shore"]
    scenario["incident"]["object"] = [
        {"class": "kayak"}, {"class": "PIW-1", "search_object": "person_in_water"},
    ]  # fmt: skip
    path = tmp_path / "kayak.yaml"
    path.write_text(yaml.safe_dump(scenario | {"sensor": "sweep_width"}))
    assert main([UNITS, f"--scenario={path}", f"--out={tmp_path}"]) == 2
    assert "incident: object must be one, or several that" in capsys.readouterr().err
