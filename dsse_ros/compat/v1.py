# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`DroneSwarmSearch` of DSSE 0.1.13 over `SearchEnv` with the profile v1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.base.fields import Spec
from dsse_ros.compat.drifting import ProbabilityMatrix
from dsse_ros.compat.published import PublishedEnv, no_rewards
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario import Scenario

Observations = dict[str, dict[str, tuple[tuple[int, int], NDArray[np.float32]]]]


class DroneSwarmSearch(PublishedEnv):
    """The search of DSSE 0.1.13, whose interface is not that of today's PettingZoo.

    `reset` returns observations alone, `{agent: {"observation": ((x, y), map)}}`, the map (G, G)
    float32 as [y, x]. `step` returns them with rewards, which have `total_reward` too,
    terminations, truncations and `{"Found": bool}`. Once any drone is terminated or truncated the
    mission is over: later steps change nothing.

    Raises:
        ValueError: If an argument is not allowed.
    """

    metadata: dict[str, Any] = {}
    _names = {"n_drones": "num_drones", "disperse_constant": "sigma"}
    _read_in_reset = {
        "grid_size": "grid_size",
        "person_initial_position": "person_initial_position",
        "disperse_constant": "sigma",
    }

    def __init__(
        self,
        grid_size: int = 7,
        render_mode: str = "ansi",
        render_grid: bool = False,
        render_gradient: bool = True,
        n_drones: int = 1,
        vector: tuple[float, float] = (-0.5, -0.5),
        person_initial_position: Sequence[int] = (0, 0),
        disperse_constant: float = 10,
        timestep_limit: int = 100,
    ) -> None:
        self.grid_size = grid_size
        self.vector = vector
        self.person_initial_position = person_initial_position
        self.disperse_constant = disperse_constant
        self.timestep_limit = timestep_limit
        self.reward_scheme = {
            "default": 1,
            "leave_grid": -100000,
            "exceed_timestep": -100000,
            "drones_collision": -100000,
            "search_cell": 1,
            "search_and_find": 100000,
        }
        self._set_up(
            render_mode,
            lambda: Scenario(
                grid_size=grid_size,
                num_drones=n_drones,
                vector=vector,
                person_initial_position=tuple(person_initial_position),  # type: ignore[arg-type]
                sigma=disperse_constant,
                timestep_limit=timestep_limit,
            ),
        )
        self.agents_positions: dict[str, Any] = {a: [None, None] for a in self.possible_agents}
        self.rewards_sum = no_rewards(self.possible_agents)

    def _rules(self) -> Rules:
        rewards = self.reward_scheme
        return profile(
            "v1",
            move=rewards["default"],
            leave_grid=rewards["leave_grid"],
            collision=rewards["drones_collision"],
            time_out=rewards["exceed_timestep"],
            find=rewards["search_and_find"],
            find_bonus=rewards["search_and_find"],
        )

    def _make(self) -> None:
        super()._make()
        self.probability_matrix = ProbabilityMatrix(self._search.world)

    def _published_cells(self) -> list[Any]:
        return list(self.agents_positions.values())

    def reset(
        self,
        seed: int | None = None,
        return_info: bool = False,
        options: Mapping[str, Any] | None = None,
        drones_positions: Sequence[Sequence[int]] | None = None,
        vector: tuple[float, float] | None = None,
    ) -> Observations:
        """Start a new mission and return observations.

        Args:
            seed: The same seed gives the same mission.
            return_info: Ignored.
            options: Ignored.
            drones_positions: Cells (x, y); by default row by row from the north-west corner.
            vector: Drift, for later missions too.

        Raises:
            ValueError: If an argument is not allowed; the mission under way stays as it is.
        """
        vector = vector or self.vector
        start = {"drones_positions": drones_positions, "vector": vector}
        self._start(seed, start)
        self.vector = vector
        self.rewards_sum = no_rewards(self.possible_agents)
        self._note_positions()
        observations = self.create_observations()
        self._show()
        return observations

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], dict[str, bool]]:
        """Advance the mission by one step; an unknown action does nothing.

        Raises:
            ValueError: If there was no reset, or an action is missing; the mission stays as it is.
        """
        self._check_started()
        missing = [agent for agent in self.agents if agent not in actions]
        if missing:
            raise ValueError(f"Missing action for {missing[0]}")
        search, agents = self._search, self.possible_agents
        world = search.world
        over = bool(world.worlds["done"][0])
        if not over:
            sums = [self.rewards_sum[agent] for agent in agents]
            world.drones["episode_return"] = sums
            known = range(len(search.rules.actions))
            joint = [
                actions[a] if a in self.agents and actions[a] in known else NO_ACTION
                for a in agents
            ]
            self._advance(np.array(joint, np.int8))
            self._note_positions()
        rewards, terminations, truncations = self._outcome(agents)
        for agent in {*agents} - {*self.agents}:
            del rewards[agent], terminations[agent], truncations[agent]
        if over:
            rewards = dict.fromkeys(rewards, 0.0)
        for agent, reward in rewards.items():
            self.rewards_sum[agent] += reward
        rewards["total_reward"] = sum(rewards.values())
        self.rewards_sum["total"] += rewards["total_reward"]
        self._show()
        infos = {"Found": bool(world.worlds["num_missing"][0] == 0)}
        return self.create_observations(), rewards, terminations, truncations, infos

    def _note_positions(self) -> None:
        self.agents_positions.update(zip(self.possible_agents, self._cells(), strict=True))

    def create_observations(self) -> Observations:
        """Return the observation of each agent; called once per reset and step.

        A subclass can override it. The person and the map have already moved.
        """
        probability = self.probability_matrix.get_matrix()
        return {
            agent: {"observation": (cell, probability)}
            for agent, cell in self.agents_positions.items()
        }

    @property
    def person_x(self) -> int:
        """Column of the person's cell; it can be set."""
        return int(self._search.world.persons["x"][0, 0])

    @person_x.setter
    def person_x(self, value: int) -> None:
        self._search.world.persons["x"] = self._line.check("person_x", value)

    @property
    def person_y(self) -> int:
        """Row of the person's cell; it can be set."""
        return int(self._search.world.persons["y"][0, 0])

    @person_y.setter
    def person_y(self, value: int) -> None:
        self._search.world.persons["y"] = self._line.check("person_y", value)

    @property
    def _line(self) -> Spec:
        return Spec("int", "", low=0, high=self._search.world.grid_size.columns - 1)

    def observation_space(self, agent: str) -> spaces.MultiDiscrete:
        """Return the space of a cell, as published: the map is not in it."""
        return spaces.MultiDiscrete([self.grid_size] * 2)

    def action_space(self, agent: str) -> list[int]:
        """Return the numbers of the actions, as published: no space."""
        return list(range(len(self._search.rules.actions)))
