# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Step reports as a table: a line for each step, which a person can read."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.mission.run.report_table import HEADER_EVERY, ReportTable
from dsse_ros.mission.run.step_reports import place_columns
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.step_report import FLAGS, make_step_report

ACTIONS = ("left", "right", "up", "down", "search")
RUN = 7


def search(drones: int, actions: tuple[str, ...] = ACTIONS, seed: int | None = 6) -> AgentsInfo:
    return AgentsInfo(
        agents=tuple(f"drone{i}" for i in range(drones)), actions=actions, rules="paper", seed=seed,
        frame=GridFrame(20, 130.0, -24.0, -46.0, 0.0, 120.0), timestep_limit=180,
        step_duration_s=13.0, mission=1, run_id=RUN,
    )  # fmt: skip


def report(drones: int, step: int, *, mission: int = 1, **given: Any) -> NDArray[Any]:
    numbers = np.arange(drones)
    cells = np.stack([numbers % 20, numbers // 20], axis=1)
    values: dict[str, Any] = {
        "run_id": RUN, "mission": mission, "step": step,
        **place_columns(search(drones).frame, cells, cells),
        "action": 4, "reward": 1.5, "action_mask": np.ones((drones, len(ACTIONS))),
        **dict.fromkeys((*FLAGS, "all_found"), False),
    }  # fmt: skip
    if "status" in given:
        values["command"] = 4
    return make_step_report(values | given)


def test_a_mission_reads_like_this() -> None:
    table, info = ReportTable(80), search(2)
    lines = [
        *table.lines(info, report(2, 0, action=[-1, -1], reward=[0, 0])),
        *table.lines(info, report(2, 1, held=[False, True])),
        *table.lines(
            info,
            report(
                2, 21, found=[True, False], terminated=[True, True], all_found=True,
                reward=[19000.25, -3],
            ),
        ),
    ]  # fmt: skip
    assert lines == [
        "mission 1 of run 7: 2 drones, 20 x 20 cells, seed 6",
        "step    time    reward  drone0        drone1",
        "   0    0:00       0.0  0,0 -         1,0 -",
        "   1    0:13       3.0  0,0 search    1,0 held",
        "steps 2 to 20 were not received",
        "  21    4:33   18997.2  0,0 FOUND     1,0 search",
        "mission 1 is over after 21 steps: found by drone0",
    ]


@given(drones=st.integers(1, 250), width=st.integers(70, 300), found=st.data())
def test_no_line_is_wider_than_the_terminal_and_no_drone_is_left_out(
    drones: int, width: int, found: st.DataObject
) -> None:
    out = np.array(found.draw(st.lists(st.booleans(), min_size=drones, max_size=drones)))
    out[0] = False
    lines = ReportTable(width).lines(search(drones), report(drones, 3, terminated=out))
    header, line = lines[1:]
    assert max(map(len, lines)) <= width
    shown = len(re.findall(r"drone\d+", header))
    assert shown >= 1
    more = re.search(r"and (\d+) more", line)
    assert shown + (int(more[1]) if more else 0) == drones
    assert line.count("search") == (~out[:shown]).sum()


def test_one_who_finds_somebody_is_named_even_where_there_is_no_room() -> None:
    found = np.arange(30) == 28
    *_, line = ReportTable(80).lines(search(30), report(30, 3, found=found))
    assert line.endswith("and 27 more  drone28 FOUND")


def test_the_header_is_repeated_and_a_new_mission_has_its_own() -> None:
    table, info = ReportTable(80), search(1)
    steps = range(2 * HEADER_EVERY)
    lines = [line for step in steps for line in table.lines(info, report(1, step))]
    assert [i for i, line in enumerate(lines) if line.startswith("step ")] == [1, 22]
    title, header, _ = table.lines(info, report(1, 0, mission=2))
    # The seed is that of another mission.
    assert title == "mission 2 of run 7: 1 drone, 20 x 20 cells"
    assert header.startswith("step ")


def test_a_report_that_comes_again_is_one_line_unless_a_drone_was_lost_meanwhile() -> None:
    table, info = ReportTable(80), search(2)
    table.lines(info, report(2, 3))
    assert table.lines(info, report(2, 3)) == []
    (line,) = table.lines(info, report(2, 3, terminated=[False, True]))
    assert line.endswith("0,0 search    1,0 out")


def test_the_state_and_the_battery_of_a_drone_with_faults_are_shown() -> None:
    values = report(3, 3, status=[0, 1, 6], battery=[83.4, 9.0, np.nan])
    header, line = ReportTable(120).lines(search(3), values)[1:]
    assert re.split("  +", line)[-3:] == ["0,0 search 83%", "1,0 stuck 9%", "2,0 under_way"]
    assert header.index("drone2") == line.index("2,0")


@pytest.mark.parametrize(
    ("given", "outcome"),
    [
        ({"truncated": [True, True]}, "out of time"),
        ({"terminated": [True, True]}, "no drone left"),
        ({"terminated": [True, False], "truncated": [False, True]}, "out of time"),
        ({"terminated": [True, True], "all_found": True}, "all found"),
        (
            {
                "terminated": [True, True], "all_found": True,
                "coverage_rate": 1.0, "repeated_coverage": 0.1, "pos": 1.0,
            },
            "all covered",
        ),
    ],
)  # fmt: skip
def test_the_end_of_a_mission_says_why(given: dict[str, Any], outcome: str) -> None:
    *_, line = ReportTable(80).lines(search(2), report(2, 9, **given))
    assert line == f"mission 1 is over after 9 steps: {outcome}"


@pytest.mark.parametrize(
    ("values", "error"),
    [
        (report(3, 0), "drones must be 2, as in agents, got 3"),
        (report(2, 0, action=[0, 5]), "action must be from -1 to 4, got 5"),
        (report(2, 0, action=[-2, 0]), "action must be from -1 to 4, got -2"),
    ],
)
def test_a_report_of_another_search_is_refused_and_the_next_one_is_shown(
    values: NDArray[Any], error: str
) -> None:
    table, info = ReportTable(80), search(2)
    with pytest.raises(ValueError, match=error):
        table.lines(info, values)
    assert len(table.lines(info, report(2, 0))) == 3


@given(st.text(min_size=1, max_size=40))
def test_a_name_from_a_message_cannot_command_a_terminal(name: str) -> None:
    lines = ReportTable(80).lines(search(1, actions=(name,)), report(1, 0, action=[0]))
    assert all(line.isprintable() for line in lines)
    assert max(map(len, lines)) <= 80
