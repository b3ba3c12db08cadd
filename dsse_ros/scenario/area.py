# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The searched part of the grid: polygons in latitude and longitude, and the sea.

A cell is in the area if its centre is. Edges of polygons are straight in latitude and longitude. A
polygon across the antimeridian must be cut there (RFC 7946, 3.1.1 and 3.1.9).
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.extras import pip_install
from dsse_ros.scenario.fields import FieldError, shown

if TYPE_CHECKING:
    from dsse_ros.scenario.geodesy import Origin

MAX_BYTES = 10_000_000
_BLOCK_CELLS = 1 << 16
ALLOWED = "a GeoJSON file of a Polygon or MultiPolygon, or a list of three or more [lat, lon]"

Point = tuple[float, float]
"""Latitude and longitude in degrees."""
Polygon = tuple[tuple[Point, ...], ...]
"""Rings without a repeated last point: the outer one, then the holes."""


@dataclass(frozen=True)
class Area:
    """Polygons on the Earth; the area is their union."""

    polygons: tuple[Polygon, ...]

    @classmethod
    def of(cls, value: Any) -> Area:
        """Return the area from the path, text or content of GeoJSON, or from a list of points.

        Raises:
            FieldError: If the value is none of these.
        """
        if isinstance(value, cls):
            return value
        if isinstance(value, str | os.PathLike):
            value = _read(value)
        try:
            if isinstance(value, Mapping):
                return cls(tuple(_polygons_of(value)))
            return cls(((_ring(value),),))
        except FieldError:
            raise
        except (AttributeError, KeyError, RecursionError, TypeError, ValueError):
            raise FieldError(f"area: {shown(value)} is not allowed; {ALLOWED}") from None

    def to_geojson(self) -> str:
        """Return the area as GeoJSON text."""
        coordinates = [
            [[[lon, lat] for lat, lon in (*ring, ring[0])] for ring in polygon]
            for polygon in self.polygons
        ]
        return json.dumps({"type": "MultiPolygon", "coordinates": coordinates})

    def contains(self, lat_deg: NDArray[Any], lon_deg: NDArray[Any]) -> NDArray[np.bool_]:
        """Return whether points lie inside, (...) bool; points on an outline do not.

        Args:
            lat_deg: (...) WGS84 latitudes.
            lon_deg: (...) WGS84 longitudes.

        Raises:
            FieldError: If a polygon is invalid, or Shapely is missing.
        """
        return self.prepared()(lat_deg, lon_deg)

    def prepared(self) -> Callable[[NDArray[Any], NDArray[Any]], NDArray[np.bool_]]:
        """Return `contains` prepared for many calls with parts of the points.

        Raises:
            FieldError: As there.
        """
        try:
            import shapely
        except ModuleNotFoundError:
            raise FieldError(f"area: Shapely is missing; {pip_install('area')}") from None
        polygons = []
        for rings in self.polygons:
            shell, *holes = ([(lon, lat) for lat, lon in ring] for ring in rings)
            polygon = shapely.Polygon(shell, holes)
            if not polygon.is_valid:
                raise FieldError(
                    f"area: {shapely.is_valid_reason(polygon)} (lon lat) is not allowed; "
                    "polygons whose outlines do not cross or touch themselves"
                )
            shapely.prepare(polygon)
            polygons.append(polygon)

        def contains(lat_deg: NDArray[Any], lon_deg: NDArray[Any]) -> NDArray[np.bool_]:
            inside = np.zeros(lat_deg.shape, np.bool_)
            for polygon in polygons:
                inside |= shapely.contains_xy(polygon, lon_deg, lat_deg)
            return inside

        return contains


def cell_centre(grid_size: int, cell_size_m: float, col: Any, row: Any) -> tuple[Any, Any]:
    """Return the centre of a cell in metres from the grid's south-west corner, x east and y north.

    Args:
        grid_size: Cells along a side, G.
        cell_size_m: Side of a cell.
        col: Column; a fraction lies between cells. A number or an array.
        row: Row, 0 in the north; a number or an array of the same shape.
    """
    return (col + 0.5) * cell_size_m, (grid_size - 1 - row + 0.5) * cell_size_m


@lru_cache(maxsize=4)
def area_mask(
    area: Area | None, land: bool, grid_size: int, cell_size_m: float, origin: Origin
) -> NDArray[np.bool_] | None:
    """Return the searched cells of a grid, (G, G) bool [row, col], read-only; None for all.

    Args:
        area: Area of the searched cells; None for no limit.
        land: Whether to leave out cells on land.
        grid_size: G.
        cell_size_m: Side of a cell.
        origin: The grid's south-west corner.

    Raises:
        FieldError: If no cell is left, a polygon is invalid, or a package is missing.
    """
    if area is None and not land:
        return None
    mask = np.ones((grid_size, grid_size), np.bool_)
    if area is not None:
        contains = area.prepared()
        south, north, west, east = 90.0, -90.0, 180.0, -180.0
        for rows in _blocks(grid_size):
            lat, lon = _centres(grid_size, cell_size_m, origin, rows)
            mask[rows] = contains(lat, lon)
            south, north = min(south, lat.min()), max(north, lat.max())
            west, east = min(west, lon.min()), max(east, lon.max())
        if not mask.any():
            raise FieldError(
                f"area: {shown(area.polygons[0][0])} is not allowed; polygons with the centre of "
                f"a cell of the grid, {south:.5f} to {north:.5f} N and {west:.5f} to {east:.5f} E"
            )
    if land:
        is_land = _land_mask()
        for rows in _blocks(grid_size):
            mask[rows] &= ~is_land(*_centres(grid_size, cell_size_m, origin, rows))
        if not mask.any():
            where = "the grid" if area is None else "the area"
            raise FieldError(f"land: true is not allowed; {where} has no cell at sea")
    if mask.all():
        return None
    mask.flags.writeable = False
    return mask


def _blocks(grid_size: int) -> Iterator[slice]:
    """Yield the rows of a grid in blocks: positions of all cells can take gigabytes."""
    count = max(_BLOCK_CELLS // grid_size, 1)
    for first in range(0, grid_size, count):
        yield slice(first, min(first + count, grid_size))


def _centres(
    grid_size: int, cell_size_m: float, origin: Origin, rows: slice
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return latitude and longitude of the cell centres in some rows, (R, G) each."""
    from dsse_ros.scenario.geodesy import surface_to_geodetic

    row, col = np.meshgrid(np.arange(rows.start, rows.stop), np.arange(grid_size), indexing="ij")
    lat, lon = surface_to_geodetic(origin, *cell_centre(grid_size, cell_size_m, col, row))
    return lat, lon


def runs_of(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the cells of a mask (G, G) as runs along the rows, (R, 3): row, first, last column."""
    edges = np.diff(mask.astype(np.int8), axis=1, prepend=0, append=0)
    rows, first = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    return np.stack([rows, first, end - 1], axis=1).astype(np.int64)


def _land_mask() -> Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]:
    """Return a function (latitudes, longitudes) of whether points are on land; it takes 1.3 GB.

    The shoreline is GSHHG, full resolution (Wessel and Smith, "A global, self-consistent,
    hierarchical, high-resolution shoreline database", J. Geophys. Res. 101, 1996).

    Raises:
        FieldError: If the package is missing.
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


def _read(source: str | os.PathLike[str]) -> Any:
    """Return the content of a GeoJSON text, or of the file at this path.

    Raises:
        FieldError: If the file cannot be read, or is not JSON.
    """
    text = os.fspath(source)
    try:
        if not text.lstrip().startswith("{"):
            with Path(text).open("rb") as file:
                data = file.read(MAX_BYTES + 1)
            if len(data) > MAX_BYTES:
                raise ValueError(f"more than {MAX_BYTES} bytes are not allowed")
            text = data.decode()
        value = json.loads(text)
    except OSError as error:
        raise FieldError(f"area: {shown(source)}: {error.strerror}; {ALLOWED}") from None
    except (RecursionError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise FieldError(f"area: {shown(source)} is no GeoJSON: {reason}; {ALLOWED}") from None
    if not isinstance(value, Mapping):
        raise FieldError(f"area: {shown(source)} is no GeoJSON; {ALLOWED}")
    return value


def _polygons_of(geojson: Mapping[str, Any]) -> Iterator[Polygon]:
    """Yield the polygons of a GeoJSON object (RFC 7946), at least one.

    Raises:
        FieldError: If the object has anything else, or no polygon.
        KeyError, TypeError, ValueError: If the object is not GeoJSON.
    """
    kind = geojson["type"]
    match kind:
        case "FeatureCollection" | "GeometryCollection":
            parts = geojson["features" if kind == "FeatureCollection" else "geometries"]
            polygons = [polygon for part in parts for polygon in _polygons_of(part)]
        case "Feature":
            polygons = list(_polygons_of(geojson["geometry"]))
        case "Polygon" | "MultiPolygon":
            coordinates = geojson["coordinates"]
            polygons = [
                tuple(_ring([point[1::-1] for point in ring]) for ring in polygon)
                for polygon in ([coordinates] if kind == "Polygon" else coordinates)
            ]
        case _:
            raise FieldError(f"area: {shown(kind)} is not allowed; {ALLOWED}")
    if not all(polygons) or not polygons:
        raise ValueError
    yield from polygons


def _ring(points: Any) -> tuple[Point, ...]:
    """Return the points of an outline, without the repeated first point at the end.

    Raises:
        FieldError: If a point is not on the Earth, or there are fewer than three.
        TypeError: If the values are not points.
        ValueError: If the points are not pairs.
    """
    if not isinstance(points, Sequence) or isinstance(points, str):
        raise TypeError
    ring = [_point(point) for point in points]
    if len(ring) > 1 and ring[0] == ring[-1]:
        del ring[-1]
    if len(ring) < 3:
        raise FieldError(
            f"area: {shown(points)} is not allowed; an outline of three or more points"
        )
    return tuple(ring)


def _point(point: Any) -> Point:
    lat, lon = point
    for value, most in ((lat, 90), (lon, 180)):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and math.isfinite(value) and abs(value) <= most):
            raise FieldError(
                f"area: [{shown(lat)}, {shown(lon)}] is not allowed; latitude -90 to 90 and "
                "longitude -180 to 180"
            )
    return float(lat), float(lon)
