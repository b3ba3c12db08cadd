# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`CoverageDroneSwarmSearch` of DSSE 1.1.9: visit the cells where probability is, once each."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from dsse_ros.compat.arguments import check_render_mode, joint_action, with_names
from dsse_ros.compat.search import NAMES, DroneData, DroneSwarmSearch
from dsse_ros.search import rendering
from dsse_ros.search.actions import ACTION_VECTORS
from dsse_ros.search.options import check_options
from dsse_ros.search.rules import profile
from dsse_ros.search.scenario import Scenario

Cell = tuple[int, int]
Observations = dict[str, tuple[Cell, NDArray[np.float64]]]
Infos = dict[str, dict[str, Any]]

MIN_PROBABILITY = 1e-10
"""Cells below it need no visit."""


def read_matrix(path: str | Path) -> NDArray[np.float64]:
    """Return the probability matrix (G, G) as [y, x] of a .npy or CSV file.

    Raises:
        ValueError: If it is not square, finite and non-negative, with a cell above 0.
        OSError: If the file cannot be read.
    """
    if Path(path).suffix.lower() == ".csv":
        with open(path, newline="", encoding="utf-8") as file:
            matrix = np.array([[float(value) for value in row] for row in csv.reader(file) if row])
    else:
        matrix = np.asarray(np.load(path, allow_pickle=False), np.float64)
    square = matrix.ndim == 2 and matrix.shape[0] == matrix.shape[1]
    if (
        not square
        or not np.isfinite(matrix).all()
        or matrix.min() < 0
        or matrix.max() < MIN_PROBABILITY
    ):
        raise ValueError(
            f"prob_matrix_path: {str(path)!r} is not allowed; "
            "a square matrix of numbers >= 0, not all 0"
        )
    return matrix


class CoverageMatrix:
    """The probability that is left: a visit takes that of its cell."""

    def __init__(self, matrix: NDArray[np.float64]) -> None:
        self.original_map = matrix
        self.probability_map = matrix.copy()

    def restart(self) -> None:
        """Put all probability back, into new memory."""
        self.probability_map = self.original_map.copy()

    def get_matrix(self) -> NDArray[np.float64]:
        """Return the matrix (G, G) float64 as [y, x]; visits change it."""
        return self.probability_map

    def get_map_size(self) -> int:
        """Return G."""
        return len(self.original_map)

    def save_state(self, output_path: str) -> None:
        """Write the matrix as it was before all visits to a .npy file."""
        with open(output_path, "wb") as file:
            np.save(file, self.original_map)


class CoverageDroneSwarmSearch(ParallelEnv[str, Any, int]):
    """The coverage task of DSSE 1.1.9 (PettingZoo parallel API).

    An observation is the agent's cell (x, y) and the probability that is left over its maximum,
    (G, G) float64 as [y, x]; all 0 once nothing is left. The matrix comes from a file: particles
    of an ocean model are not simulated here.

    Raises:
        ValueError: If an argument is not allowed, or there is no `prob_matrix_path`.
    """

    metadata = {"name": "DroneSwarmSearchCPP"}
    reward_scheme = {
        "default": -0.2,
        "exceed_timestep": 0.0,
        "search_cell": 1.0,
        "done": 60,
        "reward_poc": 45.0,
    }
    is_valid_position = DroneSwarmSearch.is_valid_position
    calculate_simulation_time_step = staticmethod(DroneSwarmSearch.calculate_simulation_time_step)

    def __init__(
        self,
        render_mode: str = "ansi",
        render_grid: bool = True,
        render_gradient: bool = True,
        timestep_limit: int = 100,
        disaster_position: tuple[float, float] = (-24.04, -46.17),
        drone_amount: int = 1,
        drone_speed: float = 10,
        drone_probability_of_detection: float = 0.9,
        pre_render_time: float = 10,
        prob_matrix_path: str | None = None,
        particle_amount: int = 50_000,
        particle_radius: float = 800,
        num_particle_to_filter_as_noise: int = 1,
        start_time: Any = None,
        grid_cell_size: float = 130,
    ) -> None:
        self.render_mode = check_render_mode(render_mode)
        if not isinstance(prob_matrix_path, str):
            raise ValueError(
                f"prob_matrix_path: {prob_matrix_path!r} is not allowed; the path of a .npy or CSV "
                "file, for no ocean model is run here"
            )
        self.probability_matrix = CoverageMatrix(read_matrix(prob_matrix_path))
        self.grid_size = self.probability_matrix.get_map_size()
        self._rules = profile("v2")
        names = {**NAMES, "drone_probability_of_detection": "probability_of_detection"}
        self._scenario = with_names(
            names,
            lambda: Scenario(
                grid_size=self.grid_size,
                timestep_limit=timestep_limit,
                num_drones=drone_amount,
                drone_speed=drone_speed,
                probability_of_detection=drone_probability_of_detection,
                cell_size=grid_cell_size,
            ).resolve(self._rules),
        )
        self.cell_size = grid_cell_size
        self.timestep_limit = timestep_limit
        self.disaster_position = disaster_position
        self.drone = DroneData(drone_amount, drone_speed, drone_probability_of_detection)
        self.probability_of_detection = drone_probability_of_detection
        self.time_step_relation = self.calculate_simulation_time_step(drone_speed, grid_cell_size)
        self.reward_scheme = dict(self.reward_scheme)
        self.timestep: int | None = None
        self.possible_agents = [f"drone{i}" for i in range(drone_amount)]
        self.agents: list[str] = []
        self.agents_positions: list[Any] = [(None, None)] * drone_amount
        g = self.grid_size
        self.observation_spaces = dict.fromkeys(
            self.possible_agents,
            spaces.Tuple((spaces.MultiDiscrete([g, g]), spaces.Box(0, 1, (g, g), np.float64))),
        )
        self.action_spaces = {
            agent: spaces.Discrete(len(self._rules.actions)) for agent in self.possible_agents
        }
        self._vectors = [ACTION_VECTORS[name] for name in self._rules.actions]
        self._start = self.probability_matrix.original_map.copy()
        flat = np.argwhere(np.abs(self._start) >= MIN_PROBABILITY).tolist()
        self.all_states = {(x, y) for x in range(g) for y in range(g)}
        self._to_visit = frozenset((x, y) for y, x in flat)
        self.seen_states: set[Cell] = set()
        self.not_seen_states: set[Cell] = set(self._to_visit)
        self.repeated_coverage = 0
        self.cumm_pos = 0.0
        self._tracks: list[list[Cell]] = []
        self._viewer: rendering.Viewer | None = None

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start a new mission.

        Args:
            seed: Nothing is random here.
            options: `drones_positions`.

        Raises:
            ValueError: If an option is not allowed.
        """
        given = {"drones_positions": (options or {}).get("drones_positions")}
        start = check_options(given, self._scenario, self._rules)
        cells = start.get("drones_positions", self._scenario.drones_positions)
        self.agents_positions = [(int(x), int(y)) for x, y in cells]
        self.agents = self.possible_agents.copy()
        self.timestep = 0
        self.probability_matrix.restart()
        self.seen_states, self.not_seen_states = set(), set(self._to_visit)
        self.reward_scheme["done"] = len(self._to_visit) / len(self.agents)
        self.reward_scheme["reward_poc"] = len(self._to_visit)
        self.cumm_pos, self.repeated_coverage = 0.0, 0
        self._tracks = [list(self.agents_positions)]
        self._show()
        return self._observe(), self._infos(False)

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
        numbers = joint_action(actions, agents, len(self._vectors))
        self.timestep += 1
        scheme = self.reward_scheme
        time_left = 1 - self.timestep / self.timestep_limit
        out_of_time = self.timestep >= self.timestep_limit
        if out_of_time:
            rewards = dict.fromkeys(agents, scheme["exceed_timestep"])
        else:
            rewards = {
                agent: self._visit(i, number, time_left)
                for i, (agent, number) in enumerate(zip(agents, numbers, strict=True))
            }
        completed = not self.not_seen_states
        if completed:
            rewards = dict.fromkeys(agents, scheme["done"] + time_left * scheme["done"])
        self._tracks.append(list(self.agents_positions))
        self._show()
        infos, observations = self._infos(completed), self._observe()
        if completed or out_of_time:
            self.agents = []
        terminations = dict.fromkeys(agents, completed)
        return observations, rewards, terminations, dict.fromkeys(agents, out_of_time), infos

    def _visit(self, drone: int, number: int, time_left: float) -> float:
        """Move a drone and return its reward; a move that would leave the grid does nothing."""
        x, y = self.agents_positions[drone]
        dx, dy = self._vectors[number]
        cell = (x + dx, y + dy)
        if not self.is_valid_position(cell):
            return self.reward_scheme["default"]
        self.agents_positions[drone] = cell
        if cell not in self.not_seen_states:
            self.repeated_coverage += 1
            return self.reward_scheme["default"]
        self.not_seen_states.remove(cell)
        self.seen_states.add(cell)
        matrix = self.probability_matrix.get_matrix()
        probability = matrix[cell[1], cell[0]]
        matrix[cell[1], cell[0]] = 0.0
        self.cumm_pos += probability * self.drone.pod
        earned = time_left * probability * self.reward_scheme["reward_poc"]
        return float(self.reward_scheme["search_cell"] + earned)

    def _observe(self) -> Observations:
        probability = self.probability
        return {
            agent: (cell, probability)
            for agent, cell in zip(self.agents, self.agents_positions, strict=True)
        }

    def _infos(self, completed: bool) -> Infos:
        count = len(self._to_visit)
        info = {
            "is_completed": completed,
            "coverage_rate": len(self.seen_states) / count,
            "repeated_coverage": self.repeated_coverage / count,
            "accumulated_pos": self.cumm_pos,
        }
        return {agent: info for agent in self.agents}

    @property
    def positions(self) -> NDArray[np.int64]:
        """Cells (N, 2) as (x, y) of all drones."""
        return np.array(self.agents_positions, np.int64)

    @property
    def probability(self) -> NDArray[np.float64]:
        """What agents observe of the matrix, (G, G) as [y, x]."""
        matrix = self.probability_matrix.get_matrix()
        return matrix / (matrix.max() or 1.0)

    @property
    def steps_done(self) -> int:
        """Steps of the mission that are done."""
        return self.timestep or 0

    def get_agents(self) -> list[str]:
        """Return the names of all drones."""
        return self.possible_agents

    def observation_space(self, agent: str) -> Any:
        """Return the agent's observation space, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Any:
        """Return the agent's action space, always the same object."""
        return self.action_spaces[agent]

    def save_matrix(self, path: str) -> None:
        """Write the matrix as it was before all visits to a .npy file."""
        self.probability_matrix.save_state(path)

    def view(self) -> rendering.MissionView:
        """Return what a picture of the mission shows."""
        return rendering.MissionView(
            probability=self.probability.astype(np.float32),
            tracks=np.array(self._tracks or [list(self._scenario.drones_positions)]).swapaxes(0, 1),
            alive=np.ones(len(self.possible_agents), bool),
            persons=np.zeros((0, 2), np.int64),
            found=np.zeros(0, bool),
            datum=None,
            step=self.steps_done,
            timestep_limit=self.timestep_limit,
            cell_size_m=self.cell_size,
        )

    def render(self) -> str | None:
        """Show the mission in a window in the mode human; return it as text else."""
        if self.render_mode != "human":
            return rendering.to_ansi(self.view())
        if self._viewer is None:
            self._viewer = rendering.Viewer(math.inf)
        self._viewer.show(self.view())
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _show(self) -> None:
        if self.render_mode == "human":
            self.render()
