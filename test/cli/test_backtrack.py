# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The program `backtrack` follows an object back to where it came from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsse_ros.cli.backtrack import main
from dsse_ros.world.drift.sightings import Sighting
from dsse_ros.world.drift.tracks import collected
from dsse_ros.world.scenario.scenario import Scenario

KAYAK = Path(__file__).resolve().parents[2] / "config" / "kayak.yaml"


def test_what_drifted_from_a_place_is_followed_back_to_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    incident = Scenario.from_yaml(KAYAK).incident
    assert incident is not None
    seen = incident.sightings[0]
    start = Sighting(seen.lat_deg, seen.lon_deg, seen.time_s)
    times = seen.time_s + np.array([0.0, 7200.0])
    # Forward with the same law; the mean of many particles cancels their sides and errors.
    there = collected(times, incident._drifted([start], times, 4000, np.random.default_rng(1)))
    lat, lon = there.lats_deg[-1].mean(), there.lons_deg[-1].mean()
    end = tmp_path / "from.csv"
    arguments = [
        "--found",
        f"{lat},{lon}",
        "--time=2026-01-17T15:20Z",
        "--radius=0",
        f"--out={end}",
    ]
    assert main([f"--scenario={KAYAK}", *arguments]) == 0
    *_, last = capsys.readouterr().out.splitlines()
    assert last.startswith("2026-01-17T13:20:00Z")
    came_from = np.loadtxt(end, delimiter=",", skiprows=1).mean(axis=0)
    assert came_from == pytest.approx([seen.lat_deg, seen.lon_deg], abs=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--found=-24", "--time=2026-01-17T15:20Z"], "found must be LAT,LON"),
        (["--found=-24,-46", "--time=noon"], "time must be a time like"),
        (["--found=-24,-46", "--time=2026-01-18"], "time must be a time like 2026-01-17T14:00Z"),
        (
            ["--found=-46.360,-24.012", "--time=2026-01-17T15:20Z"],
            "found must be at most 500 km from the search at",
        ),
        (["--found=-24,-46", "--time=2026-01-17T12:00Z"], "until must be before the find"),
        (["--found=-24,-46", "--time=2026-01-17T15:00Z", "--scenario=santos"], "an incident"),
    ],
)
def test_bad_input_is_refused_in_a_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([f"--scenario={KAYAK}", *arguments]) == 2
    printed = capsys.readouterr().err
    assert message in printed and printed.count("\n") == 1
