# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The latest messages of several searches are kept, and no more than those."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.world.scenario.agents import AgentsInfo, agents_json
from dsse_ros.world.scenario.agents_inbox import AgentsInbox, Latest
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.step_report import step_report_dtype

INFO = AgentsInfo(
    agents=("drone0",),
    actions=("left", "search"),
    rules="paper",
    seed=1,
    frame=GridFrame(8, 130.0, -24.0, -46.0, 0.0, 120.0),
    timestep_limit=10,
    step_duration_s=13.0,
    mission=1,
    run_id=1,
)


@given(st.lists(st.integers(0, 6), max_size=30), st.integers(1, 4))
def test_the_latest_keys_have_their_last_values(keys: list[int], most: int) -> None:
    kept: Latest[int, int] = Latest(most)
    for place, key in enumerate(keys):
        kept.put(key, place)
    last = {key: place for place, key in enumerate(keys)}
    newest = sorted(last, key=lambda key: last[key])[-most:]
    assert dict(kept) == {key: last[key] for key in newest}
    assert list(kept) == newest
    assert kept.last == (len(keys) - 1 if keys else None)


def test_a_report_finds_the_agents_of_its_run() -> None:
    inbox = AgentsInbox()
    for run_id in (5, 9):
        assert inbox.take(agents_json(replace(INFO, run_id=run_id))).run_id == run_id
    report = np.zeros(1, step_report_dtype(2))
    report["run_id"] = 5
    found = inbox.info_of(report)
    assert found is not None and found.run_id == 5
    report["run_id"] = 7
    assert inbox.info_of(report) is None


def test_agents_that_cannot_be_read_replace_none() -> None:
    inbox = AgentsInbox()
    inbox.take(agents_json(INFO))
    with pytest.raises(ValueError, match="agents"):
        inbox.take("{}")
    assert inbox.last == INFO and len(inbox) == 1
