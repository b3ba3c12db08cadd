# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The grid of an incident, around the positions of its particles during the search."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pymap3d
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridExtent, GridShape
from dsse_ros.world.scenario.frames import flip_y
from dsse_ros.world.scenario.geodesy import mean_lon, surface_to_geodetic, through_ecef
from dsse_ros.world.scenario.incident import LONGEST_SEARCH_S, GridSummary, Incident
from dsse_ros.world.scenario.limits import MAX_SIDE
from dsse_ros.world.scenario.while_alive import while_alive

if TYPE_CHECKING:
    from dsse_ros.world.scenario.geodesy import Origin

OUTSIDE = 0.005
"""Share of the particles that may leave the grid: half of the 1 % that is promised, because these
particles are only a sample."""
APPROACHES = 3
"""Number of times that the grid is laid out: the time of transit depends on it."""
PARTICLES = 4000
TIME_STEP_S = 60.0
"""Particles, and the longest time between their positions, to lay out a grid."""


class IncidentGrid(NamedTuple):
    """A grid, and the drift on it.

    Attributes:
        origin: Latitude, longitude and height of the grid's south-west corner.
        grid: Its shape.
        datum: Cell (col, row) of the particles' mean position at this time.
        vector: Their mean drift per step, to the east and to the south, in cells.
        sigma: Their spread along x and y at this time, in cells.
        summary: See `GridSummary`.
    """

    origin: Origin
    grid: GridShape
    datum: tuple[int, int]
    vector: tuple[float, float]
    sigma: tuple[float, float]
    summary: GridSummary


@while_alive
def lay_grid(
    incident: Incident, *, cell_m: float, alt_m: float, grid: GridShape | None, fits: bool,
    steps: int,
    step_s: float, speed_mps: float, seed: int,
) -> IncidentGrid:  # fmt: skip
    """Return the grid around the positions that the particles of an incident reach.

    Args:
        incident: The incident.
        cell_m: Side of a cell.
        alt_m: Height of the sea above the ellipsoid.
        grid: Its shape; None for as many cells as hold the particles.
        fits: Whether it then has as many along each axis as hold them, or is a square.
        steps: Steps of the search.
        step_s: Duration of a step.
        speed_mps: Airspeed of the slowest drone, in transit from the base.
        seed: Seed of the ensemble; truth and belief of the search have other draws.

    Raises:
        FieldError: If wind or current are missing, or the particles are too far from each other.
    """
    begins_s, lasts_s = incident.search_start_s, steps * step_s
    count = math.ceil(lasts_s / TIME_STEP_S)
    for approach in range(APPROACHES):
        times = begins_s + lasts_s / count * np.arange(count + 1, dtype=np.float64)
        # The first two children of the seed belong to truth and belief, see `cell_tracks`.
        rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(3)[2])
        tracks = incident.tracks(times, PARTICLES, rng)
        centre = float(tracks.lats_deg[0].mean()), mean_lon(tracks.lons_deg[0]), alt_m
        x, y = metres_from(centre, tracks.lats_deg, tracks.lons_deg)
        corner, size, inside = _around(x, y, cell_m, grid, fits)
        if size.longer > MAX_SIDE:
            raise FieldError(
                f"incident must have particles within {MAX_SIDE} cells of {cell_m:g} m, got "
                f"{size.longer}; state a grid_size, or search from a greater altitude or earlier"
            )
        lat, lon = surface_to_geodetic(centre, *corner)
        origin = float(lat), float(lon), alt_m
        if incident.base is None or approach == APPROACHES - 1:
            break
        distance_m = _distance(origin, size.extent(cell_m), incident)
        begins_s = incident.search_start_s + distance_m / speed_mps
        check_transit(incident, begins_s, speed_mps, LONGEST_SEARCH_S)
    x, y = (x - corner[0]) / cell_m, size.rows - (y - corner[1]) / cell_m
    middle = float(x[0].mean()), float(y[0].mean())
    return IncidentGrid(
        origin, size,
        (_clipped(middle[0], size.columns), _clipped(middle[1], size.rows)),
        (float(x[-1].mean() - middle[0]) / steps, float(y[-1].mean() - middle[1]) / steps),
        (max(float(x[0].std()), 0.1), max(float(y[0].std()), 0.1)),
        GridSummary(begins_s, inside, float(tracks.stranded[-1].mean())),
    )  # fmt: skip


def check_transit(
    incident: Incident, begins_s: float, speed_mps: float, endurance_s: float
) -> None:
    """Check that drones reach the grid from their base.

    Args:
        incident: The incident.
        begins_s: Time at which they are at the grid.
        speed_mps: Airspeed of the slowest drone.
        endurance_s: Time that they can fly.

    Raises:
        FieldError: If the transit takes longer.
    """
    transit_s = begins_s - incident.search_start_s
    if incident.base is not None and transit_s > endurance_s:
        lat, lon = incident.base
        raise FieldError(
            f"incident.base must be at most {endurance_s / 60:.0f} min of flight from the grid, "
            f"got [{lat:g}, {lon:g}], {transit_s * speed_mps / 1000:.0f} km and "
            f"{transit_s / 60:.0f} min away"
        )


def positions(
    incident: Incident, origin: Origin, height_m: float, times_s: NDArray[np.float64],
    rng: np.random.Generator, count: int,
) -> tuple[
    Iterator[NDArray[np.float64]], NDArray[np.int8] | None,
    Callable[[], NDArray[np.float64]] | None,
]:  # fmt: skip
    """Return positions on a grid, objects and `dies_s` of particles, as in `TracksBySteps`.

    Args:
        incident: The incident, with the time at which the search begins.
        origin: The grid's south-west corner.
        height_m: Of the grid.
        times_s: (T,) float64, increasing, seconds since the search began; also before it.
        rng: Generator of the draws.
        count: M; given tracks keep their number.

    Raises:
        FieldError: See `Incident.drift_steps`.
    """
    assert incident.grid_summary is not None
    times = incident.grid_summary.begins_s + times_s
    drifting = incident.drift_steps(times, count, rng)

    def of_steps() -> Iterator[NDArray[np.float64]]:
        for at_step in drifting.positions:
            x, y = metres_from(origin, at_step.lats_deg, at_step.lons_deg)
            yield np.stack([x, flip_y(height_m, y)], axis=1)

    survival, released_s = incident.survival, drifting.released_s
    if survival is None:
        return of_steps(), drifting.objects, None

    def dies_s() -> NDArray[np.float64]:
        # Drawn last: the tracks are those of the same incident without a survival curve.
        assert released_s is not None
        return np.asarray(released_s + survival.draw_s(len(released_s), rng) - times[0])

    return of_steps(), drifting.objects, dies_s


def nearest_cells(
    origin: Origin, grid: GridShape, cell_m: float, base: tuple[float, float], count: int,
    mask: NDArray[np.bool_] | None,
) -> tuple[tuple[int, int], ...]:  # fmt: skip
    """Return the cells (col, row) nearest to a base, fewer than `count` if there are no more.

    Args:
        origin: The grid's south-west corner.
        grid: Its shape.
        cell_m: Side of a cell.
        base: Latitude and longitude.
        count: Number of cells.
        mask: (R, C) bool, the searched cells; None for all.
    """
    x, y = metres_from(origin, np.array([base[0]]), np.array([base[1]]))
    rows, cols = np.indices(grid.matrix)
    distance = np.hypot((cols + 0.5) * cell_m - x, (grid.rows - rows - 0.5) * cell_m - y)
    if mask is not None:
        distance[~mask] = np.inf
        count = min(count, int(mask.sum()))
    nearest = np.argsort(distance, axis=None, kind="stable")[:count]
    return tuple((int(i % grid.columns), int(i // grid.columns)) for i in nearest)


def _around(
    x: NDArray[np.float64], y: NDArray[np.float64], cell_m: float, grid: GridShape | None,
    fits: bool,
) -> tuple[tuple[float, float], GridShape, float]:  # fmt: skip
    """Return south-west corner, shape and share inside of a grid around tracks.

    Args:
        x: (T, M), metres to the east.
        y: (T, M), metres to the north.
        cell_m: Side of a cell.
        grid: Its shape; None for one that holds all but `OUTSIDE` of the tracks.
        fits: Whether it then need not be a square.
    """
    ends = []
    for axis in (x, y):
        # Each of the four sides may lose a quarter of the share that may be outside.
        low = np.quantile(axis.min(axis=0), OUTSIDE / 4)
        high = np.quantile(axis.max(axis=0), 1 - OUTSIDE / 4)
        ends.append((float(low), float(high)))
    if grid is None:
        # The margin covers the rotation of north between the grid's centre and its corner.
        grid = GridShape(*(math.ceil((high - low) / cell_m) + 2 for low, high in ends))
        grid = grid if fits else GridShape.square(grid.longer)
    extent = grid.extent(cell_m)
    corner = tuple((low + high - side) / 2 for (low, high), side in zip(ends, extent, strict=True))
    within = [
        ((axis >= start) & (axis < start + side)).all(axis=0)
        for axis, start, side in zip((x, y), corner, extent, strict=True)
    ]
    return (corner[0], corner[1]), grid, float((within[0] & within[1]).mean())


def _distance(origin: Origin, extent: GridExtent, incident: Incident) -> float:
    """Return the distance from an incident's base to the grid in metres, 0 inside."""
    assert incident.base is not None
    lat, lon = incident.base
    x, y = metres_from(origin, np.array([lat]), np.array([lon]))
    beyond = [
        max(0.0, -float(v[0]), float(v[0]) - side) for v, side in zip((x, y), extent, strict=True)
    ]
    return math.hypot(*beyond)


def metres_from(
    origin: Origin, lats: NDArray[np.float64], lons: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return metres to the east and to the north of an origin."""
    x, y, _ = through_ecef(pymap3d.geodetic2enu, origin, lats, lons, origin[2])
    return np.asarray(x), np.asarray(y)


def _clipped(value: float, size: int) -> int:
    return min(max(math.floor(value), 0), size - 1)
