# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The detector of examples/ sees as often, as far and as exactly as it states."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_frame
from dsse_ros.world.scenario.sea_state import sea_state

ROOT = Path(__file__).resolve().parents[3]
DRONE = np.array([500.0, 700.0])


@pytest.fixture(scope="module")
def detector() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "examples" / "detector.py"))


@pytest.mark.parametrize("away_m", [0.0, 149.0, 151.0])
def test_a_person_in_range_is_reported_at_the_rate_and_one_beyond_it_never(
    detector: dict[str, Any], away_m: float
) -> None:
    camera = detector["Camera"](false_alarm_rate=0.0)
    person, rng = DRONE + [away_m, 0.0], np.random.default_rng(1)
    reports = [
        report for _ in range(1000) for report in detector["look"](camera, DRONE, person, 13, rng)
    ]
    expected = 1000 * 13 * camera.rate if away_m <= camera.range_m else 0.0
    # Five standard deviations of a Poisson count.
    assert abs(len(reports) - expected) <= 5 * np.sqrt(expected)
    if reports:
        errors = np.array(reports) - person
        assert errors.std(axis=0) == pytest.approx(camera.error_m, rel=0.15)


def test_false_alarms_come_at_their_rate_anywhere_in_range(detector: dict[str, Any]) -> None:
    camera = detector["Camera"](false_alarm_rate=0.01)
    far, rng = DRONE + [1e4, 0.0], np.random.default_rng(2)
    places = np.array(
        [p for _ in range(5000) for p in detector["look"](camera, DRONE, far, 10, rng)]
    )
    assert abs(len(places) - 500) <= 5 * np.sqrt(500)
    away_m = np.hypot(*(places - DRONE).T)
    assert away_m.max() <= camera.range_m
    # Uniform over the disc: half of them in the inner disc of half its area.
    assert np.mean(away_m < camera.range_m / np.sqrt(2)) == pytest.approx(0.5, abs=0.12)


@pytest.mark.slow
def test_the_hidden_person_begins_where_it_was_seen_and_each_seed_hides_another(
    detector: dict[str, Any],
) -> None:
    rules = profile("sea")
    scenario = Scenario.read(str(ROOT / "config" / "kayak.yaml")).override(
        num_drones=1, particles=100
    )
    resolved = scenario.resolve(rules)
    frame = scenario_frame(resolved)
    info = AgentsInfo(
        ("drone0",), rules.actions, "sea", 0, frame, 180, resolved.step_duration_s, 1, 7,
        SearchDefinition(rules, resolved),
    )  # fmt: skip
    track, again, other = (detector["hidden_track"](info, seed) for seed in (1, 1, 2))
    assert track.shape == (181, 2) and np.isfinite(track).all()
    np.testing.assert_array_equal(track, again)
    assert np.hypot(*(track - other).T).min() > 1.0
    # A kayak has drifted less than 4 km in the hour since it was seen.
    seen = [(lkp.x_m, lkp.y_m) for lkp in sea_state(resolved, 0).sightings]
    assert min(np.hypot(*(track[0] - place)) for place in seen) < 4000


def test_without_an_incident_the_user_states_where_the_person_is(detector: dict[str, Any]) -> None:
    scenario = Scenario(num_drones=1, grid_size=5)
    rules = profile("paper")
    resolved = scenario.resolve(rules)
    info = AgentsInfo(
        ("drone0",), rules.actions, "paper", 0, scenario_frame(resolved), 10, 13.0, 1, 7,
        SearchDefinition(rules, resolved),
    )  # fmt: skip
    with pytest.raises(ValueError, match="state where the person is"):
        detector["hidden_track"](info, 0)
