# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The metrics are what a few plain loops over the rows of the CSV give."""

from __future__ import annotations

import csv
import math
from collections import Counter
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flights import Log, environment, fly
from hypothesis import given
from hypothesis import strategies as st
from looking import search_in_vain

from dsse_ros.mission.run.mission import Mission
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.metrics import METRICS, curves, effort, metrics, work
from dsse_ros.results.report.texts import outcome, summary
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES

OF_OTHERS = {"drones_lost", "duration", "poc_outside", "pos_alive", "stranded"}
"""Metrics that other tests check."""
Rows = list[list[dict[str, str]]]


def steps_of(path: Path) -> Rows:
    """Return the rows of each step of a log with one mission."""
    by_step: dict[str, list[dict[str, str]]] = {}
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            by_step.setdefault(row["step"], []).append(row)
    return list(by_step.values())


def expected(steps: Rows, cells_of_area: int, last_step: int) -> dict[str, Any]:
    """Return the metrics by plain loops; steps after `last_step` come too late to be done."""
    drones = [[row for row in rows if row["agent"].startswith("drone")] for rows in steps]
    count = len(drones[0])
    alive, lengths = [True] * count, [0.0] * count
    searched: list[tuple[str, str]] = []
    collisions, nearest, first_find, total = 0, math.inf, None, 0.0
    # The mean time until detection, as if the search ended with the first find, or with the record.
    waited_s, missed, step = 0.0, 1.0, 0
    for k, rows in enumerate(drones):
        places = [(float(row["east_m"]), float(row["north_m"])) for row in rows]
        flying = [i for i in range(count) if alive[i]]
        for i, row in enumerate(rows):
            total += float(row["reward"])
            if k:
                lengths[i] += math.dist(
                    *((float(r["east_m"]), float(r["north_m"])) for r in (row, drones[k - 1][i]))
                )
            if k and alive[i] and int(row["step"]) <= last_step and row["action"] == "search":
                searched.append((row["col"], row["row"]))
            if row["found"] == "1" and first_find is None:
                first_find = float(row["time_s"])
        for i, j in combinations(flying, 2):
            away = math.dist(places[i], places[j])
            nearest = min(nearest, away)
            collisions += away == 0 and k > 0
        for i, row in enumerate(rows):
            alive[i] = alive[i] and row["terminated"] == "0" and row["truncated"] == "0"
        if flying and 0 < k <= last_step and step == k - 1 and first_find in (None, k * 13.0):
            waited_s, step = waited_s + missed * 13.0, k
            missed = 1 - float(rows[0]["pos"])
    left_s = (last_step - step) * missed * 13.0
    persons = [row for row in steps[-1] if row["agent"].startswith("person")]
    return {
        "pos": float(drones[-1][0]["pos"]),
        "expected_time_at_least": waited_s + left_s * (first_find is None),
        "expected_time_at_most": waited_s + left_s,
        "time_to_detection": first_find,
        "share_found": sum(row["found"] == "1" for row in persons) / len(persons),
        "coverage": len(set(searched)) / cells_of_area,
        # Of another task.
        "coverage_rate": None,
        "repeated_coverage": None,
        "coverage_factor": len(searched) / cells_of_area,
        "redundancy": 1 - len(set(searched)) / len(searched) if searched else None,
        "searches": len(searched),
        "path_length": sum(lengths),
        "longest_path": max(lengths),
        "collisions": collisions,
        "separation": None if nearest == math.inf else nearest,
        "episode_return": total,
    }


@pytest.mark.slow
@given(
    st.integers(0, 2**32),
    st.sampled_from(["paper", "v2"]),
    st.integers(1, 5),
    st.integers(1, 3),
    st.sampled_from([0.0, 0.3, 0.8, 1.0]),
)
def test_metrics_equal_those_of_plain_loops(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    rules: str,
    drones: int,
    persons: int,
    searching: float,
) -> None:
    path = tmp_path_factory.mktemp("flown") / "mission.csv"
    env = environment(rules, num_drones=drones, person_amount=persons)
    fly(env, Log(path, env), seeds=(seed,), searching=searching)
    (record,) = read_csv(path)
    steps = steps_of(path)
    plain, numbers = expected(steps, 81, env.scenario.timestep_limit), metrics(record)
    assert set(plain) | OF_OTHERS == set(numbers) == {m.name for m in METRICS}
    for name, value in plain.items():
        close = None if value is None else pytest.approx(value, abs=1e-6)
        assert numbers[name] == close, name

    # The parts make the whole.
    count, done, grown = effort(record), work(record), curves(record)
    assert count.sum() == done.searching.sum() == plain["searches"]
    assert (count > 0).sum() == grown.cells_searched[-1]
    steps_flown = done.searching + done.moving + done.holding
    assert np.array_equal(steps_flown, record.acted.sum(axis=0))
    assert done.returns.sum() == pytest.approx(plain["episode_return"])
    for name in ("num_searches", "cells_searched", "path_length_m", "num_detections"):
        assert (np.diff(getattr(grown, name)) >= 0).all()


@pytest.mark.slow
def test_the_expected_time_is_that_of_the_plan_whenever_luck_has_it_that_somebody_is_found(
    tmp_path: Path,
) -> None:
    fields: dict[str, Any] = {
        "probability_of_detection": 0.1, "timestep_limit": 30, "vector": (0.1, 0.1),
        "drones_positions": [(4, 4), (4, 3), (5, 5)],
    }  # fmt: skip
    env = environment("v2", **fields)
    draw = np.random.default_rng(0)
    search = env.rules.action_set.search
    plan = draw.integers(0, 8, (31, 3))
    plan[draw.random(plan.shape) < 0.8] = search
    # What the searches of the whole plan come to, with nobody found.
    belief = Belief(Forecast(env.scenario, env.rules, drift_samples=DRIFT_SAMPLES))
    blind = environment("v2", **{**fields, "probability_of_detection": 0.0})
    blind.reset(seed=0)
    exact_s = 0.0
    for joint in plan[:30]:
        exact_s += (1.0 - belief.pos) * 13.0
        cells = [tuple(cell) for cell in blind.positions.tolist()]
        searched = np.flatnonzero(joint == search)
        search_in_vain(belief, [cells[i] for i in searched])
        belief.advance()
        blind.advance(joint.astype(np.int8))
    mission, times_s, bounds = Mission(env, 0), [], []
    for seed in range(150):
        log = Log(tmp_path / "mission.csv", env)
        mission.reset(seed)
        while True:
            log.write(mission)
            if mission.done:
                break
            mission.command_all(plan[mission.result.step].tolist())
            mission.advance("hold")
        log.close()
        (record,) = read_csv(tmp_path / "mission.csv")
        numbers = metrics(record)
        low, high = numbers["expected_time_at_least"], numbers["expected_time_at_most"]
        assert low is not None and high is not None
        assert low - 1e-6 <= exact_s <= high + 1e-6
        bounds.append((low, high))
        time_s = numbers["time_to_detection"]
        times_s.append(390.0 if time_s is None else time_s)
        if time_s is None:
            assert low == pytest.approx(exact_s) == high
    found = np.array(times_s) < 390.0
    assert 20 < found.sum() < 130
    # The mean of what luck made of it is what was to be expected.
    assert np.mean(times_s) == pytest.approx(exact_s, abs=4 * np.std(times_s) / len(times_s) ** 0.5)
    # The sooner somebody was found, the less is known of the plan.
    widths = np.diff(bounds, axis=1).ravel()[np.argsort(times_s, kind="stable")]
    assert (np.diff(widths) <= 1e-6).all() and widths[0] > 50.0


def test_effort_says_which_cell_was_searched_how_often(tmp_path: Path) -> None:
    env = environment(probability_of_detection=0.0)
    fly(env, Log(tmp_path / "mission.csv", env))
    (record,) = read_csv(tmp_path / "mission.csv")
    searched = Counter(
        (row["row"], row["col"])
        for rows in steps_of(tmp_path / "mission.csv")[1:15]
        for row in rows
        if row["action"] == "search"
    )
    count = effort(record)
    assert {(str(row), str(col)): count[row, col] for row, col in np.argwhere(count)} == searched


def test_a_collision_loses_both_and_is_one_pair(tmp_path: Path) -> None:
    env = environment(num_drones=2, drones_positions=[(3, 3), (5, 3)])
    mission, log = Mission(env, 1), Log(tmp_path / "mission.csv", env)
    log.write(mission)
    mission.command_all([env.rules.actions.index("right"), env.rules.actions.index("left")])
    mission.advance("hold")
    log.write(mission)
    log.close()
    (record,) = read_csv(tmp_path / "mission.csv")
    numbers = metrics(record)
    assert (numbers["collisions"], numbers["drones_lost"], numbers["separation"]) == (1, 2, 0)
    assert work(record).lost_at.tolist() == [1, 1]
    collided = "no drone left: drone0 and drone1 collided in cell (4, 3) (rule collisions)"
    assert outcome(record) == f"not found, {collided}" and collided in summary(record)


def test_a_search_that_finds_nobody_has_no_time_to_detection(tmp_path: Path) -> None:
    env = environment(probability_of_detection=0.0, num_drones=1)
    fly(env, Log(tmp_path / "mission.csv", env), searching=1.0)
    (record,) = read_csv(tmp_path / "mission.csv")
    numbers = metrics(record)
    assert numbers["time_to_detection"] is None and numbers["separation"] is None
    assert numbers["expected_time_at_least"] == numbers["expected_time_at_most"] == 14 * 13.0
    assert numbers["duration"] == 14 * 13.0
    assert outcome(record) == "not found, out of time"
