# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A pair of variables on the grid of a `Flow`: the part that is needed, filled at the coast."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.coordinates import Place, place_of
from dsse_ros.world.drift.curvilinear import curvilinear
from dsse_ros.world.drift.flow import MAX_SPEED_MPS, NO_LOOKUP, Extent, Flow, Kind, Span
from dsse_ros.world.drift.flow_times import Axis, Source, Times, part_of
from dsse_ros.world.drift.grids import Grid, Lookup, Mesh
from dsse_ros.world.drift.meshes import mesh_of
from dsse_ros.world.drift.netcdf import Unfit, filled
from dsse_ros.world.drift.projections import projected
from dsse_ros.world.drift.shore import Box
from dsse_ros.world.drift.units import metres_per_second
from dsse_ros.world.drift.velocity_pairs import Pair

SAME_AXES_RAD = 1e-3
"""Angle up to which the axes of a grid are those to the east and north."""
MAX_VALUES = 20_000_000
"""Values of a variable that are read at most, 80 MB."""
SAME_MERIDIAN_DEG = 1e-4
"""Longitudes that differ by less are one: files of the globe have their first meridian twice."""
MAX_COMPARED = 1_000_000
"""Values of a coordinate that are compared between files."""
_LOGGER = logging.getLogger(__name__)


def flow_on_grid(
    kind: Kind,
    sources: Sequence[Source],
    span: Span,
    gap_cells: int,
    name: str,
    constant_s: float = 0.0,
) -> Flow:
    """Return the flow of pairs in a span.

    Args:
        kind: What it is of; values beyond its greatest speed are fill values without a declaration.
        sources: The pair in files of one grid and different times. Where times overlap, the last
            file counts.
        span: Where the flow may be needed; little beyond it is read.
        gap_cells: Cells over which the nearest value fills a gap.
        name: See `Flow.source`.
        constant_s: See `Choice`.

    Raises:
        Unfit: If the files do not have it.
    """
    names, limit = sources[0].pair.names, MAX_SPEED_MPS[kind]
    times = Times.of_sources(sources)
    when = times.within(span, names, constant_s)
    grid = _grid(*sources[0], span.box, gap_cells)
    east, north = _components(sources, times, when, grid, limit)
    gaps = ~(np.hypot(east, north) <= limit)
    if gaps.all():
        raise Unfit(
            f"{names} has no value of at most {limit:g} m/s in the area and the times needed"
        )
    east[gaps] = north[gaps] = np.nan
    if gap_cells and gaps.any():
        filled = _fill_gaps(east, north, gaps, gap_cells)
        _LOGGER.warning(
            "%s: %d of %d cells without a value take the nearest one, at most %d cells away",
            name, filled, int(gaps.any(axis=0).sum()), gap_cells,
        )  # fmt: skip
    lats, lons, rows, cols = grid.lookup
    every, times_s = times.times_s, times.times_s[when]
    if constant_s:
        every = times_s = times_s + [-constant_s, constant_s]
        east, north = east.repeat(2, axis=0), north.repeat(2, axis=0)
    extent = Extent.of_axes(every, grid.lats_deg, grid.lons_deg)
    return Flow(times_s, lats, lons, east, north, name, extent, gap_cells, rows, cols)


def _components(
    sources: Sequence[Source], times: Times, when: NDArray[np.int64], grid: Grid, limit: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the velocities to the east and to the north, (T, J, I) each.

    Args:
        sources: The pair in each file.
        times: Their times.
        when: (T,) which of them.
        grid: The part of the grid.
        limit: Greatest speed in m/s.
    """
    shape = len(when), *(len(part) for part in grid.indices)
    if math.prod(shape) > MAX_VALUES:
        raise Unfit(
            f"{sources[0].pair.names} must have at most {MAX_VALUES} values in the area and the "
            f"times needed, got {' x '.join(map(str, shape))}"
        )
    needed = np.unique(times.files[when])
    _check_one_grid([sources[number] for number in {0, *needed.tolist()}])
    east, north = np.empty((2, *shape), np.float32)
    for number in needed:
        part = times.files[when] == number
        places = _places(*sources[number])
        pair = sources[number].pair
        for values, variable, place, shifts in zip(
            (east, north), (pair.east, pair.north), places, grid.shifts, strict=True
        ):
            dims = (times.dims[number], *place.dims)
            steps = times.steps[when][part]
            if grid.mesh is None:
                axes = steps, *grid.indices
                values[part] = _read(variable, dims, axes, shifts, limit)
            else:
                values[part] = _on_mesh(variable, dims, steps, grid.mesh, limit)
    return (east, north) if grid.turn is None else _turned(east, north, grid.turn)


def _places(dataset: Any, pair: Pair) -> tuple[Place, Place]:
    return place_of(dataset, pair.east), place_of(dataset, pair.north)


def _check_one_grid(sources: Sequence[Source]) -> None:
    """Check that files have the same coordinates of place."""
    first, *others = ([*_sampled(source)] for source in sources)
    for other in others:
        if len(first) != len(other) or not all(map(_are_equal, first, other)):
            raise Unfit("files must have one grid, got different places")


def _sampled(source: Source) -> Iterator[NDArray[Any]]:
    """Yield the horizontal coordinates of a file, of large ones only some values."""
    for place in _places(*source):
        for axis in place[:4]:
            if axis is not None:
                step = math.ceil((axis.size / MAX_COMPARED) ** (1 / axis.ndim))
                yield axis.isel({dim: slice(None, None, step) for dim in axis.dims}).values


def _are_equal(first: NDArray[Any], other: NDArray[Any]) -> bool:
    return np.array_equal(first, other, equal_nan=True)


def _grid(dataset: Any, pair: Pair, box: Box, margin: int) -> Grid:
    """Return the part of the grid of a pair that holds a box.

    Raises:
        Unfit: If the grid is not understood, or it holds nothing of the box.
    """
    places = _places(dataset, pair)
    place = places[0]
    alike = place.dims == places[1].dims
    if len(place.dims) == 1 and alike:
        return _of_mesh(mesh_of(place, box))
    if place.is_regular and alike:
        return _regular(place, box, margin)
    grid = projected(place, box, margin) if alike and place.y is not None else None
    if grid is None:
        grid = curvilinear(dataset, places, box, margin)
    axes: str = pair.axes or ("grid" if grid.shifts[0] != grid.shifts[1] else "")
    if not axes and grid.turn is not None and np.nanmax(np.abs(grid.turn)) > SAME_AXES_RAD:
        raise Unfit(
            f"{pair.names} may point to the east and north or along the grid; state axes: earth or "
            "axes: grid"
        )
    return grid if axes == "grid" else grid._replace(turn=None)


def _of_mesh(mesh: Mesh) -> Grid:
    indices = np.arange(len(mesh.lats_deg)), np.arange(len(mesh.lons_deg))
    lookup = Lookup(mesh.lats_deg, mesh.lons_deg, NO_LOOKUP, NO_LOOKUP)
    return Grid(lookup, indices, mesh.all_lats_deg, mesh.all_lons_deg, mesh=mesh)


def _on_mesh(
    variable: Any, dims: Sequence[str], steps: NDArray[np.int64], mesh: Mesh, limit: float
) -> NDArray[np.float32]:
    """Return a variable of a mesh on its grid in m/s, (T, Y, X), one time after the other."""
    first, last = int(mesh.points[0]), int(mesh.points[-1])
    between = np.arange(first, last + 1)
    times = (
        _read(variable, dims, (steps[i : i + 1], between), ((0,),), limit)
        for i in range(len(steps))
    )
    return np.stack([mesh.resampled(values[0, mesh.points - first]) for values in times])


def _regular(place: Place, box: Box, margin: int) -> Grid:
    """Return the part of a grid of latitude and longitude; see `_grid`."""
    lats, lons = _values(place.lat), _values(place.lon)
    south, north = box.south_deg, box.north_deg
    rows = part_of("latitude", place.lat.dims[0], lats, south, north, margin)
    cols = _longitudes(place, lons, box, margin)
    indices = rows.indices, cols.indices
    lookup = Lookup(rows.values, cols.values, NO_LOOKUP, NO_LOOKUP)
    return Grid(lookup, indices, lats, lons)


def _values(coordinate: Any) -> NDArray[np.float64]:
    """Return the values of a coordinate."""
    values = filled(coordinate.values)
    if not values.size or not np.isfinite(values).all():
        raise Unfit(f"{coordinate.name} must have values without gaps")
    return values


def _longitudes(place: Place, lons_deg: NDArray[np.float64], box: Box, margin: int) -> Axis:
    """Return the part of the longitudes, which may be from -180 or from 0."""
    turned = box.turned(lons_deg)
    order = np.argsort(turned, kind="stable")
    once = order[np.diff(turned[order], prepend=-np.inf) > SAME_MERIDIAN_DEG]
    dim = place.lon.dims[0]
    part = part_of("longitude", dim, turned[once], box.west_deg, box.east_deg, margin)
    return part._replace(indices=once[part.indices])


def _read(
    variable: Any,
    dims: Sequence[str],
    axes: Sequence[NDArray[np.int64]],
    shifts: Sequence[tuple[int, ...]],
    limit: float,
) -> NDArray[np.float32]:
    """Return a variable in m/s, (T, J, I) or (T, N), NaN where there is no value.

    Args:
        variable: The variable.
        dims: Its dimensions of time and place; "" for a single time.
        axes: Indices along each.
        shifts: Which values to average.
        limit: Greatest speed in m/s; values beyond it are none.
    """
    factor = metres_per_second(variable)
    parts = []
    for shift in shifts:
        wanted = [index + by for index, by in zip(axes, (0, *shift), strict=True)]
        chosen = [_as_slice(index) for index in wanted]
        there = [(dim, read) for dim, read in zip(dims, chosen, strict=True) if dim]
        part = variable.isel(dict(there)).transpose(*(dim for dim, _ in there))
        found = filled(part.values, np.float32)
        found = found.reshape(*(len(index) for index in wanted))
        # Restore the order of axes that were read forward.
        for number, (index, read) in enumerate(zip(wanted, chosen, strict=True)):
            if isinstance(read, slice) and index[0] > index[-1]:
                found = np.flip(found, number)
        found = found * np.float32(factor)
        parts.append(np.where(np.abs(found) <= limit, found, np.nan))
    return np.ascontiguousarray(_mean(parts), np.float32)


def _mean(parts: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Return the mean of one or two arrays; a side of a cell on land does not count."""
    first, last = parts[0], parts[-1]
    mean = np.float32(0.5) * (first + last)
    return np.where(np.isnan(mean), np.where(np.isnan(first), last, first), mean)


def _turned(
    along_rows: NDArray[np.float32], across: NDArray[np.float32], turn: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return velocities along the axes of a grid as velocities to the east and to the north."""
    cos, sin = np.cos(turn).astype(np.float32), np.sin(turn).astype(np.float32)
    return cos * along_rows - sin * across, sin * along_rows + cos * across


def _as_slice(index: NDArray[np.int64]) -> Any:
    """Return indices as a slice where possible, which reads a part of the file only."""
    low, high = int(index.min()), int(index.max())
    # Longitudes across the file's own seam, and times out of order, are not a slice.
    in_order = (np.abs(np.diff(index)) == 1).all() and high - low + 1 == len(index)
    return slice(low, high + 1) if in_order else index


def _fill_gaps(
    east: NDArray[np.float32], north: NDArray[np.float32], gaps: NDArray[np.bool_], cells: int
) -> int:
    """Fill gaps near values, time by time, in place; return the number of cells filled.

    Args:
        east: (T, Y, X).
        north: (T, Y, X).
        gaps: (T, Y, X), where one of them has no value.
        cells: Greatest distance of the value.
    """
    from scipy.ndimage import distance_transform_edt

    filled = np.zeros(gaps.shape[1:], np.bool_)
    before, near, rows, cols = None, filled, filled, filled
    for number, gap in enumerate(gaps):
        if gap.all() or not gap.any():
            continue
        if before is None or not np.array_equal(gap, before):
            distance, (rows, cols) = distance_transform_edt(gap, return_indices=True)
            near, before = gap & (distance <= cells), gap
        for values in (east[number], north[number]):
            values[near] = values[rows[near], cols[near]]
        filled |= near
    return int(filled.sum())
