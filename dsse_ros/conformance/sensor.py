# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The promises of a sensor, tested."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsse_ros.base.fields import FieldError
from dsse_ros.conformance.registered import registered
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import IDENTIFYING
from dsse_ros.search.step.looks import Looks, looks_of
from dsse_ros.world.scenario.scenario import scenario_and_rules
from dsse_ros.world.sensors.registry import SENSORS
from dsse_ros.world.sensors.sensor import Sensor

SIGMAS = 5.0
"""Largest error of a share of many draws, in standard deviations."""
WORLDS = 4000
STEPS = 12


def sensor_test(sensor: Sensor, *, rules: str = "v2", seed: int = 0, **fields: Any) -> None:
    """Test that a sensor's looks are valid, repeatable, and find persons with the stated PODs.

    Args:
        sensor: The sensor.
        rules: Name of the profile.
        seed: Seed of the simulated missions.
        fields: Fields of the scenario and the rules that replace those of the test.

    Raises:
        AssertionError: If the sensor breaks a promise.
    """
    assert sensor.doc, "doc: empty; what it sees, without a subject"
    with registered(SENSORS, sensor) as name:
        chosen: dict[str, Any] = {
            "grid_size": 11, "person_amount": 2, "person_pod_multipliers": [1.0, 0.5],
            "one_find_per_search": False, "timestep_limit": 4 * STEPS, "sensor": name,
            "drones_positions": [(5, 5)], **fields,
        }  # fmt: skip
        scenario, of_rules = scenario_and_rules(rules=rules, **chosen)
        resolved = scenario.resolve(of_rules)
        try:
            looks, again = looks_of(resolved, of_rules), looks_of(resolved, of_rules)
        except FieldError as error:
            raise AssertionError(str(error)) from None
        for look, other in zip(looks, again, strict=True):
            assert np.array_equal(look, other), "looks: those of the same scenario differ"
        assert looks.counts.any(), "looks: no action looks at anything"
        world = World(scenario, of_rules, WORLDS)
        world.seed(seed)
        world.reset()
        _play(world, looks, np.random.default_rng(seed))


def _play(world: World, looks: Looks, rng: np.random.Generator) -> None:
    """Simulate missions with random actions, and compare the outcomes with the looks' promises."""
    beliefs = WorldBeliefs(world)
    expected = variance = alarms = 0.0
    finds = alarmed = 0
    for _ in range(STEPS):
        actions = rng.integers(0, len(world.rules.action_set), (WORLDS, 1)).astype(np.int8)
        drone, persons = world.drones[:, 0], world.persons
        live = drone["alive"] & ~world.worlds["done"]
        before = persons[["x", "y", "found"]].copy()
        beliefs.before_step(actions)
        world.step(actions, maps=world.maps)
        beliefs.after_step()
        done = actions[:, 0] if world.faults is None else world.faults.applied[:, 0]
        kind = looks.kind[np.zeros(WORLDS, np.int64)]
        cells = np.column_stack([drone["x"], drone["y"]])
        who, row, cell = looks._replace(kind=kind).at(np.where(live, done, NO_ACTION), cells)
        for person in range(persons.shape[1]):
            was = before[who, person]
            there = (was["x"] == cell[:, 0]) & (was["y"] == cell[:, 1]) & ~was["found"]
            pods = looks.pods[row[there], person]
            expected, variance = expected + pods.sum(), variance + (pods * (1 - pods)).sum()
            found = live & persons["found"][:, person] & ~before["found"][:, person]
            seen = np.zeros(WORLDS, bool)
            seen[who[there]] = True
            assert not (found & ~seen).any(), "a person was found where no look was"
            finds += int(found.sum())
        if world.faults is not None:
            vain = live & ~drone["found"] & ~world.worlds["done"]
            rates = looks.false_alarms[0][np.where(vain, done, 0)] * (vain & (done != NO_ACTION))
            alarms += rates.sum()
            now = world.faults.conditions[:, 0]
            begun = now["until"] == world.worlds["t"] + world.scenario.false_alarm_steps
            alarmed += int((vain & begun & (now["status"] == IDENTIFYING)).sum())
    spread = SIGMAS * max(variance, 1.0) ** 0.5
    assert abs(finds - expected) <= spread, (
        f"pods: {finds} persons were found where {expected:.1f} +- {spread:.1f} were expected"
    )
    share, pos = persons["found"].mean(axis=1), beliefs.pos
    off, spread = float((share - pos).mean()), SIGMAS * float((share - pos).std()) / WORLDS**0.5
    assert abs(off) <= spread + ROUGH, (
        f"belief: POS is {pos.mean():.3f} on average, and {share.mean():.3f} were found"
    )
    spread = SIGMAS * max(alarms, 1.0) ** 0.5
    assert abs(alarmed - alarms) <= spread, (
        f"false_alarms: {alarmed} came where {alarms:.1f} +- {spread:.1f} were expected"
    )


ROUGH = 0.01
"""Largest error of POS with several persons after a find, see `search_outcomes`."""
