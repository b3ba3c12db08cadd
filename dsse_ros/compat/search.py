# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`DroneSwarmSearch` of DSSE 1.1.9 over `SearchEnv` with the profile v2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from dsse_ros.compat.arguments import check_render_mode, joint_action, with_names
from dsse_ros.compat.constants import Actions, Reward
from dsse_ros.search import rendering
from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.rules import Rules, profile
from dsse_ros.search.scenario import Scenario

Cell = tuple[int, int]
Observations = dict[str, tuple[Cell, NDArray[np.float32]]]
Infos = dict[str, dict[str, Any]]

NAMES = {
    "drone_amount": "num_drones",
    "dispersion_start": "sigma",
    "pre_render_time": "pre_search_minutes",
    "grid_cell_size": "cell_size",
}
"""Published names of arguments whose fields of the scenario have other names."""


class DroneData(NamedTuple):
    """The drones: how many, their speed in m/s, their probability of detection."""

    amount: int
    speed: float
    pod: float


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


def rules_of(rewards: Reward) -> Rules:
    """Return the profile v2 with these rewards."""
    return profile(
        "v2",
        move=rewards.default,
        leave_grid=rewards.leave_grid,
        time_out=rewards.exceed_timestep,
        # Every search that finds nobody is one below the least probability.
        search_min_probability=1.0,
        search_min_inclusive=False,
        search_below=rewards.default,
        find=rewards.search_and_find,
        find_bonus=rewards.search_and_find,
    )


class DroneSwarmSearch(ParallelEnv[str, Any, int]):
    """The search of DSSE 1.1.9 (PettingZoo parallel API).

    An observation is the agent's cell (x, y) and the map (G, G) float32 as [y, x]. Arguments,
    methods and attributes are the published ones; a seed of `reset` seeds the mission.

    Raises:
        ValueError: If an argument is not allowed.
    """

    metadata = {"name": "DroneSwarmSearchV0"}
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
    ) -> None:
        self.render_mode = check_render_mode(render_mode)
        self._scenario = with_names(
            NAMES,
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
        )
        self.grid_size = grid_size
        self.cell_size = grid_cell_size
        self.vector = vector
        self.dispersion_inc = dispersion_inc
        self.dispersion_start = dispersion_start
        self.timestep_limit = timestep_limit
        self.person_amount = person_amount
        self.person_initial_position = person_initial_position
        self.disaster_position = person_initial_position
        self.drone = DroneData(drone_amount, drone_speed, probability_of_detection)
        self.probability_of_detection = probability_of_detection
        self.time_step_relation = self.calculate_simulation_time_step(drone_speed, grid_cell_size)
        self.timestep: int | None = None
        self.probability_matrix: ProbabilityMatrix | None = None
        self._make(rules_of(self.reward_scheme))
        self.pre_render_steps = self._search.scenario.pre_search_steps
        self.possible_agents = self._search.possible_agents
        self.agents: list[str] = []
        self.agents_positions: list[Any] = [(None, None)] * drone_amount
        self.action_spaces = self._search.action_spaces
        self.observation_spaces = self._search.observation_spaces
        self.rewards_sum: dict[str, float] = {}
        self._forget_rewards()

    def _make(self, rules: Rules) -> None:
        """Make the search; a new one goes on with the random numbers of the one before."""
        mode = "human" if self.render_mode == "human" else None
        self._search = with_names(NAMES, lambda: SearchEnv(self._scenario, rules, mode))

    def _forget_rewards(self) -> None:
        self.rewards_sum = {**dict.fromkeys(self.possible_agents, 0), "total": 0}

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
        rules = rules_of(self.reward_scheme)
        if rules != self._search.rules:
            state = self._search.world.worlds["rng"].copy()
            self._make(rules)
            self._search.world.worlds["rng"] = state
        vector = options.get("vector") or self.vector
        start = {
            "vector": vector,
            "drones_positions": options.get("drones_positions"),
            "person_pod_multipliers": options.get("person_pod_multipliers"),
        }
        self._search.reset(None if seed is None else int(seed), start)
        self.vector = vector
        self.agents = self.possible_agents.copy()
        self.timestep = 0
        self.probability_matrix = ProbabilityMatrix(self._search)
        records = self._search.world.persons[0]
        self._persons = [Person(i, records[i]) for i in range(len(records))]
        self._forget_rewards()
        return self._observe(), {agent: {"Found": False} for agent in self.agents}

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance the mission by one step.

        Raises:
            ValueError: If there was no reset, or an action is missing or not allowed; the mission
                stays as it is.
        """
        if self.timestep is None:
            raise ValueError("Please reset the env before interacting with it")
        agents = self.agents
        if not agents:
            return {}, {}, {}, {}, {}
        search = self._search
        search.advance(np.array(joint_action(actions, agents, len(Actions)), np.int8))
        self.timestep += 1
        world = search.world
        rewards = dict(zip(agents, world.rewards[0].tolist(), strict=True))
        for agent, reward in rewards.items():
            self.rewards_sum[agent] += reward
        terminations, truncations = (
            dict(zip(agents, flags[0].tolist(), strict=True))
            for flags in (world.terminated, world.truncated)
        )
        found = bool(world.worlds["num_missing"][0] == 0)
        observations = self._observe()
        if self.render_mode == "human":
            self.render()
        self.agents = search.agents.copy()
        infos: Infos = {agent: {"Found": found} for agent in agents}
        return observations, rewards, terminations, truncations, infos

    def _observe(self) -> Observations:
        search = self._search
        self.agents_positions = list(map(tuple, search.positions.tolist()))
        probability = search.world.maps[0]
        return {
            agent: (cell, probability)
            for agent, cell in zip(self.agents, self.agents_positions, strict=True)
        }

    @property
    def positions(self) -> NDArray[np.int64]:
        """Cells (N, 2) as (x, y) of all drones."""
        return self._search.positions

    @property
    def probability(self) -> NDArray[np.float32]:
        """The map (G, G) as [y, x] of the last observation."""
        return self._search.world.maps[0]

    @property
    def steps_done(self) -> int:
        """Steps of the mission that are done."""
        return self._search.steps_done

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

    def get_agents(self) -> list[str]:
        """Return the names of all drones."""
        return self.possible_agents

    def observation_space(self, agent: str) -> Any:
        """Return the agent's observation space, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Any:
        """Return the agent's action space, always the same object."""
        return self.action_spaces[agent]

    def is_valid_position(self, position: Cell) -> bool:
        """Return whether a cell (x, y) is on the grid."""
        return all(0 <= value < self.grid_size for value in position)

    @staticmethod
    def calculate_simulation_time_step(
        drone_max_speed: float, cell_size: float, wind_resistance: float = 0.0
    ) -> float:
        """Return the seconds of one step: metres of a cell over metres per second."""
        return cell_size / (drone_max_speed - wind_resistance)

    def render(self) -> str | None:
        """Show the mission in a window in the mode human; return it as text else."""
        if self.render_mode == "human":
            self._search.render()
            return None
        return rendering.to_ansi(self._search.view())

    def close(self) -> None:
        """Close the window, if there is one."""
        self._search.close()
