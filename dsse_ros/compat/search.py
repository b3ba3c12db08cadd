# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`DroneSwarmSearch` of DSSE 1.1.9 over `SearchEnv` with the profile v2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compat.constants import Actions, Reward
from dsse_ros.compat.published import Cell, DroneData, Infos, SwarmEnv, no_rewards
from dsse_ros.scenario.rules import Rules, profile
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.search.parallel_env import SearchEnv

Observations = dict[str, tuple[Cell, NDArray[np.float32]]]

NAMES = {
    "drone_amount": "num_drones",
    "dispersion_start": "sigma",
    "pre_render_time": "pre_search_minutes",
    "grid_cell_size": "cell_size",
}
"""Fields of the scenario by published argument, where the names differ."""


class Person:
    """A person who has not been found yet.

    Attributes:
        index: Number of the person.
    """

    def __init__(self, index: int, record: Any) -> None:
        self.index = index
        self._record = record

    def __hash__(self) -> int:
        return hash(self.index)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Person) and self.index == other.index

    @property
    def x(self) -> int:
        """Column of the person's cell; it can be set."""
        return int(self._record["x"])

    @x.setter
    def x(self, value: int) -> None:
        self._record["x"] = value

    @property
    def y(self) -> int:
        """Row of the person's cell; it can be set."""
        return int(self._record["y"])

    @y.setter
    def y(self, value: int) -> None:
        self._record["y"] = value

    def get_position(self) -> Cell:
        """Return the cell (x, y)."""
        return self.x, self.y

    def get_mult(self) -> float:
        """Return the factor on the probability of detection."""
        return float(self._record["pod_multiplier"])

    def set_mult(self, mult: float) -> None:
        """Set the factor on the probability of detection for this mission."""
        self._record["pod_multiplier"] = mult


class ProbabilityMatrix:
    """The map of a search."""

    def __init__(self, search: SearchEnv) -> None:
        self._world = search.world

    def get_matrix(self) -> NDArray[np.float32]:
        """Return the map (G, G) float32 as [y, x] of the last observation."""
        return self._world.maps[0]

    @property
    def supposed_position(self) -> tuple[int, int]:
        """Cell of the datum as (row, column)."""
        world = self._world.worlds[0]
        return int(world["datum_y"]), int(world["datum_x"])


class DroneSwarmSearch(SwarmEnv):
    """The search of DSSE 1.1.9 (PettingZoo parallel API).

    An observation is the agent's cell (x, y) and the map (G, G) float32 as [y, x]. Arguments,
    methods and attributes are the published ones; a seed of `reset` seeds the mission.

    Raises:
        ValueError: If an argument is not allowed.
    """

    metadata = {"name": "DroneSwarmSearchV0"}
    _names = NAMES
    possible_actions = set(Actions)
    reward_scheme = Reward(
        default=0.0,
        leave_grid=0,
        exceed_timestep=0,
        drones_collision=0,
        search_cell=0,
        search_and_find=1,
    )

    def __init__(
        self,
        grid_size: int = 20,
        render_mode: str = "ansi",
        render_grid: bool = False,
        render_gradient: bool = True,
        vector: tuple[float, float] = (1.1, 1),
        dispersion_inc: float = 0.1,
        dispersion_start: float = 0.5,
        timestep_limit: int = 100,
        person_amount: int = 1,
        person_initial_position: Cell = (0, 0),
        drone_amount: int = 1,
        drone_speed: float = 10,
        probability_of_detection: float = 1.0,
        pre_render_time: float = 0,
        grid_cell_size: float = 130,
        fps: float = 5,
    ) -> None:
        self._set_up(
            render_mode,
            lambda: Scenario(
                grid_size=grid_size,
                vector=vector,
                dispersion_inc=dispersion_inc,
                sigma=dispersion_start,
                timestep_limit=timestep_limit,
                person_amount=person_amount,
                person_initial_position=person_initial_position,
                num_drones=drone_amount,
                drone_speed=drone_speed,
                probability_of_detection=probability_of_detection,
                pre_search_minutes=pre_render_time,
                cell_size=grid_cell_size,
            ),
            fps,
        )
        self.grid_size = grid_size
        drone = DroneData(drone_amount, drone_speed, probability_of_detection)
        self._publish(drone, grid_cell_size, timestep_limit)
        self.vector = vector
        self.dispersion_inc = dispersion_inc
        self.dispersion_start = dispersion_start
        self.person_amount = person_amount
        self.person_initial_position = person_initial_position
        self.disaster_position = person_initial_position
        self.probability_matrix: ProbabilityMatrix | None = None
        self.pre_render_steps = self._search.scenario.pre_search_steps
        self.observation_spaces = self._search.observation_spaces
        self.rewards_sum = no_rewards(self.possible_agents)

    def _rules(self) -> Rules:
        rewards = self.reward_scheme
        return profile(
            "v2",
            move=rewards.default,
            leave_grid=rewards.leave_grid,
            time_out=rewards.exceed_timestep,
            # No cell has a probability above 1, so every unsuccessful search gets `search_below`.
            search_min_probability=1.0,
            search_min_inclusive=False,
            search_below=rewards.default,
            find=rewards.search_and_find,
            find_bonus=rewards.search_and_find,
        )

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start a new mission.

        Args:
            seed: The same seed gives the same mission.
            options: `drones_positions`, `person_pod_multipliers`, and `vector`, which holds for
                later missions too.

        Raises:
            ValueError: If an option is not allowed.
        """
        options = options or {}
        vector = options.get("vector") or self.vector
        start = {
            "vector": vector,
            "drones_positions": options.get("drones_positions"),
            "person_pod_multipliers": options.get("person_pod_multipliers"),
        }
        self._start(None if seed is None else int(seed), start)
        self.vector = vector
        self.probability_matrix = ProbabilityMatrix(self._search)
        records = self._search.world.persons[0]
        self._persons = [Person(i, records[i]) for i in range(len(records))]
        self.rewards_sum = no_rewards(self.possible_agents)
        self.agents_positions[:] = self._cells()
        observations = self.create_observations()
        self._show()
        return observations, self._infos()

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance the mission by one step, as `SwarmEnv` says."""
        done = super().step(actions)
        for agent, reward in done[1].items():
            self.rewards_sum[agent] += reward
        return done

    def _infos(self) -> Infos:
        found = bool(self._search.world.worlds["num_missing"][0] == 0)
        return {agent: {"Found": found} for agent in self.agents}

    @property
    def probability(self) -> NDArray[np.float32]:
        """The map (G, G) as [y, x] of the last observation."""
        return self._search.world.maps[0]

    @property
    def persons_set(self) -> set[Person]:
        """Persons who have not been found yet."""
        if self.timestep is None:
            return set()
        found = self._search.world.persons["found"][0].tolist()
        return {person for person in self._persons if not found[person.index]}

    def get_persons(self) -> set[Person]:
        """Return the persons who have not been found yet."""
        return self.persons_set
