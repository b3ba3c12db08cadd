# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sortie after another one is planned on what that has missed, where it has drifted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.search_plan.assignments import Choice, SearchUnit, assignment_of
from dsse_ros.planners.search_plan.next_sortie import missed_persons
from dsse_ros.planners.search_plan.plan_file import plan_text, read_plan
from dsse_ros.planners.search_plan.success import Success
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.sensors.lateral_range import LateralRange

KAYAK = Path(__file__).resolve().parents[3] / "config" / "kayak.yaml"
FLIGHT = profile("flight")
LATER_S = 3600.0


def test_two_sorties_find_what_one_search_of_both_would(tmp_path: Path) -> None:
    stated = Scenario.from_yaml(KAYAK).override(particles=3000, timestep_limit=420)
    assert stated.incident is not None
    incident = replace(stated.incident, base=None)
    whole = EnsembleForecast(stated.override(incident=incident), FLIGHT)
    laid = [
        assignment_of(
            SearchUnit("boat", 12.0, (2500.0, 2500.0), ready_s, ready_s + 1800.0, sees),
            Choice(2500.0, south, 75.0, False, 7, 250.0),
        )
        for ready_s, south, sees in (
            (0.0, 2400.0, LateralRange(0.0, 0.0, 300.0, 12.0)),
            (LATER_S, 1700.0, LateralRange(120.0, 0.8)),
        )
    ]
    first, second = laid
    assert first is not None
    assert second is not None
    both = Success(whole)
    missed = [both.missed(each.search) for each in (first, second)]
    file = tmp_path / "plan.json"
    file.write_text(plan_text(whole.scenario, [first]))
    started = replace(incident, search_start_s=incident.search_start_s + LATER_S)
    later = stated.override(incident=started, timestep_limit=140).resolve(FLIGHT)
    (earlier,) = read_plan(file, later)
    again = missed_persons(later, FLIGHT, [earlier.search])
    assert again.pos == pytest.approx(both.pos(missed[:1]), abs=0.025)
    assert 0.1 < again.pos < 0.8
    # The second one in the grid of the later search.
    file.write_text(plan_text(whole.scenario, [second]))
    (unit,) = read_plan(file, later)
    for forecast in (again.forecast, again.forecast.of_pos, again.planned):
        success = Success(forecast)
        pos = success.pos([success.missed(unit.search)])
        assert pos > 0.1
        assert 1 - (1 - again.pos) * (1 - pos) == pytest.approx(both.pos(missed), abs=0.025)
    with pytest.raises(FieldError, match="begins must be at least .*, the end of the earlier"):
        missed_persons(later, FLIGHT, [unit.search])
