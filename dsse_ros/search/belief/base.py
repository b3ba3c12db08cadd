# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common parts of the beliefs for motions and for ensembles."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief import search_outcomes
from dsse_ros.search.belief.component_kernels import Mass
from dsse_ros.search.belief.look_kernels import LooksDone
from dsse_ros.search.belief.motion_kernels import MARGIN
from dsse_ros.search.belief.protocol import LooksToCome
from dsse_ros.search.belief.search_outcomes import Persons
from dsse_ros.search.step.constants import area_of, constants_of
from dsse_ros.search.step.looks import Looked
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario

if TYPE_CHECKING:
    from typing_extensions import Self


class ForecastBase:
    """A scenario and its rules, with the columns of a belief; see `TargetForecast`.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search.
        horizon: Number of steps after the present one that are available.

    Attributes:
        constants: (1,) of `constants.CONSTANTS`.
        area, runs: The searched cells, see `sea_map.Sea`.
        first_step: Steps of the sea before a mission's first observation.
        padded: The grid with its margins, of S cells.
    """

    def __init__(self, scenario: Scenario, rules: Rules, horizon: int) -> None:
        self.scenario = resolved = scenario.resolve(rules)
        self.rules = rules
        self.horizon = horizon
        self.constants = constants_of(resolved, rules)
        self.area, self.runs = area_of(resolved)
        self.first_step = resolved.pre_search_steps + rules.reset_sea_steps
        self.padded = resolved.grid_size.padded(MARGIN)

    def column(self, cell: Cell) -> int:
        """Return the column of a belief for a cell (col, row)."""
        return (cell[1] + MARGIN) * self.padded.columns + cell[0] + MARGIN

    def cell(self, column: int) -> Cell:
        """Return the cell (col, row) of a column of a belief."""
        row, col = divmod(column, self.padded.columns)
        return col - MARGIN, row - MARGIN


class BeliefBase:
    """The detection classes of persons, and what is known of each; see `TargetBelief`.

    Finds do not identify the person found; see `search_outcomes` for the updates after failed
    searches and finds.

    Args:
        alike: (n, k), the persons with equal rows are one detection class.

    Attributes:
        step: Steps done in the mission.
        pos: Cumulative probability of success, see `TargetBelief`.
        class_of: (n,) int64, the detection class of each person.
        examples: (C,) int64, number of a person of each class.
        missing: (n,) float64, probability that a person is missing; 1 for a single person.
        unfound: (n,) float64, the same, regardless of the outcomes of the searches; for a single
            person see `pos`.
        mass: Where the persons of each class are.
    """

    step: int
    pos: float

    def __init__(self, alike: NDArray[Any]) -> None:
        classes, self.examples, class_of = np.unique(
            alike, axis=0, return_index=True, return_inverse=True
        )
        self.class_of = class_of.ravel()
        self.missing, self.unfound = np.ones((2, len(alike)))
        self._numbers = np.zeros((search_outcomes.OF_CLASS, len(classes)))
        self.mass = self._new_mass(len(classes))
        self._drifts = len(self.mass.components) // len(classes)
        self.reset()

    @abstractmethod
    def _new_mass(self, classes: int) -> Mass:
        """Return memory for the mass of C classes."""

    def reset(self) -> None:
        """Start a new mission with the prior at its first observation."""
        self.step, self.pos = 0, 0.0
        self.missing[:] = self.unfound[:] = 1.0

    def copy(self) -> Self:
        """Return an independent copy; the forecast is shared."""
        twin = copy.copy(self)
        twin.mass = self.mass.copy()
        twin.missing, twin.unfound = self.missing.copy(), self.unfound.copy()
        return twin

    def mean_pod(self, pods: NDArray[np.float64]) -> float:
        """Return the mean of these PODs, (n,) by person, over the persons who are missing."""
        return float(self.missing @ pods / self.missing.sum())

    @property
    def pod_columns(self) -> NDArray[np.int64]:
        """The columns of the PODs of looks that the detection classes have."""
        return self.examples

    @abstractmethod
    def _sum_up(self) -> None:
        """Compute the rest of the mass from its components."""

    def _weights(self, present: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the factors, (C,), that make the mass that of persons who are `present`, (n,)."""
        weights = np.empty(len(self.examples))
        search_outcomes.weigh_classes(self.class_of, present, self.mass.totals, weights)
        return weights

    def _scaled(self, present: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._components() * np.repeat(self._weights(present), self._drifts)[:, None]

    @abstractmethod
    def _components(self) -> NDArray[np.float64]:
        """Return the components place by place, a copy or the memory itself."""

    @property
    def density(self) -> NDArray[np.float64]:
        """The components, (C K, ...) float64, with the sum 1; each class has its share of it.

        It is a copy; what is assigned to it replaces the components.
        """
        return self._scaled(np.ones_like(self.missing))

    @density.setter
    def density(self, density: NDArray[np.float64]) -> None:
        self.mass.components[:] = density
        self._sum_up()

    def of_missing(self) -> NDArray[np.float64]:
        """Return the density of the persons who are missing; it sums to 1."""
        return self._scaled(self.missing)

    def update(self, looks: Sequence[Looked]) -> None:
        """Update with looks that found nobody.

        If no probability is left, because nobody can be anywhere by the rules, the belief restarts
        from the present map, or from the prior of an ensemble.
        """
        self._learn(looks, failed=len(looks))

    def observe_find(self, look: Looked) -> None:
        """Update with a look that found a person while others are still missing.

        A look for one person leaves the others in the cell as before. A look for all finds everyone
        whom it detects.
        """
        self._learn([look], failed=0)

    def _learn(self, looks: Sequence[Looked], *, failed: int) -> None:
        """Update with looks, of which the first `failed` found nobody."""
        if looks:
            done = LooksDone(
                seen=np.array([look.cell for look in looks], np.int64),
                rows=np.arange(len(looks)),
                pods=np.array([look.pods[self.pod_columns] for look in looks]),
                failed=failed,
                number=len(looks),
            )
            self.pos = self._updated(done)

    def _persons(self) -> Persons:
        """Return what is known of the persons."""
        hazard = np.empty_like(self.missing)
        return Persons(
            class_of=self.class_of, missing=self.missing, unfound=self.unfound,
            numbers=self._numbers, hazard=hazard,
        )  # fmt: skip

    def _by_class(self, looks: LooksToCome) -> LooksToCome:
        """Return looks with PODs by detection class."""
        return looks._replace(pods=np.ascontiguousarray(looks.pods[:, self.pod_columns]))

    @abstractmethod
    def _updated(self, looks: LooksDone) -> float:
        """Update the mass with looks, and return the POS."""
