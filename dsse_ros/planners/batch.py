# SPDX-License-Identifier: Apache-2.0
"""Thousands of missions with the planners on a belief.

Missions whose planners have the same seed and have seen the same are at one mind: they share one
belief and one plan until what they see differs. With one person that is to the end, as failed
searches are all there is to learn from.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.beam_search import BeamOptions
from dsse_ros.planners.belief import BeamOnBelief, GreedyOnBelief, Tactic, TacticFactory
from dsse_ros.search.actions import Cell
from dsse_ros.search.belief import Belief, Forecast
from dsse_ros.search.rules import Rules
from dsse_ros.search.scenario import ScenarioSource, scenario_and_rules
from dsse_ros.search.world import HOLD, World

TACTICS: dict[str, TacticFactory] = {
    "belief": BeamOnBelief(BeamOptions()),
    "belief_greedy": GreedyOnBelief(),
}


@dataclass(frozen=True)
class Missions:
    """What M missions came to.

    Attributes:
        found: (M,) bool, whether every person was found.
        steps: (M,) int64, steps until the end; the limit where not every person was found.
        lost: (M,) int64, drones that had collided or left the grid when it ended; of missions in
            which every person was found, 0.
    """

    found: NDArray[np.bool_]
    steps: NDArray[np.int64]
    lost: NDArray[np.int64]


@dataclass
class _Group:
    """Missions at one mind."""

    members: NDArray[np.int64]
    belief: Belief
    tactic: Tactic
    agents: list[int]
    present: list[Cell]
    ends: list[Cell]

    def plan(self) -> None:
        self.ends = self.tactic(self.belief, self.agents, self.present)

    def learn(self) -> None:
        searched = [a for a, b in zip(self.present, self.ends, strict=True) if a == b]
        self.belief.observe_failed_searches(searched)
        self.belief.advance()

    def split(self, world: World) -> list[_Group]:
        """Return the groups that this one has become; missions that have ended are in none."""
        members = self.members[~world.worlds["done"][self.members]]
        if not len(members):
            return []
        drones = world.drones[members]
        seen = np.stack([drones["alive"], drones["x"], drones["y"]], axis=-1).reshape(
            len(members), -1
        )
        views, of_view = np.unique(seen, axis=0, return_inverse=True)
        groups = []
        for k, view in enumerate(views.reshape(len(views), -1, 3).tolist()):
            last = k == len(views) - 1
            agents = [n for n, (alive, _, _) in enumerate(view) if alive]
            present = [(x, y) for alive, x, y in view if alive]
            groups.append(
                _Group(
                    members[of_view.ravel() == k],
                    self.belief if last else self.belief.copy(),
                    self.tactic if last else self.tactic.copy(),
                    agents,
                    present,
                    present,
                )
            )
        return groups


def _each(
    pool: ThreadPoolExecutor,
    do: Callable[[_Group], None],
    groups: Sequence[_Group],
    forecasts: Sequence[Forecast],
) -> None:
    """Do something with every group, those of one forecast one after the other."""

    def do_those_of(forecast: Forecast) -> None:
        for group in groups:
            if group.belief.forecast is forecast:
                do(group)

    list(pool.map(do_those_of, forecasts))


def play_missions(
    count: int,
    planner: str | TacticFactory,
    scenario: ScenarioSource = None,
    *,
    rules: str | Rules = "paper",
    seed: int = 0,
    planner_seeds: Sequence[int] = (0,),
    threads: int = 1,
    **fields: object,
) -> Missions:
    """Play missions to their ends.

    Args:
        count: M.
        planner: `belief`, `belief_greedy`, or what makes another tactic.
        scenario: As in `parallel_env`.
        rules: As in `parallel_env`.
        seed: Mission m is that of an environment seeded with seed + m.
        planner_seeds: Dealt to the missions in turn: mission m is that of
            `planner_for(env, planner, seed=planner_seeds[m % len(planner_seeds)])`.
        threads: How many threads share the work.
        fields: As in `parallel_env`.

    Raises:
        FieldError: If scenario or rules are not allowed.
        ValueError: If the planner is unknown.
    """
    if isinstance(planner, str):
        if planner not in TACTICS:
            raise ValueError(f"planner: {planner!r} is not known; one of {', '.join(TACTICS)}")
        planner = TACTICS[planner]
    chosen, chosen_rules = scenario_and_rules(scenario, rules, **fields)
    world = World(chosen, chosen_rules, count, write_maps=False, threads=threads)
    world.seed(seed)
    world.reset()
    limit = world.scenario.timestep_limit
    # One for each thread: while one reads its tables another would write them.
    forecasts = [
        Forecast(
            chosen,
            chosen_rules,
            horizon=planner.horizon(chosen_rules),
            drift_samples=planner.drift_samples,
        )
        for _ in range(threads)
    ]
    starts = [Belief(forecast) for forecast in forecasts]
    cells = list(world.scenario.drones_positions)
    dealt = np.arange(count) % len(planner_seeds)
    groups: list[_Group] = []
    for k, planner_seed in enumerate(planner_seeds[:count]):
        forecast, start = forecasts[k % threads], starts[k % threads]
        tactic = planner.start(forecast, planner_seed)
        agents = list(range(len(cells)))
        members = np.flatnonzero(dealt == k)
        groups.append(_Group(members, start.copy(), tactic, agents, cells, cells))
    action_set = chosen_rules.action_set
    steps = np.full(count, limit)
    going = np.ones(count, bool)
    found = np.zeros(count, bool)
    lost = np.zeros(count, np.int64)
    with ThreadPoolExecutor(threads) as pool:
        for step in range(limit):
            _each(pool, _Group.plan, groups, forecasts)
            actions = np.full(world.drones.shape, HOLD, np.int8)
            for group in groups:
                for agent, cell, end in zip(group.agents, group.present, group.ends, strict=True):
                    actions[group.members, agent] = action_set.action(cell, end)
            world.step(actions)
            _each(pool, _Group.learn, groups, forecasts)
            groups = [part for group in groups for part in group.split(world)]
            # A world that goes on after its end does not count any more.
            now_found = going & (world.worlds["num_missing"] == 0)
            found |= now_found
            steps[now_found] = step + 1
            lost[going] = world.terminated[going].sum(axis=1)
            lost[found] = 0
            going &= ~world.worlds["done"]
            if not going.any():
                break
    world.close()
    return Missions(found, steps, lost)
