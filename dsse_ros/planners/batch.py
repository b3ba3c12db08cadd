# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Thousands of missions with any planner.

Missions with equal observations share one planner until their observations differ, or until the
planner draws and the missions have different seeds. With one person, missions share a planner that
draws nothing to the end, because it can only learn from failed searches.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec
from dsse_ros.planners.belief import BeliefPlanner, Forecasts
from dsse_ros.planners.mission_batches import ALL, MissionBatch, PlayedMissions, batch_of
from dsse_ros.planners.planner import Planner, PlannerFactory, Shareable
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import check_task, load_planner
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.env_options import check_seed
from dsse_ros.world.scenario.scenario import ScenarioSource, scenario_and_rules
from dsse_ros.world.scenario.swarm import number_of


@dataclass
class _Group:
    """Missions that share a planner.

    Attributes:
        members: Numbers of the missions.
        seeds: Seeds of the planners, one for each member.
        planner: Planner that decides for all of them, made with the first seed.
        thread: Number of the thread that calls the planner.
        actions: Actions of the next step, by drone.
        drawn: Whether the seed of the planner has made a difference, or may have.
    """

    members: NDArray[np.int64]
    seeds: NDArray[np.int64]
    planner: Planner
    thread: int
    actions: dict[int, Any] = field(default_factory=dict)
    drawn: bool = True

    def decide(self, batch: MissionBatch) -> list[_Group]:
        """Choose the actions of the next step.

        Returns:
            The group, or one for each seed if the planner has drawn for the first time.
        """
        if self.drawn or not isinstance(self.planner, Shareable):
            self._decide(batch)
            return [self]
        seeds = np.unique(self.seeds).tolist()
        before = self.planner.copy() if len(seeds) > 1 else self.planner
        self._decide(batch)
        self.drawn = self.planner.drawn
        if not self.drawn or len(seeds) == 1:
            return [self]
        groups = []
        for seed in seeds:
            chosen = self.seeds == seed
            group = replace(self, members=self.members[chosen], seeds=self.seeds[chosen])
            if seed != self.seeds[0]:
                group.planner = before.with_seed(seed)
                group._decide(batch)
            groups.append(group)
        return groups

    def _decide(self, batch: MissionBatch) -> None:
        """Get the actions of the next step from the planner."""
        observations, infos = batch.observe(int(self.members[0]))
        chosen = self.planner(observations, infos)
        self.actions = {number_of(name): batch.action_of(name, chosen) for name in observations}

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
            if not self.drawn and isinstance(self.planner, Shareable):
                planner: Planner = self.planner.with_seed(int(seeds[chosen][0]))
            else:
                planner = self.planner if k == len(views) - 1 else _copied(self.planner)
            groups.append(
                replace(self, members=members[chosen], seeds=seeds[chosen], planner=planner)
            )
        return groups


def _copied(planner: Planner) -> Planner:
    return planner.copy() if isinstance(planner, Shareable) else copy.deepcopy(planner)


class SharedPlanners:
    """The planners of the missions of a batch: a planner of the batch, for one `play`.

    Args:
        make: Makes a planner with a seed.
        seeds: (M,) seed of the planner of each mission.
        threads: Number of threads that call the planners.
        pool: The threads.
    """

    def __init__(
        self,
        make: Callable[[int], Planner],
        seeds: NDArray[np.int64],
        threads: int,
        pool: ThreadPoolExecutor,
    ) -> None:
        self._groups, self._pool = list(_groups(make, seeds, threads)), pool

    def __call__(
        self, observations: Mapping[str, MissionBatch], infos: Mapping[str, Any]
    ) -> dict[str, NDArray[Any]]:
        """Return the actions (M, N) of all drones, by `ALL`; note the seeds that made them."""
        batch = observations[ALL]
        parts = [part for group in self._groups for part in group.split(batch.world)]

        def decide(thread: int) -> list[_Group]:
            """Decide for the groups of a thread, one after the other."""
            of_thread = [part for part in parts if part.thread == thread]
            return [group for part in of_thread for group in part.decide(batch)]

        decided = self._pool.map(decide, sorted({part.thread for part in parts}))
        self._groups = [group for of_thread in decided for group in of_thread]
        joint = batch.nothing()
        for group in self._groups:
            if group.drawn:
                batch.results.planner_seeds[group.members] = group.seeds
            for drone, action in group.actions.items():
                joint[group.members, drone] = action
        return {ALL: joint}


def _groups(
    make: Callable[[int], Planner], seeds: NDArray[np.int64], threads: int
) -> Iterator[_Group]:
    """Yield the missions that start with one planner.

    Args:
        make: Makes a planner with a seed.
        seeds: (M,) seed of the planner of each mission.
        threads: Number of threads that call the planners.
    """
    shared = isinstance(make(0), Shareable)
    parts: list[tuple[NDArray[np.int64], int]] = []
    if shared:
        for thread in range(min(threads, len(seeds))):
            parts.append((np.arange(thread, len(seeds), threads), thread))
    else:
        for k, seed in enumerate(dict.fromkeys(seeds.tolist())):
            parts.append((np.flatnonzero(seeds == seed), k % threads))
    # One per thread: forecasts are large, and not safe to share between threads.
    forecasts: dict[int, Forecasts] = {}
    for members, thread in parts:
        planner = make(int(seeds[members[0]]))
        if isinstance(planner, BeliefPlanner):
            planner.forecasts = forecasts.setdefault(thread, planner.forecasts)
        yield _Group(members, seeds[members], planner, thread, drawn=not shared)


def _checked_seeds(
    seed: int | Sequence[int], planner_seeds: Sequence[int] | None, count: int
) -> tuple[list[int], NDArray[np.int64]]:
    """Return the seeds of the missions and those of their planners, one for each."""
    if isinstance(seed, int | np.integer) or np.ndim(seed) == 0:
        first = check_seed(seed)
        seeds = list(range(first, first + count))
    else:
        seeds = [check_seed(value) for value in seed]
    if len(seeds) != count:
        raise FieldError(f"seed must be one number for each of {count} missions, got {len(seeds)}")
    of_planners = seeds if planner_seeds is None else [check_seed(value) for value in planner_seeds]
    if not of_planners:
        raise FieldError("planner_seeds must be one or more, got none")
    if max(of_planners) >= 2**63:
        raise FieldError(f"planner_seeds must be less than 2^63, got {max(of_planners)}")
    return seeds, np.resize(np.asarray(of_planners, np.int64), count)


def play_missions(
    count: int,
    planner: str | PlannerFactory,
    scenario: ScenarioSource = None,
    *,
    seed: int | Sequence[int] = 0,
    planner_seeds: Sequence[int] | None = None,
    options: Mapping[str, Any] | None = None,
    threads: int = 1,
    **fields: Any,
) -> PlayedMissions:
    """Play missions to their ends, each as `play.play` plays it in an environment.

    Args:
        count: M.
        planner: One of `PLANNER_NAMES`, or a factory, which may give the planner another search to
            assume. Unless the planner is `Shareable`, `copy.deepcopy` must copy its state.
        scenario: As in `parallel_env`.
        seed: Mission m equals that of an environment seeded with seed + m, or with seed[m].
        planner_seeds: Seeds that the missions take in turn: mission m uses
            `planner_for(env, planner, seed=planner_seeds[m % len(planner_seeds)])`. By default the
            planner of each mission has the mission's seed. Missions that share a planner seed are
            not independent samples of a planner that draws.
        options: Options of the planner.
        threads: Number of threads.
        fields: `rules` and other fields, as in `parallel_env`.

    Raises:
        FieldError: If scenario or rules are not allowed, or the planner cannot be loaded.
    """
    count = Spec("int", "", low=1).check("count", count)
    threads = Spec("int", "", low=1, high=1024).check("threads", threads)
    factory = load_planner(planner) if isinstance(planner, str) else planner
    chosen, chosen_rules = scenario_and_rules(scenario, **fields)
    if isinstance(planner, str):
        check_task(planner, chosen_rules)
    seeds, of_planners = _checked_seeds(seed, planner_seeds, count)
    search = SearchDefinition(chosen_rules, chosen)
    world = World(chosen, chosen_rules, count, write_maps=False, threads=threads)
    batch = batch_of(world)
    with ThreadPoolExecutor(threads) as pool:
        planners = SharedPlanners(
            lambda each: factory(search, seed=each, **(options or {})), of_planners, threads, pool
        )
        for _ in play(batch, planners, seed=seeds):
            pass
    world.close()
    batch.results.path_length_m[:] *= world.scenario.cell_size
    return batch.results
