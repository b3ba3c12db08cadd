# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission without ROS."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from looking import find_in, search_in_vain

from dsse_ros.mission.run.mission import END_NS, Mission, StepResult
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.step.constants import NO_ACTION
from msg_adapters.stamps import to_stamp

SEARCH = 4
joints = st.lists(st.lists(st.integers(0, 4), min_size=3, max_size=3), max_size=15)
seeds = st.integers(0, 2**32)


def mission(seed: int = 0, **scenario: object) -> Mission:
    scenario = {"grid_size": 7, "num_drones": 3, "sigma": 2.0, "timestep_limit": 12} | scenario
    if scenario.pop("nobody_is_found", False):
        scenario["person_pod_multipliers"] = [0.0]
    return Mission(parallel_env(**scenario), seed)  # type: ignore[arg-type]


def fly(flown: Mission, joint: list[int]) -> StepResult:
    flown.command_all(joint)
    return flown.advance("hold")


def same(a: StepResult, b: StepResult, *, but: tuple[str, ...] = ()) -> bool:
    names = [f.name for f in fields(StepResult) if f.name not in but]
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


@pytest.mark.slow
@given(seeds, joints)
def test_the_same_seed_and_commands_give_the_same_mission(
    seed: int, actions: list[list[int]]
) -> None:
    first, second = mission(seed), mission(seed)
    assert same(first.result, second.result)
    for joint in actions:
        if first.done:
            break
        assert same(fly(first, joint), fly(second, joint))
        assert first.pos == second.pos


def test_goals_that_no_moves_in_the_area_lead_to_are_refused() -> None:
    north = [[-24.04, -46.17], [-24.04, -46.0], [-24.0365, -46.0], [-24.0365, -46.17]]
    flown = mission(area=north, person_initial_position=(3, 6))
    mask = flown.env.scenario.area_mask
    assert mask is not None and not mask[0].any() and mask[6].all()
    assert flown.send(0, (6, 6)) is None
    refused = flown.send(0, (1, 0))
    assert refused is not None
    assert refused.code == "outside_area" and "[1, 0]" in refused.reason


@pytest.mark.slow
@given(seeds, joints)
def test_a_reset_repeats_the_mission_and_time_goes_on(seed: int, actions: list[list[int]]) -> None:
    flown = mission(seed)
    results = [flown.result]
    for joint in actions:
        if not flown.done:
            results.append(fly(flown, joint))
    again = [flown.reset(seed)]
    again += [fly(flown, joint) for joint in actions[: len(results) - 1]]
    assert flown.number == 2
    for before, after in zip(results, again, strict=True):
        assert same(before, after, but=("stamp_ns",))
    stamps = [result.stamp_ns for result in results + again]
    assert np.diff(stamps).tolist() == [13 * 10**9] * (len(stamps) - 1)
    # A stamp of 0 means "no time" in ROS.
    assert stamps[0] == 13 * 10**9


@pytest.mark.slow
@given(seeds, joints, st.integers(0, 14), st.integers(0, 2))
def test_the_history_is_every_step_with_the_drones_lost_since(
    seed: int, actions: list[list[int]], lost_at: int, drone: int
) -> None:
    flown = mission(seed)
    results = [flown.result]
    for step, joint in enumerate(actions):
        if step == lost_at:
            flown.lose(drone)
            results[-1] = flown.result
        if not flown.done:
            results.append(fly(flown, joint))
    history = flown.history
    assert history.shape == (len(results), 3)
    for row, result in zip(history, results, strict=True):
        assert np.array_equal(np.stack([row["col"], row["row"]], axis=1), result.cells)
        assert np.array_equal(row["action"], result.actions)
        assert np.array_equal(row["reward"], result.rewards)
        for flag in ("terminated", "truncated", "found", "held"):
            assert np.array_equal(row[flag].astype(bool), getattr(result, flag))
    flown.reset(seed)
    assert flown.history.shape == (1, 3)


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_the_steps_of_a_mission_out_of_time_are_its_limit(rules: str) -> None:
    flown = Mission(
        parallel_env(rules=rules, grid_size=7, num_drones=1, timestep_limit=5,
                     person_initial_position=(6, 6), person_pod_multipliers=[0.0]),
        seed=0,
    )  # fmt: skip
    while not flown.done:
        flown.command_all([flown.env.rules.actions.index("search")])
        flown.advance("hold")
    assert flown.outcome == "out of time" and flown.steps == 5
    assert flown.history.shape == (flown.result.step + 1, 1)


@pytest.mark.slow
@given(seeds, joints)
def test_the_pos_is_that_of_the_cells_searched(seed: int, actions: list[list[int]]) -> None:
    # Nothing is searched any more when the time is out.
    flown = mission(
        seed, person_initial_position=(6, 6), probability_of_detection=0.7, timestep_limit=16
    )
    belief = Belief(Forecast(flown.env.scenario, flown.env.rules))
    for joint in actions:
        if flown.done:
            break
        live, cells = flown.live, [tuple(cell) for cell in flown.result.cells.tolist()]
        found = fly(flown, joint).found
        searchers = [i for i in live if joint[i] == SEARCH]
        search_in_vain(belief, [cells[i] for i in searchers if not found[i]])
        for i in searchers:
            if found[i]:
                find_in(belief, cells[i])
        belief.advance()
        assert flown.pos == pytest.approx(belief.pos)
        assert flown.belief() == pytest.approx(belief.poc(), abs=1e-6)


def test_drones_that_search_one_cell_look_into_it_one_by_one() -> None:
    flown = mission(
        drones_positions=((3, 3), (2, 3)), num_drones=2, collisions=False,
        person_initial_position=(3, 3), probability_of_detection=0.5,
    )  # fmt: skip
    for seed in range(20):
        flown.reset(seed)
        assert flown.pos == 0.0
        alone = float(flown.belief()[3, 3])
        assert fly(flown, [SEARCH, 1]).step == 1
        assert flown.pos == pytest.approx(0.5 * alone)
        if not flown.done:
            together, before = float(flown.belief()[3, 3]), flown.pos
            fly(flown, [SEARCH, SEARCH])
            assert flown.pos == pytest.approx(before + (1 - before) * 0.75 * together)
            return
    raise AssertionError("every search has found the person")


@pytest.mark.slow
@given(seeds, joints, joints)
def test_a_resumed_mission_goes_on_with_its_belief(
    seed: int, before: list[list[int]], after: list[list[int]]
) -> None:
    flown, resumed = (mission(seed, probability_of_detection=0.7) for _ in range(2))
    for joint in before:
        if not flown.done:
            fly(flown, joint)
    resumed.restore(Snapshot.from_bytes(flown.snapshot().to_bytes()))
    for joint in after:
        assert resumed.pos == flown.pos
        assert np.array_equal(resumed.belief(), flown.belief())
        if flown.done:
            break
        assert same(fly(flown, joint), fly(resumed, joint))


def test_a_belief_that_was_prepared_is_the_same() -> None:
    plain, prepared = (mission(5, probability_of_detection=0.4) for _ in range(2))
    prepared.prepare_belief()
    for joint in ([SEARCH] * 3, [1, 1, 1], [SEARCH, SEARCH, 3], [3, SEARCH, SEARCH]):
        if not plain.done:
            assert same(fly(plain, joint), fly(prepared, joint))
        assert plain.pos == prepared.pos
        assert np.array_equal(plain.belief(), prepared.belief())


def test_a_mission_needs_no_belief_and_says_so_where_a_snapshot_has_none() -> None:
    env = parallel_env(grid_size=7, num_drones=3)
    plain = Mission(env, 0, belief=False)
    fly(plain, [SEARCH] * 3)
    assert plain.pos is None
    with pytest.raises(ValueError, match="no belief"):
        plain.belief()
    with pytest.raises(SnapshotError, match="without a belief"):
        Mission(parallel_env(grid_size=7, num_drones=3), 0).restore(plain.snapshot())


def test_the_track_has_each_cell_once_per_visit() -> None:
    flown = mission(drones_positions=((0, 0), (3, 3), (6, 6)), nobody_is_found=True)
    for joint in ([1, 4, 4], [4, 4, 4], [1, 4, 4], [0, 4, 4]):
        fly(flown, joint)
    assert flown.tracks == [[(0, 0), (1, 0), (2, 0), (1, 0)], [(3, 3)], [(6, 6)]]
    flown.reset(0)
    assert flown.tracks == [[(0, 0)], [(3, 3)], [(6, 6)]]


def test_a_drone_that_is_lost_takes_no_command_and_is_not_waited_for() -> None:
    flown = mission()
    fly(flown, [0, SEARCH, SEARCH])
    assert flown.live == [1, 2] == flown.missing
    refusal = flown.refuse(0)
    assert refusal is not None and refusal.code == "drone_terminated"
    assert flown.refuse(1) is None
    flown.command_all([3, SEARCH, SEARCH])
    assert flown.missing == []
    assert flown.advance("search").actions.tolist() == [NO_ACTION, SEARCH, SEARCH]


def test_a_mission_that_is_over_takes_no_command_until_a_reset() -> None:
    flown = mission()
    fly(flown, [0, 2, 2])
    assert flown.done and flown.live == []
    refusal = flown.refuse()
    assert refusal is not None and refusal.code == "mission_over"
    flown.reset(0)
    assert not flown.done and flown.refuse() is None


def test_an_aborted_mission_is_over() -> None:
    flown = mission()
    flown.abort()
    assert flown.done
    flown.reset(0)
    assert not flown.done


def test_a_mission_says_how_it_has_ended() -> None:
    def end(joint: list[int], **scenario: object) -> str:
        flown = mission(person_initial_position=(6, 6), **scenario)
        assert flown.outcome == ""
        while not flown.done:
            fly(flown, joint)
        return flown.outcome

    near = {"drones_positions": ((5, 6), (6, 6), (0, 0)), "vector": (0.0, 0.0)}
    certain = {"probability_of_detection": 1.0, "person_pod_multipliers": [1.0]}
    assert end([SEARCH] * 3, **near, **certain) == "found by drone1"
    assert end([SEARCH] * 3, nobody_is_found=True) == "out of time"
    assert end([0, 2, 2]) == "no drone left"
    meet = {"drones_positions": ((2, 3), (4, 3), (0, 0))}
    assert end([1, 0, 2], **meet) == (
        "no drone left: drone0 and drone1 collided in cell (3, 3) (rule collisions)"
    )
    assert end([0, SEARCH, SEARCH], rules="v1") == "drone0 terminated"
    assert end([SEARCH] * 3, rules="v1", nobody_is_found=True) == "out of time"
    given_up = mission()
    given_up.abort()
    assert given_up.outcome == "aborted"


def test_a_step_that_nobody_commanded_is_held() -> None:
    result = mission().advance("hold")
    assert result.held.all() and (result.actions == NO_ACTION).all()
    result = mission().advance("search")
    assert not result.held.any() and (result.actions == SEARCH).all()


def test_mission_time_never_leaves_what_a_stamp_holds() -> None:
    flown = mission(cell_size=1e6, drone_speed=0.01, timestep_limit=99, nobody_is_found=True)
    while not flown.done:
        result = fly(flown, [SEARCH] * 3)
        to_stamp(result.stamp_ns)
    assert flown.live
    assert flown.result.stamp_ns + 10**8 * 10**9 >= END_NS
    assert flown.reset(0).stamp_ns == 10**8 * 10**9


def parts_of(snapshot: Snapshot) -> list[tuple[str, str]]:
    return [("arrays", name) for name in snapshot.arrays] + [("extra", n) for n in snapshot.extra]


def of_faults() -> Mission:
    return mission(3, position_noise=0.5, probability_of_detection=0.3)


def state(flown: Mission) -> tuple[object, ...]:
    parts = flown.snapshot()
    return flown.env.world.state_bytes(), flown.pos, flown.belief().tobytes(), parts.extra


@pytest.mark.parametrize("part", parts_of(of_faults().snapshot()), ids=lambda part: part[1])
def test_a_snapshot_that_lacks_a_part_is_refused_and_nothing_changes(part: tuple[str, str]) -> None:
    flown, other = of_faults(), of_faults()
    fly(flown, [SEARCH, 1, 3])
    fly(other, [1, SEARCH, SEARCH])
    fly(other, [3, SEARCH, SEARCH])
    snapshot, (group, name) = flown.snapshot(), part
    del getattr(snapshot, group)[name]
    result, before = other.result, state(other)
    with pytest.raises(SnapshotError) as refusal:
        other.restore(snapshot)
    assert "\n" not in str(refusal.value)
    assert other.result is result and state(other) == before


@pytest.mark.parametrize("name", ["result_actions", "result_commands"])
def test_a_snapshot_with_an_action_that_is_none_is_refused(name: str) -> None:
    flown, other = of_faults(), of_faults()
    snapshot, before = flown.snapshot(), state(other)
    snapshot.arrays[name][1] = 7
    with pytest.raises(SnapshotError, match=f"is of an impossible mission: {name}"):
        other.restore(snapshot)
    assert state(other) == before
