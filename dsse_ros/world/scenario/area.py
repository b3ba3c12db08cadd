# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The searched part of the grid: polygons in latitude and longitude, and the sea.

A cell is in the area if its centre is. Edges of polygons are straight in latitude and longitude. A
polygon across the antimeridian must be cut there (RFC 7946, 3.1.1 and 3.1.9).
"""

from __future__ import annotations

import json
import logging
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.base.json_reader import read_json
from dsse_ros.world.scenario.frames import cell_centre
from dsse_ros.world.scenario.limits import MAX_SIDE
from dsse_ros.world.scenario.outline_faults import fault_of
from dsse_ros.world.scenario.outlines import BY_GDAL, outlines_of, read_by_gdal
from dsse_ros.world.scenario.positions import position

if TYPE_CHECKING:
    from dsse_ros.world.scenario.geodesy import Origin

MAX_BYTES = 10_000_000
_BLOCK_CELLS = 1 << 16
_LOGGER = logging.getLogger(__name__)
Point = tuple[float, float]
"""Latitude and longitude in degrees."""
Polygon = tuple[tuple[Point, ...], ...]
"""Rings without a repeated last point: the outer one, then the holes."""


@dataclass(frozen=True)
class Area:
    """Polygons on the Earth; the area is their union."""

    ALLOWED: ClassVar[str] = (
        "a GeoJSON file of a Polygon or MultiPolygon, or a list of three or more [lat, lon]"
    )
    IN_MESSAGE: ClassVar[str] = "a GeoJSON object"
    IS_FILE: ClassVar[bool] = True

    polygons: tuple[Polygon, ...]

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        # An outline may have many points, and each reset looks up the mask of the area.
        return hash(self.polygons)

    @classmethod
    def read(cls, value: Any, name: str = "area") -> Area:
        """Return the area from the path, text or content of GeoJSON, or from a list of points.

        Args:
            value: Any of these, or an area.
            name: Name of the field that has it.

        Raises:
            FieldError: If the value is none of these, a polygon is invalid, or Shapely is missing.
        """
        if isinstance(value, cls):
            return value
        try:
            import shapely
        except ModuleNotFoundError:
            raise FieldError(f"{name}: Shapely is missing; {pip_install('area')}") from None
        content = _read(value, name) if isinstance(value, str | os.PathLike) else value
        try:
            outlines, others, without = outlines_of(_geojson_of(content))
            shapes = [
                (
                    shapely.from_geojson(json.dumps(outline.geometry, allow_nan=False)),
                    outline.feature,
                )
                for outline in outlines
            ]
        except (LookupError, RecursionError, TypeError, ValueError, shapely.GEOSException):
            raise _refusal(value, name, content) from None
        if without:
            shown_names = ", ".join(without[:8]) + (", ..." if len(without) > 8 else "")
            _LOGGER.warning("%s: %s must have a geometry, got none", name, shown_names)
        if not shapes or any(shape.is_empty for shape, _ in shapes):
            raise _refusal(value, name, content)
        if others:
            _LOGGER.warning("%s: %d geometries are not polygons and do not count", name, others)
        polygons = []
        for shape, feature in shapes:
            of_feature = f" in {feature}" if feature else ""
            for polygon in _parts_of(shape):
                _check_outline(polygon, name, of_feature)
                polygons.append(polygon)
        return cls(
            tuple(
                tuple(
                    tuple((lat, lon) for lon, lat, *_ in ring.coords[:-1])
                    for ring in (polygon.exterior, *polygon.interiors)
                )
                for polygon in polygons
            )
        )

    @classmethod
    def may_be_sent(cls, value: Any) -> bool:
        """Return that a message may have GeoJSON, which names no file."""
        return True

    @property
    def identity(self) -> dict[str, Any]:
        """The polygons."""
        return asdict(self)

    def to_text(self) -> str:
        """Return the area as GeoJSON text."""
        return json.dumps(self.to_json())

    def to_json(self) -> dict[str, Any]:
        """Return the area as GeoJSON."""
        coordinates = [
            [[[lon, lat] for lat, lon in (*ring, ring[0])] for ring in polygon]
            for polygon in self.polygons
        ]
        return {"type": "MultiPolygon", "coordinates": coordinates}

    def prepared(self) -> Callable[[NDArray[Any], NDArray[Any]], NDArray[np.bool_]]:
        """Return a function (latitudes, longitudes) of whether points (...) lie inside, (...) bool.

        Points on an outline do not.
        """
        import shapely

        polygons = list(shapely.from_geojson(self.to_text()).geoms)
        shapely.prepare(polygons)

        def contains(lat_deg: NDArray[Any], lon_deg: NDArray[Any]) -> NDArray[np.bool_]:
            inside = np.zeros(lat_deg.shape, np.bool_)
            for polygon in polygons:
                inside |= shapely.contains_xy(polygon, lon_deg, lat_deg)
            return inside

        return contains


def grid_around(area: Area, cell_m: float, alt_m: float) -> tuple[GridShape, Origin]:
    """Return the shape and the south-west corner of the smallest grid around an area.

    Args:
        area: The area.
        cell_m: Side of a cell.
        alt_m: Height of the corner above the ellipsoid.

    Raises:
        FieldError: If it has too many cells along a side.
    """
    from dsse_ros.world.scenario.geodesy import mean_lon, surface_to_geodetic
    from dsse_ros.world.scenario.incident_grid import metres_from

    points = np.array([point for polygon in area.polygons for point in polygon[0]])
    middle = float(points[:, 0].mean()), mean_lon(points[:, 1]), alt_m
    ends = [(float(v.min()), float(v.max())) for v in metres_from(middle, *points.T)]
    # North at the corner is another than in the middle: it takes no cell more for that.
    grid = GridShape(*(max(math.ceil((high - low) / cell_m - 0.01), 1) for low, high in ends))
    if grid.longer > MAX_SIDE:
        raise FieldError(
            f"area must be at most {MAX_SIDE} cells of {cell_m:g} m along each axis with fit_grid, "
            f"got {grid}"
        )
    corner = [
        (low + high - side) / 2 for (low, high), side in zip(ends, grid.extent(cell_m), strict=True)
    ]
    lat, lon = surface_to_geodetic(middle, *corner)
    return grid, (float(lat), float(lon), alt_m)


@lru_cache(maxsize=4)
def area_mask(
    area: Area | None, land: bool, grid: GridShape, cell_size_m: float, origin: Origin
) -> NDArray[np.bool_] | None:
    """Return the searched cells of a grid, (R, C) bool [row, col], read-only; None for all.

    Args:
        area: Area of the searched cells; None for no limit.
        land: Whether to leave out cells on land.
        grid: Its shape.
        cell_size_m: Side of a cell.
        origin: The grid's south-west corner.

    Raises:
        FieldError: If no cell is left, a polygon is invalid, or a package is missing.
    """
    if area is None and not land:
        return None
    mask = np.ones(grid.matrix, np.bool_)
    if area is not None:
        contains = area.prepared()
        south, north, west, east = 90.0, -90.0, 180.0, -180.0
        for rows in _blocks(grid):
            lat, lon = _centres(grid, cell_size_m, origin, rows)
            mask[rows] = contains(lat, lon)
            south, north = min(south, lat.min()), max(north, lat.max())
            west, east = min(west, lon.min()), max(east, lon.max())
        if not mask.any():
            raise FieldError(
                f"area must have the centre of a cell of the grid, {south:.5f} to {north:.5f} N "
                f"and {west:.5f} to {east:.5f} E, got {shown(area.polygons[0][0])}"
            )
    if land:
        is_land = _land_mask()
        for rows in _blocks(grid):
            mask[rows] &= ~is_land(*_centres(grid, cell_size_m, origin, rows))
        if not mask.any():
            where = "the grid" if area is None else "the area"
            raise FieldError(f"land must be false where {where} has no cell at sea, got true")
    if mask.all():
        return None
    mask.flags.writeable = False
    return mask


def _blocks(grid: GridShape) -> Iterator[slice]:
    """Yield the rows of a grid in blocks: positions of all cells can take gigabytes."""
    count = max(_BLOCK_CELLS // grid.columns, 1)
    for first in range(0, grid.rows, count):
        yield slice(first, min(first + count, grid.rows))


def _centres(
    grid: GridShape, cell_size_m: float, origin: Origin, rows: slice
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return latitude and longitude of the cell centres in some rows, (R, C) each."""
    from dsse_ros.world.scenario.geodesy import surface_to_geodetic

    row, col = np.meshgrid(np.arange(rows.start, rows.stop), np.arange(grid.columns), indexing="ij")
    lat, lon = surface_to_geodetic(origin, *cell_centre(grid, cell_size_m, col, row))
    return lat, lon


def runs_of(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the cells of a mask (R, C) as runs along the rows, (R, 3): row, first, last column."""
    edges = np.diff(mask.astype(np.int8), axis=1, prepend=0, append=0)
    rows, first = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    return np.stack([rows, first, end - 1], axis=1).astype(np.int64)


def _land_mask() -> Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]:
    """Return a function (latitudes, longitudes) of whether points are on land; it takes 1.3 GB.

    The shoreline is GSHHG, full resolution (Wessel and Smith, "A global, self-consistent,
    hierarchical, high-resolution shoreline database", J. Geophys. Res. 101, 1996).
    """
    try:
        from roaring_landmask import RoaringLandmask
    except ModuleNotFoundError:
        raise FieldError(f"land: roaring-landmask is missing; {pip_install('land')}") from None
    shores = RoaringLandmask.new()

    def is_land(lat_deg: NDArray[np.float64], lon_deg: NDArray[np.float64]) -> NDArray[np.bool_]:
        land = shores.contains_many(lon_deg.ravel(), lat_deg.ravel())
        return np.asarray(land, np.bool_).reshape(lat_deg.shape)

    return is_land


def _read(source: str | os.PathLike[str], name: str) -> Any:
    """Return the content of a GeoJSON text, or of the file at this path.

    Raises:
        FieldError: If the file cannot be read, or is not JSON.
    """
    text = os.fspath(source)
    try:
        if not text.lstrip().startswith("{"):
            if text.lower().endswith(BY_GDAL):
                return read_by_gdal(text, name)
            with Path(text).open("rb") as file:
                data = file.read(MAX_BYTES + 1)
            if len(data) > MAX_BYTES:
                raise FieldError(f"{name} must have at most {MAX_BYTES} bytes, got {shown(source)}")
            # Some programs put a byte order mark first.
            text = data.decode("utf-8-sig")
        return read_json(text, name)
    except OSError as error:
        raise FieldError(
            f"{name} must be {Area.ALLOWED}, got {shown(source)}: {error.strerror}"
        ) from None
    except FieldError:
        raise
    except ValueError as error:
        reason = reason_of(error).removeprefix(f"{name}: ")
        raise FieldError(f"{name} must be {Area.ALLOWED}, got {shown(source)}: {reason}") from None


def _geojson_of(content: Any) -> Mapping[str, Any]:
    """Return GeoJSON, or a list of points (latitude, longitude) or texts, as GeoJSON."""
    if isinstance(content, Mapping):
        return content
    if not isinstance(content, Sequence):
        raise TypeError
    places = [position(place) if isinstance(place, str) else place for place in content]
    ring = [(lon, lat) for lat, lon in places]
    return {"type": "Polygon", "coordinates": [ring if ring[0] == ring[-1] else [*ring, ring[0]]]}


def _check_outline(polygon: Any, name: str, of_feature: str) -> None:
    """Check that a polygon lies on the Earth and is valid."""
    import shapely

    west, south, east, north = polygon.bounds
    if not (-180 <= west <= east <= 180 and -90 <= south <= north <= 90):
        raise FieldError(
            f"{name} must have latitudes from -90 to 90 and longitudes from -180 to 180, got "
            f"{south:.10g} to {north:.10g} and {west:.10g} to {east:.10g}{of_feature}"
        )
    if not polygon.is_valid:
        raise FieldError(
            f"{name} must have outlines that do not cross or touch themselves, got "
            f"{shapely.is_valid_reason(polygon)} (lon lat){of_feature}"
        )


def _parts_of(geometry: Any) -> Iterator[Any]:
    """Yield the parts of a geometry of Shapely that are not collections."""
    if not hasattr(geometry, "geoms"):
        yield geometry
        return
    for part in geometry.geoms:
        yield from _parts_of(part)


def _refusal(value: Any, name: str, content: Any) -> FieldError:
    reason = f": {fault}" if (fault := fault_of(content)) else ""
    return FieldError(f"{name} must be {Area.ALLOWED}, got {shown(value)}{reason}")
