# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Polygons among the features that people have: GeoJSON, KML, GPX, shapefiles, GeoPackages."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from dsse_ros.base.defects import reason_of
from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import FieldError

BY_GDAL = (".kml", ".kmz", ".gpx", ".shp", ".gpkg")
"""Suffixes of files that GDAL reads (extra `gis`)."""
ROUNDING_DEG = 1e-9
"""Degrees by which an outline may exceed a pole or the antimeridian."""
_POLYGONS = ("Polygon", "MultiPolygon")
_OTHERS = ("Point", "MultiPoint", "LineString", "MultiLineString")
_NAMES = ("title", "name", "Name", "id")


class Outline(NamedTuple):
    """A polygon or several of a feature.

    Attributes:
        geometry: GeoJSON, with positions of two numbers.
        feature: Number and name of its feature, "" without features.
    """

    geometry: dict[str, Any]
    feature: str


def outlines_of(content: Mapping[str, Any]) -> tuple[list[Outline], int, list[str]]:
    """Return the polygons of GeoJSON, the number of its other geometries, and features without one.

    Raises:
        LookupError, TypeError, ValueError: If the content is not GeoJSON.
    """
    found, others, without = [], 0, []
    for geometry, feature in _geometries(content, ""):
        if feature and not _has_places(geometry):
            without.append(feature)
        elif geometry["type"] in _OTHERS:
            others += 1
        elif geometry["type"] in _POLYGONS:
            positions = _positions(geometry["coordinates"])
            found.append(Outline({"type": geometry["type"], "coordinates": positions}, feature))
        else:
            raise ValueError
    return found, others, without


def _has_places(geometry: Any) -> bool:
    """Return whether a geometry is there; programs write null, {} or no coordinates for none."""
    return bool(geometry) and geometry.get("coordinates", True) not in (None, [])


def _geometries(content: Any, feature: str) -> Iterator[tuple[Any, str]]:
    """Yield the geometries of GeoJSON with their features."""
    match content["type"]:
        case "FeatureCollection":
            for number, part in enumerate(content["features"], start=1):
                about = part.get("properties") or {}
                name = next((str(about[key])[:40] for key in _NAMES if about.get(key)), "")
                yield from _geometries(part, f"feature {number}" + (f" ({name})" if name else ""))
        case "Feature":
            geometry = content.get("geometry")
            if not geometry:
                yield None, feature or "the feature"
            else:
                yield from _geometries(geometry, feature)
        case "GeometryCollection":
            for part in content["geometries"]:
                yield from _geometries(part, feature)
        case _:
            yield content, feature


def _positions(values: Any) -> Any:
    """Return nested positions with longitude and latitude alone, rounded to the Earth."""
    if values and all(isinstance(value, list | tuple) for value in values):
        return [_positions(value) for value in values]
    lon, lat = values[:2]
    return [_rounded(lon, 180.0), _rounded(lat, 90.0)]


def _rounded(value: Any, end: float) -> Any:
    near = isinstance(value, int | float) and 0 < abs(value) - end <= ROUNDING_DEG
    return (end if value > 0 else -end) if near else value


def read_by_gdal(path: str, name: str) -> dict[str, Any]:
    """Return the features of a file as GeoJSON in WGS84; closed lines and tracks are polygons.

    Args:
        path: A file.
        name: Name of the field that has it.

    Raises:
        FieldError: If it cannot be read, or a package is missing.
        OSError: If there is no such file.
    """
    os.stat(path)
    try:
        import pyogrio
        import shapely
        from pyogrio.errors import DataLayerError, DataSourceError
    except ModuleNotFoundError as error:
        raise FieldError(f"{name}: {error.name} is missing; {pip_install('gis')}") from None
    features: list[dict[str, Any]] = []
    try:
        for layer, kind in pyogrio.list_layers(path):
            # Those of GPX have the points of the lines of other layers.
            if kind is None or layer in ("route_points", "track_points"):
                continue
            about, _, geometries, _ = pyogrio.raw.read(path, layer=layer, columns=[])
            for geometry in shapely.force_2d(shapely.from_wkb(geometries)):
                shape = None if geometry is None else _in_wgs84(geometry, about["crs"], name)
                shape = None if shape is None else _with_closed_lines(shape)
                content = None if shape is None else json.loads(shapely.to_geojson(shape))
                features.append({"type": "Feature", "properties": {}, "geometry": content})
    except (DataLayerError, DataSourceError, ValueError, shapely.GEOSException) as error:
        reason = reason_of(error)
        raise FieldError(f"{name} must be a file that GDAL reads, got {path!r}: {reason}") from None
    return {"type": "FeatureCollection", "features": features}


def _with_closed_lines(geometry: Any) -> Any:
    """Return a geometry in which lines that close, alone or one after the other, are polygons."""
    import shapely

    if geometry.geom_type in ("LineString", "MultiLineString"):
        parts = list(getattr(shapely.line_merge(geometry), "geoms", [shapely.line_merge(geometry)]))
    elif geometry.geom_type == "GeometryCollection":
        lines = [part for part in geometry.geoms if part.geom_type == "LineString"]
        others = [part for part in geometry.geoms if part.geom_type != "LineString"]
        parts = [_with_closed_lines(part) for part in others]
        parts += [_with_closed_lines(shapely.MultiLineString(lines))] if lines else []
    else:
        return geometry
    closed = [
        shapely.Polygon(part)
        if part.geom_type == "LineString" and part.is_closed and len(part.coords) > 3
        else part
        for part in parts
    ]
    return closed[0] if len(closed) == 1 else shapely.GeometryCollection(closed)


def _in_wgs84(geometry: Any, crs: Any, name: str) -> Any:
    """Return a geometry in WGS84.

    Raises:
        FieldError: If pyproj is missing for another reference system.
    """
    if crs in (None, "EPSG:4326", "OGC:CRS84"):
        return geometry
    import numpy as np
    import shapely

    try:
        from pyproj import Transformer
    except ModuleNotFoundError:
        raise FieldError(
            f"{name} must be in WGS84, got {crs}, or pyproj is missing; {pip_install('drift')}"
        ) from None
    to_wgs84 = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    return shapely.transform(
        geometry, lambda xy: np.stack(to_wgs84.transform(xy[:, 0], xy[:, 1]), axis=-1)
    )
