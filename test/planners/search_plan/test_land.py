# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of units that float do not cross land."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsse_ros.planners.search_plan import optimiser
from dsse_ros.planners.search_plan.assignments import SearchUnit
from dsse_ros.planners.search_plan.land import Land
from dsse_ros.planners.search_plan.optimiser import best_plan
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.world.scenario.frames import flip_y
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_frame
from dsse_ros.world.sensors.lateral_range import LateralRange

EAST_M = 2200.0
KAYAK = Path(__file__).resolve().parents[3] / "config" / "kayak.yaml"


def test_the_land_is_where_the_shore_is() -> None:
    scenario = Scenario.from_yaml(KAYAK).resolve(profile("flight"))
    frame, land = scenario_frame(scenario), Land(scenario)
    assert scenario.incident is not None
    assert scenario.incident.land is not None
    points = np.random.default_rng(0).uniform(0.0, frame.extent.width, (500, 2))
    lats, lons, _ = map_to_geodetic(
        frame, points[:, 0], flip_y(frame.extent.height, points[:, 1]), 0.0
    )
    on_land = scenario.incident.land.prepared()(lats, lons)
    shares = np.array([land.share_of(np.stack([point, point])) for point in points])
    assert 0.02 < on_land.mean() < 0.98
    assert (shares != on_land).mean() < 0.02


class EastIsLand(Land):
    """Land east of `EAST_M`."""

    def share_of(self, track: NDArray[np.float64]) -> float:
        return float((track[:, 0] > EAST_M).mean())


def test_a_unit_that_floats_keeps_off_the_land(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(optimiser, "DIVISION_GENERATIONS", 6)
    monkeypatch.setattr(optimiser, "MOVE_GENERATIONS", 2)
    monkeypatch.setattr(optimiser, "Land", EastIsLand)
    stated = Scenario.from_yaml(KAYAK).override(particles=500, timestep_limit=100)
    forecast = EnsembleForecast(stated, profile("flight"))
    until_s = 100 * forecast.scenario.step_duration_s
    sees = LateralRange(sweep_width_m=300.0, speed_mps=12.0)
    east = []
    for afloat in (True, False):
        unit = SearchUnit("boat", 12.0, (2000.0, 2000.0), 0.0, until_s, sees, afloat=afloat)
        (laid,) = best_plan([unit], forecast, seed=1)
        east.append(float(laid.track[:, 0].max()))
    assert east[0] <= EAST_M < east[1]
