# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common base of the published environments, which wrap `SearchEnv`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from operator import is_
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.compat.arguments import with_names
from dsse_ros.compat.pygame_window import PygameWindow
from dsse_ros.picture import rendering
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.world import Rebound
from dsse_ros.search.step.constants import constants_of
from dsse_ros.world.scenario.cell_checks import check_cell, check_positions
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import SPECS, Scenario

Cell = tuple[int, int]
Infos = dict[str, dict[str, Any]]
RENDER_MODE = Spec("str", "How a mission is shown.", choices=("ansi", "human"))
FPS = Spec("float", "Pictures per second in the mode human.", above=0)
TIMESTEP = Spec("int", "Steps done in a mission.", low=0, high=2**40)
OF_REWARDS = (
    "move", "leave_grid", "collision", "search_below", "find", "find_bonus", "time_out", "cover",
    "cover_scale", "cover_all", "cover_all_bonus",
)  # fmt: skip
"""Constants of the step that follow from `reward_scheme`, which the packages read in each step."""
INNER_METHODS = (
    "build_movement_matrix", "calculate_simulation_time_step", "compute_infos",
    "create_persons_set", "create_random_positions_person", "default_drones_positions", "draw",
    "enable_render", "failure_render", "is_valid_position", "is_valid_position_drones", "move",
    "move_drone", "pre_search_simulate", "raise_if_unvalid_mult", "render_probability_matrix",
    "render_step", "required_drone_positions", "reset_search_state", "victory_render",
)  # fmt: skip
"""Methods that the packages call in `reset` and `step`, and that are not called here."""


@dataclass
class DroneData:
    """The drones: how many, their speed in m/s, their probability of detection.

    Only `pod` can be changed with effect, as in DSSE 1.1.9, at any time.

    Raises:
        FieldError: If a value is not allowed.
    """

    amount: int
    speed: float
    pod: float = 1

    def __post_init__(self) -> None:
        SPECS["num_drones"].check("amount", self.amount)
        SPECS["drone_speed"].check("speed", self.speed)
        SPECS["probability_of_detection"].check("pod", self.pod)


def no_rewards(agents: Iterable[str]) -> dict[str, float]:
    """Return the sums of rewards, each agent's and the total, at the start of a mission."""
    return {**dict.fromkeys(agents, 0), "total": 0}


class PublishedEnv(Rebound):
    """A search under published names.

    What a script sets takes effect when the packages read it: in each step or in a reset.

    Attributes:
        render_mode: `ansi` or `human`.
        timestep_limit: Maximum number of steps of a mission.
        possible_agents: Names of all drones.
        agents: Names of the drones in the search; none before the first reset.
        timestep: Number of steps done, None before the first reset.

    Raises:
        TypeError: If a subclass overrides one of `INNER_METHODS`, which would have no effect.
    """

    _names: ClassVar[Mapping[str, str]]
    """Fields of the scenario by published argument, where the names differ."""
    _read_in_reset: ClassVar[Mapping[str, str]] = {}
    """Fields of the scenario by the attribute that a reset reads."""

    render_mode: str
    possible_agents: list[str]
    agents: list[str]
    timestep: int | None
    timestep_limit: int
    grid_size: int
    reward_scheme: Any

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
        """Make the search."""
        self.render_mode = RENDER_MODE.check("render_mode", render_mode)
        self._fps = FPS.check("fps", fps)
        self._window: rendering.Viewer | PygameWindow | None = None
        self._placed: list[Any] = []
        self._scenario = with_names(self._names, scenario)
        self._make()
        self.possible_agents = self._search.possible_agents
        self.agents = []
        self.timestep = None

    def _rules(self) -> Rules:
        """Return the rules with the rewards as they are now."""
        raise NotImplementedError

    def _make(self) -> None:
        # In the mode rgb_array a search keeps what a picture shows, and shows nothing by itself.
        mode, rules = "rgb_array" if self.render_mode == "human" else None, self._rules()
        self._search = with_names(self._names, lambda: SearchEnv(self._scenario, rules, mode))
        self._made_of = self._attributes()
        self._applied: tuple[Any, ...] = ()
        self._begun = self._over = False
        self._steps_done = 0
        self._rebind()

    def _bind(self) -> None:
        """Create the views on the world's arrays."""
        world = self._search.world
        self._x, self._y = world.drones["x"][0], world.drones["y"][0]
        self._of_step = world.rewards[0], world.terminated[0], world.truncated[0]
        self._multipliers = world.persons["pod_multiplier"]
        self._num_missing = world.worlds["num_missing"]

    def _attributes(self) -> list[Any]:
        """Return what a new search is made of, as values that stay as they are."""
        attributes = [getattr(self, name, None) for name in self._read_in_reset]
        frozen = [tuple(v) if isinstance(v, list | tuple | np.ndarray) else v for v in attributes]
        return [self.render_mode == "human", *frozen]

    def _follow_attributes(self) -> None:
        """Make the search again if a script has changed what it is made of."""
        if self._attributes() == self._made_of:
            return
        fields = {field: getattr(self, name) for name, field in self._read_in_reset.items()}
        before = self._scenario, self._search
        self._scenario = with_names(self._names, lambda: before[0].override(**fields))
        try:
            self._make()
        except FieldError:
            self._scenario, self._search = before
            raise
        # The new search continues the random numbers of the old one.
        self._search.world.worlds["rng"] = before[1].world.worlds["rng"]

    def _start(self, seed: int | None, options: Mapping[str, Any]) -> None:
        """Start a mission with the attributes as they are now.

        Raises:
            FieldError: If the seed, an option or an attribute is not allowed, or two drones start
                in one cell.
        """
        self._follow_attributes()
        self._check_apart(options.get("drones_positions"))
        self._reset_search(seed, options)
        self.agents = list(self.possible_agents)
        self.timestep = self._steps_done = 0
        self._begun, self._over, self._applied = True, False, ()

    def _reset_search(self, seed: int | None, options: Mapping[str, Any]) -> None:
        self._search.reset(seed, options)

    def _settings(self) -> tuple[Any, ...]:
        """Return what a script may have set and a step reads, to see whether it has."""
        return (*self.reward_scheme.values(), self._over, self.timestep_limit, self.grid_size)

    def _take_over(self) -> None:
        """Bring what a script has set into the world."""
        world = self._search.world
        if self.grid_size != world.grid_size.columns:
            raise FieldError(
                f"grid_size must be {world.grid_size.columns} until the next reset, got "
                f"{shown(self.grid_size)}"
            )
        limit = SPECS["timestep_limit"].check("timestep_limit", self.timestep_limit)
        constants = constants_of(self._search.scenario, self._rules())
        for name in OF_REWARDS:
            world.constants[name] = constants[name]
        world.constants["timestep_limit"] = limit

    def _advance(self, joint: NDArray[np.int8]) -> None:
        """Advance the search by the drones' actions, with all that a script has set."""
        now = self._settings()
        if now != self._applied:
            self._take_over()
            self._applied = now
        self._place_drones(self._published_cells())
        if self.timestep != self._steps_done:
            self._steps_done = TIMESTEP.check("timestep", self.timestep)
            self._search.world.worlds["t"] = self._steps_done
        self._search.advance(joint)
        self._steps_done += 1
        self.timestep = self._steps_done

    def _published_cells(self) -> Collection[Any]:
        """Return the cells of all drones as `agents_positions` has them."""
        raise NotImplementedError

    def _check_apart(self, cells: Any) -> None:
        """Raise unless the drones start in different cells, as the packages demand of each task.

        Raises:
            FieldError: If there is not one cell on the grid for each drone, or one occurs twice.
        """
        if cells is not None:
            checked = SPECS["drones_positions"].check("drones_positions", cells)
            grid, count = self._search.world.grid_size, self._search.world.num_drones
            check_positions(checked, grid, count, None, apart=True)

    def _check_started(self) -> None:
        """Raise unless there was a reset."""
        if not self._begun:
            raise FieldError("Please reset the env before interacting with it")

    def _outcome(
        self, agents: list[str]
    ) -> tuple[dict[str, float], dict[str, bool], dict[str, bool]]:
        """Return rewards, terminations and truncations of the first drones in the last step."""
        rewards, terminations, truncations = self._of_step
        return (
            dict(zip(agents, rewards.tolist(), strict=False)),
            dict(zip(agents, terminations.tolist(), strict=False)),
            dict(zip(agents, truncations.tolist(), strict=False)),
        )

    def _cells(self) -> list[Any]:
        """Return the cells (x, y) of all drones, and remember that they are published."""
        self._placed = list(zip(self._x.tolist(), self._y.tolist(), strict=True))
        return self._placed

    def _place_drones(self, cells: Collection[Any]) -> None:
        """Move the drones whose cells the script has replaced in `agents_positions`.

        Raises:
            FieldError: If there is not one cell on the grid for each drone that has an agent.
        """
        if len(cells) == len(self._placed) and all(map(is_, cells, self._placed)):
            return
        if len(cells) != len(self._placed):
            raise FieldError(
                f"agents_positions must be {len(self._placed)} cells, one per drone, got "
                f"{shown(cells)}"
            )
        acting = list(cells)[: len(self.agents)]
        checked = SPECS["drones_positions"].check("agents_positions", acting)
        for cell in checked:
            check_cell("agents_positions", cell, self._search.world.grid_size)
        drones = self._search.world.drones[0, : len(acting)]
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
        """The rules of the search, with the rewards as they are now."""
        return self._rules()

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
