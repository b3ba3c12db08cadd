# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sightings from CSV and GeoJSON, as the fields of `sighting_fields`.

A row of CSV is a point, and its columns are the fields. A feature of GeoJSON is a point, an area (a
polygon) or a voyage (a line), and its properties are the other fields; `times` has the times of the
points of a line.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping
from typing import Any

from dsse_ros.base.defects import reason_of
from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.json_reader import read_json

COLUMNS = ("lat", "lon", "position", "time", "radius", "weight", "time_error")
_NUMBERS = ("radius", "weight", "time_error")
_FIELDS = (
    "time", "radius", "weight", "time_error", "times", "departure", "speed", "leg_weights",
    "bearing", "bearing_error", "range",
)  # fmt: skip
MOST_BYTES = 10_000_000


def sightings_of_file(name: str, path: str) -> list[dict[str, Any]]:
    """Return the fields of each sighting in a file.

    Args:
        name: Name of the field that has it.
        path: The file, `.csv`, `.geojson` or `.json`.

    Raises:
        FieldError: If it cannot be read or has something else.
    """
    readers = {".csv": _of_csv, ".geojson": _of_geojson, ".json": _of_geojson}
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in readers:
        raise FieldError(
            f"{name} must be a list of sightings, or a file of them, {', '.join(readers)}, got "
            f"{shown(path)}"
        )
    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise FieldError(f"{name} must have at most {MOST_BYTES} bytes, got {shown(path)}")
        # Some programs put a byte order mark first.
        return list(readers[suffix](name, data.decode("utf-8-sig")))
    except OSError as error:
        raise FieldError(f"{name}: {path!r}: {error.strerror}") from None
    except FieldError:
        raise
    except (AttributeError, LookupError, TypeError, ValueError, csv.Error) as error:
        raise FieldError(
            f"{name} must be a {suffix} file of sightings, got {path!r}: {reason_of(error)}"
        ) from None


def _of_csv(name: str, text: str) -> Iterator[dict[str, Any]]:
    rows = csv.DictReader(text.splitlines(), skipinitialspace=True)
    unknown = [column for column in rows.fieldnames or [""] if column not in COLUMNS]
    if unknown:
        raise FieldError(
            f"{name} must have a row of the columns {', '.join(COLUMNS)} first, got "
            f"{shown(unknown[0])}"
        )
    for row in rows:
        # Cells beyond the last column have no name.
        if None in row:
            raise FieldError(f"{name}: line {rows.line_num} must have one cell a column")
        stated = {column: cell.strip() for column, cell in row.items() if cell and cell.strip()}
        if stated:
            yield {
                column: _number(cell) if column in _NUMBERS else cell
                for column, cell in stated.items()
            }


def _number(cell: str) -> float | str:
    """Return a number; other text is refused where its field is known."""
    try:
        return float(cell)
    except ValueError:
        return cell


def _of_geojson(name: str, text: str) -> Iterator[dict[str, Any]]:
    content = read_json(text, name)
    is_one = content["type"] == "Feature"
    for number, feature in enumerate([content] if is_one else content["features"]):
        where = f"{name}: feature {number + 1}"
        about: Mapping[str, Any] = feature.get("properties") or {}
        fields = {key: about[key] for key in _FIELDS if about.get(key) is not None}
        geometry: Mapping[str, Any] = feature["geometry"] or {}
        places: Any = geometry.get("coordinates")
        match geometry.get("type"):
            case "Point":
                lon, lat, *_ = places
                yield {"lat": lat, "lon": lon, **fields}
            case "Polygon" | "MultiPolygon":
                yield {"area": geometry, **fields}
            case "LineString":
                yield {"voyage": _way_points(where, places, fields.pop("times", None)), **fields}
            case other:
                raise FieldError(
                    f"{where} must be a Point, a Polygon, a MultiPolygon or a LineString, got "
                    f"{shown(other)}"
                )


def _way_points(where: str, places: Any, times: Any) -> list[dict[str, Any]]:
    points = [{"lat": lat, "lon": lon} for lon, lat, *_ in places]
    if times is None:
        return points
    if not isinstance(times, list) or len(times) != len(points):
        raise FieldError(f"{where} must have {len(points)} times, got {shown(times)}")
    return [{**point, "time": time} for point, time in zip(points, times, strict=True)]
