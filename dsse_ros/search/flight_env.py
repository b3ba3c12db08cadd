# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search in metres as a PettingZoo parallel environment: drones fly by a turn and a speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.scenario.fields import FieldError, shown
from dsse_ros.search.observation import Started, Stepped, agent_infos
from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.world import World

STATE = ("east", "south", "heading_east", "heading_north", "speed")
"""The state of a drone in an observation: its position as a share of the grid's side, its heading
as a unit vector, and its airspeed as a share of that of cruise."""
STRAIGHT_ON = (0.0, 1.0)
"""The action of a drone without a command."""

_LOWEST = np.array([0, 0, -1, -1, 0], np.float32)


def state_space(grid_size: int) -> spaces.Tuple:  # type: ignore[type-arg]
    """Return the observation space of a drone in metres, over a grid of G x G cells."""
    return spaces.Tuple(
        (
            spaces.Box(_LOWEST, np.ones(len(STATE), np.float32)),
            spaces.Box(0.0, 1.0, (grid_size, grid_size), np.float32),
        )
    )


def action_space() -> spaces.Box:
    """Return the action space of a drone in metres, see `step.flight_paths`."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def states_of(world: World) -> NDArray[np.float32]:
    """Return the states (B, N, 5) float32 of the drones, see `STATE`."""
    assert world.flight is not None
    side_m = world.grid_size * world.scenario.cell_size
    cruise = world.flight.flyers["cruise"][world.looks.kind]
    return states_from(world.flight.flights, side_m, cruise)


def states_from(
    flights: NDArray[np.void], side_m: float, cruise: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the states (..., N, 5) float32 of N drones, see `STATE`.

    Args:
        flights: (..., N) of `flight_paths.FLIGHTS`.
        side_m: Side of the grid.
        cruise: (N,) their airspeeds of cruise, m/s.
    """
    columns = (
        flights["east"] / side_m, flights["south"] / side_m, np.sin(flights["heading"]),
        np.cos(flights["heading"]), flights["speed"] / cruise,
    )  # fmt: skip
    states: NDArray[np.float32] = np.stack(columns, axis=-1).astype(np.float32)
    return np.clip(states, _LOWEST, 1.0, out=states)


class FlightEnv(SearchEnv):
    """A `SearchEnv` whose drones fly in metres.

    An observation is a plain tuple of a state (5,) float32, see `STATE`, and the map (G, G) float32
    as [y, x]. An action is a turn and a speed, (2,) from -1 to 1, see `step.flight_paths`: it is
    flown for a step of `step_duration_s`. `infos[agent]` has no `action_mask`, and `path` (K + 1,
    2) float64, the positions of the drone at equal times of the last step, metres to the east and
    to the south of the grid's north-west corner. With `vehicle_timed_actions` it has `looked` (K +
    1,) bool: whether it looked right before the step and on each piece.
    """

    _in_metres = True

    def _observation_space(self) -> spaces.Space[Any]:
        return state_space(self.world.grid_size)

    def _action_space(self) -> spaces.Space[Any]:
        return action_space()

    def _observe(self, agents: list[str], live: list[int]) -> Started:
        """Return observations and infos of these agents."""
        states, probability = states_of(self.world)[0], self.probability
        observations = {
            agent: (states[i], probability) for agent, i in zip(agents, live, strict=True)
        }
        assert self.world.flight is not None
        columns = self._info_columns(live)
        columns["path"] = [self.world.flight.paths[0, i].copy() for i in live]
        if self.rules.vehicle_timed_actions:
            columns["looked"] = [self.world.flight.looked[0, i].copy() for i in live]
        return observations, agent_infos(agents, self._num_missing[0] == 0, None, columns)

    def step(self, actions: Mapping[str, Any]) -> Stepped:
        """Advance the mission by one step, see `SearchEnv.step`; actions are those of the class."""
        return super().step(actions)

    def _take(self, actions: Mapping[str, Any]) -> None:
        """Check the live agents' actions and store them for the next step."""
        if not isinstance(actions, Mapping):
            raise FieldError(f"actions must be two numbers per live agent, got {shown(actions)}")
        taken = [
            flight_action_of(agent, actions) if self._alive[i] else STRAIGHT_ON
            for agent, i in zip(self.agents, self._live, strict=True)
        ]
        assert self.world.flight is not None
        self.world.flight.actions[0, self._live] = taken


def flight_action_of(
    agent: str, actions: Mapping[str, Any], *, low: float = -1.0, names: str = "turn and speed"
) -> NDArray[np.float64]:
    """Return the action of an agent, (2,).

    Args:
        agent: The agent.
        actions: By agent.
        low: Smallest of the two numbers; the largest is 1.
        names: What they are.

    Raises:
        FieldError: If it is missing or not two such numbers.
    """
    if agent not in actions:
        raise FieldError(f"actions: {agent} is missing; one action per live agent")
    try:
        action = np.asarray(actions[agent], np.float64)
    except (TypeError, ValueError):
        action = np.full(2, np.nan)
    # This form of the comparison also refuses NaN.
    if action.shape != (2,) or not ((action >= low) & (action <= 1.0)).all():
        raise FieldError(
            f"action of {agent} must be two numbers from {low:g} to 1, {names}, got "
            f"{shown(actions[agent])}"
        )
    return action
