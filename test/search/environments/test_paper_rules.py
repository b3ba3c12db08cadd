# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Profile `paper`, one promise at a time: rewards, ends, collisions, drift and circle."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from play import cells, persons_found, put_drones, put_person, started, step

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.plain import DOWN, LEFT, RIGHT, SEARCH, UP, Cell, in_circle
from dsse_ros.world.scenario.actions import ACTION_VECTORS
from dsse_ros.world.scenario.rules import PROFILES, Rules, profile

FAR: dict[str, Any] = {"person_initial_position": (7, 7), "vector": (0.0, 0.0)}
"""A person that stays in the far corner for the first two steps."""


def idle(env: SearchEnv, steps: int) -> None:
    """Let the sea go on while all drones search in vain."""
    for _ in range(steps):
        step(env, *[SEARCH] * len(env.agents))


def datum_of(env: SearchEnv) -> Cell:
    """The most probable cell: with a small spread the datum."""
    row, col = np.unravel_index(int(env.probability.argmax()), env.probability.shape)
    return int(col), int(row)


def test_the_defaults_are_a_zone_of_a_square_kilometre_one_drone_and_a_hundred_steps() -> None:
    env = started()
    assert env.probability.shape == (8, 8)
    assert env.possible_agents == ["drone0"]
    assert env.positions.tolist() == [[0, 0]]
    assert env.scenario.timestep_limit == 100
    assert env.scenario.person_amount == 1
    assert env.scenario.step_duration_s == 13
    assert env.rules.actions == ("left", "right", "up", "down", "search")


def test_drones_start_row_by_row_by_default() -> None:
    env = started(grid_size=3, num_drones=5)
    assert env.positions.tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1]]
    env = started(grid_size=3, drones_positions=[[2, 1], [0, 2]])
    assert env.positions.tolist() == [[2, 1], [0, 2]]


@given(st.integers(1, 12).flatmap(lambda size: st.tuples(st.just(size), cells((size, size)))))
@settings(deadline=None, max_examples=25)
def test_the_first_map_has_all_the_probability_in_the_person_s_cell(
    drawn: tuple[int, Cell],
) -> None:
    size, (col, row) = drawn
    env = parallel_env(grid_size=size, person_initial_position=(col, row))
    observations, _ = env.reset(seed=0)
    expected = np.zeros((size, size), np.float32)
    expected[row, col] = 1
    np.testing.assert_array_equal(observations["drone0"][1], expected)


@pytest.mark.parametrize(
    ("action", "cell"), [(LEFT, [2, 3]), (RIGHT, [4, 3]), (UP, [3, 2]), (DOWN, [3, 4])]
)
def test_a_move_goes_one_cell_and_earns_one(action: int, cell: list[int]) -> None:
    env = started(drones_positions=[(3, 3)], **FAR)
    _, rewards, terminated, truncated, _ = step(env, action)
    assert env.positions.tolist() == [cell]
    assert rewards == {"drone0": 1}
    assert not terminated["drone0"] and not truncated["drone0"]


@pytest.mark.parametrize(
    ("start", "action"), [((0, 3), LEFT), ((7, 3), RIGHT), ((3, 0), UP), ((3, 7), DOWN)]
)
def test_who_leaves_the_grid_is_lost_in_its_last_cell_and_the_others_go_on(
    start: Cell, action: int
) -> None:
    env = started(drones_positions=[start, (4, 4)], **FAR)
    observations, rewards, terminated, truncated, _ = step(env, action, SEARCH)
    assert rewards["drone0"] == -100000
    assert terminated == {"drone0": True, "drone1": False}
    assert truncated == {"drone0": False, "drone1": False}
    assert tuple(observations["drone0"][0]) == start
    assert env.agents == ["drone1"]
    observations, *_ = step(env, LEFT)
    assert list(observations) == ["drone1"]
    assert env.positions.tolist() == [list(start), [3, 4]]


def test_drones_that_meet_in_a_cell_collide() -> None:
    env = started(drones_positions=[(2, 2), (4, 2), (3, 3), (6, 6)], **FAR)
    _, rewards, terminated, _, _ = step(env, RIGHT, LEFT, UP, SEARCH)
    assert [rewards[f"drone{i}"] for i in range(3)] == [-100000] * 3
    assert terminated == {"drone0": True, "drone1": True, "drone2": True, "drone3": False}


def test_a_drone_that_is_flown_into_collides_whatever_it_does() -> None:
    env = started(drones_positions=[(2, 2), (3, 2)], **FAR)
    _, rewards, terminated, _, _ = step(env, RIGHT, SEARCH)
    assert rewards == {"drone0": -100000, "drone1": -100000}
    assert all(terminated.values()) and env.agents == []


@pytest.mark.parametrize("actions", [(RIGHT, LEFT), (RIGHT, RIGHT)])
def test_drones_may_swap_cells_and_follow_each_other(actions: tuple[int, int]) -> None:
    env = started(drones_positions=[(2, 2), (3, 2)], **FAR)
    _, rewards, _, _, _ = step(env, *actions)
    assert rewards == {"drone0": 1, "drone1": 1}
    assert len(env.agents) == 2


def test_nobody_collides_with_a_drone_that_is_lost() -> None:
    env = started(drones_positions=[(0, 2), (1, 2), (2, 2)], **FAR)
    _, rewards, _, _, _ = step(env, LEFT, LEFT, SEARCH)
    assert rewards["drone0"] == -100000 and rewards["drone1"] == 1
    assert env.agents == ["drone1", "drone2"]
    _, rewards, _, _, _ = step(env, SEARCH, LEFT)
    assert rewards == {"drone1": -100, "drone2": 1}


def test_the_collision_of_the_paper_s_text_is_a_field() -> None:
    env = started(drones_positions=[(2, 2), (4, 2)], collision=-2000, **FAR)
    _, rewards, terminated, _, _ = step(env, RIGHT, LEFT)
    assert rewards == {"drone0": -2000, "drone1": -2000}
    assert all(terminated.values())


def test_a_drone_may_be_stopped_at_the_edge_instead() -> None:
    env = started(drones_positions=[(0, 0)], leave_policy="stay", leave_grid=-5, **FAR)
    _, rewards, terminated, _, _ = step(env, LEFT)
    assert rewards == {"drone0": -5} and not terminated["drone0"]
    assert env.positions.tolist() == [[0, 0]]


def test_searching_an_improbable_cell_costs_a_hundred() -> None:
    env = started(drones_positions=[(0, 0)], **FAR)
    _, rewards, terminated, _, _ = step(env, SEARCH)
    assert rewards == {"drone0": -100} and not terminated["drone0"]


def test_searching_a_probable_cell_in_vain_earns_ten_thousand_times_its_probability() -> None:
    env = started(drones_positions=[(3, 3)], person_initial_position=(3, 3), vector=(0, 0), sigma=2)
    for _ in range(6):
        put_person(env, (0, 0))
        before = float(env.probability[3, 3])
        _, rewards, _, _, _ = step(env, SEARCH)
        assert rewards["drone0"] == pytest.approx(before * 10000, rel=1e-6)
    assert before < 0.2


def test_a_search_counts_the_map_of_the_last_observation() -> None:
    env = started(drones_positions=[(3, 3)], person_initial_position=(3, 3), vector=(1, 0))
    put_person(env, (0, 0))
    _, rewards, _, _, _ = step(env, SEARCH)
    assert env.probability[3, 3] == 0
    assert rewards == {"drone0": 10000}


def test_a_cell_of_exactly_one_percent_is_probable() -> None:
    fields: dict[str, Any] = {"grid_size": 10, "sigma": 1e9, "vector": (0, 0)}
    for bound, reward in ((0.01, 100.0), (np.nextafter(0.01, 1), -100.0)):
        env = started(**fields, search_min_probability=bound)
        # Once the circle reaches the corners, all 100 cells are alike.
        for _ in range(15):
            idle(env, 1)
            put_person(env, (9, 9))
        assert (env.probability == np.float32(0.01)).all()
        _, rewards, _, _, _ = step(env, SEARCH)
        assert rewards == {"drone0": reward}


@pytest.mark.parametrize(("limit", "before"), [(100, 0), (100, 7), (500, 480), (500, 100), (4, 3)])
def test_a_find_earns_ten_thousand_and_as_much_again_for_the_time_left(
    limit: int, before: int
) -> None:
    env = started(drones_positions=[(0, 0), (3, 3)], timestep_limit=limit, **FAR)
    for _ in range(before):
        put_person(env, (7, 7))
        idle(env, 1)
    put_person(env, (3, 3))
    _, rewards, terminated, truncated, infos = step(env, RIGHT, SEARCH)
    assert rewards == {"drone0": 1, "drone1": 10000 + 10000 * (1 - before / limit)}
    assert terminated == {"drone0": True, "drone1": True}
    assert truncated == {"drone0": False, "drone1": False}
    assert infos["drone0"]["Found"] is infos["drone1"]["Found"] is True
    assert env.agents == []


def test_a_mission_goes_on_until_every_person_is_found() -> None:
    env = started(drones_positions=[(3, 3)], person_amount=3, **FAR)
    put_person(env, (3, 3), 0)
    put_person(env, (3, 3), 2)
    _, rewards, terminated, _, infos = step(env, SEARCH)
    assert rewards == {"drone0": 2 * 20000}
    assert persons_found(env) == {0, 2}
    assert not terminated["drone0"] and infos["drone0"]["Found"] is False
    put_person(env, (3, 3), 1)
    _, rewards, terminated, _, infos = step(env, SEARCH)
    assert rewards == {"drone0": 10000 + 10000 * (1 - 1 / 100)}
    assert terminated["drone0"] and infos["drone0"]["Found"] is True


def test_who_is_found_is_not_found_again() -> None:
    env = started(drones_positions=[(3, 3)], person_amount=2, **FAR)
    put_person(env, (3, 3), 0)
    step(env, SEARCH)
    put_person(env, (3, 3), 0)
    put_person(env, (7, 7), 1)
    _, rewards, _, _, _ = step(env, SEARCH)
    assert rewards == {"drone0": -100}


def test_a_finder_that_is_flown_into_has_found_the_person_and_is_paid_for_the_collision() -> None:
    env = started(drones_positions=[(3, 3), (4, 3), (6, 6)], **FAR)
    put_person(env, (3, 3))
    _, rewards, terminated, _, infos = step(env, SEARCH, LEFT, RIGHT)
    assert rewards == {"drone0": -100000, "drone1": -100000, "drone2": 1}
    assert all(terminated.values())
    assert all(info["Found"] is True for info in infos.values())


def test_an_earlier_drone_s_find_leaves_nothing_to_a_later_one() -> None:
    env = started(drones_positions=[(3, 3), (6, 6)], person_amount=2, **FAR)
    put_person(env, (3, 3), 0)
    put_person(env, (3, 3), 1)
    _, rewards, _, _, _ = step(env, SEARCH, SEARCH)
    assert rewards["drone0"] == 40000 and rewards["drone1"] == -100


def test_the_action_after_the_last_is_not_done_and_ends_the_mission() -> None:
    env = started(drones_positions=[(3, 3), (5, 5)], timestep_limit=4, **FAR)
    idle(env, 4)
    before = env.probability
    put_person(env, (3, 3))
    _, rewards, terminated, truncated, infos = step(env, SEARCH, LEFT)
    assert rewards == {"drone0": -100000, "drone1": -100000}
    assert terminated == {"drone0": False, "drone1": False}
    assert truncated == {"drone0": True, "drone1": True}
    assert infos["drone0"]["Found"] is False
    assert env.positions.tolist() == [[3, 3], [5, 5]]
    assert env.agents == []
    assert not np.array_equal(env.probability, before)


def test_a_mission_without_a_drone_left_is_over() -> None:
    env = started(drones_positions=[(0, 0), (7, 0)], **FAR)
    step(env, LEFT, UP)
    assert env.agents == []
    state = env.world.state_bytes()
    assert env.step({}) == ({}, {}, {}, {}, {})
    assert env.step({"drone0": RIGHT}) == ({}, {}, {}, {}, {})
    assert env.world.state_bytes() == state


def test_the_datum_keeps_the_fraction_of_a_cell_that_it_drifted() -> None:
    env = started(grid_size=12, person_initial_position=(2, 9), vector=(0.375, -0.75), sigma=0.4)
    cols, rows = [], []
    for _ in range(12):
        idle(env, 1)
        col, row = datum_of(env)
        cols.append(col)
        rows.append(row)
    assert cols == [2, 2, 3, 3, 3, 4, 4, 5, 5, 5, 6, 6]
    assert rows == [9, 8, 7, 6, 6, 5, 4, 3, 3, 2, 1, 0]


def test_at_the_edge_one_axis_of_the_datum_waits_while_the_other_drifts() -> None:
    env = started(grid_size=9, person_initial_position=(7, 0), vector=(1, 1), sigma=0.4)
    seen = []
    for _ in range(5):
        idle(env, 1)
        seen.append(datum_of(env))
    assert seen == [(8, 1), (8, 2), (8, 3), (8, 4), (8, 5)]


def test_a_step_over_the_edge_is_not_shortened_and_its_cells_are_not_kept() -> None:
    env = started(grid_size=10, person_initial_position=(7, 5), vector=(5, 0), sigma=0.4)
    idle(env, 1)
    assert datum_of(env) == (7, 5)
    env.reset(options={"vector": (-5.0, 0.0)})
    seen = []
    for _ in range(3):
        idle(env, 1)
        seen.append(datum_of(env))
    assert seen == [(2, 5)] * 3


def test_the_circle_grows_by_half_a_cell_a_step_from_the_third_map_on() -> None:
    env = started(grid_size=21, person_initial_position=(10, 10), vector=(0, 0), sigma=50)
    for radius in (1, 1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5):
        idle(env, 1)
        inside = {(int(col) - 10, int(row) - 10) for row, col in np.argwhere(env.probability > 0)}
        offsets = range(-10, 11)
        assert inside == {(x, y) for x in offsets for y in offsets if in_circle(x, y, radius)}


def test_the_circle_is_centred_on_the_datum_of_the_same_map() -> None:
    env = started(grid_size=9, person_initial_position=(3, 4), vector=(1, 0), sigma=1)
    idle(env, 3)
    assert sorted((int(c), int(r)) for r, c in np.argwhere(env.probability > 0)) == [
        *[(5, 4), (6, 3), (6, 4), (6, 5), (7, 4)]
    ]


def test_the_gaussian_does_not_widen_with_time() -> None:
    env = started(grid_size=15, person_initial_position=(7, 7), vector=(0, 0), sigma=1.5)
    for _ in range(8):
        idle(env, 1)
        centre, beside = env.probability[7, 7], env.probability[7, 8]
        if beside:
            assert beside / centre == pytest.approx(np.exp(-1 / (2 * 1.5**2)), rel=1e-5)
    assert beside


def test_x_spread_is_along_columns_and_y_spread_along_rows() -> None:
    env = started(grid_size=9, person_initial_position=(4, 4), vector=(0, 0), sigma_x=4, sigma_y=1)
    idle(env, 6)
    assert env.probability[4, 6] > 2 * env.probability[6, 4] > 0


def test_a_profile_is_data_of_which_single_fields_can_be_replaced() -> None:
    paper = profile("paper")
    assert paper == PROFILES["paper"]
    changed = profile("paper", find=5, move=-1)
    assert dataclasses.replace(changed, find=paper.find, move=paper.move) == paper
    assert paper.override(find=5, move=-1) == changed
    env = started(rules=changed, drones_positions=[(3, 3)], **FAR)
    assert step(env, LEFT)[1] == {"drone0": -1}
    with pytest.raises(dataclasses.FrozenInstanceError):
        paper.find = 3  # type: ignore[misc]


def test_rules_can_be_given_by_name_by_value_and_by_field() -> None:
    by_name = parallel_env(rules="paper", find=7.0)
    by_value = parallel_env(rules=profile("paper", find=7.0))
    by_both = parallel_env(rules=profile("paper", move=5), move=1, find=7)
    assert by_name.rules == by_value.rules == by_both.rules
    assert isinstance(by_name.rules, Rules)


def test_the_action_set_says_where_each_action_goes() -> None:
    for number, name in enumerate(profile("paper").actions):
        env = started(drones_positions=[(3, 3)], **FAR)
        step(env, number)
        dx, dy = ACTION_VECTORS[name]
        assert env.positions.tolist() == [[3 + dx, 3 + dy]]


def test_actions_in_another_order_are_obeyed() -> None:
    actions = ("search", "down", "right", "up", "left")
    env = started(actions=actions, drones_positions=[(3, 3)], **FAR)
    assert step(env, 1)[1] == {"drone0": 1}
    assert env.positions.tolist() == [[3, 4]]
    assert step(env, 0)[1] == {"drone0": -100}
    put_drones(env, (0, 0))
    assert env.action_masks().tolist() == [[1, 1, 1, 0, 0]]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("actions", ("left", "right")),
        ("actions", ("search", "search")),
        ("actions", ("search", "hover")),
        ("find", float("nan")),
        ("search_min_probability", 1.5),
        ("leave_policy", "explode"),
        ("no_such_rule", 1),
    ],
)
def test_rules_that_make_no_sense_are_refused(field: str, value: Any) -> None:
    with pytest.raises(FieldError, match=field):
        profile("paper", **{field: value})
    with pytest.raises(FieldError, match=field):
        parallel_env(**{field: value})
