# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Cells or metres: what differs between searches in which drones move from cell to cell, or fly.

Both environments, `SearchEnv` of one world and `VectorEnv` of many, have a `Space`: it checks
actions, and makes the part of observations and infos that tells where drones are.
"""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridExtent, GridShape
from dsse_ros.search.environments.metres_drones import MetresDrones
from dsse_ros.search.environments.world import Rebound, World
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.rules import Rules

FEW_ACTIONS = 4096
"""Up to this many actions, checking each byte is faster than NumPy's reductions."""

STATE = ("east", "south", "heading_east", "heading_north", "speed")
"""The state of a drone in metres, as it observes it: its position as shares of the grid's width and
height,
its heading as a unit vector, and its airspeed as a share of that of cruise."""
STRAIGHT_ON = (0.0, 1.0)
"""The action of a drone in metres without a command."""

_LOWEST = np.array([0, 0, -1, -1, 0], np.float32)


Observed = tuple[NDArray[Any], Iterable[NDArray[np.int8]] | None, dict[str, Iterable[Any]]]
"""Where drones observe themselves, a row each; their action masks, None in metres; and further
infos by key."""


class Space(Rebound, ABC):
    """Cells or metres, for the drones of B worlds.

    Args:
        world: The worlds.

    Attributes:
        cells: (B, N, 2) int64, the cells (x, y) in which the drones observe themselves, a view.
        joint: (B, N) int8, the next actions by number; in metres they are in `World.metres`.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._rebind()

    def _bind(self) -> None:
        world = self._world
        if world.faults is not None and world.faults.is_noisy:
            self.cells = world.faults.positions()
        else:
            # x and y are the first fields of a drone's record.
            self.cells = world.drones.view(np.int64).reshape(*world.drones.shape, -1)[..., :2]
        self.joint = np.zeros(world.drones.shape, np.int8)

    # The agents of the first world

    @abstractmethod
    def take(self, agents: Sequence[str], drones: list[int], actions: Mapping[str, Any]) -> None:
        """Check the actions of live agents, and store them for the next step.

        Args:
            agents: The live agents.
            drones: Their numbers.
            actions: By agent; withdrawn agents need none, those of others are ignored.

        Raises:
            FieldError: If an action is missing or not allowed.
        """

    @abstractmethod
    def observe(self, drones: list[int]) -> Observed:
        """Return where drones observe themselves, and the infos that only this space has."""

    # The drones of many worlds

    @abstractmethod
    def joint_of(self, actions: Any) -> NDArray[np.int8]:
        """Return the checked actions of all drones by number, (B, N); see `joint`.

        Raises:
            FieldError: If the actions have another shape, or the rules do not allow one.
        """

    @abstractmethod
    def observed(self, cells: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """Return where the drones are, (B, N, ...) by name; `cells` are those of the report."""

    @abstractmethod
    def infos(self, masks: NDArray[np.int8]) -> dict[str, NDArray[Any]]:
        """Return the infos that only this space has; `masks` are those of the report."""

    @abstractmethod
    def of_one_world(self) -> tuple[spaces.Dict, spaces.Space[Any]]:
        """Return the spaces of the observations and of the joint action of one world."""


class CellSpace(Space):
    """Drones move from cell to cell: actions are numbers, and drones observe their cells (x, y)."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._of_agents = bytes(range(len(world.rules.actions)))
        self._of_worlds = self._of_agents + bytes([NO_ACTION & 0xFF])

    def _bind(self) -> None:
        super()._bind()
        self._joint_bytes = self.joint[0].data.cast("B")
        self._alive = self._world.drones["alive"][0]
        self._places: NDArray[Any] = self.cells[0]
        self._table: list[list[NDArray[np.int8]]] | None = None

    def take(self, agents: Sequence[str], drones: list[int], actions: Mapping[str, Any]) -> None:
        """See `Space`."""
        try:
            # bytearray() accepts only integers from 0 to 255.
            values = list(map(actions.__getitem__, agents))
            numbers = bytearray(values)
            # true and false are numbers in Python, but no actions.
            if numbers.translate(None, self._of_agents) or bool in map(type, values):
                raise ValueError
        except (AttributeError, KeyError, TypeError, ValueError):
            if not isinstance(actions, Mapping):
                raise FieldError(
                    f"actions must be one number per live agent, got {shown(actions)}"
                ) from None
            rules = self._world.rules
            numbers = bytearray(
                (action_of(rules, agent, actions) if self._alive[i] else NO_ACTION) & 0xFF
                for agent, i in zip(agents, drones, strict=True)
            )
        if len(numbers) == len(self._joint_bytes):
            self._joint_bytes[:] = numbers
        else:
            self.joint[0, drones] = np.frombuffer(numbers, np.int8)

    def observe(self, drones: list[int]) -> Observed:
        """See `Space`."""
        world, places = self._world, self._places
        places = places.copy() if len(drones) == len(places) else places[drones]
        if world.faults is not None:
            return places, world.action_masks()[0][drones], {}
        if self._table is None:
            self._table = world.mask_table
        table = self._table
        # The caller owns the infos, also those of drones that are in one cell.
        return places, [table[y][x].copy() for x, y in places.tolist()], {}

    def joint_of(self, actions: Any) -> NDArray[np.int8]:
        """See `Space`; `NO_ACTION` replaces numbers that the rules count as nothing."""
        world, count = self._world, len(self._of_agents)
        actions = check_integers("actions", actions, world.drones.shape)
        if not self._are_known(actions):
            unknown = (actions < NO_ACTION) | (actions >= count)
            acting = world.drones["alive"] & ~world.worlds["done"][:, None]
            if not world.rules.noop_actions and (wrong := unknown & acting).any():
                raise FieldError(
                    f"actions must be from 0 to {count - 1}, or {NO_ACTION} for nothing, got "
                    f"{actions[wrong][0]}"
                )
            actions = np.where(unknown, NO_ACTION, actions)
        return actions.astype(np.int8, copy=False)

    def _are_known(self, actions: NDArray[Any]) -> bool:
        """Return whether all numbers are of actions, or `NO_ACTION`."""
        if actions.dtype == np.int8 and actions.size <= FEW_ACTIONS:
            return not actions.tobytes().translate(None, self._of_worlds)
        return bool(actions.min() >= NO_ACTION and actions.max() < len(self._of_agents))

    def observed(self, cells: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """See `Space`."""
        return {"positions": cells}

    def infos(self, masks: NDArray[np.int8]) -> dict[str, NDArray[Any]]:
        """See `Space`."""
        return {"action_mask": masks}

    def of_one_world(self) -> tuple[spaces.Dict, spaces.Space[Any]]:
        """See `Space`."""
        world, margin = self._world, self._world.rules.margin
        highest = [[size - 1 + margin for size in world.grid_size]] * world.num_drones
        return (
            spaces.Dict(
                positions=spaces.Box(
                    np.full((world.num_drones, 2), -margin), np.array(highest), dtype=np.int64
                ),
                probability=map_space(world.grid_size),
            ),
            spaces.MultiDiscrete([len(self._of_agents)] * world.num_drones),
        )


class MetresSpace(Space):
    """Drones fly in metres: actions are turns and speeds, and drones observe their states.

    An action is (2,) from -1 to 1, see `step.metres_paths`; a state is (5,) float32, see `STATE`.
    """

    @property
    def _drones(self) -> MetresDrones:
        assert self._world.metres is not None
        return self._world.metres

    def take(self, agents: Sequence[str], drones: list[int], actions: Mapping[str, Any]) -> None:
        """See `Space`."""
        if not isinstance(actions, Mapping):
            raise FieldError(f"actions must be two numbers per live agent, got {shown(actions)}")
        alive = self._world.drones["alive"][0]
        taken = [
            turn_and_speed_of(agent, actions) if alive[i] else STRAIGHT_ON
            for agent, i in zip(agents, drones, strict=True)
        ]
        self._drones.actions[0, drones] = taken

    def observe(self, drones: list[int]) -> Observed:
        """See `Space`."""
        paths, looked = self._drones.paths[0], self._drones.looked[0]
        columns: dict[str, Iterable[Any]] = {"path": [paths[i].copy() for i in drones]}
        if self._world.rules.vehicle_timed_actions:
            columns["looked"] = [looked[i].copy() for i in drones]
            columns["wind"] = [self._drones.wind_mps] * len(drones)
        return states_of(self._world)[0, drones], None, columns

    def joint_of(self, actions: Any) -> NDArray[np.int8]:
        """See `Space`; the actions by number do nothing."""
        world, shape = self._world, (*self._world.drones.shape, 2)
        try:
            taken = np.asarray(actions, np.float64)
        except (TypeError, ValueError):
            taken = np.empty(0)
        if taken.shape != shape:
            raise FieldError(f"actions must be numbers {shape}, turns and speeds")
        acting = world.drones["alive"] & ~world.worlds["done"][:, None]
        # This form of the comparison also refuses NaN.
        wrong = ~(np.abs(taken) <= 1.0) & acting[..., None]
        if wrong.any():
            raise FieldError(f"actions must be from -1 to 1, got {taken[wrong][0]:g}")
        self._drones.actions[:] = taken
        return np.full(world.drones.shape, NO_ACTION, np.int8)

    def observed(self, cells: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """See `Space`."""
        return {"states": states_of(self._world)}

    def infos(self, masks: NDArray[np.int8]) -> dict[str, NDArray[Any]]:
        """See `Space`."""
        return {"path": self._drones.paths.copy()}

    def of_one_world(self) -> tuple[spaces.Dict, spaces.Space[Any]]:
        """See `Space`."""
        world, rules = self._world, self._world.rules
        states = _repeated(state_space(rules), world.num_drones)
        return (
            spaces.Dict(states=states, probability=map_space(world.grid_size)),
            _repeated(action_space(rules), world.num_drones),
        )


def space_of(world: World) -> Space:
    """Return the space of the drones of B worlds."""
    return MetresSpace(world) if world.rules.in_metres else CellSpace(world)


def observation_space(grid: GridShape, rules: Rules) -> spaces.Tuple:  # type: ignore[type-arg]
    """Return the observation space of a drone: of its cell or state, and of the map (R, C)."""
    place: spaces.Space[Any]
    if rules.in_metres:
        place = state_space(rules)
    else:
        span, first = list(grid.padded(rules.margin)), [-rules.margin] * 2
        place = spaces.MultiDiscrete(span, start=first)
    return spaces.Tuple((place, map_space(grid)))


def action_space(rules: Rules) -> spaces.Space[Any]:
    """Return the action space of a drone: a number, or a turn and a speed."""
    if rules.in_metres:
        return spaces.Box(-1.0, 1.0, (2,), np.float32)
    return spaces.Discrete(len(rules.actions))


def map_space(grid: GridShape) -> spaces.Box:
    """Return the space of the map (R, C)."""
    return spaces.Box(0.0, 1.0, grid.matrix, np.float32)


def state_space(rules: Rules) -> spaces.Box:
    """Return the space of a `STATE`; vehicles may be off the grid."""
    lowest, highest = _LOWEST.copy(), np.ones(len(STATE), np.float32)
    if rules.vehicle_timed_actions:
        lowest[:2], highest[:2] = -np.inf, np.inf
    return spaces.Box(lowest, highest)


def _repeated(space: Any, count: int) -> spaces.Box:
    low, high = (np.repeat(bound[None], count, axis=0) for bound in (space.low, space.high))
    return spaces.Box(low, high, dtype=space.dtype)


def states_of(world: World) -> NDArray[np.float32]:
    """Return the states (B, N, 5) float32 of the drones of B worlds in metres, see `STATE`."""
    assert world.metres is not None
    extent = world.grid_size.extent(world.scenario.cell_size)
    cruise = world.metres.airframes["cruise"][world.looks.kind]
    return states_from(world.metres.states, extent, cruise)


def states_from(
    states: NDArray[np.void], extent: GridExtent, cruise: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the observed states (..., N, 5) float32 of N drones, see `STATE`.

    Args:
        states: (..., N) of `metres_paths.MOTION_STATES`.
        extent: Of the grid.
        cruise: (N,) their airspeeds of cruise, m/s.
    """
    columns = (
        states["east"] / extent.width, states["south"] / extent.height, np.sin(states["heading"]),
        np.cos(states["heading"]), states["speed"] / cruise,
    )  # fmt: skip
    observed: NDArray[np.float32] = np.stack(columns, axis=-1).astype(np.float32)
    # Positions are what they are: a vehicle may be off the grid.
    np.clip(observed[..., 2:], _LOWEST[2:], 1.0, out=observed[..., 2:])
    return observed


def number_of(value: Any) -> int:
    """Return an action as a number; true and false are none.

    Raises:
        TypeError: If it is no whole number.
    """
    if isinstance(value, bool):
        raise TypeError
    return operator.index(value)


def action_of(rules: Rules, agent: str, actions: Mapping[str, int]) -> int:
    """Return an agent's action number; `NO_ACTION` if the rules count its action as nothing.

    Raises:
        FieldError: If the action is missing or the rules do not allow it.
    """
    if agent not in actions:
        raise FieldError(f"actions: {agent} is missing; one action per live agent")
    value = actions[agent]
    try:
        # If unknown actions do nothing, any value that equals a number counts, as in DSSE 0.1.13.
        known = range(len(rules.actions))
        return known.index(value if rules.noop_actions else number_of(value))
    except (TypeError, ValueError):
        if rules.noop_actions:
            return NO_ACTION
    raise FieldError(
        f"action of {agent} must be one of {rules.action_set}, got {shown(value)}"
    ) from None


def turn_and_speed_of(
    agent: str, actions: Mapping[str, Any], *, low: float = -1.0, names: str = "turn and speed"
) -> NDArray[np.float64]:
    """Return the action (2,) of an agent in metres.

    Args:
        agent: The agent.
        actions: By agent.
        low: Smallest of the two numbers; the largest is 1.
        names: Names of the two numbers.

    Raises:
        FieldError: If it is missing or not two such numbers.
    """
    if agent not in actions:
        raise FieldError(f"actions: {agent} is missing; one action per live agent")
    try:
        value = np.asarray(actions[agent])
        action = value.astype(np.float64) if value.dtype.kind != "b" else np.full(2, np.nan)
    except (TypeError, ValueError):
        action = np.full(2, np.nan)
    # Two numbers are compared faster without NumPy; this form also refuses NaN.
    if action.shape != (2,) or not all(low <= number <= 1.0 for number in action.tolist()):
        raise FieldError(
            f"action of {agent} must be two numbers from {low:g} to 1, {names}, got "
            f"{shown(actions[agent])}"
        )
    return action


def check_integers(name: str, value: Any, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Return the value as an array of integers of this shape, where None is any length.

    Raises:
        FieldError: If the value is not such an array.
    """
    wanted = f"integers ({', '.join('any' if n is None else str(n) for n in shape)})"
    try:
        array = np.asarray(value)
    except ValueError:
        raise FieldError(f"{name} must be {wanted}, got {shown(value)}") from None
    fits = len(array.shape) == len(shape) and all(
        n in (None, length) for n, length in zip(shape, array.shape, strict=True)
    )
    if not fits or array.dtype.kind not in "iu":
        raise FieldError(f"{name} must be {wanted}, got {array.dtype} {array.shape}")
    return array
