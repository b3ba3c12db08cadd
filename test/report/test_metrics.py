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

from dsse_ros.mission.mission import Mission
from dsse_ros.report.metrics import METRICS, curves, effort, metrics, work
from dsse_ros.report.record import read_csv
from dsse_ros.report.texts import outcome

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
    collisions, nearest, first_find, pos_sum, total = 0, math.inf, None, 0.0, 0.0
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
        if 0 < k <= last_step:
            pos_sum += (1 - float(drones[k - 1][0]["pos"])) * 13.0
    persons = [row for row in steps[-1] if row["agent"].startswith("person")]
    return {
        "pos": float(drones[-1][0]["pos"]),
        "expected_time_to_detection": pos_sum,
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
    plain = expected(steps, 81, env.scenario.timestep_limit)
    numbers = metrics(record)
    assert set(plain) | {"drones_lost", "duration"} == set(numbers) == {m.name for m in METRICS}
    for name, value in plain.items():
        assert numbers[name] == (None if value is None else pytest.approx(value, abs=1e-6)), name

    # The parts make the whole.
    count, done, of = effort(record), work(record), curves(record)
    assert count.sum() == done.searching.sum() == plain["searches"]
    assert (count > 0).sum() == of.cells_searched[-1]
    steps_flown = done.searching + done.moving + done.holding
    assert np.array_equal(steps_flown, record.acted.sum(axis=0))
    assert done.returns.sum() == pytest.approx(plain["episode_return"])
    for name in ("num_searches", "cells_searched", "path_length_m", "num_detections"):
        assert (np.diff(getattr(of, name)) >= 0).all()


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
    assert outcome(record) == "not found, no drone left"


def test_a_search_that_finds_nobody_has_no_time_to_detection(tmp_path: Path) -> None:
    env = environment(probability_of_detection=0.0, num_drones=1)
    fly(env, Log(tmp_path / "mission.csv", env), searching=1.0)
    (record,) = read_csv(tmp_path / "mission.csv")
    numbers = metrics(record)
    assert numbers["time_to_detection"] is None and numbers["separation"] is None
    assert numbers["expected_time_to_detection"] == numbers["duration"] == 14 * 13.0
    assert outcome(record) == "not found, out of time"
