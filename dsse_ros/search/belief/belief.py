# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The posterior probability of where the persons are: the exact filter of the search.

The map that drones observe is the same before and after a hundred unsuccessful searches. A belief
is updated by them: each failed search removes the probability of detection (POD) from its cell, and
the rest is scaled up (Koopman, "Search and Screening", 1946; Stone, "Theory of Optimal Search",
1975, chapter 8 for moving targets). Between searches the belief moves like the persons.

A belief knows the scenario and the rules, but no person and no random state. For one person the
filter is exact except for two negligible approximations: a person's own drift (`v2`) is one of
`drift_samples` angles, and cells with less than 1e-13 of the total count as empty. For several
persons see `search_outcomes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief import (
    component_kernels,
    component_motion,
    filter_kernels,
    future_kernels,
    motion_kernels,
)
from dsse_ros.search.belief.base import BeliefBase, ForecastBase
from dsse_ros.search.belief.component_kernels import BOX, Mass
from dsse_ros.search.belief.look_kernels import LooksDone
from dsse_ros.search.belief.motion_kernels import MARGIN, MotionTables
from dsse_ros.search.belief.protocol import Expected, Futures, LooksToCome, Outlook
from dsse_ros.search.step.entities import WORLDS
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.probable_cells import datum_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.targets import sea_map
from dsse_ros.world.targets.motion import CHANCES, PERSONS, STEPS
from dsse_ros.world.targets.person_kernels import motion_data
from dsse_ros.world.targets.registry import MOTIONS

KEPT_BYTES = 1 << 28
"""Forecasts up to this size are kept for later missions; larger ones are computed step by step."""


class Forecast(ForecastBase):
    """The motion of map and persons, known in advance and the same in every mission of a scenario.

    Steps of the sea count from the start of its drift; the first `first_step` of them precede the
    mission.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search.
        horizon: Number of steps after the present one that are available.
        drift_samples: K, number of angles that sample a person's own drift; without own drifts, K
            is 1.

    Attributes:
        sea: The map, and what limits the persons' steps.
        moves: The persons' moves in R steps of the sea; those of step s are at s % R.
    """

    def __init__(
        self, scenario: Scenario, rules: Rules, *, horizon: int = 0, drift_samples: int = 256
    ) -> None:
        super().__init__(scenario, rules, horizon)
        resolved = self.scenario
        drifts = drift_samples if MOTIONS[rules.person_motion].own_drift else 1
        longer = resolved.grid_size.longer
        cells = self.padded.cells
        steps = self.first_step + rules.last_step(resolved.timestep_limit) + horizon + 2
        if 8 * steps * cells * (1 + CHANCES) > KEPT_BYTES:
            # Beliefs that share a forecast may be one step apart.
            steps = horizon + 2
        self._world = np.zeros(1, WORLDS)
        self._world["vector_x"], self._world["vector_y"] = resolved.vector
        self._world["start_x"], self._world["start_y"] = resolved.person_initial_position
        self._drifts = np.zeros(drifts, PERSONS)
        gauss, tails = np.zeros((2, 2 * longer + 1)), np.zeros((2, longer + 2))
        self.sea = sea_map.Sea(gauss, tails, self.area, self.runs, motion_data(resolved, rules))
        self._circle = np.zeros(longer + 1, np.int64)
        self.moves = MotionTables(
            np.zeros((steps, cells)), np.zeros((steps, CHANCES, cells)),
            np.zeros((steps, drifts), np.int64), np.zeros((steps, drifts), np.bool_),
        )  # fmt: skip
        self._still = np.zeros(drifts, np.bool_)
        self._start()

    def _start(self) -> None:
        self._ready = 0
        self._still[:] = self.scenario.person_amount > 1 and self.rules.person_scatter > 0
        motion_kernels.start_sea(self.constants, self._world, self._drifts)
        sea_map.disperse(self.constants[0], self._world[0], self.sea)

    @property
    def of_pos(self) -> Forecast:
        """The forecast whose beliefs state the POS: this one, which is exact."""
        return self

    def prepare(self, step: int) -> int:
        """Prepare a step of the sea and the `horizon` steps after it; return its index."""
        chances, tables, *_ = self.moves
        slots = len(chances)
        if step < self._ready - slots:
            self._start()
        while self._ready <= step + self.horizon:
            slot, before = self._ready % slots, (self._ready - 1) % slots
            motion_kernels.forecast_step(
                self.constants, self._world, self.sea, self._circle, self._drifts,
                self.moves.at(slot), self._still,
            )  # fmt: skip
            # If the map does not change, the tables of the previous step remain valid.
            stays = self._ready > 0 and np.array_equal(chances[slot], chances[before])
            if stays:
                tables[slot] = tables[before]
            else:
                tables[slot, [0, STEPS]] = -1.0
            self._ready += 1
        return step % slots

    def take_over(self, other: Forecast) -> None:
        """Copy the prepared steps of another forecast, and its tables if the map is the same.

        Args:
            other: A forecast with the same rules, grid, area, data of the motion and number of
                steps.
        """
        steps = other._ready
        if steps > len(self.moves.chances):
            return
        self.prepare(steps - 1 - self.horizon)
        (chances, tables, *_), theirs = self.moves, other.moves
        same = (chances[:steps] == theirs.chances[:steps]).all(axis=1)
        tables[:steps][same] = theirs.tables[:steps][same]

    def belief(self) -> Belief:
        """Return a belief at the start of a mission."""
        return Belief(self)

    def most_probable(self, steps: int) -> Cell:
        """Return the most probable cell of the map that drones observe after these steps.

        Args:
            steps: Steps of the sea, at least 1.
        """
        # If persons move first, they look at the map of the previous step.
        drawn = steps if self.rules.person_first else steps - 1
        chances = self.moves.chances[self.prepare(drawn)].reshape(self.padded.matrix)
        inner = slice(MARGIN, -MARGIN)
        return datum_of(chances[inner, inner].astype(np.float32))


class Belief(BeliefBase):
    """The probability of the positions of the persons who have not been found.

    Persons with the same start and POD multiplier are one detection class.

    Args:
        forecast: Motion of map and persons. Beliefs may share a forecast while they are at most one
            step apart.

    Attributes:
        mass: See `BeliefBase`.
    """

    def __init__(self, forecast: Forecast) -> None:
        self.forecast = forecast
        cells = forecast.padded.cells
        self._scratch = component_motion.new_scratch(cells)
        scenario = forecast.scenario
        scattered = np.zeros(scenario.person_amount, np.bool_)
        scattered[1:] = forecast.rules.person_scatter > 0
        alike = np.stack([scattered, scenario.person_pod_multipliers], axis=1)
        super().__init__(alike)

    def _new_mass(self, classes: int) -> Mass:
        drifts, cells = self.forecast.moves.directions.shape[1], self.forecast.padded.cells
        return Mass(
            np.zeros((classes * drifts, cells)), np.empty((classes * drifts, BOX), np.int64),
            np.empty((classes, cells)), np.empty(classes),
        )  # fmt: skip

    def _sum_up(self) -> None:
        component_kernels.sum_up(self.mass, self.forecast.padded)

    def _components(self) -> NDArray[np.float64]:
        components = np.empty_like(self.mass.components)
        component_kernels.unpack(self.mass, self.forecast.padded.columns, components)
        return components

    def reset(self) -> None:
        """Start a new mission with the prior of the rules at its first observation."""
        super().reset()
        self.step = -self.forecast.first_step
        self._put_persons()
        while self.step < 0:
            self.advance()

    def _put_persons(self) -> None:
        """Put the first person in the start cell, the others there too or scattered around it."""
        scenario, rules = self.forecast.scenario, self.forecast.rules
        grid, reach, area = scenario.grid_size, rules.person_scatter, self.forecast.area
        x0, y0 = scenario.person_initial_position
        density = np.zeros_like(self.mass.components)
        around = [
            (x, y)
            for y in range(max(y0 - reach, 0), min(y0 + reach, grid.rows - 1) + 1)
            for x in range(max(x0 - reach, 0), min(x0 + reach, grid.columns - 1) + 1)
            if (x, y) != (x0, y0) and (area is None or area[y, x])
        ] or [(x0, y0)]
        persons = scenario.person_amount
        for person, of_class in enumerate(self.class_of.tolist()):
            rows = slice(of_class * self._drifts, (of_class + 1) * self._drifts)
            cells = around if person else [(x0, y0)]
            for cell in cells:
                column = self.forecast.column(cell)
                density[rows, column] += 1.0 / (persons * self._drifts * len(cells))
        self.density = density

    def advance(self) -> None:
        """Advance the sea by one step, after the update with this step's searches."""
        forecast = self.forecast
        slot = forecast.prepare(self.step + forecast.first_step)
        component_motion.predict(
            forecast.constants, forecast.sea, self.mass, forecast.moves.at(slot), self._scratch
        )
        self.step += 1

    def _updated(self, looks: LooksDone) -> float:
        forecast = self.forecast
        step = forecast.moves.at(forecast.prepare(self.step + forecast.first_step))
        pos: float = filter_kernels.learn(
            forecast.constants, self.mass, step, self._persons(), looks, self.pos
        )
        return pos

    def futures(self, count: int, horizon: int, rng: np.random.Generator) -> Futures:
        """Draw futures of the missing persons from their motion model.

        Sampling is systematic: each cell gets its share of the futures, rounded up or down. The
        steps of a future depend on each other, so from the second step on the shares of cells only
        approximate those of the belief: the measured error is up to .11, whatever M is.

        Args:
            count: M.
            horizon: H, at most that of the forecast.
            rng: Generator of the draws.
        """
        forecast, slots = self.forecast, self._slots(horizon)
        offset, *offsets = rng.random(horizon + 1)
        rows = np.empty(count, np.int64)
        futures = Futures.empty(count, horizon, self.forecast.padded.cells)
        future_kernels.sample(
            self.mass, self.forecast.padded, self._weights(self.missing), count, offset, rows,
            futures.cells[0],
        )  # fmt: skip
        future_kernels.roll(
            forecast.constants, forecast.sea, forecast.moves, slots, np.array(offsets), rows,
            futures,
        )  # fmt: skip
        futures.persons[:] = self.examples[rows // self._drifts]
        return futures

    def outlook(self, horizon: int, gamma: float) -> Outlook:
        """Return a function of what plans are expected to find, by the exact filter.

        Args:
            horizon: H, at most that of the forecast.
            gamma: Discount of a find per step.
        """
        forecast, slots, mass = self.forecast, self._slots(horizon), self._mass_of_missing()

        def expect(looks: LooksToCome) -> Expected:
            expected: Expected = future_kernels.expect(
                forecast.constants, forecast.sea, mass, forecast.moves, slots,
                self._by_class(looks), gamma, self._scratch,
            )  # fmt: skip
            return expected

        return expect

    def _mass_of_missing(self) -> Mass:
        """Return a copy of the mass for the persons who are missing; it sums to 1."""
        weights, (components, boxes, cells, totals) = self._weights(self.missing), self.mass
        components = components * np.repeat(weights, self._drifts)[:, None]
        return Mass(components, boxes.copy(), cells * weights[:, None], totals * weights)

    def _slots(self, horizon: int) -> NDArray[np.int64]:
        """Return the indices of the next steps in the forecast, (H,)."""
        first = self.step + self.forecast.first_step
        self.forecast.prepare(first)
        return np.arange(first, first + horizon) % len(self.forecast.moves.directions)

    @property
    def outside(self) -> float:
        """The probability that a missing person is off the grid."""
        return max(1.0 - float(self.poc().sum()), 0.0)

    def poc(self) -> NDArray[np.float64]:
        """Return the probability of containment of every cell, (R, C) as [y, x].

        It sums to 1 minus the probability that the person has walked off the grid (`v1`).
        """
        grid = self.forecast.scenario.grid_size
        out = np.empty(grid.matrix)
        filter_kernels.write_cells(
            self.forecast.constants, self.mass, self.class_of, self.missing,
            np.empty(len(self.examples) + grid.columns), out,
        )  # fmt: skip
        return out
