# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The record of a mission whose persons follow an ensemble says what its belief did."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flights import Log, environment, fly

from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import follow_belief, forecast_for, views
from dsse_ros.search.environments.parallel_env import SearchEnv


@pytest.mark.parametrize("rules", ["paper", "v2"])
def test_a_belief_that_follows_the_csv_has_the_pos_of_the_mission(
    rules: str, tmp_path: Path
) -> None:
    usual = environment(rules, person_amount=2, particles=2000, vector=(0.4, 0.3))
    env = SearchEnv(usual.scenario.stated, usual.rules.override(person_motion="constant_drift"))
    (flown,) = fly(env, Log(tmp_path / "mission.csv", env), seeds=(2,))
    (record,) = read_csv(tmp_path / "mission.csv")
    forecast = forecast_for(record, None)
    assert forecast is not None
    assert forecast_for(record, forecast) is forecast
    pos, beliefs = follow_belief(record, forecast, wanted=(0, 3))
    assert pos == pytest.approx(flown.pos, abs=1e-6)
    assert 0.0 < pos[-1] < 1.0 and beliefs[3].shape == (9, 9)
    assert record.persons is not None
    shown = views(record, [0, 3])
    assert np.array_equal(shown[3].persons, record.persons[3])
    assert shown[3].circle is None
