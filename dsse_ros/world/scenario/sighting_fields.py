# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The field `seen` of an incident: points, areas, rasters, voyages and bearings."""

from __future__ import annotations

import base64
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec, check_known, shown
from dsse_ros.world.drift.flow import digest_of, seconds, utc
from dsse_ros.world.drift.sightings import (
    Bearing,
    Rings,
    Seen,
    SeenArea,
    SeenRaster,
    Sighting,
    Voyage,
    WayPoint,
    rhumb_lines,
    turned,
)
from dsse_ros.world.scenario.area import Area
from dsse_ros.world.scenario.incident_flow import mapping
from dsse_ros.world.scenario.place_checks import LAT, LON, check_near, place_of
from dsse_ros.world.scenario.rasters import geographic_raster
from dsse_ros.world.scenario.sighting_files import sightings_of_file

_RADIUS = Spec("float", "", low=0, high=1e5, unit="m")
_RANGE = Spec("float", "", low=0, high=2e5, unit="m")
_ALWAYS = {
    "weight": (Spec("float", "", above=0, high=1e6), 1.0),
    "time_error": (Spec("float", "", low=0, high=1e4, unit="min"), 0.0),
}
_PLACE = {"lat": (LAT, None), "lon": (LON, None)}
_OF_KIND: dict[str, dict[str, tuple[Spec, Any]]] = {
    "area": _ALWAYS,
    "raster": _ALWAYS,
    "voyage": {
        **_ALWAYS,
        "radius": (_RADIUS, 0.0),
        "speed": (Spec("float", "", above=0, high=50, unit="m/s"), 0.0),
        "leg_weights": (Spec("floats", ""), ()),
    },
    "bearing": {
        **_ALWAYS, **_PLACE,
        "bearing": (Spec("float", "", low=0, high=360, unit="deg"), None),
        "bearing_error": (Spec("float", "", low=0, high=180, unit="deg"), None),
    },
    "point": {**_ALWAYS, **_PLACE, "radius": (_RADIUS, 0.0)},
}  # fmt: skip
"""Numbers of each kind of `seen`, with their defaults; None for those that must be given."""
_OTHERS = {
    "area": ("area", "time"),
    "raster": ("raster", "time"),
    "voyage": ("voyage", "departure"),
    "bearing": ("range", "time"),
    "point": ("time",),
}
_KINDS = ("area", "raster", "voyage", "bearing")
"""Each has a field of this name; a point has none of them."""
MOST_WAY_POINTS = 1000
_GRID = ("south", "north", "west", "east", "rows", "weights")


def read_seen(value: Any, folder: str = "") -> tuple[Seen, ...]:
    """Return where and when an object was seen.

    Args:
        value: The field `seen` as in YAML.
        folder: Folder to which paths of files are relative.

    Raises:
        FieldError: If a field is missing or not allowed.
    """
    if isinstance(value, str):
        value = sightings_of_file("incident.seen", os.path.join(folder, value))
    if isinstance(value, Mapping):
        value = [value]
    if not isinstance(value, list | tuple) or not value:
        raise FieldError(
            f"incident.seen must be a list of sightings, or a CSV or GeoJSON file of them, got "
            f"{shown(value)}"
        )
    return near_each_other(
        [_read(f"incident.seen[{number}]", one, folder) for number, one in enumerate(value)]
    )


def near_each_other(seen: Sequence[Seen]) -> tuple[Seen, ...]:
    """Return sightings with longitudes near each other, on both sides of the antimeridian too.

    Raises:
        FieldError: If a place of one is far from the first one.
    """
    first = seen[0].place
    near = tuple(one.turned(first[1]) for one in seen)
    for number, one in enumerate(near):
        for lats, lons in one.lines:
            for place in zip(lats.tolist(), lons.tolist(), strict=True):
                check_near(f"incident.seen[{number}]", place, first)
    return near


def names_files(value: Any) -> bool:
    """Return whether the field `seen` names files."""
    parts = value if isinstance(value, list | tuple) else [value]
    return isinstance(value, str) or any(
        isinstance(part, Mapping) and any(isinstance(part.get(kind), str) for kind in _KINDS)
        for part in parts
    )


def time_of(name: str, value: Any) -> float:
    """Return a time in whole seconds since 1970-01-01 UTC.

    Args:
        name: Name of what has it, for the error.
        value: The time in ISO 8601, in UTC without an offset.

    Raises:
        FieldError: If it is not a time.
    """
    try:
        return float(round(seconds(value)))
    except (AttributeError, OverflowError, TypeError, ValueError):
        raise FieldError(
            f"{name} must be a time like 2026-01-17T14:00Z, got {shown(value)}"
        ) from None


def _read(name: str, value: Any, folder: str) -> Seen:
    fields = _placed(name, mapping(name, value))
    kinds = [kind for kind in _KINDS if kind in fields]
    if len(kinds) > 1:
        raise FieldError(
            f"{name} must have at most one of {', '.join(_KINDS)}, got {', '.join(kinds)}"
        )
    kind = kinds[0] if kinds else "point"
    numbers = _OF_KIND[kind]
    check_known(name, fields, (*numbers, *_OTHERS[kind]))
    checked: dict[str, Any] = {}
    for part, (spec, default) in numbers.items():
        if fields.get(part) is not None:
            checked[part] = spec.check(f"{name}.{part}", fields[part])
        elif default is None:
            raise FieldError(f"{name}.{part} must be given")
        else:
            checked[part] = default
    if kind == "voyage":
        return _voyage(name, fields, checked)
    time_s, error_s = _times(name, fields, checked)
    law = time_s, checked["weight"], error_s
    match kind:
        case "area":
            return SeenArea(*law, _polygons(f"{name}.area", fields["area"], folder))
        case "raster":
            return _raster(f"{name}.raster", fields["raster"], folder, law)
        case "bearing":
            least, greatest = _range(f"{name}.range", fields.get("range"))
            return Bearing(
                *law, checked["lat"], checked["lon"], checked["bearing"], checked["bearing_error"],
                least, greatest,
            )  # fmt: skip
    return Sighting(checked["lat"], checked["lon"], time_s, checked["radius"], *law[1:])


def _placed(name: str, fields: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return fields with `lat` and `lon` in place of a `position`."""
    if "position" not in fields:
        return fields
    if fields.keys() & {"lat", "lon"}:
        raise FieldError(f"{name} must have a position, or lat and lon, got both")
    lat, lon = place_of(f"{name}.position", fields["position"])
    return {**{key: fields[key] for key in fields if key != "position"}, "lat": lat, "lon": lon}


def _times(name: str, fields: Mapping[str, Any], checked: Mapping[str, Any]) -> tuple[float, float]:
    """Return the time in the middle and the time before and after it, both in seconds."""
    value = fields.get("time")
    if value is None:
        raise FieldError(f"{name}.time must be given")
    error_s = float(round(checked["time_error"] * 60))
    if not isinstance(value, list | tuple):
        return time_of(f"{name}.time", value), error_s
    if len(value) != 2:
        raise FieldError(f"{name}.time must be a time or two, [first, last], got {shown(value)}")
    first, last = (time_of(f"{name}.time", part) for part in value)
    if not first <= last or error_s:
        raise FieldError(
            f"{name}.time must be [first, last] in this order and without a time_error, got "
            f"{utc(first)} and {utc(last)}"
        )
    return (first + last) / 2, (last - first) / 2


def _polygons(name: str, value: Any, folder: str) -> tuple[Rings, ...]:
    """Return the polygons of an area, which do not overlap."""
    if isinstance(value, str) and not value.lstrip().startswith("{"):
        value = os.path.join(folder, value)
    area = Area.read(value, name)
    if len(area.polygons) == 1:
        return area.polygons
    import shapely

    whole = shapely.union_all(shapely.get_parts(shapely.from_geojson(area.to_text())))
    return Area.read(shapely.to_geojson(whole), name).polygons


def _raster(name: str, value: Any, folder: str, law: tuple[float, float, float]) -> SeenRaster:
    """Return a raster from a file, or from the fields of `seen_dict`."""
    if isinstance(value, str):
        bounds, weights = geographic_raster(name, os.path.join(folder, value))
    else:
        fields = mapping(name, value)
        check_known(name, fields, _GRID)
        try:
            south, north, west, east = (float(fields[side]) for side in _GRID[:4])
            bounds = south, north, west, east
            weights = np.frombuffer(base64.b64decode(fields["weights"], validate=True), "<f8")
            weights = weights.astype(np.float64).reshape(fields["rows"], -1)
            fits = bool(np.isfinite([*bounds, weights.sum()]).all() and south < north)
            fits = fits and west < east and weights.min() >= 0 < weights.sum()
        except (KeyError, TypeError, ValueError):
            fits = False
        if not fits:
            raise FieldError(f"{name} must be a GeoTIFF file of probabilities, got {shown(value)}")
    return SeenRaster(*law, *bounds, weights, digest_of([weights]))


def _range(name: str, value: Any) -> tuple[float, float]:
    """Return least and greatest range of a bearing."""
    allowed = f"{name} must be [least, greatest], each {_RANGE.allowed()}"
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise FieldError(f"{allowed}, got {shown(value)}")
    least, greatest = (_RANGE.check(name, part) for part in value)
    if not least < greatest:
        raise FieldError(f"{allowed}, the least first, got {shown(value)}")
    return least, greatest


def _voyage(name: str, fields: Mapping[str, Any], checked: Mapping[str, Any]) -> Voyage:
    """Return a voyage whose way points have times, or whose vessel has a speed and a departure."""
    values = fields["voyage"]
    if not isinstance(values, list | tuple) or not 2 <= len(values) <= MOST_WAY_POINTS:
        raise FieldError(
            f"{name}.voyage must be a list of 2 to {MOST_WAY_POINTS} way points, got "
            f"{shown(values)}"
        )
    by_speed = "speed" in fields or "departure" in fields
    if by_speed and not ("speed" in fields and fields.get("departure") is not None):
        raise FieldError(f"{name} must have both speed and departure, or a time of each way point")
    own = {**_PLACE, "radius": (_RADIUS, checked["radius"])}
    points: list[WayPoint] = []
    for number, value in enumerate(values):
        part = f"{name}.voyage[{number}]"
        stated = _placed(part, mapping(part, value))
        check_known(part, stated, (*own, *(() if by_speed else ("time",))))
        for field, (_, default) in own.items():
            if stated.get(field, default) is None:
                raise FieldError(f"{part}.{field} must be given")
        lat, lon, radius = (
            spec.check(f"{part}.{field}", stated.get(field, default))
            for field, (spec, default) in own.items()
        )
        if not by_speed and stated.get("time") is None:
            raise FieldError(f"{part}.time must be given, or speed and departure of the voyage")
        time_s = 0.0 if by_speed else time_of(f"{part}.time", stated["time"])
        lon = turned(lon, points[0].lon_deg) if points else lon
        points.append(WayPoint(lat, lon, time_s, radius))
    if by_speed:
        start_s = time_of(f"{name}.departure", fields["departure"])
        places = np.array(points)
        length_m, _ = rhumb_lines(places[:-1], places[1:])
        after_s = np.cumsum([0.0, *length_m]) / checked["speed"]
        points = [
            point._replace(time_s=start_s + round(after))
            for point, after in zip(points, after_s.tolist(), strict=True)
        ]
    lasts_s = np.diff([point.time_s for point in points])
    for number in np.flatnonzero(lasts_s <= 0)[:1].tolist():
        raise FieldError(
            f"{name}.voyage[{number + 1}] must be later than the way point before it, got "
            f"{utc(points[number + 1].time_s)} after {utc(points[number].time_s)}"
        )
    weights = checked["leg_weights"] or tuple(lasts_s.tolist())
    if len(weights) != len(lasts_s) or min(weights) < 0 or not sum(weights) > 0:
        raise FieldError(
            f"{name}.leg_weights must be {len(lasts_s)} numbers >= 0, not all 0, got "
            f"{shown(list(weights))}"
        )
    error_s = float(round(checked["time_error"] * 60))
    return Voyage(points[0].time_s, checked["weight"], error_s, tuple(points), weights)


def seen_dict(seen: Seen) -> dict[str, Any]:
    """Return the fields of an equal sighting, without names of files, for JSON."""
    return _fields(seen, lambda weights: base64.b64encode(weights.astype("<f8").tobytes()).decode())


def seen_identity(seen: Seen) -> dict[str, Any]:
    """Return the fields of `seen_dict` with the digest of a raster."""
    return _fields(seen, lambda weights: digest_of([weights]))


def _fields(seen: Seen, of_weights: Callable[[NDArray[np.float64]], str]) -> dict[str, Any]:
    when: dict[str, Any] = {"time": utc(seen.time_s), "time_error": seen.time_error_s / 60}
    if seen.time_s % 1:
        # The middle of an interval of an odd number of seconds.
        when = {"time": [utc(seen.first_s), utc(seen.last_s)]}
    match seen:
        case Sighting():
            own: dict[str, Any] = {
                "lat": seen.lat_deg, "lon": seen.lon_deg, "time": "", "radius": seen.radius_m,
                "weight": seen.weight,
            }  # fmt: skip
        case SeenArea():
            own = {"area": Area(seen.turned(0.0).polygons).to_json()}
        case SeenRaster():
            bounds = seen.south_deg, seen.north_deg, seen.west_deg, seen.east_deg
            weights = len(seen.weights), of_weights(seen.weights)
            own = {"raster": dict(zip(_GRID, (*bounds, *weights), strict=True))}
        case Voyage():
            points = [
                {"lat": lat, "lon": lon, "time": utc(time_s), "radius": radius_m}
                for lat, lon, time_s, radius_m in seen.way_points
            ]
            own = {"voyage": points, "leg_weights": list(seen.leg_weights)}
            del when["time"]
        case Bearing():
            own = {
                "lat": seen.lat_deg, "lon": seen.lon_deg, "bearing": seen.bearing_deg,
                "bearing_error": seen.bearing_error_deg, "range": [seen.least_m, seen.greatest_m],
            }  # fmt: skip
    return {**own, "weight": seen.weight, **when}
