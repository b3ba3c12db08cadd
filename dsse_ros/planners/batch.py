# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Thousands of missions with any planner.

Missions with equal observations share one planner until their observations differ, or until the
planner draws and the missions have different seeds. With one person, missions share a planner that
draws nothing to the end, because it can only learn from failed searches.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.belief import BeliefPlanner, Forecasts
from dsse_ros.planners.planner import Planner, PlannerFactory, SharedPlanner
from dsse_ros.planners.registry import check_task, load_planner
from dsse_ros.scenario.definition import SearchDefinition
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario, ScenarioSource, scenario_and_rules
from dsse_ros.search.observation import Observation, agent_infos
from dsse_ros.search.world import HOLD, World


@dataclass(frozen=True)
class Missions:
    """Results of M missions.

    Attributes:
        found: (M,) bool, whether every person was found.
        steps: (M,) int64, steps until the end; the limit if not every person was found.
        lost: (M,) int64, drones that had collided, left the grid or been withdrawn at the end;
            0 if every person was found.
        path_length_m: (M,) float64, distance that all drones flew until the end, from cell centre
            to cell centre.
        collisions: (M,) int64, pairs of active drones in the same cell after a step, summed over
            the steps.
        planner_seeds: (M,) int64, seed of the planner; -1 if it drew nothing, so that any seed
            would have given the same mission.
    """

    found: NDArray[np.bool_]
    steps: NDArray[np.int64]
    lost: NDArray[np.int64]
    path_length_m: NDArray[np.float64]
    collisions: NDArray[np.int64]
    planner_seeds: NDArray[np.int64]


@dataclass
class _Group:
    """Missions that share a planner.

    Attributes:
        members: Numbers of the missions.
        seeds: Seeds of the planners, one for each member.
        planner: Planner that decides for all of them, made with the first seed.
        thread: Number of the thread that calls the planner.
        actions: Actions of the last step, by drone.
        drawn: Whether the seed of the planner has made a difference, or may have.
    """

    members: NDArray[np.int64]
    seeds: NDArray[np.int64]
    planner: Planner
    thread: int
    actions: dict[int, int] = field(default_factory=dict)
    drawn: bool = True

    def decide(self, *of_step: Any) -> list[_Group]:
        """Choose the actions of the next step, see `_decide`.

        Returns:
            The group, or one for each seed if the planner has drawn for the first time.
        """
        if self.drawn or not isinstance(self.planner, SharedPlanner):
            self._decide(*of_step)
            return [self]
        seeds = np.unique(self.seeds).tolist()
        before, actions = self.planner.copy() if len(seeds) > 1 else self.planner, self.actions
        self._decide(*of_step)
        self.drawn = self.planner.drawn
        if not self.drawn or len(seeds) == 1:
            return [self]
        groups = []
        for seed in seeds:
            chosen = self.seeds == seed
            group = replace(self, members=self.members[chosen], seeds=self.seeds[chosen])
            if seed != self.seeds[0]:
                group.planner, group.actions = before.with_seed(seed), actions
                group._decide(*of_step)
            groups.append(group)
        return groups

    def _decide(
        self,
        world: World,
        names: Sequence[str],
        masks: Sequence[Sequence[NDArray[np.int8]]],
        fault_masks: NDArray[np.int8] | None,
        probability: NDArray[np.float32],
        step: int,
    ) -> None:
        """Get the actions of the next step from the planner."""
        first = int(self.members[0])
        drones = world.drones[first]
        live = np.flatnonzero(~(drones["terminated"] | drones["truncated"])).tolist()
        agents, cells = [names[n] for n in live], np.stack([drones["x"], drones["y"]], axis=1)
        if world.faults is None or fault_masks is None:
            of_drones: Iterable[NDArray[np.int8]] = [masks[y][x] for x, y in cells[live].tolist()]
        else:
            of_drones, cells = fault_masks[first, live], world.faults.positions()[first]
        infos = agent_infos(agents, False, of_drones, world.info_columns(first, live))
        for agent, n in zip(agents, live, strict=True):
            infos[agent]["step"] = step
            if n in self.actions:
                infos[agent].setdefault("action", self.actions[n])
        observations = {names[n]: Observation(cells[n].copy(), probability) for n in live}
        chosen = self.planner(observations, infos)
        self.actions = {n: chosen[names[n]] for n in live}

    def split(self, world: World) -> list[_Group]:
        """Split the group by observation; missions that have ended are in no group."""
        going = ~world.worlds["done"][self.members]
        members, seeds = self.members[going], self.seeds[going]
        if not len(members):
            return []
        if len(self.members) == 1:
            return [self]
        drones = world.drones[members]
        gone = drones["terminated"] | drones["truncated"]
        parts = [gone, drones["x"], drones["y"], drones["found"]]
        if world.looks.several:
            parts.append(np.where(drones["found"], world.finds[members], 0).astype(np.int64))
        if world.faults is not None:
            conditions = world.faults.conditions[members]
            names = ("seen_x", "seen_y", "status", "applied", "battery")
            parts += [conditions[name] for name in names]
        seen = np.stack(parts, axis=-1)
        views, of_view = np.unique(seen.reshape(len(members), -1), axis=0, return_inverse=True)
        groups = []
        for k in range(len(views)):
            chosen = of_view.ravel() == k
            if not self.drawn and isinstance(self.planner, SharedPlanner):
                planner: Planner = self.planner.with_seed(int(seeds[chosen][0]))
            else:
                planner = self.planner if k == len(views) - 1 else _copied(self.planner)
            groups.append(
                replace(self, members=members[chosen], seeds=seeds[chosen], planner=planner)
            )
        return groups


def _collisions(drones: NDArray[np.void], here: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the number of pairs, (M,), of drones in the same cell that are `here`, (M, N)."""
    col, row = drones["x"].astype(np.int64), drones["y"].astype(np.int64)
    # Give each of the other drones a place of its own.
    away = -1 - np.arange(drones.shape[1])
    cells = np.sort(np.where(here, (row << 32) + col, away << 48), axis=1)
    pairs = np.zeros(len(cells), np.int64)
    for apart in range(1, cells.shape[1]):
        same = (cells[:, apart:] == cells[:, :-apart]).sum(axis=1)
        if not same.any():
            break
        pairs += same
    return pairs


def _copied(planner: Planner) -> Planner:
    return planner.copy() if isinstance(planner, SharedPlanner) else copy.deepcopy(planner)


def _each(
    pool: ThreadPoolExecutor, do: Callable[[_Group], list[_Group]], groups: Sequence[_Group]
) -> list[_Group]:
    """Return what every group makes; each thread handles its groups one after the other."""

    def do_those_of(thread: int) -> list[_Group]:
        return [made for group in groups if group.thread == thread for made in do(group)]

    threads = sorted({group.thread for group in groups})
    return [made for of_thread in pool.map(do_those_of, threads) for made in of_thread]


def _shared(
    planner: Planner, seeds: NDArray[np.int64], threads: int
) -> Iterator[tuple[NDArray[np.int64], int]]:
    """Yield the missions that start with one planner, and the thread that calls it."""
    if isinstance(planner, SharedPlanner):
        for thread in range(min(threads, len(seeds))):
            yield np.arange(thread, len(seeds), threads), thread
        return
    for k, seed in enumerate(dict.fromkeys(seeds.tolist())):
        yield np.flatnonzero(seeds == seed), k % threads


def play_missions(
    count: int,
    planner: str | PlannerFactory,
    scenario: ScenarioSource = None,
    *,
    rules: str | Rules = "auto",
    seed: int | Sequence[int] = 0,
    planner_seeds: Sequence[int] | None = None,
    options: Mapping[str, Any] | None = None,
    assumed: Scenario | None = None,
    withdraw_at: int | None = None,
    threads: int = 1,
    **fields: object,
) -> Missions:
    """Play missions to their ends.

    Args:
        count: M.
        planner: One of `PLANNER_NAMES`, or a factory. Unless the planner is a `SharedPlanner`,
            `copy.deepcopy` must copy its state.
        scenario: As in `parallel_env`.
        rules: As in `parallel_env`.
        seed: Mission m equals that of an environment seeded with seed + m, or with seed[m].
        planner_seeds: Seeds that the missions take in turn: mission m uses
            `planner_for(env, planner, seed=planner_seeds[m % len(planner_seeds)])`. By default the
            planner of each mission has the mission's seed. Missions that share a planner seed are
            not independent samples of a planner that draws.
        options: Options of the planner.
        assumed: Scenario that the planner gets, by default that of the missions.
        withdraw_at: Step after which the last drone of each mission is withdrawn, see
            `SearchEnv.withdraw`.
        threads: Number of threads.
        fields: As in `parallel_env`.

    Raises:
        FieldError: If scenario or rules are not allowed, or the planner cannot be loaded.
    """
    make = load_planner(planner) if isinstance(planner, str) else planner
    chosen, chosen_rules = scenario_and_rules(scenario, rules, **fields)
    if isinstance(planner, str):
        check_task(planner, chosen_rules)
    search = SearchDefinition(chosen_rules, assumed or chosen)
    world = World(chosen, chosen_rules, count, write_maps=False, threads=threads)
    world.seed(seed)
    world.reset()
    names = [f"drone{n}" for n in range(world.num_drones)]
    masks = chosen_rules.action_set.within(world.scenario.area_mask).masks(world.grid_size)
    # One per thread: forecasts are large, and not safe to share between threads.
    forecasts: dict[int, Forecasts] = {}
    if planner_seeds is None:
        planner_seeds = [seed + m for m in range(count)] if isinstance(seed, int) else seed
    seeds = np.resize(np.asarray(planner_seeds, np.int64), count)
    groups = []
    for members, thread in _shared(make(search, seed=0, **(options or {})), seeds, threads):
        made = make(search, seed=int(seeds[members[0]]), **(options or {}))
        if isinstance(made, BeliefPlanner):
            made.forecasts = forecasts.setdefault(thread, made.forecasts)
        drawn = not isinstance(made, SharedPlanner)
        groups.append(_Group(members, seeds[members], made, thread, drawn=drawn))
    actions = len(chosen_rules.actions)
    fault_masks = None
    if world.faults is not None:
        fault_masks = np.empty((*world.drones.shape, actions), np.int8)
        table = np.array(masks)
        # Drones may observe different positions from the start.
        groups = [part for group in groups for part in group.split(world)]
    limit = world.scenario.timestep_limit
    steps = np.full(count, limit)
    going = np.ones(count, bool)
    found = np.zeros(count, bool)
    lost = np.zeros(count, np.int64)
    path_length, collisions = np.zeros(count), np.zeros(count, np.int64)
    drawn_by = np.full(count, -1)
    with ThreadPoolExecutor(threads) as pool:
        for step in range(limit):
            # The map depends on no person, so all missions share it unless cells are covered.
            probability = world.map_of(int(groups[0].members[0]))

            if world.faults is not None and fault_masks is not None:
                x, y = world.drones["x"], world.drones["y"]
                fault_masks[:] = table[y, x]
                world.faults.restrict(world, fault_masks)

            def decide(group: _Group) -> list[_Group]:
                seen = probability  # noqa: B023
                if world.coverage is not None:
                    seen = world.map_of(int(group.members[0]))
                return group.decide(world, names, masks, fault_masks, seen, step)  # noqa: B023

            groups = _each(pool, decide, groups)
            joint = np.full(world.drones.shape, HOLD, np.int8)
            for group in groups:
                if group.drawn:
                    drawn_by[group.members] = group.seeds
                for drone, action in group.actions.items():
                    joint[group.members, drone] = action
            here = going[:, None] & ~(world.terminated | world.truncated)
            x, y = world.drones["x"].copy(), world.drones["y"].copy()
            world.step(joint)
            legs = np.hypot(world.drones["x"] - x, world.drones["y"] - y) * here
            for drone in range(world.num_drones):
                path_length += legs[:, drone]
            collisions += _collisions(world.drones, here & ~world.drones["clear"])
            # Worlds step on after their mission has ended; those steps do not count.
            now_found = going & world.worlds["done"] & (world.worlds["num_missing"] == 0)
            found |= now_found
            steps[now_found] = step + 1
            lost[going] = world.terminated[going].sum(axis=1)
            lost[found] = 0
            going &= ~world.worlds["done"]
            if step + 1 == withdraw_at:
                # Like `SearchEnv.withdraw`: the next step terminates the drone.
                world.worlds["num_active"] -= world.drones["alive"][:, -1]
                world.drones["alive"][:, -1] = False
            groups = [part for group in groups for part in group.split(world)]
            if not groups:
                break
    world.close()
    path_length *= world.scenario.cell_size
    return Missions(found, steps, lost, path_length, collisions, drawn_by)
