# SPDX-License-Identifier: Apache-2.0
"""Thousands of missions with any planner, each decision made once for all that have seen the same.

A planner knows what it has observed. With one person that is the same in all missions until one
finds it, so that missions with one seed of the planner share its decisions; where observations
differ, each group goes on with a copy of the planner.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners import Observation, Planner, Search, planner_for
from dsse_ros.search import HOLD, Rules, Scenario
from dsse_ros.search.world import World


@dataclass(frozen=True)
class Missions:
    """What M missions came to.

    Attributes:
        found: (M,) bool, whether every person was found.
        steps: (M,) steps until the end; the limit where not every person was found.
        lost: (M,) drones that collided or left the grid.
    """

    found: NDArray[np.bool_]
    steps: NDArray[np.int64]
    lost: NDArray[np.int64]


@dataclass
class _Group:
    """Missions that have seen the same."""

    members: NDArray[np.int64]
    planner: Planner
    infos: dict[str, dict[str, object]]


def play(
    name: str,
    scenario: Scenario,
    rules: Rules,
    seeds: Sequence[int],
    *,
    assumed: Scenario | None = None,
    planner_seeds: int = 1,
    withdraw_at: int | None = None,
) -> Missions:
    """Play missions to their ends.

    Args:
        name: Of the planner.
        scenario: Of the world.
        rules: Of the world.
        seeds: (M,) of the missions: each is that of an environment seeded with it.
        assumed: The scenario that the planner is given, by default that of the world.
        planner_seeds: How many seeds of the planner are dealt to the missions in turn.
        withdraw_at: Step after which the last drone is withdrawn from each mission.
    """
    count = len(seeds)
    world = World(scenario, rules, count, reuse_maps=True)
    world.seed(seeds)
    world.reset()
    limit = world.scenario.timestep_limit
    agents = [f"drone{i}" for i in range(world.drones.shape[1])]
    actions = rules.action_set.within(world.scenario.area_mask)
    masks = actions.masks(world.scenario.grid_size)
    search: Search = SimpleNamespace(rules=rules, scenario=assumed or scenario)
    groups = [
        _Group(np.arange(k, count, planner_seeds), planner_for(search, name, seed=k), {})
        for k in range(min(planner_seeds, count))
    ]
    steps = np.full(count, limit)
    found = np.zeros(count, bool)
    lost = np.zeros(count, np.int64)
    for step in range(limit):
        joint = np.full(world.drones.shape, HOLD, np.int8)
        for group in groups:
            first = group.members[0]
            drones, probability = world.drones[first], world.maps[first]
            live = np.flatnonzero(~(drones["terminated"] | drones["truncated"])).tolist()
            cells = {n: (int(drones["x"][n]), int(drones["y"][n])) for n in live}
            observations = {agents[n]: Observation(np.array(cells[n]), probability) for n in live}
            infos = {
                agents[n]: {
                    "Found": False,
                    "action_mask": masks[cells[n][1]][cells[n][0]],
                    "step": step,
                    **group.infos.get(agents[n], {}),
                }
                for n in live
            }
            chosen = group.planner(observations, infos)
            for n in live:
                joint[group.members, n] = chosen[agents[n]]
            group.infos = {agent: {"action": chosen[agent]} for agent in chosen}
        going = np.concatenate([group.members for group in groups])
        world.step(joint)
        ended = going[world.worlds["done"][going]]
        found[ended] = world.worlds["num_missing"][ended] == 0
        steps[ended] = np.where(found[ended], step + 1, limit)
        lost[ended] = (world.terminated[ended] & ~found[ended, None]).sum(axis=1)
        if withdraw_at == step + 1:
            # As `SearchEnv.withdraw`: the next step terminates it.
            world.worlds["num_active"] -= world.drones["alive"][:, -1]
            world.drones["alive"][:, -1] = False
        groups = [part for group in groups for part in _split(group, world)]
        if not groups:
            break
    world.close()
    return Missions(found, steps, lost)


def _split(group: _Group, world: World) -> Sequence[_Group]:
    """Return the groups that this one has become; missions that have ended are in none."""
    members = group.members[~world.worlds["done"][group.members]]
    if not len(members):
        return []
    drones = world.drones[members]
    gone = drones["terminated"] | drones["truncated"]
    seen = np.stack([gone, drones["x"], drones["y"]], axis=-1)
    views, of_view = np.unique(seen.reshape(len(members), -1), axis=0, return_inverse=True)
    if len(views) == 1:
        return [_Group(members, group.planner, group.infos)]
    return [
        _Group(members[of_view.ravel() == k], copy.deepcopy(group.planner), group.infos)
        for k in range(len(views))
    ]
