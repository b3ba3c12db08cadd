# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ensemble of a scenario, drawn for truth, belief, planners and POS, and cached."""

from __future__ import annotations

import math
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.step.ensemble_kernels import FAR
from dsse_ros.search.step.metres_detection import FARTHEST_M
from dsse_ros.world.scenario.frames import flip_y
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.targets.ensemble import Ensemble, TracksBySteps, WeightedTracks
from dsse_ros.world.targets.registry import TARGET_MODELS

if TYPE_CHECKING:
    from typing_extensions import Self

_T = TypeVar("_T", bound=np.generic)
_NOWHERE_M = -2 * FARTHEST_M

LARGEST_BYTES = 1 << 30
"""Memory limit of an ensemble."""
KEPT_BYTES = 1 << 28
"""Memory limit of the most recent ensembles that are kept although nothing uses them."""
MOST_KEPT = 6
"""Of those: the draws of the last two scenarios. Each report of weather in a live search is another
one, and nodes that have had many of them must not grow."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CellParticles:
    """The particles of a belief in cells, by step of the sea from the start of their drift.

    After the last step nothing moves.

    Attributes:
        particles: (T, M, 2) int16, cells (x, y) of the particles.
        weights: (M,) float64, weights of the particles.
        objects: (M,) int8, numbers of the particles' objects, see `WeightedTracks`.
        appearances: (M,) int8, numbers of the particles' appearances, see `Incident`.
        particles_m: (T, M, 2) float32, their positions in metres to the east and to the south of
            the grid's north-west corner; only with space metres.
        dies: (M,) int32, first step of the sea at which the person of a particle is no longer
            alive, T or more for never; None without a survival curve.
    """

    particles: NDArray[np.int16]
    weights: NDArray[np.float64]
    objects: NDArray[np.int8] | None
    appearances: NDArray[np.int8]
    particles_m: NDArray[np.float32] | None
    dies: NDArray[np.int32] | None

    def __deepcopy__(self, memo: object) -> Self:
        """Return the particles themselves: nothing changes them."""
        return self

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays."""
        return sum(array.nbytes for array in vars(self).values() if array is not None)


@dataclass(frozen=True, eq=False, kw_only=True)
class CellTracks(CellParticles):
    """The particles of the belief whose map drones observe, and the tracks that persons follow.

    Attributes:
        truth: (T, M', 2) int16, cells (x, y) of the tracks that persons follow, drawn with another
            seed; a view of (M', T, 2), see `SeaEnsemble`.
        cumulative: (M',) float64, cumulative sums of the tracks' weights.
        maps: (T, R, C) float32 as [y, x], the probability of each cell by the particles. They leave
            out probability outside the grid or the area and are not scaled to sum to 1.
        truth_m: (T, M', 2) float32, the positions of `truth` in metres, a view of (M', T, 2); only
            with space metres.
        truth_appearances: (M',) int8, the appearances of `truth`.
    """

    truth: NDArray[np.int16]
    cumulative: NDArray[np.float64]
    maps: NDArray[np.float32]
    truth_m: NDArray[np.float32] | None
    truth_appearances: NDArray[np.int8]


class Draw(IntEnum):
    """What tracks are drawn for; its value is the child of the `SeedSequence` of `ensemble_seed`.

    A searcher prefers cells that hold many particles by chance. If POS counted the particles that
    it goes by, POS would be too high; so nobody but POS sees those of `POS`.
    """

    TRUTH = 0
    BELIEF = 1
    # Number 2 is that of `incident_grid`.
    PLANNING = 3
    POS = 4


_Key = tuple[Ensemble, ResolvedScenario, Rules, Draw]
_alive: list[tuple[_Key, weakref.ref[CellParticles]]] = []
"""The ensembles in use or kept."""
_kept: list[CellParticles] = []
"""The most recent ones, the last one last."""
_lock = threading.Lock()


def tracks_of(scenario: ResolvedScenario, rules: Rules) -> CellTracks | None:
    """Return the tracks of a scenario, or None if its persons do not follow an ensemble.

    Truth and particles are drawn from the same model, with seeds that `ensemble_seed` spawns; an
    incident may state another law for the truth.

    Args:
        scenario: The scenario.
        rules: The rules of the search.

    Raises:
        FieldError: If they would take too much memory.
        ValueError: If the ensemble breaks its contract.
    """
    tracks = particles_of(scenario, rules, Draw.BELIEF)
    assert tracks is None or isinstance(tracks, CellTracks)
    return tracks


def particles_of(scenario: ResolvedScenario, rules: Rules, draw: Draw) -> CellParticles | None:
    """Return the particles of a belief; those of `Draw.BELIEF` are `CellTracks`.

    Args:
        scenario: See `tracks_of`.
        rules: See there.
        draw: Of the particles.

    Raises:
        FieldError: See there.
        ValueError: See there.
    """
    model = TARGET_MODELS[rules.person_motion]
    if not isinstance(model, Ensemble):
        return None
    with _lock:
        return _cached(model, scenario, rules, draw)


def _cached(model: Ensemble, scenario: ResolvedScenario, rules: Rules, draw: Draw) -> CellParticles:
    key = (model, scenario, rules, draw)
    _alive[:] = [(known, tracks) for known, tracks in _alive if tracks() is not None]
    found = next((t() for known, t in _alive if known[0] is model and known[1:] == key[1:]), None)
    if found is not None:
        _keep(found)
        return found
    check_memory(scenario, rules)
    new: CellParticles
    if draw is Draw.BELIEF:
        new = _made(model, scenario, rules)
    else:
        new = CellParticles(**_of_particles(scenario, _drawn(model, scenario, rules, draw)))
    _alive.append((key, weakref.ref(new)))
    _keep(new)
    return new


def _keep(tracks: CellParticles) -> None:
    """Note that an ensemble is the most recent one; forget those that are too many."""
    _kept[:] = [*(kept for kept in _kept if kept is not tracks), tracks]
    while len(_kept) > MOST_KEPT or sum(kept.nbytes for kept in _kept) > KEPT_BYTES:
        del _kept[0]


def last_step_of(scenario: ResolvedScenario, rules: Rules) -> int:
    """Return the number of steps of the sea until the time limit of a mission."""
    mission = rules.last_step(scenario.timestep_limit) + 1
    return scenario.pre_search_steps + rules.reset_sea_steps + mission


def check_memory(scenario: ResolvedScenario, rules: Rules) -> None:
    """Check that the ensemble of a scenario, if it has one, does not take too much memory.

    Nothing is drawn for it.

    Raises:
        FieldError: If it does; it says what to change.
    """
    model = TARGET_MODELS[rules.person_motion]
    if not isinstance(model, Ensemble):
        return
    rows, grid = last_step_of(scenario, rules) + 1, scenario.grid_size
    counts = model.count(scenario.followed), model.count(scenario)
    of_tracks, of_map = (12 if rules.in_metres else 4) * sum(counts), 4 * grid.cells
    needed = rows * (of_tracks + of_map)
    if needed <= LARGEST_BYTES:
        return
    # What each would have to be, if the others stay.
    of_row = LARGEST_BYTES // rows
    particles = (of_row - of_map) * max(counts) // of_tracks
    largest = {
        "particles": particles,
        "timestep_limit": scenario.timestep_limit + LARGEST_BYTES // (of_tracks + of_map) - rows,
        "grid_size": math.isqrt(max(of_row - of_tracks, 0) // 4),
    }
    fits = " or ".join(f"{name} {value}" for name, value in largest.items() if value >= 1)
    raise FieldError(
        f"tracks and maps of person_motion {rules.person_motion} must be at most "
        f"{LARGEST_BYTES >> 20} MiB, got {max(counts)} particles, {rows - 1} steps and a grid of "
        f"{grid}, {needed >> 20} MiB; state "
        f"{f'at most {fits}' if fits else 'less of all three'}, or larger cells"
    )


def _made(model: Ensemble, scenario: ResolvedScenario, rules: Rules) -> CellTracks:
    followed = scenario.followed if scenario.has_persons else scenario
    with ThreadPoolExecutor(1) as beside:
        drawing = None
        if scenario.has_persons:
            drawing = beside.submit(_drawn, model, followed, rules, Draw.TRUTH)
        belief = _drawn(model, scenario, rules, Draw.BELIEF)
        truth = belief if drawing is None else drawing.result()
    return CellTracks(
        **_of_particles(scenario, belief), truth=_by_track(truth.cells),
        cumulative=np.cumsum(truth.weights), maps=maps_of(scenario, belief.cells, belief.weights),
        truth_m=None if truth.positions_m is None else _by_track(truth.positions_m),
        truth_appearances=_appearances(scenario, followed, truth),
    )  # fmt: skip


def maps_of(
    scenario: ResolvedScenario, cells: NDArray[np.int16], weights: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the maps of particles, see `CellTracks`."""
    grid = scenario.grid_size
    maps = np.empty((len(cells), *grid.matrix), np.float32)
    for step, of_step in enumerate(cells):
        maps[step] = poc_of_cells(of_step, weights, grid, scenario.area_mask)
    return maps


def given_particles(
    tracks: TracksBySteps, scenario: ResolvedScenario, rules: Rules
) -> CellParticles:
    """Return the particles of a belief that go along given tracks.

    Args:
        tracks: The tracks, with a position for each step of the sea until the time limit.
        scenario: The scenario.
        rules: The rules of the search.
    """
    return CellParticles(**_of_particles(scenario, _on_grid(tracks, scenario, rules)))


def _of_particles(scenario: ResolvedScenario, drawn: _Drawn) -> dict[str, Any]:
    """Return the fields of `CellParticles` of what was drawn."""
    return {
        "particles": drawn.cells, "weights": drawn.weights, "particles_m": drawn.positions_m,
        "objects": drawn.objects, "appearances": _appearances(scenario, scenario, drawn),
        "dies": drawn.dies,
    }  # fmt: skip


def of_living(tracks: CellParticles) -> CellParticles:
    """Return particles that are nowhere once their persons are no longer alive."""
    assert tracks.dies is not None
    dead = np.arange(len(tracks.particles))[:, None] >= tracks.dies
    particles = tracks.particles.copy()
    particles[dead] = -FAR
    particles_m = None if tracks.particles_m is None else tracks.particles_m.copy()
    if particles_m is not None:
        particles_m[dead] = _NOWHERE_M
    return replace(tracks, particles=particles, particles_m=particles_m)


def _by_track(steps: NDArray[_T]) -> NDArray[_T]:
    """Return a view (T, M, 2) on a copy with the steps of a track side by side."""
    return np.ascontiguousarray(steps.transpose(1, 0, 2)).transpose(1, 0, 2)


def generator_of(scenario: ResolvedScenario, draw: Draw) -> np.random.Generator:
    """Return what the tracks of a draw are drawn from."""
    children = np.random.SeedSequence(scenario.ensemble_seed).spawn(len(Draw) + 1)
    return np.random.default_rng(children[draw])


def particle_positions(
    scenario: ResolvedScenario, rules: Rules, draw: Draw = Draw.BELIEF
) -> NDArray[np.float32]:
    """Return the positions of a belief's particles in metres, by step of the sea.

    The search keeps only their cells, so they are drawn again, with the same seed.

    Args:
        scenario: The scenario.
        rules: The rules of the search; persons must follow an ensemble.
        draw: Of the particles.

    Returns:
        (T, M, 2) float32, to the east and to the north of the grid's south-west corner.
    """
    model = TARGET_MODELS[rules.person_motion]
    assert isinstance(model, Ensemble)
    rng = generator_of(scenario, draw)
    steps = last_step_of(scenario, rules)
    drawn = model.drawn(scenario, steps, rng, scenario.particles)
    height_m = scenario.grid_size.rows * scenario.cell_size
    flipped = np.empty((steps + 1, len(drawn.weights), 2), np.float32)
    for step, positions in enumerate(drawn.positions):
        flipped[step] = positions
        flipped[step, :, 1] = flip_y(height_m, positions[:, 1])
    return flipped


class _Drawn(NamedTuple):
    """Tracks of particles: (T, M, 2) cells, (M,) weights, objects; positions in metres; deaths."""

    cells: NDArray[np.int16]
    weights: NDArray[np.float64]
    positions_m: NDArray[np.float32] | None
    objects: NDArray[np.int8] | None
    dies: NDArray[np.int32] | None


def _drawn(model: Ensemble, scenario: ResolvedScenario, rules: Rules, draw: Draw) -> _Drawn:
    """Return tracks.

    Raises:
        ValueError: If the ensemble breaks its contract.
    """
    rng, steps = generator_of(scenario, draw), last_step_of(scenario, rules)
    return _on_grid(model.drawn(scenario, steps, rng, scenario.particles), scenario, rules)


def _on_grid(
    tracks: WeightedTracks | TracksBySteps, scenario: ResolvedScenario, rules: Rules
) -> _Drawn:
    """Return tracks in the cells of a scenario."""
    steps = last_step_of(scenario, rules)
    shape = steps + 1, len(tracks.weights), 2
    cells = np.empty(shape, np.int16)
    positions_m = np.empty(shape, np.float32) if rules.in_metres else None
    # Step by step, because all positions would take four times as much memory.
    for step, positions in enumerate(tracks.positions):
        place = np.floor(positions / scenario.cell_size)
        place[~np.isfinite(place).all(axis=1)] = -FAR
        cells[step] = np.clip(place, -FAR, FAR)
        if positions_m is not None:
            positions_m[step] = np.nan_to_num(
                positions.astype(np.float32), nan=_NOWHERE_M, posinf=_NOWHERE_M, neginf=_NOWHERE_M
            )
    # Drawn after the positions.
    dies, dies_s = None, tracks.dies_s() if callable(tracks.dies_s) else tracks.dies_s
    if dies_s is not None:
        at_step = np.ceil(dies_s / scenario.step_duration_s)
        dies = np.clip(at_step, 0, steps + 1).astype(np.int32)
    # Copy the weights: the compiled functions do not accept read-only arrays.
    return _Drawn(cells, np.array(tracks.weights, np.float64), positions_m, tracks.objects, dies)


def _appearances(
    scenario: ResolvedScenario, of_tracks: ResolvedScenario, drawn: _Drawn
) -> NDArray[np.int8]:
    """Return the numbers, (M,), that the appearances of tracks have in a scenario."""
    if scenario.incident is None or of_tracks.incident is None or not of_tracks.incident.objects:
        return np.zeros(len(drawn.weights), np.int8)
    numbers = [
        scenario.incident.appearances.index(one.appearance) for one in of_tracks.incident.objects
    ]
    objects = np.zeros(len(drawn.weights), np.int8) if drawn.objects is None else drawn.objects
    return np.array(numbers, np.int8)[objects]


def poc_of_cells(
    cells: NDArray[np.int16],
    weights: NDArray[np.float64],
    grid: GridShape,
    area: NDArray[np.bool_] | None,
) -> NDArray[np.float64]:
    """Return the weight in each cell, (R, C) float64 as [y, x], 0 outside the area.

    Args:
        cells: (M, 2) cells (x, y).
        weights: (M,) float64.
        grid: Its shape.
        area: (R, C) bool, the searched cells; None for all.
    """
    x, y = cells[:, 0].astype(np.int64), cells[:, 1].astype(np.int64)
    inside = (x >= 0) & (x < grid.columns) & (y >= 0) & (y < grid.rows)
    column = (y * grid.columns + x)[inside]
    poc = np.bincount(column, weights[inside], grid.cells).astype(np.float64)
    poc = poc.reshape(grid.matrix)
    if area is not None:
        poc[~area] = 0.0
    return poc
