# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Estimate of the drift from the observed cells of the datum.

The datum moves by whole cells, so the cells observed so far leave a range of possible drifts along
each axis. The range narrows with time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import kernel
from dsse_ros.search.step.constants import area_of, constants_of
from dsse_ros.search.step.entities import WORLDS
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.current import vector_of_increment
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.targets.sea_map import drift, drift_per_step

POINTS = 33
"""Drifts along each axis that are compared at a time."""
ROUNDS = 6
"""How often the compared range is narrowed around the best drifts."""
KEPT, HALVINGS = 200, 14
"""Number of drifts to refine if the best drifts do not form one range, and how often."""
FIRST_OBSERVED = 4
"""Step of the sea from which the most probable cell is the datum. Earlier, a circle around the
previous datum (`circle_on_previous_datum`) may be too small to contain it."""
RELATIVE_ERROR = 0.5
"""Standard deviation of the assumed drift, as a share of the drift."""
LEAST_DRIFT = 1e-3
"""Cells per step; the error of a slower assumed drift is that of this drift."""


@kernel
def misfits(constants, worlds, area, seen, drifts, out):
    """Count the cells by which drifts miss the observed datum.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (1,) of `entities.WORLDS`, with the start set; the rest is scratch.
        area: Of `sea_map.Sea`.
        seen: (T, 2) int64, the datum (x, y) after step 1, 2, ... of the sea, -1 where not observed.
        drifts: (M, 2) float64, cells per step.
        out: (M,) int64 out.
    """
    world = worlds[0]
    for m in range(len(drifts)):
        world.datum_x, world.datum_y = world.start_x, world.start_y
        world.remainder_x = world.remainder_y = 0.0
        world.drift_x, world.drift_y = drifts[m, 0], drifts[m, 1]
        out[m] = 0
        for t in range(len(seen)):
            drift(constants[0], world, area)
            if seen[t, 0] >= 0:
                out[m] += abs(seen[t, 0] - world.datum_x) + abs(seen[t, 1] - world.datum_y)


class DriftEstimate:
    """Estimates a mission's drift from the observed cells of the datum.

    Args:
        scenario: Its `vector` is the assumed drift.
        rules: The rules of the search.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules) -> None:
        self._rules = rules
        self._constants = constants_of(scenario, rules)
        self._area, _ = area_of(scenario)
        self._world = np.zeros(1, WORLDS)
        self._world["start_x"], self._world["start_y"] = scenario.person_initial_position
        self._assumed = np.array(drift_per_step(self._constants[0], *scenario.vector))
        self._observed: dict[int, Cell] = {}

    def observe(self, step: int, datum: Cell) -> None:
        """Record the datum after this many steps of the sea, at least `FIRST_OBSERVED`."""
        self._observed[step] = datum

    def vector(self) -> tuple[float, float] | None:
        """Return the vector of a scenario with the estimated drift, None if no drift is possible.

        The estimate is the posterior mean of a normal prior around the assumed drift, over the
        drifts that explain all observed cells. If the mean itself does not explain them, the
        estimate is the nearest drift that does.
        """
        steps = max(self._observed, default=0)
        seen = np.full((steps, 2), -1, np.int64)
        for step, datum in self._observed.items():
            seen[step - 1] = datum
        start = np.array([self._world["start_x"][0], self._world["start_y"][0]])
        cells = [start, *(seen[step - 1] for step in sorted(self._observed))]
        reach = 1.0 + np.abs(np.diff(cells, axis=0)).max(initial=0)
        possible = self._narrowed(seen, reach)
        if not len(possible):
            possible = self._refined(seen, reach)
        if not len(possible):
            return None
        spread = RELATIVE_ERROR * max(float(np.hypot(*self._assumed)), LEAST_DRIFT)
        error = ((possible - self._assumed) ** 2).sum(axis=1) / (2 * spread**2)
        weights = np.exp(error.min() - error)
        mean = weights @ possible / weights.sum()
        if self._misfits(seen, mean[None])[0]:
            # The mean lies between drifts that explain the cells, but does not explain them.
            mean = possible[np.argmin(((possible - mean) ** 2).sum(axis=1))]
        speed = float(self._constants["cell_size"][0] / self._constants["step_duration_s"][0])
        return vector_of_increment(self._rules, (float(mean[0]), float(mean[1])), speed)

    def _misfits(self, seen: NDArray[np.int64], drifts: NDArray[np.float64]) -> NDArray[np.int64]:
        missed = np.empty(len(drifts), np.int64)
        misfits(self._constants, self._world, self._area, seen, drifts, missed)
        return missed

    def _narrowed(self, seen: NDArray[np.int64], reach: float) -> NDArray[np.float64]:
        """Return drifts (M, 2) that explain the observations, from the whole range of such drifts.

        The datum moves further with more drift, so the range is narrowed around the best drifts.
        """
        middle, half = np.zeros(2), np.full(2, reach)
        possible = np.zeros((0, 2))
        for _ in range(ROUNDS):
            line = np.linspace(-1.0, 1.0, POINTS)
            x, y = np.meshgrid(middle[0] + half[0] * line, middle[1] + half[1] * line)
            drifts = np.stack([x.ravel(), y.ravel()], axis=1)
            missed = self._misfits(seen, drifts)
            best = drifts[missed == missed.min()]
            if missed.min() == 0:
                possible = best
            low, high = best.min(axis=0), best.max(axis=0)
            # Equally good drifts are within one point of these.
            spacing = 2.0 * half / (POINTS - 1)
            middle, half = (low + high) / 2, (high - low) / 2 + spacing
        return possible

    def _refined(self, seen: NDArray[np.int64], reach: float) -> NDArray[np.float64]:
        """Return drifts (M, 2) that explain the observations, if these do not form one range.

        At an edge the datum may move less far with more drift, because it stays when a step would
        lead out. Therefore the drifts around each of the best ones are compared, closer each time.
        """
        line = np.linspace(-reach, reach, 4 * POINTS - 3)
        drifts = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
        spacing = line[1] - line[0]
        around = np.stack([axis.ravel() for axis in np.meshgrid([-1, 0, 1], [-1, 0, 1])], axis=1)
        for _ in range(HALVINGS):
            missed = self._misfits(seen, drifts)
            if missed.min() == 0:
                return drifts[missed == 0]
            # Among drifts with equal misfit, prefer the nearest to the assumed one.
            away = np.hypot(*(drifts - self._assumed).T)
            best = drifts[np.lexsort((away, missed))[:KEPT]]
            spacing /= 2.0
            drifts = np.unique((best[:, None] + spacing * around).reshape(-1, 2), axis=0)
        return np.zeros((0, 2))
