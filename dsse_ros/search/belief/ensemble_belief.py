# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The belief about persons who follow an ensemble: weights of its particles.

A failed search removes the probability of detection from the particles in its cell, and the rest is
scaled up. With time the particles move along their tracks. The filter is exact for the particles;
its only error is that M particles approximate the model.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief import particle_kernels, passing_kernels
from dsse_ros.search.belief.base import BeliefBase, ForecastBase
from dsse_ros.search.belief.component_kernels import BOX, Mass
from dsse_ros.search.belief.future_kernels import index
from dsse_ros.search.belief.look_kernels import LooksDone
from dsse_ros.search.belief.motion_kernels import MARGIN
from dsse_ros.search.belief.particle_kernels import BinnedParticles
from dsse_ros.search.belief.passing_kernels import ParticlePositions, Passing, moved_of, seen_of
from dsse_ros.search.belief.protocol import Expected, Futures, LooksToCome, Outlook
from dsse_ros.search.step.cell_tracks import (
    CellParticles,
    CellTracks,
    Draw,
    maps_of,
    of_living,
    particle_positions,
    particles_of,
    tracks_of,
)
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.probable_cells import datum_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario

LARGEST_SORTED_BYTES = 1 << 27
"""Memory of the particles of an ensemble, sorted by column, that is kept."""


class PathsFlown(NamedTuple):
    """The paths of N drones in a step, see `passing_kernels.Passing`.

    Attributes:
        detectors: (K, A) of `metres_detection.DETECTORS`, by kind and appearance.
        kinds: (N,) int64.
        paths: (N, K + 1, 2) float64, metres to the east and to the south of the grid's north-west
            corner, at equal times of the step.
        flown: (N,) bool, the drones that flew.
        found: (N,) bool, the drones that found somebody.
        looked: (N, K + 1) bool, whether they looked right before the step and on each piece; None
            if they look all the time.
    """

    detectors: NDArray[np.void]
    kinds: NDArray[np.int64]
    paths: NDArray[np.float64]
    flown: NDArray[np.bool_]
    found: NDArray[np.bool_]
    looked: NDArray[np.bool_] | None = None


class EnsembleForecast(ForecastBase):
    """The particles of a scenario, known in advance for a whole mission; a `TargetForecast`.

    After the last step of the tracks nothing moves.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search; persons must follow an ensemble.
        horizon: Number of steps after the present one that are available.
        draw: What the particles are drawn for.
        living: Whether particles vanish when their persons are no longer alive, see
            `Incident.survival`. What beliefs then call POS is the probability to find the person
            alive.
        given: Returns the particles of each draw, in metres; None for those of the scenario, see
            `particles_of`.

    Attributes:
        tracks: The particles.

    Raises:
        FieldError: If the ensemble would take too much memory.
    """

    def __init__(
        self, scenario: Scenario, rules: Rules, *, horizon: int = 0, draw: Draw = Draw.BELIEF,
        living: bool = False, given: Callable[[Draw], CellParticles] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(scenario, rules, horizon)
        self._draw, self._given = draw, given
        tracks = particles_of(self.scenario, rules, draw) if given is None else given(draw)
        if tracks is None:
            raise ValueError(f"person_motion must be an ensemble, got {rules.person_motion!r}")
        self.tracks = of_living(tracks) if living and tracks.dies is not None else tracks
        self._rows: dict[int, tuple[NDArray[np.int32], NDArray[np.int32]]] = {}

    @cached_property
    def of_pos(self) -> EnsembleForecast:
        """The forecast whose beliefs state the POS: its particles are seen by nobody else."""
        return EnsembleForecast(self.scenario, self.rules, draw=Draw.POS, given=self._given)

    @cached_property
    def of_pos_alive(self) -> EnsembleForecast | None:
        """As `of_pos`, for the POS alive; None without a survival curve."""
        if self.tracks.dies is None:
            return None
        return EnsembleForecast(
            self.scenario, self.rules, draw=Draw.POS, living=True, given=self._given
        )

    @property
    def cells(self) -> NDArray[np.int16]:
        """(T, M, 2) int16, cells (x, y) of the particles by step of the sea."""
        return self.tracks.particles

    @property
    def weights(self) -> NDArray[np.float64]:
        """(M,) float64, weights of the particles."""
        return self.tracks.weights

    @property
    def appearances(self) -> NDArray[np.int8]:
        """(M,) int8, number of each particle's appearance, see `Incident.appearances`."""
        return self.tracks.appearances

    def pod_columns(self, examples: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the columns of the PODs of looks of these persons, for all appearances."""
        persons = self.scenario.person_amount
        return np.add.outer(persons * np.arange(len(self.scenario.seen_as)), examples).ravel()

    @cached_property
    def maps(self) -> NDArray[np.float32]:
        """(T, R, C) float32, those that drones observe, see `CellTracks`."""
        if self._given is not None:
            particles = self._given(Draw.BELIEF)
            return maps_of(self.scenario, particles.particles, particles.weights)
        observed = self.tracks
        if not isinstance(observed, CellTracks):
            tracks = tracks_of(self.scenario, self.rules)
            assert tracks is not None
            observed = tracks
        return observed.maps

    @cached_property
    def positions(self) -> NDArray[np.float32]:
        """(T, M, 2) float32, see `particle_positions`."""
        if self._given is not None:
            there = self._given(self._draw).particles_m
            assert there is not None
            east, south = np.moveaxis(there, -1, 0)
            height_m = self.scenario.grid_size.rows * self.scenario.cell_size
            return np.stack([east, np.float32(height_m) - south], axis=-1)
        return particle_positions(self.scenario, self.rules, self._draw)

    def columns(self, cells: NDArray[np.int16]) -> NDArray[np.int32]:
        """Return the columns, (...,), of cells of particles, (..., 2).

        A particle off the grid is in the nearest margin. One outside the area is in the first
        column, where nobody looks.
        """
        # The outermost cells stay empty.
        farthest = np.array(self.padded, np.int16) - MARGIN - 2
        within = np.clip(cells, 1 - MARGIN, farthest).astype(np.int32) + MARGIN
        columns: NDArray[np.int32] = within[..., 1] * self.padded.columns + within[..., 0]
        if self.area is not None:
            columns[~self._searched[columns]] = 0
        return columns

    @cached_property
    def _searched(self) -> NDArray[np.bool_]:
        assert self.area is not None
        return np.pad(self.area, MARGIN, constant_values=True).ravel()

    def _sorted(self, first: int, last: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the particles of rows first..last by column: starts and members, see `index`.

        A look finds its particles without a search through all of them.
        """
        columns = self.columns(self.cells[first : last + 1])
        starts = np.empty((len(columns), self.padded.cells + 1), np.int32)
        members = np.empty_like(columns)
        index(columns, starts, members)
        return starts, members

    @cached_property
    def _by_column(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        return self._sorted(0, len(self.cells) - 1)

    def particles(self, first: int = 0, last: int | None = None) -> BinnedParticles:
        """Return the particles of rows first..last, by default of all; row 0 is then the first.

        If all rows are small they are sorted once, else those that are asked for.

        Args:
            first: First row.
            last: Last row; None for that of the last step.
        """
        last = len(self.cells) - 1 if last is None else last
        of_row = 4 * (self.padded.cells + len(self.weights))
        if of_row * len(self.cells) <= LARGEST_SORTED_BYTES:
            starts, members = (rows[first : last + 1] for rows in self._by_column)
            return BinnedParticles(starts, members, self.weights, self.appearances)
        rows = []
        for row in range(first, last + 1):
            found = self._rows.get(row)
            if found is None:
                starts, members = self._sorted(row, row)
                found = self._rows[row] = starts[0], members[0]
            rows.append(found)
        # Threads may do this at the same time.
        for old in list(self._rows)[: -max(LARGEST_SORTED_BYTES // of_row, 1)]:
            self._rows.pop(old, None)
        starts, members = (np.array(of_rows) for of_rows in zip(*rows, strict=True))
        return BinnedParticles(starts, members, self.weights, self.appearances)

    @cached_property
    def _moved(self) -> NDArray[np.float64]:
        assert self.tracks.particles_m is not None
        return moved_of(self.tracks.particles_m)

    def places(self, examples: NDArray[np.int64]) -> ParticlePositions:
        """Return the particles in metres, with the classes of these persons; space metres only."""
        positions, multipliers = self.tracks.particles_m, self.scenario.person_pod_multipliers
        assert positions is not None
        return ParticlePositions(
            particles=self.particles(), cell_m=self.scenario.cell_size, positions=positions,
            moved=self._moved, multipliers=np.array(multipliers)[examples],
        )  # fmt: skip

    def passing(self, step: int, flights: PathsFlown) -> Passing:
        """Return the paths of the step after `step` steps of the mission."""
        looked = flights.looked
        if looked is None:
            looked = np.ones(flights.paths.shape[:2], np.bool_)
            looked[:, 0] = step > 0
        return Passing(
            detectors=flights.detectors, kinds=flights.kinds, paths=flights.paths, looked=looked,
            step_s=self.scenario.step_duration_s, flown=flights.flown, found=flights.found,
        )  # fmt: skip

    def missed_in_passing(self, step: int, flights: PathsFlown, drone: int) -> NDArray[np.float64]:
        """Return the probability, 1 - POD, that a drone misses the first person, (M,).

        Args:
            step: Steps of the mission before.
            flights: The paths of the next step.
            drone: The drone.
        """
        missed, places = np.ones(len(self.weights)), self.places(np.zeros(1, np.int64))
        if flights.flown[drone]:
            passing_kernels.write_missed(
                self.constants, places, self.row(self.first_step + step),
                self.passing(step, flights), drone, seen_of(places, len(flights.paths)), missed,
            )  # fmt: skip
        return missed

    def row(self, step: int) -> int:
        """Return the index of a step of the sea in the tracks."""
        return min(step, len(self.cells) - 1)

    def belief(self) -> EnsembleBelief:
        """Return a belief at the start of a mission."""
        return EnsembleBelief(self)

    def most_probable(self, steps: int) -> Cell:
        """Return the most probable cell of the map that drones observe after these steps."""
        return datum_of(self.maps[self.row(steps)])


class EnsembleBelief(BeliefBase):
    """The weights of the particles of one mission; a `TargetBelief`.

    Persons with the same POD are one detection class: all start alike and move independently.

    Args:
        forecast: The particles. Beliefs may share one.

    Attributes:
        mass: See `BeliefBase`; its components are the weights of the particles.
    """

    def __init__(self, forecast: EnsembleForecast) -> None:
        self.forecast = forecast
        multipliers = np.array(forecast.scenario.person_pod_multipliers)
        super().__init__(multipliers[:, None])

    @property
    def pod_columns(self) -> NDArray[np.int64]:
        """The columns of the PODs of looks, by appearance and detection class."""
        return self.forecast.pod_columns(self.examples)

    def mean_pod(self, pods: NDArray[np.float64]) -> float:
        """Return the mean of these PODs over the persons who are missing, and what they may be."""
        of_missing = self.of_missing().sum(axis=0)
        shares = np.bincount(self.forecast.appearances, of_missing, len(pods) // len(self.missing))
        by_appearance = pods.reshape(len(shares), -1) @ self.missing / self.missing.sum()
        return float(shares / shares.sum() @ by_appearance)

    def _new_mass(self, classes: int) -> Mass:
        weights = np.empty((classes, len(self.forecast.weights)))
        return Mass(weights, np.empty((0, BOX), np.int64), np.empty((0, 0)), np.empty(classes))

    def _components(self) -> NDArray[np.float64]:
        return self.mass.components

    def _sum_up(self) -> None:
        self.mass.totals[:] = self.mass.components.sum(axis=1)

    def reset(self) -> None:
        """Start a new mission with the weights of the ensemble."""
        super().reset()
        shares = np.bincount(self.class_of) / len(self.class_of)
        self.density = shares[:, None] * self.forecast.weights

    def update_in_passing(self, flights: PathsFlown) -> None:
        """Update with the paths of a step, in metres, before `advance`."""
        places = self.forecast.places(self.examples)
        self.pos = passing_kernels.learn_paths(
            self.forecast.constants, places, self.forecast.row(self._sea_step), self.mass,
            self._persons(), self.forecast.passing(self.step, flights),
            seen_of(places, len(flights.paths)),
        )  # fmt: skip

    @property
    def _sea_step(self) -> int:
        return self.forecast.first_step + self.step

    def _cells(self) -> NDArray[np.int16]:
        """Return the present cells of the particles, (M, 2)."""
        return self.forecast.cells[self.forecast.row(self._sea_step)]

    def particles(self) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return the present positions of the particles and their weights.

        Positions are (M, 2), metres to the east and to the north of the grid's south-west corner;
        the weights (M,) sum to 1.
        """
        row = self.forecast.row(self._sea_step)
        return self.forecast.positions[row], self.of_missing().sum(axis=0)

    @property
    def object_shares(self) -> dict[str, float]:
        """The probability of each class of leeway that the object may be; none if it is known."""
        objects, incident = self.forecast.tracks.objects, self.forecast.scenario.incident
        if objects is None or incident is None:
            return {}
        keys = [of_object.category.key for of_object in incident.objects]
        shares = np.bincount(objects, self.of_missing().sum(axis=0), len(keys))
        return dict(zip(keys, shares.tolist(), strict=True))

    def of_living(self) -> EnsembleBelief:
        """Return the belief about a person who is still alive, by the survival of the incident.

        If nobody would be, it is the belief about all.
        """
        twin, dies = self.copy(), self.forecast.tracks.dies
        if dies is not None:
            alive = dies > self._sea_step
            if twin.mass.components[:, alive].any():
                twin.mass.components[:, ~alive] = 0.0
                twin._sum_up()
        return twin

    def advance(self) -> None:
        """Advance the sea by one step, after the update with this step's looks."""
        self.step += 1

    def _particles(self) -> BinnedParticles:
        """Return the particles at the present step."""
        row = self.forecast.row(self._sea_step)
        return self.forecast.particles(row, row).at(0)

    def _updated(self, looks: LooksDone) -> float:
        pos: float = particle_kernels.learn(
            self.forecast.constants, self._particles(), self.mass, self._persons(), looks, self.pos
        )
        return pos

    def poc(self) -> NDArray[np.float64]:
        """Return the probability of containment of every cell, (R, C) as [y, x].

        Probability outside the grid or the area is in no cell.
        """
        out = np.empty(self.forecast.scenario.grid_size.matrix)
        particle_kernels.write_poc(
            self.forecast.constants, self._particles(), self.mass, self.class_of, self.missing,
            np.empty(len(self.examples)), out,
        )  # fmt: skip
        return out

    @property
    def outside(self) -> float:
        """The probability of containment outside the grid and the area."""
        x, y = self._cells().astype(np.int64).T
        grid, area = self.forecast.scenario.grid_size, self.forecast.area
        inside = (x >= 0) & (x < grid.columns) & (y >= 0) & (y < grid.rows)
        if area is not None:
            inside[inside] = area[y[inside], x[inside]]
        return float(self.of_missing()[:, ~inside].sum())

    def futures(self, count: int, horizon: int, rng: np.random.Generator) -> Futures:
        """Draw futures of the missing persons: tracks of particles, by their weights.

        Sampling is systematic: each particle gets its share of the futures, rounded up or down.

        Args:
            count: M.
            horizon: H; after the last step of the tracks nothing moves.
            rng: Generator of the draws.
        """
        sums = np.cumsum(self.of_missing())
        wanted = (np.arange(count) + rng.random()) * (sums[-1] / count)
        # Rounding may put the last draw beyond the end, or on a particle of weight 0.
        last = int(np.searchsorted(sums, sums[-1]))
        drawn = np.minimum(np.searchsorted(sums, wanted, side="right"), last)
        of_class, particle = np.divmod(drawn, len(self.forecast.weights))
        cells = self.forecast.cells
        steps = np.arange(self._sea_step, self._sea_step + horizon + 1)
        rows = np.minimum(steps, len(cells) - 1)
        futures = Futures.empty(count, horizon, self.forecast.padded.cells)
        futures.cells[:] = self.forecast.columns(cells[rows[:, None], particle])
        index(futures.cells, futures.starts, futures.members)
        futures.persons[:] = (
            self.examples[of_class]
            + self.forecast.scenario.person_amount * self.forecast.appearances[particle]
        )
        return futures

    def outlook(self, horizon: int, gamma: float) -> Outlook:
        """Return a function of what plans are expected to find, exactly for the particles.

        Args:
            horizon: H.
            gamma: Discount of a find per step.
        """
        forecast, weights, now = self.forecast, self.of_missing(), self._sea_step
        ends = forecast.columns(forecast.cells[forecast.row(now + horizon)])
        left = np.asarray(np.bincount(ends, weights.sum(axis=0), forecast.padded.cells), np.float64)

        def expect(looks: LooksToCome) -> Expected:
            last = forecast.row(now + int(looks.steps.max(initial=0)))
            expected: Expected = particle_kernels.expect_particles(
                forecast.particles(min(now, last), last), weights, ends, left,
                self._by_class(looks), 0, gamma,
                forecast.scenario.grid_size,
            )  # fmt: skip
            return expected

        return expect
