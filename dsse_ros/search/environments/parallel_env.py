# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search as a PettingZoo parallel environment, a thin layer over one `World`."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import repeat
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.picture import rendering
from dsse_ros.search.environments.agents import (
    RESET_FIRST,
    AgentObservation,
    AgentSpaces,
    Started,
    Stepped,
    agent_infos,
)
from dsse_ros.search.environments.mission_history import MissionHistory, view_of
from dsse_ros.search.environments.snapshot import Snapshot
from dsse_ros.search.environments.space import action_space, observation_space, space_of
from dsse_ros.search.environments.world import Rebound, World
from dsse_ros.search.environments.world_beliefs import observed_beliefs
from dsse_ros.world.scenario.env_options import OBSERVED, check_options, check_seed
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import (
    ResolvedScenario,
    Scenario,
)


class SearchEnv(Rebound, AgentSpaces, ParallelEnv[str, AgentObservation, int]):
    """A drone swarm searching for persons at sea (PettingZoo parallel API).

    An observation is a plain tuple with the parts of an `Observation`, from the space
    `Tuple(MultiDiscrete([C, R]), Box(0, 1, (R, C), float32))`: the agent's cell (x, y) and the map
    [y, x], one read-only array that all agents share. Actions are numbers of `rules.actions`.
    `infos[agent]` has `Found`, whether every person has been found, `action_mask` (A,) int8, 0
    where a move would leave the grid or the area, and, with several persons,
    the keys of `World.info_columns`.

    In metres a drone observes its state (5,) float32, see `space.STATE`, in place of its cell. An
    action is a turn and a speed, (2,) from -1 to 1, see `step.metres_paths`, and is flown for a
    step of `step_duration_s`. `infos[agent]` has no `action_mask`, and `path` (K + 1, 2) float64,
    the positions of the drone at equal times of the last step, metres to the east and to the south
    of the grid's north-west corner. With `vehicle_timed_actions` it has `looked` (K + 1,) bool:
    whether it looked right before the step and on each piece, and `wind`, the velocity of the wind
    to the east and to the north, m/s: the scenario's, or one reported in flight.

    By default agents observe the map of the rules, which searches do not change. With
    `observe="belief"` they observe the posterior after the searches so far (`belief.Belief`), in
    the cells that the drones observed, and `infos[agent]` has `pos`, the cumulative probability of
    success of the mission's searches there.

    In the coverage task agents observe the probability left to cover. `Found` is then whether all
    is covered, and `infos[agent]` has the metrics of `coverage_task.Coverage`.

    Attributes:
        world: The arrays behind this environment, a batch of one.
        scenario: The resolved scenario.
        rules: The rules in force.
        observed: The map that agents observe, `map` or `belief`.

    Raises:
        FieldError: If the scenario does not fit the rules, or an argument is unknown.
    """

    metadata = {
        "name": "dsse_search_v1",
        "render_modes": ["ansi", "rgb_array", "human"],
        "render_fps": 10,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        scenario: Scenario,
        rules: Rules,
        render_mode: str | None = None,
        *,
        observe: str = "map",
    ) -> None:
        modes: list[str] = self.metadata["render_modes"]  # type: ignore[assignment]
        if render_mode is not None and not (isinstance(render_mode, str) and render_mode in modes):
            known = ", ".join(modes)
            raise FieldError(f"render_mode must be one of {known}, got {shown(render_mode)}")
        self.render_mode = render_mode
        self.rules = rules
        self.observed = OBSERVED.check("observe", observe)
        self.world = World(scenario, rules, write_maps=self.observed == "map")
        self._space = space_of(self.world)
        self._beliefs = observed_beliefs(self.world) if self.observed == "belief" else None
        self._belief_map: NDArray[np.float32] | None = None
        self._note_belief()
        self.scenario = self.world.scenario
        self.possible_agents = [f"drone{i}" for i in range(self.world.num_drones)]
        self.agents: list[str] = []
        # All agents share one space, because its bounds are as large as the map.
        self.observation_spaces = dict.fromkeys(
            self.possible_agents, observation_space(self.world.grid_size, rules)
        )
        self.action_spaces = {agent: action_space(rules) for agent in self.possible_agents}
        # The share of the time used exceeds 1 in the steps after the limit.
        limit = self.world.scenario.timestep_limit
        used = (rules.last_step(limit) + 1) / limit
        most = max(self.world.num_drones, self.scenario.person_amount, used)
        self.state_space = spaces.Box(0.0, float(most), (4, *self.world.grid_size.matrix))
        self._live: list[int] = []
        self._no_flags: dict[str, bool] = {}
        self._history: MissionHistory | None = None
        self._rebind()

    def _bind(self) -> None:
        """Create the views on the world's arrays, and whatever must not be copied."""
        world = self.world
        self._rewards = world.rewards[0]
        self._terminated, self._truncated = world.terminated[0], world.truncated[0]
        # Memory views return plain numbers in a third of the time of an array.
        self._num_active, self._num_missing, self._done = (
            world.worlds[name].data for name in ("num_active", "num_missing", "done")
        )
        # A window stays with the environment that opened it.
        self._viewer: rendering.Viewer | None = None
        self._renderer: rendering.FigureRenderer | None = None

    def reset(self, seed: int | None = None, options: Mapping[str, Any] | None = None) -> Started:
        """Start a new mission.

        Args:
            seed: Seed of the world's generator; without one the generator continues.
            options: Values for this mission only: `drones_positions`, `vector`,
                `person_initial_position`, `person_pod_multipliers`. A key `options`, which
                PettingZoo's tests pass, is ignored.

        Raises:
            FieldError: If an option is unknown or not allowed; the current mission stays as it is.
        """
        start = check_options(options, self.scenario, self.rules)
        if seed is not None:
            self.world.seed(check_seed(seed))
        self.world.place(**start)
        if self._beliefs is not None:
            self._beliefs.reset()
        self.world.reset()
        self._note_belief()
        self._note_live()
        self._start_history()
        result = self._observe(self.agents, self._live)
        self._show()
        return result

    def step(self, actions: Mapping[str, Any]) -> Stepped:
        """Advance the mission by one step.

        Args:
            actions: One action per live agent; withdrawn agents need none, and those of other
                agents are ignored.

        Raises:
            FieldError: If an action is missing or not allowed; the mission stays as it is.
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        agents, live = self.agents, self._live
        if not agents:
            self._check_reset()
            return {}, {}, {}, {}, {}
        self._space.take(agents, live, actions)
        self._advance()
        rewards = self._rewards.tolist()
        if len(agents) < len(rewards):
            rewards = [rewards[i] for i in live]
        if self.agents is agents:
            # Nobody has left the search, so there is no flag.
            terminations, truncations = self._no_flags.copy(), self._no_flags.copy()
        else:
            terminations, truncations = (
                {agent: values[i] for agent, i in zip(agents, live)}
                for values in (self._terminated.tolist(), self._truncated.tolist())
            )
        observations, infos = self._observe(agents, live)
        self._show()
        return observations, dict(zip(agents, rewards)), terminations, truncations, infos

    def advance(self, joint: NDArray[np.int8]) -> None:
        """Advance the world by one joint action (N,) int8, without making observations.

        `NO_ACTION` stands for a drone that does nothing.

        Raises:
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        self._check_reset()
        self._space.joint[0] = joint
        self._advance()

    def withdraw(self, drone: int) -> bool:
        """Take a drone out of the mission; it stays where it is and the others continue.

        The next step terminates it: the drone does nothing, whatever its action, earns 0, and
        leaves `agents`. If it was the last one, that step ends the mission.

        Args:
            drone: Its number.

        Returns:
            Whether it was still in the search.

        Raises:
            FieldError: If there is no such drone.
        """
        drone = Spec("int", "", low=0, high=self.world.num_drones - 1).check("drone", drone)
        return bool(self.world.withdraw(drone)[0])

    def snapshot(self) -> Snapshot:
        """Return the whole state of the mission, random state included."""
        snapshot = self.world.snapshot()
        if self._beliefs is not None:
            snapshot.arrays.update(self._beliefs.arrays())
        return snapshot

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot, bit for bit; the tracks of pictures start empty.

        Raises:
            SnapshotError: If it is of another scenario or other rules, or lacks the belief that
                agents observe; the current mission stays as it is.
        """
        if self._beliefs is not None:
            self._beliefs.check(snapshot)
        self.world.restore(snapshot)
        if self._beliefs is not None:
            self._beliefs.restore(snapshot)
        self._note_belief()
        self._note_live()
        self._start_history()

    @property
    def flags(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Terminated and truncated (N,) of all drones."""
        return self._terminated.copy(), self._truncated.copy()

    @property
    def mission_scenario(self) -> ResolvedScenario:
        """The scenario with the values that the reset `options` replaced."""
        replaced = self.world.placed()
        return self.scenario.override(**replaced).resolve(self.rules) if replaced else self.scenario

    @property
    def steps_done(self) -> int:
        """Number of steps done in the mission."""
        return int(self.world.worlds["t"][0])

    @property
    def positions(self) -> NDArray[np.int64]:
        """Cells (N, 2) as (x, y) of all drones, as they observe them."""
        return self._space.cells[0].copy()

    @property
    def probability(self) -> NDArray[np.float32]:
        """The map or belief of the last observation, (R, C) as [y, x], read-only."""
        probability = self.world.maps[0] if self._belief_map is None else self._belief_map
        probability.setflags(write=False)
        return probability

    def action_masks(self) -> NDArray[np.int8]:
        """Return the action masks (N, A) of all drones."""
        return self.world.action_masks()[0]

    def state(self) -> NDArray[np.float32]:
        """Return the global state (4, R, C) float32, hidden parts included.

        Planes: probability, drones in flight, persons not found yet, share of the time used.

        Raises:
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        self._check_reset()
        world = self.world
        drones, persons = world.drones[0], world.persons[0]
        state = np.zeros(self.state_space.shape, np.float32)
        state[0] = self.probability
        for plane, things in ((1, drones[drones["alive"]]), (2, persons[~persons["found"]])):
            x, y = things["x"], things["y"]
            inside = (
                (x >= 0) & (x < world.grid_size.columns) & (y >= 0) & (y < world.grid_size.rows)
            )
            np.add.at(state[plane], (y[inside], x[inside]), 1)
        state[3] = world.worlds["t"][0] / self.scenario.timestep_limit
        return state

    def view(self) -> rendering.MissionView:
        """Return the contents of a picture; the past is recorded only in a render mode."""
        pos = None if self._beliefs is None else float(self._beliefs.pos[0])
        return view_of(
            self.world, self.probability, self._history or MissionHistory(self.world), pos
        )

    def render(self) -> str | NDArray[np.uint8] | None:
        """Return the mission as text (ansi) or image (H, W, 3) uint8 (rgb_array), or show it.

        Raises:
            ModuleNotFoundError: If matplotlib is missing in the mode rgb_array or human.
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        if self.render_mode is None:
            return None
        self._check_reset()
        view = self.view()
        if self.render_mode == "ansi":
            return rendering.to_ansi(view)
        if self.render_mode == "rgb_array":
            if self._renderer is None:
                self._renderer = rendering.FigureRenderer()
            return self._renderer.rgb_array(view)
        if self._viewer is None:
            self._viewer = rendering.Viewer(float(self.metadata["render_fps"]))  # type: ignore[arg-type]
        self._viewer.show(view)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
        self._renderer = None

    def _check_reset(self) -> None:
        """Raise before the first reset.

        Raises:
            gymnasium.error.ResetNeeded: If there was no reset.
        """
        if self._done[0] and self.steps_done == 0:
            raise ResetNeeded(RESET_FIRST)

    def _show(self) -> None:
        if self.render_mode == "human":
            self.render()

    def _start_history(self) -> None:
        self._history = None if self.render_mode is None else MissionHistory(self.world)

    def _note_belief(self) -> None:
        """Update the observed map from the belief, if agents observe that."""
        self._belief_map = None if self._beliefs is None else self._beliefs.write()[0]

    def _advance(self) -> None:
        """Advance the world by the actions taken."""
        if self.render_mode is None:
            self._history = None
        elif self._history is None:
            self._history = MissionHistory(self.world)
        if self._history is not None:
            self._history.before_step(self._space.joint[0], self.probability)
        (self._beliefs or self.world).step(self._space.joint)
        self._note_belief()
        if self._history is not None:
            self._history.after_step()
        if self._done[0] or self._num_active[0] < len(self.agents):
            self._note_live()

    def _note_live(self) -> None:
        """Update the live agents: drones without a flag, none before the first reset."""
        out = self._terminated | self._truncated | self._done[0]
        self._live = [i for i, is_out in enumerate(out.tolist()) if not is_out]
        self.agents = [self.possible_agents[i] for i in self._live]
        self._no_flags = dict.fromkeys(self.agents, False)

    def _observe(self, agents: list[str], live: list[int]) -> Started:
        """Return observations and infos of these agents."""
        places, masks, own = self._space.observe(live)
        # Plain tuples: named ones would take a sixth of a step with 50 drones.
        observations = dict(zip(agents, zip(places, repeat(self.probability))))
        columns = self.world.info_columns(0, live)
        if self._beliefs is not None:
            columns["pos"] = [float(self._beliefs.pos[0])] * len(live)
        columns |= own
        return observations, agent_infos(agents, self._num_missing[0] == 0, masks, columns)
