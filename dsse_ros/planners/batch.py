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
from dsse_ros.planners.planner import Planner, PlannerFactory, Shareable
from dsse_ros.planners.registry import check_task, load_planner
from dsse_ros.scenario.definition import SearchDefinition
from dsse_ros.scenario.fields import FieldError, Spec
from dsse_ros.scenario.options import check_seed
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ScenarioSource, scenario_and_rules
from dsse_ros.scenario.swarm import number_of
from dsse_ros.search.agent_actions import action_of
from dsse_ros.search.observation import AgentObservation, Observation, Started, agent_infos
from dsse_ros.search.world import HOLD, World


@dataclass(frozen=True)
class PlayedMissions:
    """Results of M missions.

    Attributes:
        found: (M,) bool, whether every person was found.
        steps: (M,) int64, steps until the end; the limit if not every person was found. With rules
            that let drones act after the limit (`v1`), a find may come later than that.
        lost: (M,) int64, drones that had collided, left the grid or been withdrawn at the end;
            0 if every person was found.
        path_length_m: (M,) float64, distance that all drones flew until the end, from cell centre
            to cell centre; in metres along their paths.
        collisions: (M,) int64, pairs of active drones in the same cell after a step, summed over
            the steps; 0 in metres.
        planner_seeds: (M,) int64, seed of the planner; -1 if it drew nothing, so that any seed
            would have given the same mission.
    """

    found: NDArray[np.bool_]
    steps: NDArray[np.int64]
    lost: NDArray[np.int64]
    path_length_m: NDArray[np.float64]
    collisions: NDArray[np.int64]
    planner_seeds: NDArray[np.int64]


class MissionBatch:
    """M missions that are stepped together: what their drones observe, and their results.

    Attributes:
        world: The missions.
        results: Of the missions so far; path lengths are in cells.
    """

    def __init__(self, world: World) -> None:
        self.world, count = world, world.num_worlds
        self.results = PlayedMissions(
            np.zeros(count, bool), np.full(count, world.scenario.timestep_limit),
            np.zeros(count, np.int64), np.zeros(count), np.zeros(count, np.int64),
            np.full(count, -1),
        )  # fmt: skip
        self._going = np.ones(count, bool)
        self._step = 0
        self._names = [f"drone{n}" for n in range(world.num_drones)]
        self._fault_masks: NDArray[np.int8] | None = None
        self._probability = np.empty((0, 0), np.float32)

    def look(self) -> None:
        """Prepare what all missions share of the next observations."""
        world = self.world
        # The map depends on no person, so all missions share it unless cells are covered.
        first = int(np.argmax(self._going))
        self._probability = world.map_of(first)
        if world.faults is not None:
            self._fault_masks = world.action_masks()

    def observe(self, mission: int, last: Mapping[int, int]) -> Started:
        """Return what the live drones of a mission observe, after `look`.

        Args:
            mission: Number of the mission.
            last: Last action of each drone, by its number.
        """
        world, drones = self.world, self.world.drones[mission]
        live = np.flatnonzero(~(drones["terminated"] | drones["truncated"])).tolist()
        cells = np.stack([drones["x"], drones["y"]], axis=1)
        if self._fault_masks is None or world.faults is None:
            table = world.mask_table
            masks: Iterable[NDArray[np.int8]] = [table[y][x] for x, y in cells[live].tolist()]
        else:
            masks, cells = self._fault_masks[mission, live], world.faults.positions()[mission]
        seen = self._probability if world.coverage is None else world.map_of(mission)
        names = [self._names[n] for n in live]
        observations: dict[str, AgentObservation] = {
            name: Observation(cells[n].copy(), seen) for name, n in zip(names, live, strict=True)
        }
        infos = agent_infos(names, False, masks, world.info_columns(mission, live))
        for n, info in zip(live, infos.values(), strict=True):
            info["step"] = self._step
            if n in last:
                info.setdefault("action", last[n])
        return observations, infos

    def action_of(self, agent: str, actions: Mapping[str, Any]) -> Any:
        """Return the action of an agent, checked.

        Raises:
            FieldError: If it is missing or not allowed.
        """
        return action_of(self.world.rules, agent, actions)

    def nothing(self) -> NDArray[Any]:
        """Return the actions (M, N) of drones that do nothing."""
        return np.full(self.world.drones.shape, HOLD, np.int8)

    def fly(self, joint: NDArray[Any]) -> NDArray[np.float64]:
        """Advance the world by actions (M, N); return how far each drone flew, (M, N) in cells."""
        world = self.world
        x, y = world.drones["x"].copy(), world.drones["y"].copy()
        world.step(joint)
        return np.hypot(world.drones["x"] - x, world.drones["y"] - y)

    def step(self, joint: NDArray[Any]) -> None:
        """Advance all missions by one step, and note the results of those that go on.

        Worlds step on after their mission has ended; those steps do not count.

        Args:
            joint: (M, N), the actions.
        """
        world, results, going = self.world, self.results, self._going
        here = going[:, None] & ~(world.terminated | world.truncated)
        legs = self.fly(joint) * here
        self._step += 1
        for drone in range(world.num_drones):
            results.path_length_m[:] += legs[:, drone]
        if not world.rules.in_metres:
            results.collisions[:] += _collisions(world.drones, here & ~world.drones["clear"])
        done = world.worlds["done"]
        found = going & done & (world.worlds["num_missing"] == 0)
        results.found[found] = True
        results.steps[found] = self._step
        if self._step <= world.rules.last_step(world.scenario.timestep_limit):
            # The end of the time terminates nobody.
            results.lost[going] = world.terminated[going].sum(axis=1)
        results.lost[found] = 0
        self._going = going & ~done


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
        before, actions = self.planner.copy() if len(seeds) > 1 else self.planner, self.actions
        self._decide(batch)
        self.drawn = self.planner.drawn
        if not self.drawn or len(seeds) == 1:
            return [self]
        groups = []
        for seed in seeds:
            chosen = self.seeds == seed
            group = replace(self, members=self.members[chosen], seeds=self.seeds[chosen])
            if seed != self.seeds[0]:
                group.planner, group.actions = before.with_seed(seed), actions
                group._decide(batch)
            groups.append(group)
        return groups

    def _decide(self, batch: MissionBatch) -> None:
        """Get the actions of the next step from the planner."""
        observations, infos = batch.observe(int(self.members[0]), self.actions)
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
    return planner.copy() if isinstance(planner, Shareable) else copy.deepcopy(planner)


def _each(
    pool: ThreadPoolExecutor, do: Callable[[_Group], list[_Group]], groups: Sequence[_Group]
) -> list[_Group]:
    """Return what every group makes; each thread handles its groups one after the other."""

    def do_those_of(thread: int) -> list[_Group]:
        return [part for group in groups if group.thread == thread for part in do(group)]

    threads = sorted({group.thread for group in groups})
    return [part for of_thread in pool.map(do_those_of, threads) for part in of_thread]


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
    """Return the seeds of the missions and those of their planners, one for each.

    Raises:
        FieldError: If one is not allowed.
    """
    if isinstance(seed, int | np.integer) or np.ndim(seed) == 0:
        first = check_seed(seed)
        seeds = list(range(first, first + count))
    else:
        seeds = [check_seed(one) for one in seed]
    if len(seeds) != count:
        raise FieldError(f"seed must be one number for each of {count} missions, got {len(seeds)}")
    of_planners = seeds if planner_seeds is None else [check_seed(one) for one in planner_seeds]
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
    rules: str | Rules = "auto",
    seed: int | Sequence[int] = 0,
    planner_seeds: Sequence[int] | None = None,
    options: Mapping[str, Any] | None = None,
    withdraw_at: int | None = None,
    threads: int = 1,
    **fields: object,
) -> PlayedMissions:
    """Play missions to their ends, each as `play.play` plays it in an environment.

    Args:
        count: M.
        planner: One of `PLANNER_NAMES`, or a factory, which may give the planner another search to
            assume. Unless the planner is `Shareable`, `copy.deepcopy` must copy its state.
        scenario: As in `parallel_env`.
        rules: As in `parallel_env`.
        seed: Mission m equals that of an environment seeded with seed + m, or with seed[m].
        planner_seeds: Seeds that the missions take in turn: mission m uses
            `planner_for(env, planner, seed=planner_seeds[m % len(planner_seeds)])`. By default the
            planner of each mission has the mission's seed. Missions that share a planner seed are
            not independent samples of a planner that draws.
        options: Options of the planner.
        withdraw_at: Step after which the last drone of each mission is withdrawn, see
            `SearchEnv.withdraw`.
        threads: Number of threads.
        fields: As in `parallel_env`.

    Raises:
        FieldError: If scenario or rules are not allowed, or the planner cannot be loaded.
    """
    count = Spec("int", "", low=1).check("count", count)
    threads = Spec("int", "", low=1, high=1024).check("threads", threads)
    withdraw_at = Spec("int", "", low=1, optional=True).check("withdraw_at", withdraw_at)
    factory = load_planner(planner) if isinstance(planner, str) else planner
    chosen, chosen_rules = scenario_and_rules(scenario, rules, **fields)
    if isinstance(planner, str):
        check_task(planner, chosen_rules)
    seeds, of_planners = _checked_seeds(seed, planner_seeds, count)
    search = SearchDefinition(chosen_rules, chosen)
    world = World(chosen, chosen_rules, count, write_maps=False, threads=threads)
    world.seed(seeds)
    world.reset()
    batch = _batch_of(world)
    groups = list(
        _groups(lambda one: factory(search, seed=one, **(options or {})), of_planners, threads)
    )
    _play(batch, groups, withdraw_at, threads)
    world.close()
    batch.results.path_length_m[:] *= world.scenario.cell_size
    return batch.results


def _play(
    batch: MissionBatch, groups: Sequence[_Group], withdraw_at: int | None, threads: int
) -> None:
    """Play the missions of a batch to their ends; the arguments are those of `play_missions`."""
    world = batch.world
    if world.faults is not None:
        # Drones may observe different positions from the start.
        groups = [part for group in groups for part in group.split(world)]
    with ThreadPoolExecutor(threads) as pool:
        for step in range(1, world.rules.last_acting_step(world.scenario.timestep_limit) + 1):
            batch.look()
            groups = _each(pool, lambda group: group.decide(batch), groups)
            batch.step(_joint(batch, groups))
            if step == withdraw_at:
                world.withdraw(world.num_drones - 1)
            groups = [part for group in groups for part in group.split(world)]
            if not groups:
                break


def _batch_of(world: World) -> MissionBatch:
    if world.rules.in_metres:
        # It extends this module.
        from dsse_ros.planners.flight_batch import FlightBatch

        return FlightBatch(world)
    return MissionBatch(world)


def _joint(batch: MissionBatch, groups: Sequence[_Group]) -> NDArray[Any]:
    """Return the actions (M, N) that the groups have chosen; note the seeds that made them."""
    joint = batch.nothing()
    for group in groups:
        if group.drawn:
            batch.results.planner_seeds[group.members] = group.seeds
        for drone, action in group.actions.items():
            joint[group.members, drone] = action
    return joint
