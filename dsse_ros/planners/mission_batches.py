# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions that are stepped together, on cells and in metres, as planners observe them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.environments.agents import (
    AgentObservation,
    Observation,
    Started,
    agent_infos,
)
from dsse_ros.search.environments.metres_drones import MetresDrones
from dsse_ros.search.environments.space import STRAIGHT_ON, action_of, states_of, turn_and_speed_of
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.constants import NO_ACTION


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


ALL = "missions"
"""The agent of a `MissionBatch`."""


class MissionBatch:
    """M missions that are stepped together: an environment for `play` with one agent, `ALL`.

    The agent observes the batch, and acts for all drones of all missions.

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
        self._step, self._last_step = 0, world.rules.last_acting_step(world.scenario.timestep_limit)
        self._joint = self.nothing()
        self._names = [f"drone{n}" for n in range(world.num_drones)]
        self._fault_masks: NDArray[np.int8] | None = None
        self._probability = np.empty((0, 0), np.float32)

    @property
    def agents(self) -> list[str]:
        """The agent, while a mission goes on."""
        return [ALL] if self._step < self._last_step and self._going.any() else []

    def reset(
        self, seed: Sequence[int] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, MissionBatch], dict[str, Any]]:
        """Start the missions, once, with a seed each; there are no options."""
        self.world.seed(seed)
        self.world.reset()
        self._look()
        return {ALL: self}, {ALL: {}}

    def _look(self) -> None:
        """Prepare what all missions share of their observations."""
        world = self.world
        # The map depends on no person, so all missions share it unless cells are covered.
        first = int(np.argmax(self._going))
        self._probability = world.map_of(first)
        if world.faults is not None:
            self._fault_masks = world.action_masks()

    def observe(self, mission: int) -> Started:
        """Return what the live drones of a mission observe."""
        drones = self.world.drones[mission]
        live = np.flatnonzero(~(drones["terminated"] | drones["truncated"])).tolist()
        columns = self.world.info_columns(mission, live)
        columns["step"] = [self._step] * len(live)
        return self._observe(mission, live, columns)

    def _observe(self, mission: int, live: list[int], columns: dict[str, Iterable[Any]]) -> Started:
        """Return what these drones observe; the columns are for their infos."""
        world, drones = self.world, self.world.drones[mission]
        cells = np.stack([drones["x"], drones["y"]], axis=1)
        if self._fault_masks is None or world.faults is None:
            table = world.mask_table
            masks: Iterable[NDArray[np.int8]] = [table[y][x] for x, y in cells[live].tolist()]
        else:
            masks, cells = self._fault_masks[mission, live], world.faults.positions()[mission]
        if self._step:
            joint = self._joint[mission].tolist()
            columns.setdefault("action", [joint[n] for n in live])
        seen = self._probability if world.coverage is None else world.map_of(mission)
        names = [self._names[n] for n in live]
        observations: dict[str, AgentObservation] = {
            name: Observation(cells[n].copy(), seen) for name, n in zip(names, live, strict=True)
        }
        return observations, agent_infos(names, False, masks, columns)

    def action_of(self, agent: str, actions: Mapping[str, Any]) -> Any:
        """Return the action of an agent, checked.

        Raises:
            FieldError: If it is missing or not allowed.
        """
        return action_of(self.world.rules, agent, actions)

    def nothing(self) -> NDArray[Any]:
        """Return the actions (M, N) of drones that do nothing."""
        return np.full(self.world.drones.shape, NO_ACTION, np.int8)

    def fly(self, joint: NDArray[Any]) -> NDArray[np.float64]:
        """Advance the world by actions (M, N); return how far each drone flew, (M, N) in cells."""
        world = self.world
        x, y = world.drones["x"].copy(), world.drones["y"].copy()
        world.step(joint)
        return np.hypot(world.drones["x"] - x, world.drones["y"] - y)

    def step(self, actions: Mapping[str, NDArray[Any]]) -> tuple[Any, Any, Any, Any, Any]:
        """Advance all missions by one step, and note the results of those that go on.

        Worlds step on after their mission has ended; those steps do not count.

        Args:
            actions: (M, N) of all drones, by `ALL`.
        """
        world, results, going = self.world, self.results, self._going
        here = going[:, None] & ~(world.terminated | world.truncated)
        self._joint = actions[ALL]
        legs = self.fly(self._joint) * here
        self._step += 1
        for drone in range(world.num_drones):
            results.path_length_m[:] += legs[:, drone]
        if not world.rules.in_metres:
            results.collisions[:] += _collisions(
                world.drones, here & ~world.drones["cannot_collide"]
            )
        done = world.worlds["done"]
        found = going & done & (world.worlds["num_missing"] == 0)
        results.found[found] = True
        results.steps[found] = self._step
        if self._step <= world.rules.last_step(world.scenario.timestep_limit):
            # The end of the time terminates nobody.
            results.lost[going] = world.terminated[going].sum(axis=1)
        results.lost[found] = 0
        self._going = going & ~done
        if self.agents:
            self._look()
        return {ALL: self}, {}, {}, {}, {ALL: {}}


class FlightBatch(MissionBatch):
    """A `MissionBatch` whose drones fly by a turn and a speed; see `SearchEnv`."""

    @property
    def _flights(self) -> MetresDrones:
        assert self.world.metres is not None
        return self.world.metres

    def _observe(self, mission: int, live: list[int], columns: dict[str, Iterable[Any]]) -> Started:
        """See `MissionBatch`."""
        states, names = states_of(self.world)[mission], [self._names[n] for n in live]
        observations: Any = {
            name: (states[n], self._probability) for name, n in zip(names, live, strict=True)
        }
        columns["path"] = [self._flights.paths[mission, n].copy() for n in live]
        return observations, agent_infos(names, False, None, columns)

    def action_of(self, agent: str, actions: Mapping[str, Any]) -> Any:
        """See `MissionBatch`."""
        return turn_and_speed_of(agent, actions)

    def nothing(self) -> NDArray[Any]:
        """Return the actions (M, N, 2) of drones that fly straight on."""
        return np.tile(np.array(STRAIGHT_ON), (*self.world.drones.shape, 1))

    def fly(self, joint: NDArray[Any]) -> NDArray[np.float64]:
        """See `MissionBatch`."""
        self._flights.actions[:] = joint
        self.world.step(np.full(self.world.drones.shape, NO_ACTION, np.int8))
        pieces = np.diff(self._flights.paths, axis=2)
        far: NDArray[np.float64] = np.hypot(pieces[..., 0], pieces[..., 1]).sum(axis=2)
        return far / self.world.scenario.cell_size


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


def batch_of(world: World) -> MissionBatch:
    """Return the batch of a world, on cells or in metres."""
    return FlightBatch(world) if world.rules.in_metres else MissionBatch(world)
