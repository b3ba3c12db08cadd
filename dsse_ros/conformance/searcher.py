# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The promises of a kind of drone, tested in missions, alone and with drones of another kind.

In your own test:

    searcher_test(Searcher(doc="flies slowly", speed=4.0))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.conformance.registered import registered
from dsse_ros.planners.registry import LOADED_PLANNERS, PERSON_PLANNERS, PLANNERS, planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import Snapshot
from dsse_ros.world.scenario.action_times import whole_steps
from dsse_ros.world.scenario.actions import STRAIGHT
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.searcher_fields import endurance_steps
from dsse_ros.world.searchers.registry import DEFAULT, SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher
from dsse_ros.world.sensors.sensor import SEARCH

GRID = 9
STEPS = 80
PLANNED_STEPS = 40
"""Steps for which each planner commands the drones."""
EFFORT: dict[str, dict[str, Any]] = {
    "belief": {"samples": 128, "width": 4, "horizon": 5},
}
"""Options of the planners that plan ahead: less of the work for the same promises."""
ENDURANCE_STEPS = 2000
"""Longest endurance that the test flies to its end."""


def searcher_test(searcher: Searcher, *, rules: str | Rules = "v2", seed: int = 0) -> None:
    """Fly missions with a kind of drone and check that it keeps its promises.

    A cell takes the whole number of steps that follows from the speed. During a move the only
    possible action completes it. Actions that the mask allows never leave the grid. The drone does
    only its own moves, and flies no longer than its endurance. The same seed gives the same
    mission, and a mission continues from a snapshot bit for bit. Every planner of this package
    that looks for persons commands only what the masks allow, and moves each drone that can fly in
    all straight directions. The kind is registered only during the test.

    Args:
        searcher: The kind of drone.
        rules: The name of a profile or a `Rules` value, without coverage.
        seed: Seed of the missions and of the commands.

    Raises:
        AssertionError: If a promise is broken; one line names it.
    """
    assert isinstance(searcher, Searcher), f"{searcher!r} is not a Searcher"
    assert searcher.doc, "doc is empty; it says what the kind is"
    with registered(SEARCHERS, searcher) as name:
        for swarm in ((name,), (name, name, name), (name, DEFAULT, name, DEFAULT)):
            env = _env(swarm, rules, STEPS)
            first = _fly(env, seed, swarm)
            assert _fly(env, seed, swarm) == first, "the same seed gives a different mission"
            _check_snapshot(_env(swarm, rules, STEPS), _env(swarm, rules, STEPS), seed)
        _check_endurance(searcher, name, rules)
        for planner in (*PLANNERS, *PERSON_PLANNERS, "onnx"):
            _check_planner(planner, name, rules, seed)


def _env(
    swarm: tuple[str, ...], rules: str | Rules, steps: int, *, detection: float = 0.0
) -> SearchEnv:
    """Return an environment where drones end only by endurance or by leaving the grid."""
    corners = [(0, 0), (GRID - 1, GRID - 1), (GRID - 1, 0), (0, GRID - 1)]
    try:
        return parallel_env(
            rules=rules, grid_size=GRID, searchers=swarm, drones_positions=corners[: len(swarm)],
            person_initial_position=(GRID // 2, GRID // 2), probability_of_detection=detection,
            collisions=False, timestep_limit=steps,
        )  # fmt: skip
    except FieldError as error:
        raise AssertionError(f"a scenario with the kind is refused: {error}") from None


@dataclass
class _Flight:
    """State of a drone derived from its commands.

    Attributes:
        kind: The drone's kind.
        needed: Steps that a move takes.
        heading: The move in progress, None for none.
        done: Steps of this move that are done.
        flown: Steps since the start.
    """

    kind: Searcher
    needed: int
    heading: int | None = None
    done: int = 0
    flown: int = 0


def _flights(env: SearchEnv) -> dict[str, _Flight]:
    scenario = env.scenario
    fastest = max(scenario.speeds)
    return {
        agent: _Flight(scenario.kinds[kind], whole_steps(fastest, scenario.speeds[kind]))
        for agent, kind in zip(env.possible_agents, scenario.kind_of, strict=True)
    }


def _fly(env: SearchEnv, seed: int, swarm: tuple[str, ...]) -> list[Any]:
    """Fly a mission with actions that the masks allow, check it, and return its results."""
    rng = np.random.default_rng(seed)
    flights = _flights(env)
    _, infos = env.reset(seed=seed)
    seen: list[Any] = []
    # Leave out the last step: the rules decide whether drones still act in it.
    for _ in range(STEPS - 1):
        if not env.agents:
            break
        before, agents = env.positions, list(env.agents)
        masks = {agent: infos[agent]["action_mask"] for agent in agents}
        for agent in agents:
            _check_mask(env, agent, masks[agent], flights[agent])
        joint = {agent: int(rng.choice(np.flatnonzero(masks[agent]))) for agent in agents}
        _, rewards, terminated, truncated, infos = env.step(joint)
        for agent in agents:
            if not terminated[agent]:
                number = env.possible_agents.index(agent)
                moved = env.positions[number] - before[number]
                _check_move(env, agent, joint[agent], moved, infos[agent], flights[agent])
        inside = (env.positions >= 0) & (env.positions < env.scenario.grid_size)
        assert inside.all(), "a drone has left the grid by an action that its mask allows"
        seen.append((joint, rewards, terminated, truncated, env.positions.tolist()))
    return seen


def _check_mask(env: SearchEnv, agent: str, mask: NDArray[np.int8], flight: _Flight) -> None:
    """Check the actions that a drone's mask allows."""
    allowed = np.flatnonzero(mask).tolist()
    names = [env.rules.actions[action] for action in allowed]
    assert allowed, f"{agent}: the action mask allows nothing"
    if flight.heading is not None:
        assert allowed == [flight.heading], (
            f"{agent}: under way with {env.rules.actions[flight.heading]} the action mask allows "
            f"{', '.join(names)}"
        )
    if flight.kind.moves is not None:
        others = [name for name in names if name not in (*flight.kind.moves, SEARCH)]
        assert not others, f"{agent}: the action mask allows {', '.join(others)}, no moves of its"


def _check_move(
    env: SearchEnv,
    agent: str,
    action: int,
    moved: NDArray[np.int64],
    info: dict[str, Any],
    flight: _Flight,
) -> None:
    """Check and record the effect of an action that the drone's mask allowed."""
    move = env.rules.action_set.moves[action]
    flight.flown += 1
    flight.done = flight.needed if move == (0, 0) else flight.done + 1
    arrives = flight.done >= flight.needed
    expected = move if arrives else (0, 0)
    status = info.get("status", "searching")
    limit = endurance_steps(flight.kind, env.scenario.step_duration_s)
    # A drone that has landed is taken out in the next step.
    in_time = not limit or flight.flown <= limit or "battery" in info
    assert in_time, f"{agent}: still in the search after its endurance of {limit} steps"
    assert tuple(moved.tolist()) == expected, (
        f"{agent}: step {flight.done} of the {flight.needed} of {env.rules.actions[action]} has "
        f"moved it by {moved.tolist()}, not by {list(expected)}"
    )
    ended = limit > 0 and flight.flown == limit
    wanted = "home" if ended else "searching" if arrives else "under_way"
    assert status == wanted, (
        f"{agent}: its status is {status!r} after step {flight.flown}, not {wanted!r}"
    )
    over = arrives or ended
    flight.heading, flight.done = (None, 0) if over else (action, flight.done)


def _check_snapshot(env: SearchEnv, twin: SearchEnv, seed: int) -> None:
    """Check that a mission continues from a snapshot, during moves too, with any commands."""
    rng = np.random.default_rng(seed)
    env.reset(seed=seed)
    for step in range(30):
        if step % 7 == 1:
            twin.restore(Snapshot.from_bytes(env.snapshot().to_bytes()))
        joint = rng.integers(0, len(env.rules.actions), len(env.possible_agents), np.int8)
        env.advance(joint)
        if step > 0:
            twin.advance(joint)
            same = env.world.state_bytes() == twin.world.state_bytes()
            assert same, f"step {step + 1} after a snapshot differs from the one without it"


def _check_endurance(searcher: Searcher, name: str, rules: str | Rules) -> None:
    """Check that a drone flies exactly as long as its endurance."""
    step_s = _env((name,), rules, STEPS).scenario.step_duration_s
    limit = endurance_steps(searcher, step_s)
    if not 0 < limit <= ENDURANCE_STEPS:
        return
    env = _env((name,), rules, limit + 10)
    env.reset(seed=0)
    search = env.rules.action_set.search
    steps = 0
    while env.agents and steps < limit + 5:
        env.step({agent: search for agent in env.agents})
        steps += 1
    assert steps == limit + 1, (
        f"its endurance is {limit} steps of {step_s:g} s; it was in the search for {steps - 1}"
    )


def _check_planner(planner: str, name: str, rules: str | Rules, seed: int) -> None:
    """Check that a planner commands two drones of a kind by their masks, and moves them."""
    # With a POD of 0 there is nothing to plan for.
    env = _env((name, name), rules, PLANNED_STEPS, detection=0.02)
    try:
        command = planner_for(env, planner, seed=seed, **EFFORT.get(planner, {}))
    except FieldError:
        # Its extra is not installed, or its model is for other rules.
        if planner in LOADED_PLANNERS and LOADED_PLANNERS[planner].libraries:
            return
        raise
    observations, infos = env.reset(seed=seed)
    # Other drones may reach no cell that is worth a search.
    crosses = all(env.scenario.kinds[0].can_do(name) for name in STRAIGHT)
    visited: dict[str, set[tuple[int, ...]]] = {agent: set() for agent in env.agents}
    for _ in range(PLANNED_STEPS):
        if not env.agents:
            return
        observations = {agent: observations[agent] for agent in env.agents}
        joint = command(observations, infos)
        for agent, action in joint.items():
            visited[agent].add(tuple(observations[agent][0].tolist()))
            assert infos[agent]["action_mask"][action], (
                f"{agent}: planner {planner} commands {env.rules.actions[action]} against its "
                "action mask"
            )
        observations, *_, infos = env.step(joint)
    for agent in env.agents if crosses else ():
        assert len(visited[agent]) > 1, (
            f"{agent}: planner {planner} leaves it in its start cell for {PLANNED_STEPS} steps"
        )
