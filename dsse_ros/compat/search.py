# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`DroneSwarmSearch` of DSSE 1.1.9 over `SearchEnv` with the profile v2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.compat.constants import Actions, Reward
from dsse_ros.compat.drifting import Person, ProbabilityMatrix
from dsse_ros.compat.published import Cell, DroneData, Infos, no_rewards
from dsse_ros.compat.swarm import SwarmEnv
from dsse_ros.world.scenario.cell_checks import check_cell
from dsse_ros.world.scenario.limits import MAX_PRE_SEARCH_STEPS
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario import SPECS, Scenario

Observations = dict[str, tuple[Cell, NDArray[np.float32]]]

NAMES = {
    "drone_amount": "num_drones",
    "dispersion_start": "sigma",
    "pre_render_time": "pre_search_minutes",
    "grid_cell_size": "cell_size",
}
"""Fields of the scenario by published argument, where the names differ."""


PRE_RENDER_STEPS = Spec("int", "Steps before a mission.", low=0, high=MAX_PRE_SEARCH_STEPS)
TIME_STEP = Spec("float", "Duration of a step.", above=0, unit="s")
_OF_DATUM = (
    "datum_x", "datum_y", "circle_x", "circle_y", "remainder_x", "remainder_y", "scale",
)  # fmt: skip
"""State of the map in `entities.WORLDS`."""


class DroneSwarmSearch(SwarmEnv):
    """The search of DSSE 1.1.9 (PettingZoo parallel API).

    An observation is the agent's cell (x, y) and the map (G, G) float32 as [y, x]. Arguments,
    methods and attributes are the published ones; a seed of `reset` seeds the mission.

    Raises:
        ValueError: If an argument is not allowed.
    """

    metadata = {"name": "DroneSwarmSearchV0"}
    _names = NAMES
    _read_in_reset = {
        "grid_size": "grid_size",
        "dispersion_inc": "dispersion_inc",
        "dispersion_start": "sigma",
        "person_amount": "person_amount",
        "person_initial_position": "person_initial_position",
    }
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
        self.grid_size = grid_size
        self.dispersion_inc = dispersion_inc
        self.dispersion_start = dispersion_start
        self.person_amount = person_amount
        self.person_initial_position = person_initial_position
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
        drone = DroneData(drone_amount, drone_speed, probability_of_detection)
        self._publish(drone, grid_cell_size, timestep_limit)
        self.vector = vector
        self.disaster_position = person_initial_position
        self._probability_matrix: ProbabilityMatrix | None = None
        self._search.world.persons["x"], self._search.world.persons["y"] = person_initial_position
        self._meet_persons()
        self.pre_render_steps = self._search.scenario.pre_search_steps
        self.observation_spaces = self._search.observation_spaces
        self._keep_spaces()
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
        self._probability_matrix = ProbabilityMatrix(self._search.world, self.time_step_relation)
        self._meet_persons()
        self.rewards_sum = no_rewards(self.agents)
        observations = self.create_observations()
        self._show()
        return observations, self._infos()

    def _meet_persons(self) -> None:
        world = self._search.world
        self._persons = [
            Person(i, world, self.time_step_relation, self.cell_size)
            for i in range(world.persons.shape[1])
        ]
        self.persons_set: Any = set(self._persons)

    def _reset_search(self, seed: int | None, options: Mapping[str, Any]) -> None:
        """Reset the search; the map may drift from another cell than that of the persons.

        Raises:
            FieldError: If an option or an attribute is not allowed.
        """
        search = self._search
        read = {
            "cell_size": SPECS["cell_size"].check("cell_size", self.cell_size),
            "step_duration_s": TIME_STEP.check("time_step_relation", self.time_step_relation),
            "pre_search_steps": PRE_RENDER_STEPS.check("pre_render_steps", self.pre_render_steps),
        }
        disaster = SPECS["person_initial_position"].check(
            "disaster_position", self.disaster_position
        )
        check_cell("disaster_position", disaster, search.world.grid_size)
        apart = disaster != search.scenario.person_initial_position
        if apart and self.pre_render_steps:
            raise FieldError(
                "disaster_position must be person_initial_position with pre_render_steps, got "
                f"{shown(disaster)}"
            )
        constants = search.world.constants
        for name, value in read.items():
            constants[name] = value
        search.reset(seed, options)
        if apart:
            # In the step of a reset nobody moves yet, so this map is that of persons from there.
            there = search.snapshot()
            search.reset(None, {**options, "person_initial_position": disaster})
            for name in _OF_DATUM:
                there.arrays["worlds"][name] = search.world.worlds[name]
            search.restore(there)

    def _settings(self) -> tuple[Any, ...]:
        # Without super() and nested calls, because it is a tenth of a step.
        return (
            self.reward_scheme, self.drone.pod, self.timestep_limit, self.grid_size, self._over,
            len(self.rewards_sum), self._multipliers.tobytes(), *self.agents,
            *map(id, self.persons_set),
        )  # fmt: skip

    def _take_over(self) -> None:
        """Bring what a script has set into the world, see `SwarmEnv._take_over`."""
        super()._take_over()
        world, left = self._search.world, set(self.persons_set)
        unknown = [agent for agent in self.agents if agent not in self.rewards_sum]
        if unknown:
            raise FieldError(f"agents must be among those of the reset, got {unknown[0]!r}")
        if not left or not left.issubset(self._persons):
            raise FieldError("persons_set must have one or more of the persons of the reset")
        world.persons["found"] = [person not in left for person in self._persons]
        world.worlds["num_missing"] = len(left)
        pod = world.constants["probability_of_detection"]
        world.looks.pods[...] = np.minimum(self._multipliers * pod, 1.0)

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance the mission by one step, see `SwarmEnv.step`."""
        late = self._begun and self.timestep >= self.timestep_limit  # type: ignore[operator]
        done = super().step(actions)
        # The package does not add the rewards of steps after the limit.
        for agent, reward in () if late else done[1].items():
            self.rewards_sum[agent] += reward
        return done

    def _infos(self) -> Infos:
        (num_missing,) = self._num_missing.tolist()
        if num_missing < len(self.persons_set):
            found = self._search.world.persons["found"][0].tolist()
            for person in [person for person in self.persons_set if found[person.index]]:
                self.persons_set.remove(person)
        return {agent: {"Found": num_missing == 0} for agent in self.agents}

    @property
    def probability(self) -> NDArray[np.float32]:
        """The map (G, G) as [y, x] of the last observation."""
        return self._search.world.maps[0]

    @property
    def probability_matrix(self) -> ProbabilityMatrix | None:
        """The map; None before the first reset."""
        return self._probability_matrix

    def get_persons(self) -> set[Person]:
        """Return the persons who have not been found yet."""
        return self.persons_set
