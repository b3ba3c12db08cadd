# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The example of a current that a script makes and that a scenario reads."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.world.drift.flow import Span, seconds
from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.shore import Box
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

pytest.importorskip("xarray")
pytest.importorskip("netCDF4")

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
SHIPPED = EXAMPLES / "santos_current.nc"
START_S = seconds("2026-01-17T12:00Z")
SPAN = Span(Box(-24.4, -23.7, -46.8, -45.9), START_S, START_S + 12 * 3600)


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / "santos_current.py"))


def test_the_file_is_small_and_is_what_the_script_makes(
    script: dict[str, Any], tmp_path: Path
) -> None:
    assert SHIPPED.stat().st_size < 100_000
    script["main"](str(tmp_path / "made.nc"))
    # Names of files are no part of a flow's equality.
    assert read_forecast("current", SHIPPED, SPAN) == read_forecast(
        "current", tmp_path / "made.nc", SPAN
    )


def test_its_current_is_a_tide_and_an_eddy(script: dict[str, Any]) -> None:
    flow = read_forecast("current", SHIPPED, SPAN)
    hours = (flow.times_s - START_S) / 3600
    wanted = script["current"](hours[:, None, None], flow.lats_deg[:, None], flow.lons_deg)
    for got, exact in zip((flow.east_mps, flow.north_mps), wanted, strict=True):
        np.testing.assert_allclose(got, exact, atol=6e-5)
    # Far from the eddy the tide turns within half of its period.
    corner = flow.east_mps[:, 0, 0]
    assert corner.max() > 0.2 and corner.min() < -0.2


@pytest.mark.slow
def test_a_scenario_drifts_by_it() -> None:
    kayak = Scenario.from_yaml(EXAMPLES.parent / "config" / "kayak.yaml").resolve(profile("sea"))
    eddy = Scenario.from_yaml(EXAMPLES / "kayak_in_eddy.yaml").resolve(profile("sea"))
    assert eddy.incident is not None and len(eddy.incident.current.times_s) > 1
    assert np.hypot(*np.subtract(eddy.vector, kayak.vector)) > 0.005
