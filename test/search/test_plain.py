# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Beliefs in cells and in metres are those of the plain search, look by look."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from looking import search_in_vain
from play import Draws, missions

from dsse_ros.search.belief.ensemble_belief import EnsembleBelief, PathsFlown
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.world import World
from dsse_ros.search.plain import (
    PlainBelief,
    PlainDrone,
    PlainMetresSearch,
    PlainParticles,
    PlainSearch,
    passes_of,
)
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.metres_kernels import path_of_action
from dsse_ros.search.step.metres_paths import AIRFRAMES, MOTION_STATES, Wind
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_and_rules

PODS = st.sampled_from([1.0, 0.6]) | st.floats(0.05, 1.0)


def plain_of(fields: dict[str, Any], pod: float) -> PlainSearch:
    return PlainSearch(
        fields["grid_size"], fields["drones_positions"], fields["person_initial_position"],
        fields["vector"], (fields["sigma_x"], fields["sigma_y"]), fields["timestep_limit"], 1, pod,
    )  # fmt: skip


@settings(deadline=None, max_examples=30)
@given(missions(max_grid=6, max_drones=3, max_persons=1), PODS, st.data())
def test_a_belief_after_searches_that_fail_is_that_of_the_plain_search(
    fields: dict[str, Any], pod: float, data: st.DataObject
) -> None:
    search = plain_of(fields, pod)
    plain = PlainBelief(search)
    fields = fields | {"probability_of_detection": pod, "rules": "paper"}
    belief = forecast_for(*scenario_and_rules(**fields)).belief()
    cells = st.tuples(*(st.integers(0, count - 1) for count in search.size))
    for _ in range(5):
        for col, row in data.draw(st.lists(cells, max_size=3)):
            # Where next to nothing is left, a belief begins anew.
            if 1.0 - pod * plain.poc[row, col] > 1e-6:
                plain.update((col, row), pod)
                search_in_vain(belief, [(col, row)])
        search.drift()
        plain.move(search.probability)
        belief.advance()
        np.testing.assert_allclose(belief.poc(), plain.poc, rtol=0, atol=1e-9)
        assert belief.pos == pytest.approx(plain.pos, abs=1e-9)


SEA = Scenario(
    incident={
        "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
        "wind": {"from": 270, "speed": 5.0},
        "seen": [{"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}],
    },
    particles=500, num_drones=2, timestep_limit=40, ensemble_seed=3, sensor="flown_over",
    probability_of_detection=0.7,
)  # fmt: skip


def test_a_belief_in_metres_is_that_of_the_plain_particles() -> None:
    world = World(SEA.override(person_pod_multipliers=(0.0,)), profile("flight"), 1)
    world.reset()
    metres = world.metres
    assert metres is not None
    forecast = forecast_for(SEA, profile("flight"))
    belief = forecast.belief()
    assert isinstance(belief, EnsembleBelief)
    places, reach = forecast.places(belief.examples), float(metres.detectors[0, 0]["reach"])
    plain, rng = PlainParticles(500), np.random.default_rng(1)
    # The drones begin where the particles are.
    east, south = places.positions[forecast.first_step].mean(axis=0)
    metres.states["east"], metres.states["south"] = east, south
    for step in range(39):
        metres.actions[:] = rng.uniform(-1, 1, (2, 2))
        world.step(np.full((1, 2), NO_ACTION, np.int8))
        paths = metres.paths[0].copy()
        belief.update_in_passing(
            PathsFlown(
                metres.detectors, world.looks.kind, paths, np.ones(2, bool), np.zeros(2, bool)
            )
        )
        row = forecast.row(forecast.first_step + step)
        before, after = places.positions[row], places.positions[row + 1]
        persons = np.array([before, after])
        for path in paths:
            plain.update(0.3 ** passes_of(path, persons, reach, looked_before=step > 0))
        weights = belief.particles()[1]
        np.testing.assert_allclose(weights, plain.weights, rtol=1e-6, atol=1e-12)
        assert belief.pos == pytest.approx(plain.pos, rel=1e-6)
        belief.advance()
    assert belief.pos > 0.05


AIRSPEEDS = st.floats(0.0, 20.0)


@given(
    st.tuples(AIRSPEEDS, AIRSPEEDS).map(sorted), AIRSPEEDS, st.sampled_from([0.0, 30.0, 90.0]),
    st.sampled_from([0.0, 0.5, 3.0]), st.floats(-4, 4), st.tuples(*[st.floats(-1, 1)] * 2),
    st.tuples(*[st.floats(-9, 9)] * 2),
)  # fmt: skip
def test_a_drone_in_metres_flies_as_the_plain_one(
    range_: list[float], speed: float, radius: float, acceleration: float, heading: float,
    action: tuple[float, float], wind: tuple[float, float],
) -> None:  # fmt: skip
    slowest, cruise = range_
    airframes = np.array([(cruise, slowest, radius, acceleration)], AIRFRAMES)
    states = np.array([(500.0, 700.0, heading, speed)], MOTION_STATES)
    path = np.zeros((5, 2))
    path_of_action(airframes, 0, Wind(*wind, 13.0), states, np.array(action), path)
    place = np.array([500.0, 700.0])
    drone = PlainDrone(place, heading, speed, cruise, slowest, radius, acceleration)
    np.testing.assert_allclose(drone.fly(action, wind, 13.0, 4), path, rtol=0, atol=1e-6)
    assert drone.speed == pytest.approx(states["speed"][0], abs=1e-6)
    turned = math.remainder(drone.heading - states["heading"][0], 2 * math.pi)
    # A drone that stands has no heading.
    assert abs(turned) < 1e-6 or drone.speed < 1e-6


@pytest.mark.parametrize(("kind", "wind"), [("drone", 0.0), ("fixed_wing", 4.0)])
def test_a_search_in_metres_is_the_plain_one_draw_for_draw(kind: str, wind: float) -> None:
    env = parallel_env(
        SEA.override(
            person_amount=3, searchers=(kind,), wind_speed=wind, wind_toward=30.0,
            probability_of_detection=0.2,
        ),
        rules="flight",
    )  # fmt: skip
    found = 0
    for seed in range(4):
        env.reset(seed=seed)
        world, metres = env.world, env.world.metres
        assert metres is not None and world.ensemble is not None
        truth = metres.arrays(world.ensemble).truth
        first = int(world.worlds["map_steps"][0])
        tracks = np.array([truth[n][first:] for n in world.ensemble.track[0]])
        # The drones begin where the persons are.
        metres.states["east"], metres.states["south"] = tracks[0, 0]
        airframe = metres.airframes[0]
        plain = PlainMetresSearch(
            [
                PlainDrone(
                    tracks[0, 0], float(state["heading"]), float(state["speed"]),
                    *map(float, airframe[["cruise", "slowest", "radius", "acceleration"]].item()),
                )
                for state in metres.states[0]
            ],
            tracks, (metres.wind.east, metres.wind.south), metres.wind.step_s,
            metres.paths.shape[2] - 1, world.grid_size.extent(world.scenario.cell_size),
            float(metres.detectors[0, 0]["reach"]), 0.2,
        )  # fmt: skip
        rng = np.random.default_rng(seed)
        while env.agents and plain.steps < world.scenario.timestep_limit:
            actions = {agent: rng.uniform(-1, 1, 2).astype(np.float32) for agent in env.agents}
            numbers = [int(agent.removeprefix("drone")) for agent in env.agents]
            assert numbers == [0, 1]
            paths = plain.step([tuple(map(float, a)) for a in actions.values()], Draws(env))
            env.step(actions)
            np.testing.assert_allclose(metres.paths[0], paths, rtol=0, atol=1e-5)
            assert set(np.flatnonzero(world.persons["found"][0])) == plain.found
        found += len(plain.found)
    assert found > 0
