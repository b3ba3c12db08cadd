# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What units of a plan have searched counts in a live search as in the plan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsse_ros.base.result import Accepted
from dsse_ros.mission.live.evidence import SearchedArea
from dsse_ros.mission.live.inputs import INVERSE_CUBE, read
from dsse_ros.mission.live.places import Places
from dsse_ros.mission.live.planned_searches import PlannedSearches
from dsse_ros.planners.search_plan.plan_file import PlannedUnit
from dsse_ros.planners.search_plan.success import Success
from dsse_ros.planners.search_plan.timed_tracks import TimedTrack, TrackSearch
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.world.scenario.frames import flip_y
from dsse_ros.world.scenario.geodesy import geodetic_to_map
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_frame
from dsse_ros.world.sensors.lateral_range import LateralRange

KAYAK = Path(__file__).resolve().parents[3] / "config" / "kayak.yaml"


def test_a_unit_is_reported_once_when_it_is_done_and_counts_as_in_the_plan() -> None:
    stated = Scenario.from_yaml(KAYAK).override(particles=2000, timestep_limit=60)
    assert stated.incident is not None
    stated = stated.override(incident=replace(stated.incident, base=None))
    forecast = EnsembleForecast(stated, profile("flight"))
    scenario, frame = forecast.scenario, scenario_frame(forecast.scenario)
    points = np.array([(500.0, 1500.0), (3800, 2500), (3700, 2800), (400, 1800), (400.0, 2100.0)])
    way = TimedTrack(points, np.concatenate([[60.0], 60 + np.cumsum(
        np.hypot(*np.diff(points, axis=0).T)) / 20]))  # fmt: skip
    for lateral in (LateralRange(150.0, 0.8), LateralRange(sweep_width_m=250.0, speed_mps=20.0)):
        units = [
            PlannedUnit(name, way, TrackSearch(way, lateral)) for name in ("lifeboat", "drone0")
        ]
        searches = PlannedSearches(units, scenario)
        assert not searches.over(float(way.times_s[-1]) - 1.0)
        (fields,) = searches.over(float(way.times_s[-1]))
        assert not searches.over(1e9)
        accepted = read("searched", fields)
        assert isinstance(accepted, Accepted)
        values = accepted.value.values
        lons, lats = np.array(values["geometry"]["coordinates"]).T
        x, y, _ = geodetic_to_map(frame, lats, lons, 0.0)
        line = np.stack([x, y], axis=1)
        assert line[:, 1] == pytest.approx(flip_y(frame.extent.height, points[:, 1]), abs=0.01)
        area = SearchedArea(
            "a", (float(way.times_s[0]), float(way.times_s[-1])), [line], values.get("pod", 1.0),
            values["sweep_width"], values["law"] == INVERSE_CUBE,
        )  # fmt: skip
        reported, planned = (
            area.missed(Places(forecast)), Success(forecast).missed(units[0].search)[0]
        )  # fmt: skip
        assert 0.2 < planned.mean() < 0.9
        assert reported.mean() == pytest.approx(planned.mean(), abs=0.03)
        assert np.abs(reported - planned).mean() < 0.06
