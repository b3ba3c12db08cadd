# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every observation lies in its declared space: of every profile, wrapper, option and grid size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from play import missions, some_actions

from dsse_ros.search.environments.aec import aec_env
from dsse_ros.search.environments.drone_slots import DroneSlots
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.joint_vector_env import JointVectorEnv
from dsse_ros.search.environments.wrappers import (
    ALL_POSITIONS,
    FLATTENED,
    IN_MATRIX,
    DiscountedObservations,
    EncodedObservations,
    Encoding,
    RetainedPositions,
    SeenDiscount,
    top_cells,
)
from dsse_ros.world.scenario.rules import profile

STEPS = 12

encodings = st.sampled_from([ALL_POSITIONS, FLATTENED, IN_MATRIX]) | st.integers(1, 120).map(
    top_cells
)
one_array = encodings.filter(lambda encoding: encoding is not ALL_POSITIONS)


@st.composite
def searches(draw: st.DrawFn) -> dict[str, Any]:
    """Keyword arguments of `parallel_env`: of every profile, with rules and faults of any kind."""
    rules = draw(st.sampled_from(["paper", "v1", "v2", "coverage"]))
    fields = draw(missions(max_grid=6, max_drones=4, max_persons=1)) | {"rules": rules}
    faults = {
        "position_noise": st.floats(0, 10),
        "loss_rate": st.floats(0, 0.5),
        "command_delay": st.integers(0, 3),
        "battery_move": st.floats(0, 20),
    }
    others = {
        "dispersion_inc": st.floats(0, 2),
        "leave_policy": st.sampled_from(["terminate", "stay", "fly_on"]),
        "ends_together": st.booleans(),
        "collisions": st.booleans(),
    }
    for name, values in (faults | others).items():
        if draw(st.integers(0, 3)) == 0:
            fields[name] = draw(values)
    columns, rows = fields["grid_size"]
    flies_on = fields.get("leave_policy", profile(rules).leave_policy) == "fly_on"
    assume(columns == rows or not flies_on)
    if rules == "coverage":
        if draw(st.booleans()):
            values = draw(
                st.lists(st.floats(0.1, 1e3), min_size=columns * rows, max_size=columns * rows)
            )
            fields["probability_matrix"] = np.reshape(values, (rows, columns))
    else:
        fields["observe"] = draw(st.sampled_from(["map", "belief"]))
    return fields


def wrapped(env: Any, encoding: Encoding | None, discount: int, retained: bool) -> Any:
    """Put wrappers around a search."""
    if retained:
        cells = [tuple(cell) for cell in env.scenario.drones_positions[::-1]]
        env = RetainedPositions(env, cells)
    if discount:
        env = DiscountedObservations(env, discount)
    return env if encoding is None else EncodedObservations(env, encoding)


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(searches(), st.none() | encodings, st.integers(0, 3), st.booleans(), st.integers(0, 2**32))
def test_what_agents_observe_lies_in_their_spaces_through_any_wrappers(
    fields: dict[str, Any], encoding: Encoding | None, discount: int, retained: bool, seed: int
) -> None:
    search = parallel_env(**fields)
    env = wrapped(search, encoding, discount, retained)
    rng = np.random.default_rng(seed)
    observations, _ = env.reset(seed=seed)
    for _ in range(STEPS):
        for agent, observed in observations.items():
            assert env.observation_space(agent).contains(observed)
        assert search.state_space.contains(search.state())
        if not env.agents:
            break
        observations, *_ = env.step(some_actions(search, rng))


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(searches(), st.integers(0, 2**32))
def test_what_agents_observe_in_turn_lies_in_their_spaces(
    fields: dict[str, Any], seed: int
) -> None:
    env = aec_env(**fields)
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for turn, agent in enumerate(env.agent_iter()):
        observed, _, terminated, truncated, _ = env.last()
        assert env.observation_space(agent).contains(observed)
        over = terminated or truncated
        env.step(None if over else int(rng.integers(env.action_space(agent).n)))
        if turn > 4 * STEPS:
            break


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(searches(), st.none() | encodings, st.integers(0, 3), st.booleans(), st.integers(0, 2**16))
def test_what_worlds_of_a_batch_observe_lies_in_their_spaces(
    fields: dict[str, Any], encoding: Encoding | None, discount: int, retained: bool, seed: int
) -> None:
    inner = vector_env(2, **fields)
    drones, grid = inner.world.num_drones, inner.world.grid_size
    seen = SeenDiscount(discount) if discount else None
    batch = JointVectorEnv(inner)
    space = batch.single_observation_space
    of_drone = encoding and encoding.space(drones, grid, inner.rules.margin)
    rng = np.random.default_rng(seed)
    starts = {"drones_positions": inner.scenario.drones_positions[::-1]} if retained else {}
    observed, infos = batch.reset(seed=seed, options=starts)
    if seen is not None:
        seen.reset(observed["probability"])
    for step in range(STEPS):
        positions, probability = observed["positions"], observed["probability"]
        if seen is not None:
            seen.see(positions, infos["step"])
            probability = seen.discount(probability, infos["step"])
        for b in range(2):
            assert space.contains({"positions": positions[b], "probability": probability[b]})
        if encoding is not None and of_drone is not None:
            encoded = encoding.encode(positions, probability)
            for b, n in np.ndindex(2, drones):
                one = (
                    (encoded[0][b, n], encoded[1][b])
                    if isinstance(encoded, tuple)
                    else encoded[b, n]
                )
                assert of_drone.contains(one)
        if step == STEPS // 2:
            mask = rng.random(2) < 0.5
            observed, infos = batch.reset(options={"reset_mask": mask})
        else:
            actions = rng.integers(0, len(inner.rules.actions), (2, drones))
            observed, *_, infos = batch.step(actions)


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(searches(), one_array, st.integers(0, 2**16))
def test_what_slots_observe_lies_in_their_space(
    fields: dict[str, Any], encoding: Encoding, seed: int
) -> None:
    slots = DroneSlots(vector_env(2, **fields), encoding)
    space = slots.single_observation_space
    rng = np.random.default_rng(seed)
    observed, _ = slots.reset(seed=seed)
    for _ in range(STEPS):
        assert all(space.contains(of_slot) for of_slot in observed)
        step = slots.step(rng.integers(0, slots.num_actions, slots.num_slots))
        assert all(space.contains(of_slot) for of_slot in step.final_observations)
        observed = step.observations
