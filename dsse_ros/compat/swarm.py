# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common base of the two environments of DSSE 1.1.9."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.compat.arguments import joint_action
from dsse_ros.compat.published import Cell, DroneData, Infos, PublishedEnv
from dsse_ros.search.environments.agents import AgentSpaces
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.cell_checks import check_positions
from dsse_ros.world.scenario.scenario import SPECS


class SwarmEnv(AgentSpaces, PublishedEnv, ParallelEnv[str, Any, int]):
    """The common base of the two environments of DSSE 1.1.9.

    Attributes:
        grid_size: Cells along each axis; a change counts from the next reset.
        agents_positions: Cells (x, y) of all drones, (None, None) before the first reset. A cell
            that is replaced moves its drone in the next step.
        agents: A script may name fewer: the first drones then act.
    """

    agents_positions: list[Any]

    def _publish(self, drone: DroneData, cell_size: float, timestep_limit: int) -> None:
        """Set the attributes that both environments publish."""
        self.drone = drone
        self.probability_of_detection = drone.pod
        self.cell_size = cell_size
        self.timestep_limit = timestep_limit
        self.time_step_relation = self.calculate_simulation_time_step(drone.speed, cell_size)
        self.agents_positions = [(None, None)] * drone.amount
        self.action_spaces = self._search.action_spaces
        self._num_drones = drone.amount

    @property
    def pygame_renderer(self) -> Any:
        """The package's renderer has no counterpart here: see `render`."""
        raise AttributeError("pygame_renderer is missing here; render() shows the mission")

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the observation space of the search as it was made, for any agent."""
        return self._spaces(agent)[0]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's action space, always the same object."""
        return self._spaces(agent)[1]

    def _keep_spaces(self) -> None:
        """Keep the spaces: replacing the dictionaries has no effect, as in the package."""
        self._spaces_of = {
            agent: (self.observation_spaces[agent], space)
            for agent, space in self.action_spaces.items()
        }

    def _spaces(self, agent: str) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        known = self._spaces_of.get(agent)
        if known is None:
            observation, _ = next(iter(self._spaces_of.values()))
            known = observation, spaces.Discrete(len(self._search.rules.actions))
            self._spaces_of[agent] = known
        return known

    def _start(self, seed: int | None, options: Mapping[str, Any]) -> None:
        """Start a mission, see `PublishedEnv._start`; agents may have other names or be fewer."""
        self._check_agents("possible_agents", self.possible_agents)
        cells, count = options.get("drones_positions"), len(self.possible_agents)
        if cells is not None and count < self._num_drones:
            positions = SPECS["drones_positions"].check("drones_positions", cells)
            check_positions(positions, GridShape.square(self.grid_size), count, None, apart=True)
            # Drones without an agent do nothing, wherever they are.
            others = ((x, y) for y in range(self.grid_size) for x in range(self.grid_size))
            free = (cell for cell in others if cell not in positions)
            cells = [*positions, *itertools.islice(free, self._num_drones - count)]
        super()._start(seed, {**options, "drones_positions": cells})
        if len(self.agents_positions) != self._num_drones:
            self.agents_positions = [(None, None)] * self._num_drones
        self._publish_cells(count)

    def _check_agents(self, name: str, agents: list[str]) -> None:
        if len(agents) > self._num_drones:
            raise FieldError(
                f"{name} must be at most {self._num_drones}, one per drone, got {shown(agents)}"
            )

    def _take_over(self) -> None:
        """Bring what a script has set into the world, see `PublishedEnv._take_over`."""
        super()._take_over()
        self._check_agents("agents", self.agents)
        if self._over:
            raise FieldError("agents must be empty until the next reset: the mission is over")
        pod = SPECS["probability_of_detection"].check("drone.pod", self.drone.pod)
        self._search.world.constants["probability_of_detection"] = pod

    def _published_cells(self) -> list[Any]:
        return self.agents_positions

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance the mission by one step.

        Raises:
            ValueError: If there was no reset, an action is missing or not allowed, or what a script
                has set is not allowed; the mission stays as it is.
        """
        self._check_started()
        agents = self.agents
        if not agents:
            return {}, {}, {}, {}, {}
        numbers = joint_action(actions, agents, len(self._search.rules.actions))
        if len(numbers) < self._num_drones:
            # A drone without an agent does nothing.
            numbers += [NO_ACTION] * (self._num_drones - len(numbers))
        self._advance(np.array(numbers, np.int8))
        self._publish_cells(len(agents))
        outcome, infos = self._outcome(agents), self._infos()
        observations = self.create_observations()
        self._show()
        if True in outcome[1].values() or True in outcome[2].values():
            self.agents, self._over = [], True
        return observations, *outcome, infos

    def _publish_cells(self, count: int) -> None:
        """Publish the cells of the drones that have an agent; those of others stay as they are."""
        cells = self._cells()
        if count < len(cells):
            cells[count:] = self.agents_positions[count:]
        self.agents_positions[:] = cells

    def create_observations(self) -> dict[str, Any]:
        """Return the observation of each agent; called once per reset and step.

        A subclass can override it. The persons and the map have already moved.
        """
        probability = self.probability
        return {
            agent: (cell, probability)
            for agent, cell in zip(self.agents, self.agents_positions, strict=False)
        }

    def _infos(self) -> Infos:
        """Return the info of each agent."""
        raise NotImplementedError

    @property
    def probability(self) -> NDArray[Any]:
        """The map as agents observe it, (G, G) as [y, x]."""
        raise NotImplementedError

    def is_valid_position(self, position: Cell) -> bool:
        """Return whether a cell (x, y) is on the grid."""
        return all(0 <= value < self.grid_size for value in position)

    @staticmethod
    def calculate_simulation_time_step(
        drone_max_speed: float, cell_size: float, wind_resistance: float = 0.0
    ) -> float:
        """Return the duration of one step in seconds: cell size over speed."""
        return cell_size / (drone_max_speed - wind_resistance)
