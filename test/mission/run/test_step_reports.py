# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The reports of a mission, and what they and the search have in common."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dsse_ros.mission.run.mission import HISTORY_DTYPE
from dsse_ros.mission.run.step_reports import mission_report_of
from dsse_ros.search.environments.coverage_task import METRICS
from dsse_ros.search.step.fault_kernels import STATUSES
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from msg_adapters.step_report import COVERAGE_FIELDS, MAX_STATUS

FRAME = GridFrame(8, 130.0, -24.04, -46.17, 0.0, 120.0)
SHAPES = st.tuples(st.integers(1, 5), st.integers(1, 4))
HISTORIES = SHAPES.flatmap(lambda shape: hnp.arrays(HISTORY_DTYPE, shape))


@pytest.mark.slow
@given(HISTORIES, st.integers(1, 2**32 - 1), st.integers(1, 2**32 - 1))
def test_a_mission_report_has_all_that_it_was_made_of(history, run_id, mission):
    report = mission_report_of(SimpleNamespace(number=mission, history=history), FRAME, run_id)
    for name in HISTORY_DTYPE.names:
        assert report[name].tobytes() == history[name].tobytes()
    assert (report["run_id"] == run_id).all() and (report["mission"] == mission).all()
    assert report["step"].T.tolist() == [list(range(len(history)))] * history.shape[1]
    x_m, y_m = cell_to_map(FRAME, history["col"].astype(int), history["row"].astype(int))
    assert np.array_equal(report["x"], np.float32(x_m))
    assert np.array_equal(report["y"], np.float32(y_m)) and (report["z"] == 120.0).all()


def test_a_report_has_the_metrics_and_the_statuses_of_the_search():
    assert tuple(name for name, _ in COVERAGE_FIELDS) == METRICS
    assert len(STATUSES) - 1 == MAX_STATUS
