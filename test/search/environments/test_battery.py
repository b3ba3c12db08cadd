# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Batteries: a drone comes home with its reserve, whatever it is commanded, and is relieved."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from areas import CELL_M, ORIGIN, geojson_of
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.ways_home import ways_home
from dsse_ros.search.step.fault_kernels import STATUSES
from dsse_ros.world.scenario.action_times import action_times
from dsse_ros.world.scenario.actions import ActionSet

G = 8
RESERVE = 20.0
energies = st.floats(0.5, 6.0)
AREA = np.ones((G, G), bool)
AREA[2, 1:] = AREA[5, :-1] = False


def status_of(env: SearchEnv) -> list[str]:
    assert env.world.faults is not None
    return [STATUSES[k] for k in env.world.faults.conditions["status"][0]]


def battery_of(env: SearchEnv) -> Any:
    assert env.world.faults is not None
    return env.world.faults.conditions["battery"][0]


def env_with(fields: dict[str, Any], rules: str = "v2") -> SearchEnv:
    search: dict[str, Any] = {
        "grid_size": G,
        "drones_positions": [(0, 0), (7, 7)],
        "person_initial_position": (4, 4),
        "timestep_limit": 400,
        "probability_of_detection": 0.0,
        "battery_reserve": RESERVE,
    }
    return parallel_env(search, rules=rules, **fields)


@settings(max_examples=12, deadline=None)
@given(
    st.tuples(energies, energies, energies, energies),
    st.sampled_from(["paper", "v2"]),
    st.booleans(),
    st.floats(0.0, 9.0),
    st.floats(-180.0, 180.0),
    st.integers(0, 3),
    st.floats(0.0, 0.3),
    st.integers(0, 2**32),
)
def test_a_drone_comes_home_with_its_reserve_whatever_it_is_commanded(
    of_steps: tuple[float, float, float, float],
    rules: str,
    in_area: bool,
    wind: float,
    toward: float,
    delay: int,
    dropped: float,
    seed: int,
) -> None:
    names = ("battery_move", "battery_search", "battery_hover", "battery_return")
    fields: dict[str, Any] = dict(zip(names, of_steps, strict=True))
    fields |= {"wind_speed": wind, "wind_toward": toward, "relief_steps": 2}
    fields |= {"command_delay": delay, "command_drop_rate": dropped, "false_alarm_rate": 0.1}
    if rules == "paper":
        # A drone that leaves the grid is out.
        fields |= {"leave_policy": "stay", "collisions": False}
    if in_area:
        fields |= {"area": geojson_of(AREA), "cell_size": CELL_M, "person_initial_position": (0, 0)}
        fields |= {"origin_lat": ORIGIN[0], "origin_lon": ORIGIN[1]}
    env = env_with(fields, rules)
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    homes, came_home, before = env.world.starts[0], 0, status_of(env)
    for _ in range(160):
        env.advance(rng.integers(0, len(env.rules.actions), 2).astype(np.int8))
        now = status_of(env)
        assert (battery_of(env) >= RESERVE - 1e-6).all()
        assert env.action_masks().any(axis=1).all()
        for drone in range(2):
            if now[drone] == "home":
                came_home += before[drone] == "returning"
                assert env.positions[drone].tolist() == homes[drone].tolist()
            assert before[drone] not in ("returning", "home") or now[drone] in (
                "returning", "home", "searching",
            )  # fmt: skip
        before = now
    assert came_home


@settings(max_examples=15, deadline=None)
@given(energies, energies, st.integers(0, 2**32))
def test_what_the_mask_allows_is_done_and_what_it_forbids_turns_a_drone_home(
    move: float, search: float, seed: int
) -> None:
    env = env_with({"battery_move": move, "battery_search": search})
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    assert env.world.faults is not None
    for _ in range(150):
        masks, before, cells = env.action_masks(), status_of(env), env.positions
        actions = rng.integers(0, 9, 2).astype(np.int8)
        env.advance(actions)
        applied = env.world.faults.applied[0]
        for drone in np.flatnonzero(env.world.drones["alive"][0]):
            if before[drone] != "searching":
                continue
            dx, dy = env.rules.action_set.moves[actions[drone]]
            inside = ((cells[drone] + (dx, dy) >= 0) & (cells[drone] + (dx, dy) < G)).all()
            if masks[drone, actions[drone]]:
                assert applied[drone] == actions[drone]
            elif inside:
                assert status_of(env)[drone] in ("returning", "home")


def test_each_step_takes_the_energy_of_what_is_done() -> None:
    env = env_with(
        {"battery_move": 1.0, "battery_search": 2.0, "battery_hover": 4.0, "battery_return": 8.0}
    )
    _, infos = env.reset(seed=1)
    assert infos["drone0"]["battery"] == 100.0
    left = 100.0
    for action, energy in ((1, 1.0), (1, 1.0), (8, 2.0), (0, 1.0)):
        _, _, _, _, infos = env.step(dict.fromkeys(env.agents, action))
        left -= energy
        assert infos["drone0"]["battery"] == left
    env.advance(np.full(2, -1, np.int8))
    assert battery_of(env).tolist()[0] == left - 4.0


def test_a_drone_at_its_reserve_goes_home_and_leaves_the_search() -> None:
    env = env_with({"battery_move": 10.0, "drones_positions": [(0, 0)]})
    _, infos = env.reset(seed=1)
    trace = []
    while env.agents:
        _, _, terminated, _, infos = env.step({"drone0": 1})
        trace.append((status_of(env)[0], env.positions[0, 0].item(), battery_of(env)[0].item()))
    assert trace == [
        ("searching", 1, 90.0), ("searching", 2, 80.0), ("searching", 3, 70.0),
        ("searching", 4, 60.0), ("returning", 3, 50.0), ("returning", 2, 40.0),
        ("returning", 1, 30.0), ("home", 0, 20.0), ("home", 0, 20.0),
    ]  # fmt: skip
    assert terminated == {"drone0": True}


def test_another_drone_fully_charged_takes_the_place_of_one_that_came_home() -> None:
    env = env_with({"battery_move": 10.0, "relief_steps": 3, "drones_positions": [(0, 0)]})
    _, infos = env.reset(seed=1)
    for _ in range(8):
        _, _, _, _, infos = env.step({"drone0": 1})
    assert infos["drone0"]["status"] == "home"
    for _ in range(2):
        _, _, _, _, infos = env.step({"drone0": 1})
        assert infos["drone0"]["status"] == "home"
        assert infos["drone0"]["action_mask"].sum() == 1
    _, _, _, _, infos = env.step({"drone0": 1})
    assert (infos["drone0"]["status"], infos["drone0"]["battery"]) == ("searching", 100.0)
    env.step({"drone0": 1})
    assert env.positions[0].tolist() == [1, 0]


def test_a_drone_that_goes_home_flies_above_the_others() -> None:
    env = env_with(
        {"battery_move": 20.0, "battery_search": 1.0, "drones_positions": [(0, 0), (1, 1)]},
        "paper",
    )
    env.reset(seed=1)
    # drone1 goes where drone0 comes back.
    still = env.rules.action_set.search
    for actions in ((1, still), (1, 2), (still, still)):
        env.step(dict(zip(env.agents, actions, strict=True)))
    assert status_of(env) == ["returning", "searching"]
    assert env.positions.tolist() == [[1, 0], [1, 0]]
    env.step(dict.fromkeys(env.agents, still))
    assert status_of(env)[0] == "home"
    assert not env.world.terminated.any()


@settings(max_examples=20, deadline=None)
@given(
    st.integers(0, G * G - 1), st.booleans(), st.floats(0.0, 9.9), st.floats(-180.0, 180.0),
    st.sampled_from([True, False]),
)  # fmt: skip
def test_the_way_home_takes_the_steps_that_are_foreseen(
    home: int, in_area: bool, wind: float, toward: float, diagonal: bool
) -> None:
    names = ("left", "right", "up", "down", "search")
    if diagonal:
        names = (*names, "up_left", "up_right", "down_left", "down_right")
    env = parallel_env(grid_size=G, actions=names, wind_speed=wind, wind_toward=toward)
    shares, actions = action_times(env.scenario, env.rules).shares, ActionSet(names)
    area = AREA if in_area else np.ones((G, G), bool)
    cell = (home % G, home // G)
    if not area[cell[1], cell[0]]:
        return
    ways = ways_home(actions, area if in_area else None, GridShape.square(G), [cell], [shares])
    measure = actions.within(area if in_area else None)
    for row, col in np.argwhere(area).tolist():
        here, steps, moves, heading, progress = (col, row), 0, 0, -1, 0.0
        while here != cell:
            action = int(ways.actions[0, here[1], here[0]])
            progress = shares[action] + (progress if action == heading else 0.0)
            heading, steps = action, steps + 1
            if progress >= 1 - 1e-9:
                progress -= 1
                moves += 1
                here = (here[0] + actions.moves[action][0], here[1] + actions.moves[action][1])
                assert area[here[1], here[0]]
        assert steps == ways.steps[0, row, col]
        assert moves == measure.distance((col, row), cell)


def test_a_battery_that_is_empty_loses_its_drone() -> None:
    env = env_with({"battery_move": 5.0, "stuck_rate": 1.0, "stuck_steps": 1000})
    env.reset(seed=1)
    for _ in range(20):
        assert env.agents
        env.step(dict.fromkeys(env.agents, 8))
    assert (battery_of(env) == 0.0).all()
    env.step(dict.fromkeys(env.agents, 8))
    assert not env.agents
    assert status_of(env) == ["lost", "lost"]


def test_ways_home_too_large_to_be_kept_are_refused_on_one_line() -> None:
    actions = ActionSet(("left", "right", "up", "down", "search"))
    with pytest.raises(ValueError, match=r"with battery_move, got 3 drones on 9000 x"):
        ways_home(actions, None, GridShape.square(9000), [(0, 0), (1, 0), (2, 0)], [1.0] * 5)
