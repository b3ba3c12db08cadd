# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common base of the published environments, which wrap `SearchEnv`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from operator import is_
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from dsse_ros.compat.arguments import joint_action, with_names
from dsse_ros.compat.pygame_window import PygameWindow
from dsse_ros.scenario.cell_checks import check_cell, check_positions
from dsse_ros.scenario.fields import FieldError, Spec, shown
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import SPECS, Scenario
from dsse_ros.search.agent_spaces import AgentSpaces
from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.view import rendering

Cell = tuple[int, int]
Infos = dict[str, dict[str, Any]]
RENDER_MODE = Spec("str", "How a mission is shown.", choices=("ansi", "human"))
FPS = Spec("float", "Pictures per second in the mode human.", above=0)
INNER_METHODS = (
    "build_movement_matrix", "calculate_simulation_time_step", "compute_infos",
    "create_persons_set", "create_random_positions_person", "default_drones_positions", "draw",
    "enable_render", "failure_render", "is_valid_position", "is_valid_position_drones", "move",
    "move_drone", "pre_search_simulate", "raise_if_unvalid_mult", "render_probability_matrix",
    "render_step", "required_drone_positions", "reset_search_state", "victory_render",
)  # fmt: skip
"""Methods that the packages call in `reset` and `step`, and that are not called here."""


class DroneData(NamedTuple):
    """The drones: how many, their speed in m/s, their probability of detection."""

    amount: int
    speed: float
    pod: float


def no_rewards(agents: Iterable[str]) -> dict[str, float]:
    """Return the sums of rewards, each agent's and the total, at the start of a mission."""
    return {**dict.fromkeys(agents, 0), "total": 0}


class PublishedEnv:
    """A search under published names.

    Attributes:
        render_mode: `ansi` or `human`.
        possible_agents: Names of all drones.
        agents: Names of the drones in the search; none before the first reset.
        timestep: Number of steps done, None before the first reset.

    Raises:
        TypeError: If a subclass overrides one of `INNER_METHODS`, which would have no effect.
    """

    _names: ClassVar[Mapping[str, str]]
    """Fields of the scenario by published argument, where the names differ."""

    render_mode: str
    possible_agents: list[str]
    agents: list[str]
    timestep: int | None

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        ours = next(c for c in cls.__mro__ if c.__module__.startswith("dsse_ros.compat."))
        for name in INNER_METHODS:
            if getattr(cls, name, None) is not getattr(ours, name, None):
                raise TypeError(
                    f"{cls.__name__} must not override {name}, which is not called here; override "
                    "create_observations, reset, step or render"
                )

    def _set_up(self, render_mode: str, scenario: Callable[[], Scenario], fps: float = 5) -> None:
        """Make the search.

        Raises:
            FieldError: If an argument is not allowed; it has its published name.
        """
        self.render_mode = RENDER_MODE.check("render_mode", render_mode)
        self._fps = FPS.check("fps", fps)
        self._window: rendering.Viewer | PygameWindow | None = None
        self._placed: list[Any] = []
        self._scenario = with_names(self._names, scenario)
        self._make(self._rules())
        self.possible_agents = self._search.possible_agents
        self.agents = []
        self.timestep = None

    def _rules(self) -> Rules:
        """Return the rules with the rewards as they are now."""
        raise NotImplementedError

    def _make(self, rules: Rules) -> None:
        # In the mode rgb_array a search keeps what a picture shows, and shows nothing by itself.
        mode = "rgb_array" if self.render_mode == "human" else None
        self._search = with_names(self._names, lambda: SearchEnv(self._scenario, rules, mode))

    def _start(self, seed: int | None, options: Mapping[str, Any]) -> None:
        """Start a mission, with the rewards as they are now.

        Raises:
            FieldError: If the seed or an option is not allowed, or two drones start in one cell.
        """
        self._check_apart(options.get("drones_positions"))
        rules = self._rules()
        if rules != self._search.rules:
            # The new search continues the random numbers of the old one.
            state = self._search.world.worlds["rng"].copy()
            self._make(rules)
            self._search.world.worlds["rng"] = state
        self._search.reset(seed, options)
        self.agents = self.possible_agents.copy()
        self.timestep = 0

    def _check_apart(self, cells: Any) -> None:
        """Raise unless the drones start in different cells, as the packages demand of each task.

        Raises:
            FieldError: If there is not one cell on the grid for each drone, or one occurs twice.
        """
        if cells is not None:
            checked = SPECS["drones_positions"].check("drones_positions", cells)
            grid, count = len(self._search.probability), len(self.possible_agents)
            check_positions(checked, grid, count, None, apart=True)

    def _check_started(self) -> int:
        """Return the steps that are done.

        Raises:
            FieldError: If there was no reset.
        """
        if self.timestep is None:
            raise FieldError("Please reset the env before interacting with it")
        return self.timestep

    def _outcome(
        self, agents: list[str]
    ) -> tuple[dict[str, float], dict[str, bool], dict[str, bool]]:
        """Return rewards, terminations and truncations of the last step."""
        world = self._search.world
        rewards, terminations, truncations = (
            dict(zip(agents, of_world[0].tolist(), strict=True))
            for of_world in (world.rewards, world.terminated, world.truncated)
        )
        return rewards, terminations, truncations

    def _cells(self) -> list[Any]:
        """Return the cells (x, y) of all drones, and remember that they are published."""
        self._placed = list(map(tuple, self._search.positions.tolist()))
        return self._placed

    def _place_drones(self, cells: Collection[Any]) -> None:
        """Move the drones whose cells the script has replaced in `agents_positions`.

        Raises:
            FieldError: If there is not one cell on the grid for each drone.
        """
        if len(cells) == len(self._placed) and all(map(is_, cells, self._placed)):
            return
        checked = SPECS["drones_positions"].check("agents_positions", list(cells))
        if len(checked) != len(self._placed):
            raise FieldError(
                f"agents_positions must be {len(self._placed)} cells, one per drone, got "
                f"{shown(cells)}"
            )
        for cell in checked:
            check_cell("agents_positions", cell, len(self._search.probability))
        drones = self._search.world.drones[0]
        drones["x"], drones["y"] = np.transpose(checked)

    def _show(self) -> None:
        if self.render_mode == "human":
            self.render()

    @property
    def positions(self) -> NDArray[Any]:
        """Cells (N, 2) as (x, y) of all drones."""
        return self._search.positions

    @property
    def steps_done(self) -> int:
        """Number of steps done in the mission."""
        return self._search.steps_done

    @property
    def rules(self) -> Rules:
        """The rules of the search, with the rewards of the last reset."""
        return self._search.rules

    def get_agents(self) -> list[str]:
        """Return the names of all drones."""
        return self.possible_agents

    def render(self) -> str | None:
        """Show the mission in a window in the mode human, otherwise return it as text.

        The window is pygame's if the script has imported pygame, otherwise Matplotlib's.
        """
        view = self._search.view()
        if self.render_mode != "human":
            return rendering.to_ansi(view)
        if self._window is None:
            window = PygameWindow if "pygame" in sys.modules else rendering.Viewer
            self._window = window(self._fps)
        self._window.show(view)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None


class SwarmEnv(AgentSpaces, PublishedEnv, ParallelEnv[str, Any, int]):
    """The common base of the two environments of DSSE 1.1.9.

    Attributes:
        grid_size: Cells along each axis.
        agents_positions: Cells (x, y) of all drones, (None, None) before the first reset. A cell
            that is replaced moves its drone in the next step.
    """

    grid_size: int
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

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance the mission by one step.

        Raises:
            ValueError: If there was no reset, or an action is missing or not allowed; the mission
                stays as it is.
        """
        steps_done, agents = self._check_started(), self.agents
        if not agents:
            return {}, {}, {}, {}, {}
        numbers = joint_action(actions, agents, len(self._search.rules.actions))
        self._place_drones(self.agents_positions)
        self._search.advance(np.array(numbers, np.int8))
        self.timestep = steps_done + 1
        self.agents_positions[:] = self._cells()
        outcome, infos = self._outcome(agents), self._infos()
        observations = self.create_observations()
        self._show()
        self.agents = self._search.agents.copy()
        return observations, *outcome, infos

    def create_observations(self) -> dict[str, Any]:
        """Return the observation of each agent; called once per reset and step.

        A subclass can override it. The persons and the map have already moved.
        """
        probability = self.probability
        return {
            agent: (cell, probability)
            for agent, cell in zip(self.agents, self.agents_positions, strict=True)
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
