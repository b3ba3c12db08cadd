# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A plan is read as it was written, its drones fly it, and beliefs know what its units search."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros import parallel_env, planner_for
from dsse_ros.base.fields import FieldError
from dsse_ros.planners.search_plan.assignments import (
    Assignment,
    Choice,
    SearchUnit,
    assignment_of,
)
from dsse_ros.planners.search_plan.plan_file import plan_text, read_plan
from dsse_ros.planners.search_plan.success import Success
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast, PathsFlown
from dsse_ros.search.step.cell_tracks import Draw
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import ResolvedScenario, Scenario, scenario_frame
from dsse_ros.world.sensors.lateral_range import LateralRange

KAYAK = Path(__file__).resolve().parents[3] / "config" / "kayak.yaml"
FLIGHT = profile("flight")
STEPS = 40


def kayak(**fields: Any) -> ResolvedScenario:
    """Return a short search with two drones."""
    stated = {"particles": 1000, "timestep_limit": STEPS, "num_drones": 2, **fields}
    return Scenario.from_yaml(KAYAK).override(**stated).resolve(FLIGHT)


@pytest.fixture(scope="module")
def plan() -> list[Assignment]:
    """A drone of the search and a boat."""
    drone = SearchUnit("drone0", 10.0, (3800.0, 100.0), 20.0, 900.0, LateralRange(65.0, 1.0))
    boat = SearchUnit("boat", 8.0, (1000.0, 2000.0), 0.0, 400.0, LateralRange(150.0, 0.8))
    laid = [
        assignment_of(drone, Choice(3000.0, 1200.0, 30.0, False, 4, 120.0)),
        assignment_of(boat, Choice(1900.0, 2300.0, 75.0, True, 3, 200.0)),
    ]
    return [each for each in laid if each is not None]


@pytest.fixture
def file(plan: list[Assignment], tmp_path: Path) -> Path:
    path = tmp_path / "plan of: two.json"
    path.write_text(plan_text(kayak(), plan))
    return path


def test_a_plan_is_read_as_it_was_written_on_any_grid(plan: list[Assignment], file: Path) -> None:
    fine = kayak(cell_size=65.0)
    corner, fine_corner = (scenario_frame(each) for each in (kayak(), fine))
    assert corner.origin != fine_corner.origin
    for unit, each in zip(read_plan(file, kayak()), plan, strict=True):
        assert unit.name == each.unit.name
        assert unit.search.lateral == each.unit.lateral
        for read, written in ((unit.way, each.timed_way), (unit.search.track, each.search.track)):
            assert read.points == pytest.approx(written.points, abs=1e-3)
            assert read.times_s == pytest.approx(written.times_s, abs=1e-6)
    there = read_plan(file, fine)[0].way
    legs = [np.hypot(*np.diff(way.points, axis=0).T) for way in (there, plan[0].timed_way)]
    assert legs[0] == pytest.approx(legs[1], rel=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"search_plan": 2}, "content must be a search plan"),
        ({"begins": "now"}, "begins must be a time"),
        ({"units": []}, "units must be a list of units, got"),
        ({"units": [{"name": "a"}]}, "units[0].sees must have reach_m, pod"),
    ],
)
def test_a_file_that_is_no_plan_is_refused_in_a_line(
    change: dict[str, Any], message: str, file: Path
) -> None:
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    with pytest.raises(FieldError) as refused:
        planner_for(parallel_env(kayak(), rules=FLIGHT), "belief", plan=str(file))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    with pytest.raises(FieldError, match="plan must be given with rules in metres"):
        planner_for(parallel_env(grid_size=8), "belief", plan=str(file))


def test_drones_fly_their_units_and_the_belief_counts_all(
    plan: list[Assignment], file: Path
) -> None:
    env = parallel_env(kayak(person_pod_multipliers=(0.0,)), rules=FLIGHT)
    assumed = parallel_env(kayak(), rules=FLIGHT)
    options: dict[str, Any] = {"samples": 200, "horizon": 5, "width": 4}
    planner: Any = planner_for(assumed, "belief", plan=str(file), **options)
    forecast = EnsembleForecast(assumed.scenario, FLIGHT, draw=Draw.PLANNING)
    belief, metres = forecast.belief(), env.world.metres
    assert metres is not None
    observations, infos = env.reset(seed=1)
    step_s, everybody = forecast.scenario.step_duration_s, np.ones(2, np.bool_)
    away = []
    for step in range(STEPS - 1):
        for info in infos.values():
            info["step"] = step
        actions = planner(observations, infos)
        observations, *_, infos = env.step(actions)
        unit = plan[0].timed_way.places_at(np.array((step + 1) * step_s))
        away.append(np.hypot(*(metres.paths[0, 0, -1] - unit)))
        belief.update_in_passing(
            PathsFlown(
                metres.detectors, env.world.looks.kind, metres.paths[0].copy(), everybody,
                ~everybody,
            )
        )  # fmt: skip
        belief.advance()
    # It starts a little off its base, and later than the plan.
    assert max(away[10:]) < 0.01
    for info in infos.values():
        info["step"] = STEPS - 1
    planner(observations, infos)
    missed = Success(forecast).missed(plan[1].search)
    assert 0.1 < missed.mean() < 0.95
    expected = belief.density * missed / (belief.density * missed).sum()
    assert planner.belief.density == pytest.approx(expected, rel=1e-4, abs=1e-12)
