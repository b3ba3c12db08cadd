# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a planner is: a policy from the drones' observations to their actions."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.actions import Cell as Cell
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.search.observation import AgentObservation as AgentObservation
from dsse_ros.search.observation import Observation as Observation


class Planner(Protocol):
    """A policy for one mission; it keeps what it needs to remember between the steps."""

    def __call__(
        self,
        observations: Mapping[str, AgentObservation],
        infos: Mapping[str, Mapping[str, Any]],
    ) -> dict[str, int]:
        """Return an action number for every drone.

        Args:
            observations: By live agent, in the fixed order of the agents.
            infos: By agent; `action_mask` int8 (A,), 0 where a move would leave the grid or the
                area that is searched. Where there are several persons, `found_person`, whether the
                drone has found one in the last step, and with sensors that look at several cells at
                once `finds`, a bit for each look of the action that has. Over ROS also `step`, the
                steps done, `action`, what the drone has done last, and where the step does not wait
                for ever, `decision_time_s`, the wall time that there is for the answer. With
                faults, or drones of different kinds, `status`, `action` and, where it runs down,
                `battery`: see `faults.Faults.infos`.
        """
        ...


@runtime_checkable
class SharedPlanner(Planner, Protocol):
    """A planner that missions with seeds of their own can share until it first draws.

    Attributes:
        drawn: Whether its seed has counted so far.
    """

    @property
    def drawn(self) -> bool: ...  # noqa: D102

    def copy(self) -> SharedPlanner:
        """Return one that goes on by itself from here."""
        ...

    def with_seed(self, seed: int) -> SharedPlanner:
        """Return a copy as if it had been made with this seed; it must not have drawn yet."""
        ...


class Search(Protocol):
    """What a planner may know of a search besides the observations.

    An environment is one, and of rules and a scenario `SearchDefinition` makes one.
    """

    @property
    def rules(self) -> Rules:
        """The rules of the search."""
        ...

    @property
    def scenario(self) -> Scenario:
        """What is searched."""
        ...

    @property
    def mission_scenario(self) -> Scenario:
        """The scenario with what the mission under way has replaced in it."""
        ...

    @property
    def observed(self) -> str:
        """`map`, or `belief` where drones observe that in place of the map of the rules."""
        ...

    @property
    def steps_done(self) -> int | None:
        """Steps of the mission that are done, None where only the infos may say it."""
        ...


def number_of(agent: Hashable) -> int:
    """Return the number of an agent, `drone3` or 3."""
    return int(str(agent).removeprefix("drone"))


PlannerFactory: TypeAlias = Callable[..., Planner]
"""Called with a `Search`, the keyword `seed` and, as keywords, the planner's own options."""


def cells_of(observations: Mapping[str, AgentObservation]) -> list[Cell]:
    """Return the present cell of every drone, in the order of the observations."""
    cells = []
    for observation in observations.values():
        col, row = Observation(*observation).position
        cells.append((int(col), int(row)))
    return cells


def probability_of(observations: Mapping[str, AgentObservation]) -> NDArray[np.float32]:
    """Return the map (G, G) that all drones share; there must be an observation."""
    return Observation(*next(iter(observations.values()))).probability
