# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The two interfaces of policies: `Planner`, on observations, and `Tactic`, on a belief."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief.protocol import TargetBelief, TargetForecast
from dsse_ros.search.environments.agents import AgentObservation as AgentObservation
from dsse_ros.search.environments.agents import Observation as Observation
from dsse_ros.world.scenario.actions import Cell as Cell
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario, Scenario

if TYPE_CHECKING:
    from typing_extensions import Self


Observations: TypeAlias = Mapping[str, AgentObservation]
"""Observations by live agent, in the fixed order of the agents."""

Infos: TypeAlias = Mapping[str, Mapping[str, Any]]
"""Infos by agent; see `Planner` for the keys."""


class Planner(Protocol):
    """A policy for one mission; it may keep state between steps."""

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every drone.

        Args:
            observations: By live agent, in the fixed order of the agents.
            infos: By agent. `action_mask`, int8 (A,), is 0 where a move would leave the grid or the
                search area. With several persons, `found_person` is whether the drone found one
                in the last step; with sensors that look at several cells at once, `finds` has a
                bit for each look of the action that found one. Over ROS, `step` is the number of
                steps done, `action` is the drone's last action, and `decision_time_s` is the wall
                time for the answer, if the step has a limit. In a live search, an `OnBelief` gets
                `belief`. With faults, or drones of different kinds, there are `status`, `action`
                and, if batteries run down, `battery`: see `faults.Faults.infos`.
        """
        ...


@runtime_checkable
class Shareable(Protocol):
    """A planner or tactic that missions with different seeds can share until it first draws.

    Attributes:
        drawn: Whether its seed has made a difference so far.
    """

    @property
    def drawn(self) -> bool: ...  # noqa: D102

    def copy(self) -> Self:
        """Return an independent copy in the same state."""
        ...

    def with_seed(self, seed: int) -> Self:
        """Return a copy as if made with this seed; it must not have drawn yet."""
        ...


@runtime_checkable
class OnBelief(Protocol):
    """A planner on a belief; it goes on from the one that infos have as `belief`.

    Others follow what the planner does not know, such as the inputs of a live search.
    """

    @property
    def forecasts(self) -> Callable[[ResolvedScenario], TargetForecast]:
        """Makes the forecasts of its beliefs."""
        ...


Plans: TypeAlias = Mapping[Any, NDArray[np.float64]]
"""Where drones will be, by agent: (M, 2) places (col, row) in turn after the present one. Whole
numbers are the centres of cells; in metres, fractions lie between cells."""


@runtime_checkable
class Planning(Protocol):
    """A planner or tactic that states where it will fly the drones."""

    def plans(self) -> Plans:
        """Return the plans of the last decision; a drone without a plan has none or no place."""
        ...


def as_plan(cells: Sequence[Cell]) -> NDArray[np.float64]:
    """Return cells as the places of a plan, see `Plans`."""
    return np.array(cells, np.float64).reshape(-1, 2)


class DrawsNothing:
    """A `Shareable` that draws nothing and replaces what changes in its state.

    Attributes:
        drawn: False.
    """

    drawn = False

    def copy(self) -> Self:
        """Return an independent copy in the same state."""
        return copy.copy(self)

    def with_seed(self, seed: int) -> Self:
        """Return a copy; the seed makes no difference."""
        return self.copy()


class Search(Protocol):
    """What a planner may know about a search besides the observations.

    An environment implements it, and so does `SearchDefinition`, from rules and a scenario.
    """

    @property
    def rules(self) -> Rules:
        """The rules of the search."""
        ...

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        ...

    @property
    def mission_scenario(self) -> Scenario:
        """The scenario, with the fields that the current mission overrides."""
        ...

    @property
    def observed(self) -> str:
        """`map`, or `belief` if drones observe the belief instead of the map of the rules."""
        ...

    @property
    def steps_done(self) -> int | None:
        """Steps done in the mission; None if only the infos may contain them."""
        ...


class DecisionPoint(NamedTuple):
    """What a tactic decides on.

    Attributes:
        belief: The belief before the step's searches.
        agents: The live drones.
        present: Cells of the drones.
        deadline_s: When to answer with the best so far, on the clock of `time.monotonic`.
        batteries: Charge of the drones, percent; empty if batteries do not run down.
    """

    belief: TargetBelief
    agents: Sequence[Hashable]
    present: Sequence[Cell]
    deadline_s: float = math.inf
    batteries: Sequence[float] = ()


class Tactic(Shareable, Protocol):
    """A policy on a belief for one mission; `BeliefPlanner` makes it a `Planner`."""

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the next cell of each drone; its present cell means a search there."""
        ...


PlannerFactory: TypeAlias = Callable[..., Planner]
"""Takes a `Search`, the keyword `seed` and the planner's own options as keywords."""

TacticFactory: TypeAlias = Callable[..., Tactic]
"""Takes the forecast of a mission and the keyword `seed`."""


def cells_of(observations: Observations) -> list[Cell]:
    """Return the present cell of every drone, in the order of the observations."""
    cells = []
    for observation in observations.values():
        col, row = Observation(*observation).position
        cells.append((int(col), int(row)))
    return cells


def probability_of(observations: Observations) -> NDArray[np.float32]:
    """Return the map (R, C) that all drones share, from at least one observation."""
    return Observation(*next(iter(observations.values()))).probability
