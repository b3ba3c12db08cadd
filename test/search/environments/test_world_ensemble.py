# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Searches whose persons follow an ensemble: environment, batch, belief, planner and snapshot."""

from __future__ import annotations

import contextlib
import copy
import gc
import pickle
import re
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from play import some_actions

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.belief import ensemble_belief
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief, EnsembleForecast
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.environments.world import World
from dsse_ros.search.step import cell_tracks
from dsse_ros.search.step.cell_tracks import LARGEST_BYTES, tracks_of
from dsse_ros.search.step.looks import Looked
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_and_rules
from dsse_ros.world.targets.ensemble import Ensemble, WeightedTracks
from dsse_ros.world.targets.registry import TARGET_MODELS

PLACE: dict[str, Any] = {
    "grid_size": 9, "person_initial_position": (4, 4), "timestep_limit": 30, "particles": 500,
    "vector": (0.9, 0.5), "person_motion": "constant_drift", "sigma": 1.0,
}  # fmt: skip
SOUTH = [[-24.04, -46.17], [-24.0335, -46.17], [-24.0335, -46.0], [-24.04, -46.0]]
"""A strip along the southern edge of the grid."""
PROFILES = ["paper", "v1", "v2"]
seeds = st.integers(0, 2**32)


@pytest.mark.parametrize("rules", PROFILES)
def test_persons_follow_tracks_of_the_truth_and_observe_the_map_of_the_particles(
    rules: str,
) -> None:
    env = parallel_env(rules=rules, num_drones=2, person_amount=3, **PLACE)
    env.reset(seed=3)
    tracks = tracks_of(env.scenario, env.rules)
    assert tracks is not None and env.world.ensemble is not None
    (track,) = env.world.ensemble.track
    assert len(set(track.tolist())) > 1
    for step in range(20):
        persons = env.world.persons[0]
        place = np.stack([persons["x"], persons["y"]], axis=1)
        present = env.rules.reset_sea_steps + step
        assert np.array_equal(place, tracks.truth[present, track])
        assert np.array_equal(env.probability, tracks.maps[present])
        cells = np.arange(-1, 10)[None]
        seen = env.world.cells(cells, np.full_like(cells, 4))
        assert np.array_equal(seen[0, 1:-1], env.probability[4])
        assert seen[0, 0] == seen[0, -1] == 0.0
        assert np.array_equal(env.world.map_of(0), env.probability)
        env.step(dict.fromkeys(env.agents, 0 if step % 2 else 1))
        if not env.agents:
            break


@pytest.mark.slow
def test_truth_and_particles_are_drawn_by_different_seeds_of_one_law() -> None:
    scenario, rules = Scenario(grid_size=9), profile("v2", person_motion="constant_drift")
    tracks = tracks_of(scenario.resolve(rules), rules)
    other = tracks_of(scenario.override(ensemble_seed=1).resolve(rules), rules)
    assert tracks is not None and other is not None
    assert not np.array_equal(tracks.truth, tracks.particles)
    assert not np.array_equal(tracks.truth, other.truth)
    assert not np.array_equal(tracks.particles, other.particles)
    assert tracks_of(scenario.resolve(rules), rules) is tracks


def test_particles_outside_the_area_and_the_grid_are_in_no_cell() -> None:
    env = parallel_env(rules="v2", **PLACE, area=SOUTH)
    env.reset(seed=0)
    mask = env.scenario.area_mask
    assert mask is not None and not mask.all()
    belief = EnsembleBelief(EnsembleForecast(env.scenario, env.rules))
    totals = []
    for _ in range(25):
        assert not env.probability[~mask].any()
        assert env.probability == pytest.approx(belief.poc(), abs=1e-6)
        assert env.probability.sum() + belief.outside == pytest.approx(1.0, abs=1e-5)
        totals.append(float(env.probability.sum()))
        env.step({"drone0": env.rules.action_set.search})
        if not env.agents:
            break
        belief.advance()
    assert min(totals) < 0.95


def test_nobody_is_found_off_the_grid() -> None:
    world = World(
        Scenario(**{k: v for k, v in PLACE.items() if k != "person_motion"} | {"vector": (9, 9)}),
        profile("v2", person_motion="constant_drift"), 200,
    )  # fmt: skip
    world.reset()
    for _ in range(30):
        world.step(np.full((200, 1), -1, np.int8))
    assert (world.persons["x"] >= 9).all() and not world.maps.any()
    world.drones["x"] = world.drones["y"] = 8
    world.step(np.full((200, 1), world.rules.action_set.search, np.int8))
    assert not world.persons["found"].any()


@pytest.mark.parametrize("observe", ["map", "belief"])
@pytest.mark.parametrize("rules", PROFILES)
def test_world_b_of_a_batch_is_the_single_environment(rules: str, observe: str) -> None:
    fields = {**PLACE, "num_drones": 2, "person_amount": 2, "probability_of_detection": 0.6}
    batch = vector_env(6, rules=rules, observe=observe, **fields)
    singles = [parallel_env(rules=rules, observe=observe, **fields) for _ in range(6)]
    seen, _ = batch.reset(seed=5)
    for b, env in enumerate(singles):
        env.reset(seed=5 + b)
        assert np.array_equal(seen["probability"][b], env.probability)
    generator = np.random.default_rng(0)
    over = np.zeros(6, bool)
    for _ in range(40):
        actions = generator.integers(0, len(batch.rules.actions), (6, 2)).astype(np.int8)
        seen, *_ = batch.step(actions)
        for b, env in enumerate(singles):
            if over[b]:
                env.reset()
            elif env.agents:
                env.step({agent: int(actions[b, int(agent[5:])]) for agent in env.agents})
            over[b] = not env.agents
            assert np.array_equal(seen["probability"][b], env.probability)
            persons = batch.world.persons[b]
            assert np.array_equal(persons["x"], env.world.persons[0]["x"])
            assert np.array_equal(persons["found"], env.world.persons[0]["found"])


@pytest.mark.parametrize("rules", PROFILES)
def test_the_observed_belief_is_that_of_the_searches(rules: str) -> None:
    env = parallel_env(
        rules=rules, observe="belief", num_drones=2, person_amount=2,
        person_pod_multipliers=(1.0, 0.5), probability_of_detection=0.5, **PLACE,
    )  # fmt: skip
    belief = EnsembleBelief(EnsembleForecast(env.scenario, env.rules))
    of_pos = belief.forecast.of_pos.belief()
    pods = np.array([0.5, 0.25])
    search, generator = env.rules.action_set.search, np.random.default_rng(1)
    for seed in range(5):
        env.reset(seed=seed)
        belief.reset()
        of_pos.reset()
        while env.agents:
            assert env.probability == pytest.approx(belief.poc(), abs=1e-6)
            actions = some_actions(env, generator)
            for agent in actions:
                if generator.random() < 0.5:
                    actions[agent] = search
            cells = [tuple(cell) for cell in env.positions.tolist()]
            last = env.steps_done == env.scenario.timestep_limit + env.rules.time_out_grace
            live = [] if last and not env.rules.time_out_acts else list(actions)
            *_, infos = env.step(actions)
            searched = [int(agent[5:]) for agent in live if actions[agent] == search]
            found = env.world.found[0]
            for each in (belief, of_pos):
                each.update([Looked(cells[n], pods) for n in searched if not found[n]])
                for n in searched:
                    if found[n]:
                        each.observe_find(Looked(cells[n], pods))
                each.advance()
            for info in infos.values():
                assert info["pos"] == pytest.approx(of_pos.pos, abs=1e-9)


@pytest.mark.parametrize("observe", ["map", "belief"])
def test_a_restored_mission_goes_on_bit_for_bit(observe: str, tmp_path: Path) -> None:
    fields = {**PLACE, "num_drones": 2, "probability_of_detection": 0.5, "observe": observe}
    env = parallel_env(rules="v2", **fields)
    # The tracks follow from what a reset places.
    env.reset(seed=4, options={"vector": (-0.5, 0.8), "person_initial_position": (6, 3)})
    generator = np.random.default_rng(0)
    for _ in range(5):
        env.step(some_actions(env, generator))
    env.snapshot().save(tmp_path / "mission.snapshot")
    twin = parallel_env(rules="v2", **fields)
    twin.restore(Snapshot.load(tmp_path / "mission.snapshot"))
    others = [twin, copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    while env.agents:
        actions = some_actions(env, generator)
        env.step(actions)
        for other in others:
            other.step(actions)
            assert env.world.state_bytes() == other.world.state_bytes()
            assert np.array_equal(other.probability, env.probability)
    assert others[1].world.ensemble.tracks is env.world.ensemble.tracks  # type: ignore[union-attr]


def test_a_snapshot_with_a_track_that_is_none_is_refused() -> None:
    env = parallel_env(rules="v2", **PLACE)
    env.reset(seed=0)
    snapshot = env.snapshot()
    for wrong in (-1, 500):
        snapshot.arrays["track"][:] = wrong
        with pytest.raises(SnapshotError, match="track is not from 0 to 499"):
            env.restore(snapshot)


@given(seeds, st.sampled_from([(0.3, -0.4), (-2.0, 1.0)]))
@settings(deadline=None, max_examples=10)
def test_a_reset_that_places_the_person_elsewhere_is_that_scenario(
    seed: int, vector: tuple[float, float]
) -> None:
    placed = {"vector": vector, "person_initial_position": (2, 6)}
    env = parallel_env(rules="v2", **PLACE)
    other = parallel_env(rules="v2", **(PLACE | placed))
    env.reset(seed=seed, options=placed)
    other.reset(seed=seed)
    for _ in range(8):
        assert np.array_equal(env.probability, other.probability)
        assert env.world.persons.tobytes() == other.world.persons.tobytes()
        for one in (env, other):
            one.step({"drone0": 0})
        if not env.agents:
            break
    env.reset(seed=seed)
    other = parallel_env(rules="v2", **PLACE)
    other.reset(seed=seed)
    assert np.array_equal(env.probability, other.probability)


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["belief", "belief_greedy", "effort_allocation"])
def test_planners_find_persons_who_follow_an_ensemble(planner: str) -> None:
    options = {"samples": 512} if planner == "belief" else {}
    env = parallel_env(rules="v2", num_drones=2, **PLACE)
    fly = planner_for(env, planner, seed=1, **options)
    found = 0
    for seed in range(12):
        observations, infos = env.reset(seed=seed)
        while env.agents:
            observations, *_, infos = env.step(fly(observations, infos))
        found += int(env.world.persons["found"].all())
    assert found >= 5


def test_played_missions_are_those_of_the_environment() -> None:
    fields = {**PLACE, "num_drones": 2}
    played = play_missions(8, "belief_greedy", rules="v2", seed=3, **fields)
    for m in range(8):
        env = parallel_env(rules="v2", **fields)
        fly = planner_for(env, "belief_greedy", seed=3 + m)
        observations, infos = env.reset(seed=3 + m)
        steps = 0
        while env.agents:
            observations, *_, infos = env.step(fly(observations, infos))
            steps += 1
        assert bool(env.world.persons["found"].all()) == played.found[m]
        assert not played.found[m] or steps == played.steps[m]


def test_particles_too_many_to_sort_at_once_are_sorted_as_they_are_needed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fields = {**PLACE, "num_drones": 2, "rules": "v2", "probability_of_detection": 0.5}

    def known() -> list[Any]:
        played = play_missions(3, "belief", seed=3, **fields)
        found: list[Any] = [played.steps, played.path_length_m]
        env, generator = vector_env(3, observe="belief", **fields), np.random.default_rng(1)
        found.append(env.reset(seed=1)[0])
        for _ in range(35):
            found.append(env.step(generator.integers(0, 9, (3, 2)))[0])
        return found

    at_once = known()
    monkeypatch.setattr(ensemble_belief, "LARGEST_SORTED_BYTES", 0)
    for one, other in zip(at_once, known(), strict=True):
        np.testing.assert_equal(one, other)


def test_what_would_take_too_much_memory_is_refused_with_what_would_fit() -> None:
    fields = PLACE | {"timestep_limit": 10**8}
    with pytest.raises(FieldError, match=f"at most {LARGEST_BYTES >> 20} MiB") as raised:
        parallel_env(rules="v2", **fields)
    line = str(raised.value)
    assert "\n" not in line and "person_motion constant_drift" in line
    found = re.search(r"timestep_limit (\d+)", line)
    assert found is not None
    for limit, fits in ((int(found[1]), True), (int(found[1]) + 1, False)):
        stated, rules = scenario_and_rules(None, "v2", **(fields | {"timestep_limit": limit}))
        with contextlib.nullcontext() if fits else pytest.raises(FieldError):
            cell_tracks.check_memory(stated.resolve(rules), rules)


def test_the_memory_limit_counts_the_tracks_that_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cell_tracks, "LARGEST_BYTES", 1 << 20)
    fields = {"timestep_limit": 30, "particles": 10, "rules": "v2"}
    parallel_env(**fields, person_motion="drifting_map", probability_matrix=np.eye(40))
    with pytest.raises(FieldError, match="^tracks and maps of .* 1 MiB, got 4900 particles, 32 st"):
        parallel_env(**fields, person_motion="drifting_map", probability_matrix=np.ones((70, 70)))


def test_tracks_are_shared_while_something_uses_them_and_then_forgotten(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    env = parallel_env(rules="v2", **PLACE)
    assert env.world.ensemble is not None
    size = env.world.ensemble.tracks.nbytes
    monkeypatch.setattr(cell_tracks, "KEPT_BYTES", size * 5 // 2)

    def tracks_for(seed: int) -> Any:
        env = parallel_env(rules="v2", ensemble_seed=seed, **PLACE)
        assert env.world.ensemble is not None
        return weakref.ref(env.world.ensemble.tracks)

    used = parallel_env(rules="v2", ensemble_seed=0, observe="belief", **PLACE)
    of_all = [tracks_for(seed) for seed in range(6)]
    gc.collect()
    assert [tracks() is not None for tracks in of_all] == [True, *[False] * 3, True, True]
    # In use, and the most recent: neither is drawn again.
    assert tracks_for(0)() is of_all[0]() and tracks_for(5)() is of_all[5]()
    del used


def test_an_ensemble_of_its_own_number_of_tracks_is_followed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def lost_or_still(scenario: Any, steps: int, rng: Any, count: int) -> WeightedTracks:
        positions = np.full((steps + 1, 2, 2), 3.5 * scenario.cell_size)
        positions[5:, 1] = np.nan
        return WeightedTracks(positions, np.array([0.25, 0.75]))

    monkeypatch.setitem(TARGET_MODELS, "constant_drift", Ensemble("is lost", lost_or_still))
    env = vector_env(1000, rules="v2", **PLACE)
    seen, _ = env.reset(seed=0)
    assert (seen["probability"][:, 3, 3] == 1.0).all()
    for _ in range(6):
        seen, *_ = env.step(np.zeros((1000, 1), np.int8))
    assert (seen["probability"][:, 3, 3] == 0.25).all()
    still = (env.world.persons["x"] == 3).mean()
    assert still == pytest.approx(0.25, abs=5 * np.sqrt(0.25 * 0.75 / 1000))
