# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a coverage task: the same metrics and maps from a CSV and from a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bags import Bag
from flights import Log, environment, fly

from dsse_ros.results.report.bags import MissionBag
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.metrics import metrics
from dsse_ros.results.report.recomputed import forecast_for, views, with_coverage
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.results.report.texts import outcome

# ROS 2's own imports, on the first message that is converted.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


@pytest.mark.parametrize(("limit", "cells"), [(14, 9), (400, 4)])
def test_a_csv_and_a_bag_have_the_metrics_and_maps_of_the_mission(
    limit: int, cells: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(2)
    matrix = np.zeros((9, 9))
    matrix.ravel()[rng.choice(81, cells, replace=False)] = rng.random(cells)
    np.save(tmp_path / "matrix.npy", matrix)
    file = str(tmp_path / "matrix.npy")
    env = environment("coverage", probability_matrix=file, timestep_limit=limit)
    (flown,) = fly(env, Log(tmp_path / "mission.csv", env), searching=0.1)
    found = {
        name: float(coverage_metric[0])
        for name, coverage_metric in env.world.coverage_metrics().items()
    }
    topics = {"agents", "mission_report", "step_report"}
    fly(env, Bag(tmp_path / "mission.mcap", env, topics=topics), searching=0.1)
    (of_csv,) = read_csv(tmp_path / "mission.csv")
    (of_bag,) = MissionBag(tmp_path / "mission.mcap").missions
    assert of_csv.covers and of_csv.pos is not None
    np.testing.assert_array_equal(of_csv.pos, flown.pos)
    records: list[RecordedMission] = [of_csv, with_coverage(of_bag)]
    complete = found["coverage_rate"] == 1.0
    assert complete == (limit == 400)
    last = len(of_csv.steps) - 1
    for record in records:
        numbers = metrics(record)
        for name, value in found.items():
            assert numbers[name] == pytest.approx(value, rel=1e-12)
        assert numbers["drones_lost"] == 0 and numbers["share_found"] is None
        assert outcome(record).startswith("all covered after" if complete else "")
        assert complete or "% covered, out of time" in outcome(record)
        assert forecast_for(record, None) is None
        np.testing.assert_array_equal(views(record, [last])[last].probability, env.probability)
    first, second = map(metrics, records)
    assert first["searches"] == second["searches"]
