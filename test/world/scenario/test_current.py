# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A current in m/s is m/s on the water under every profile, and reads back as what moves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.rules import PROFILES, Rules, profile
from dsse_ros.world.scenario.scenario import SPECS, ResolvedScenario, Scenario, scenario_and_rules

SANTOS = Path(__file__).resolve().parents[3] / "config" / "santos.yaml"
GRID, STEPS = 401, 4000
FINDING = [name for name, rules in PROFILES.items() if not rules.covers]
VARIANTS: dict[str, Rules] = {
    **{name: profile(name) for name in FINDING},
    "v1, by speed": profile("v1", drift_by_speed=True),
    "v2, kept": profile("v2", drift_remainder="kept"),
    "paper, dropped": profile("paper", drift_remainder="dropped"),
    "coverage, to find": profile("coverage", task="find"),
}
variants = pytest.mark.parametrize("name", VARIANTS)


def moved(scenario: Scenario, rules: Rules, steps: int = STEPS) -> tuple[float, float]:
    """Return how fast the datum moves to the east and to the south on average, in m/s."""
    middle = (GRID // 2, GRID // 2)
    # The datum moves on when the time of the drones is over, and among however few particles.
    far = scenario.override(
        grid_size=GRID, person_initial_position=middle, drones_positions=[(0, 0)],
        timestep_limit=1, particles=1,
    )  # fmt: skip
    world = World(far, rules, 1, write_maps=False)
    world.reset()
    where, hold = [], np.full((1, 1), -1, np.int8)
    for _ in range(steps):
        world.step(hold)
        where.append((int(world.worlds["datum_x"][0]), int(world.worlds["datum_y"][0])))
    assert all(0 < cell < GRID - 1 for cell in where[-1])
    # From one cell to another, so that no part of a cell is left over.
    speeds = []
    for axis in range(2):
        line = np.array([cell[axis] for cell in where])
        at = np.flatnonzero(np.diff(line))
        cells = line[at[-1] + 1] - line[at[0] + 1] if len(at) > 1 else 0
        steps_between = max(at[-1] - at[0], 1) if len(at) > 1 else 1
        speeds.append(cells / steps_between * world.scenario.drone_speed)
    return speeds[0], speeds[1]


def read_back(scenario: ResolvedScenario) -> tuple[float, float]:
    """Return the current of a scenario to the east and to the south, in m/s."""
    ways = scenario.other_ways
    toward = math.radians(ways["current_toward"])
    return ways["current_speed"] * math.sin(toward), -ways["current_speed"] * math.cos(toward)


@variants
def test_the_current_off_santos_is_a_quarter_of_a_metre_per_second(name: str) -> None:
    rules = VARIANTS[name]
    scenario = Scenario.from_yaml(SANTOS)
    east, south = moved(scenario, rules)
    # v1 drops remainders, so that a cell takes whole steps.
    near = 0.01 if rules.drift_remainder == "dropped" else 0.003
    toward = math.radians(235)
    assert east == pytest.approx(0.25 * math.sin(toward), rel=near)
    assert south == pytest.approx(-0.25 * math.cos(toward), rel=near)
    assert read_back(scenario.resolve(rules)) == pytest.approx((east, south), rel=3e-3)


@pytest.mark.slow
@variants
@settings(deadline=None, max_examples=30)
@given(
    speed=st.floats(0.05, 2), toward=st.floats(0, 360), drone_speed=st.floats(5, 40),
    cell=st.floats(10, 500),
)  # fmt: skip
def test_the_datum_moves_as_fast_as_the_current_that_is_read_back(
    name: str, speed: float, toward: float, drone_speed: float, cell: float
) -> None:
    stated = Scenario(
        current_speed=speed, current_toward=toward, drone_speed=drone_speed, cell_size=cell
    )
    assume(speed < 0.18 * drone_speed)
    rules = VARIANTS[name]
    wanted = read_back(stated.resolve(rules))
    exact = (speed * math.sin(math.radians(toward)), -speed * math.cos(math.radians(toward)))
    off = 0.1 if rules.drift_remainder == "dropped" else 1e-9
    assert math.dist(wanted, exact) <= off * speed
    # In as many steps as the grid leaves.
    steps = int(min(STEPS, 0.9 * (GRID // 2) * drone_speed / speed))
    east, south = moved(stated, rules, steps)
    least = drone_speed / steps
    for there, expected in zip((east, south), wanted, strict=True):
        if abs(expected) > 4 * least:
            assert there == pytest.approx(expected, rel=0.02, abs=2 * least**2 / abs(expected))


@pytest.mark.slow
@variants
@settings(deadline=None)
@given(vector=st.tuples(st.floats(-3, 3), st.floats(-3, 3)), drone_speed=st.floats(1, 50))
@example(vector=(0.0, 1.969126477451787e-159), drone_speed=1.0)
def test_what_is_read_back_states_the_same_search_again(
    name: str, vector: tuple[float, float], drone_speed: float
) -> None:
    rules = VARIANTS[name]
    scenario = Scenario(vector=vector, drone_speed=drone_speed).resolve(rules)
    assume(scenario.other_ways["current_speed"] <= SPECS["current_speed"].high)
    ways = {way: scenario.other_ways[way] for way in ("current_speed", "current_toward")}
    both = Scenario(vector=vector, drone_speed=drone_speed, **ways).resolve(rules)
    assert both == scenario


@pytest.mark.parametrize("name", FINDING)
def test_a_vector_means_what_it_did(name: str) -> None:
    rules = profile(name)
    scenario, _ = scenario_and_rules(rules=rules, vector=(0.3, -0.4))
    assert scenario.resolve(rules).vector == (0.3, -0.4)
    world = World(scenario, rules, 1)
    world.reset()
    # norm .5 and 10 m/s: a twentieth.
    factor = 0.05 if rules.drift_by_speed else 1.0
    drift = (world.worlds["drift_x"][0], world.worlds["drift_y"][0])
    assert drift == pytest.approx((0.3 * factor, -0.4 * factor))


@pytest.mark.parametrize(
    ("rules", "fields", "reason"),
    [
        ("v2", {"current_speed": 12.0}, "by at most a cell per step"),
        ("v1", {"current_speed": 7.0}, "the nearest is 5 m/s"),
    ],
)
def test_a_current_that_the_rules_cannot_drift_by_is_refused_on_one_line(
    rules: str, fields: dict[str, Any], reason: str
) -> None:
    with pytest.raises(FieldError, match="^current_speed must be .* rules .* got ") as caught:
        Scenario(**fields, current_toward=90.0).resolve(profile(rules))
    assert reason in str(caught.value) and len(str(caught.value).splitlines()) == 1


@pytest.mark.slow
def test_persons_with_a_drift_of_their_own_are_carried_by_a_current_in_metres_per_second() -> None:
    rules = profile("v2", time_out_grace=1000)
    scenario = Scenario.from_yaml(SANTOS).override(
        grid_size=101, person_initial_position=(50, 50), drones_positions=[(0, 0)]
    )
    world = World(scenario, rules, 200, write_maps=False)
    world.seed(1)
    world.reset()
    hold, steps = np.full((200, 1), -1, np.int8), 1000
    for _ in range(steps):
        world.step(hold)
    toward = math.radians(235)
    way = np.array([math.sin(toward), -math.cos(toward)])
    persons, speed = world.persons, world.scenario.drone_speed
    own = np.array([persons[f"drift_{axis}"].mean() for axis in "xy"]) @ way * speed
    carried = np.array([persons[axis].mean() - 50 for axis in "xy"]) @ way / steps * speed
    # By the published law each has another drift, and steps along both axes when one is due.
    assert own == pytest.approx(0.25, rel=0.3)
    assert carried == pytest.approx(0.25, rel=0.3)
