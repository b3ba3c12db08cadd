# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A survival curve gives each particle a time of death, and searches a POS alive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from dsse_ros.search.step.looks import looks_of
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.scenario.survival import Survival

SEA = profile("sea")
CURVE = {"hours": [1.0, 1.2, 3.0], "alive": [0.9, 0.5, 0.2]}
FIELDS: dict[str, Any] = {
    "object": "PIW-1",
    "seen": {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 100},
    "search_start": "2026-01-17T14:00Z",
}


def scenario(**fields: Any) -> Scenario:
    return Scenario(incident={**FIELDS, **fields}, particles=2000, timestep_limit=30)


def test_people_die_by_the_curve() -> None:
    curve = Survival.read(CURVE)
    assert curve.at(np.array([0.0, 0.5, 1.1, 9.0])) == pytest.approx([1.0, 0.95, 0.7, 0.2])
    dies_h = curve.draw_s(100_000, np.random.default_rng(0)) / 3600
    for hours in (0.3, 1.0, 1.15, 2.0, 1e6):
        assert (dies_h > hours).mean() == pytest.approx(curve.at(np.array(hours)), abs=1e-4)
    assert (Survival((0.0,), (0.25,)).draw_s(8, np.random.default_rng(0)) > 0).sum() == 2


def test_a_curve_of_a_file_travels_without_it_and_changes_no_track(tmp_path: Path) -> None:
    (tmp_path / "alive.csv").write_text("hours, alive\n1, .9\n1.2, .5\n3, .2\n")
    stated = {**FIELDS, "survival": "alive.csv"}
    assert not Incident.may_be_sent(stated)
    incident = Incident.read(stated, str(tmp_path))
    sent = json.loads(json.dumps(incident.to_json()))
    assert Incident.may_be_sent(sent) and Incident.read(sent) == incident
    assert incident.survival == Survival.read(CURVE)
    assert "survival" not in Incident.read(FIELDS).to_json()
    mortal, immortal = (
        EnsembleForecast(scenario(**fields), SEA) for fields in ({"survival": CURVE}, {})
    )
    assert np.array_equal(mortal.cells, immortal.cells)


def test_pos_alive_counts_what_is_searched_while_people_are_alive() -> None:
    """A look everywhere, as often: each step finds the same share of those who are alive."""
    forecast = EnsembleForecast(scenario(survival=CURVE), SEA)
    of_pos, alive = forecast.of_pos, forecast.of_pos_alive
    assert alive is not None and np.array_equal(of_pos.weights, alive.weights)
    beliefs = of_pos.belief(), alive.belief()
    looks, wanted = looks_of(of_pos.scenario, SEA), 0.0
    grid, curve = of_pos.scenario.grid_size, Survival.read(CURVE)
    for step in range(20):
        hours = 1 + step * of_pos.scenario.step_duration_s / 3600
        before = beliefs[0].pos
        cells = np.unique(np.clip(of_pos.cells[step], 0, np.array(grid) - 1), axis=0)
        for belief in beliefs:
            if step % 5 == 4:
                belief.update(
                    [look for cell in cells for look in looks.done(0, 8, tuple(cell.tolist()))]
                )
        # The share found of all, of which the curve says how many are alive.
        wanted += (beliefs[0].pos - before) * float(curve.at(np.array(hours)))
        for belief in beliefs:
            belief.advance()
    assert 0.05 < beliefs[1].pos < beliefs[0].pos
    assert beliefs[1].pos == pytest.approx(wanted, abs=0.015)


def test_worlds_and_planners_know_the_pos_alive() -> None:
    resolved = scenario(survival={"hours": [0.9, 1.05], "alive": [1.0, 0.0]}).resolve(SEA)
    world = World(resolved, SEA, 1)
    beliefs = WorldBeliefs(world)
    for _ in range(3):
        beliefs.step(np.full(world.drones.shape, 8, np.int8))
    assert beliefs.pos_alive is not None and 0.0 <= beliefs.pos_alive[0] <= beliefs.pos[0]
    belief = beliefs.of_ensemble(0)
    assert belief is not None and belief.forecast.tracks.dies is not None
    weights, living = belief.of_missing().sum(axis=0), belief.of_living().of_missing().sum(axis=0)
    alive = belief.forecast.tracks.dies > 3
    # Two thirds are dead an hour after they were seen.
    assert 0.2 < weights[alive].sum() < 0.5
    assert living == pytest.approx(np.where(alive, weights, 0.0) / weights[alive].sum())
    planner_for(SearchDefinition(SEA, resolved), "belief", maximise="pos_alive")
    with pytest.raises(FieldError, match="maximise must be pos without a survival of the incident"):
        search = SearchDefinition(SEA, scenario().resolve(SEA))
        planner_for(search, "belief", maximise="pos_alive")
    assert WorldBeliefs(World(scenario().resolve(SEA), SEA, 1)).pos_alive is None


@pytest.mark.parametrize(
    "value",
    [
        3, "none.csv", {}, {"hours": [1], "alive": [2]}, {"hours": [1, 1], "alive": [1, 0.5]},
        {"hours": [1, 2], "alive": [0.5, 0.6]}, {"hours": [-1], "alive": [1]},
        {"hours": [1, 2], "alive": [1]}, {"hours": [], "alive": []}, "text.csv",
    ],
)  # fmt: skip
def test_other_curves_are_refused_in_a_line(value: Any, tmp_path: Path) -> None:
    (tmp_path / "text.csv").write_text("hours,alive\nsoon,few\n")
    with pytest.raises(FieldError, match=r"^incident.survival\S* must be [^\n]*$"):
        Incident.read({**FIELDS, "survival": value}, str(tmp_path))
