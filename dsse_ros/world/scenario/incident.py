# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An incident: what is missing, where it was seen, in which wind and current, and who searches.

A grid follows from it: see `incident_grid`.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec, check_known, shown, specs
from dsse_ros.base.json_reader import read_json
from dsse_ros.world.drift.flow import (
    SENSE,
    Flow,
    Kind,
    Span,
    Uncertainty,
    constant_flow,
    utc,
)
from dsse_ros.world.drift.leeway import Appearance, LeewayClass, PossibleObject, leeway_class
from dsse_ros.world.drift.shore import Box, Shore, box_around, shore_of
from dsse_ros.world.drift.sightings import Seen, Sighting
from dsse_ros.world.drift.track_files import at_times
from dsse_ros.world.drift.tracks import (
    Drift,
    DriftPositions,
    DriftSteps,
    DriftTracks,
    collected,
    steps_both_ways,
)
from dsse_ros.world.scenario.area import Area
from dsse_ros.world.scenario.incident_flow import (
    check_stokes_once,
    flow_dict,
    flow_identity,
    mapping,
    read_flow,
    stated_flow,
)
from dsse_ros.world.scenario.model_tracks import ModelTracks
from dsse_ros.world.scenario.place_checks import FARTHEST_M, check_near, place_of
from dsse_ros.world.scenario.sensor_fields import SensorFields
from dsse_ros.world.scenario.sighting_fields import (
    names_files,
    near_each_other,
    read_seen,
    seen_dict,
    seen_identity,
    time_of,
)
from dsse_ros.world.scenario.survival import Survival
from dsse_ros.world.scenario.while_alive import while_alive

LONGEST_SEARCH_S = 6 * 3600.0
"""Time after the start of a search for which wind and current are read from files."""
FASTEST_DRIFT_MPS = 2.0
"""Fastest drift for which wind, current and shore are read around the sightings."""
_OF_INCIDENT = (
    "object", "seen", "search_start", "base", "wind", "current", "waves", "jibing", "shore",
    "tracks", "truth", "survival", "grid_summary",
)  # fmt: skip
_OF_DRIFT = ("object", "wind", "current", "waves", "jibing")
_ALWAYS: tuple[Kind, ...] = ("wind", "current")
"""What every incident has; by default none moves."""
_OF_TRACKS = ("tracks", "search_start", "base", "grid_summary")


class GridSummary(NamedTuple):
    """Values that the grid of an incident determines.

    Attributes:
        begins_s: Time at which the drones are at the grid, in seconds since 1970-01-01 UTC.
        inside: Share of the particles that stay on the grid until the end of the search.
        stranded: Share of the particles that lie ashore by then.
    """

    begins_s: float
    inside: float
    stranded: float


@dataclass(frozen=True)
class Incident:
    """An object that is missing at sea.

    Attributes:
        objects: What it may be, by class of leeway; none with tracks of another model.
        sightings: Where and when it was seen, or may have come to grief; none with tracks of
            another model.
        search_start_s: Time at which the drones start, in seconds since 1970-01-01 UTC.
        base: Latitude and longitude from where they start; None for the grid itself.
        wind: The wind.
        wind_error: Its uncertainty.
        current: The current.
        current_error: Its uncertainty.
        jibing: See `drift.tracks.Drift`.
        waves: Stokes drift at the surface; None for none.
        land: Polygons of land to strand on; None for none.
        grid_summary: What the grid determines, once it is laid out; None before.
        model_tracks: Tracks of another model, which then replace sightings, wind, current and land.
        truth: The incident whose drift the persons follow, if it is a different one; it
            differs in the fields of `truth`.
        survival: How long people survive from a particle's own time; None if not considered.
    """

    ALLOWED: ClassVar[str] = "a mapping with object, seen and search_start"
    IN_MESSAGE: ClassVar[str] = "an object without files"
    IS_FILE: ClassVar[bool] = False

    objects: tuple[PossibleObject, ...]
    sightings: tuple[Seen, ...]
    search_start_s: float
    base: tuple[float, float] | None
    wind: Flow
    wind_error: Uncertainty
    current: Flow
    current_error: Uncertainty
    jibing: float = 0.04
    waves: Flow | None = None
    land: Area | None = None
    grid_summary: GridSummary | None = None
    model_tracks: ModelTracks | None = None
    truth: Incident | None = None
    survival: Survival | None = None

    @property
    def appearances(self) -> tuple[Appearance, ...]:
        """What sensors tell apart of the objects that there may be, or are in truth."""
        objects = (*self.objects, *(self.truth.objects if self.truth is not None else ()))
        return tuple(dict.fromkeys(one.appearance for one in objects)) or (Appearance(),)

    @property
    def followed(self) -> Incident:
        """The incident whose drift the persons follow."""
        return self if self.truth is None else replace(self.truth, grid_summary=self.grid_summary)

    @classmethod
    def read(cls, value: Any, folder: str = "") -> Incident:
        """Return the incident from its fields, or from JSON text of them.

        Args:
            value: The fields as in YAML, or `to_json` of an incident.
            folder: Folder to which paths of files are relative.

        Raises:
            FieldError: If a field is missing or not allowed, or a file does not fit.
        """
        if isinstance(value, cls):
            return value
        if isinstance(value, str):
            # Text that is not JSON is refused below.
            with contextlib.suppress(ValueError):
                value = read_json(value, "incident")
        try:
            return _incident(mapping("incident", value), folder)
        except FieldError:
            raise
        except ValueError as error:
            # Errors of `dsse_ros.world.drift`.
            raise FieldError(f"incident: {error}") from None

    @classmethod
    def may_be_sent(cls, value: Any) -> bool:
        """Return whether fields of an incident name no files."""
        drifts = [part for part in (value, value.get("truth")) if isinstance(part, Mapping)]
        files = [drift.get(name) for drift in drifts for name in ("shore", "tracks", "survival")]
        flows = [drift.get(kind) for drift in drifts for kind in SENSE]
        return (
            not any(isinstance(file, str) for file in files)
            and not any(isinstance(flow, Mapping) and "file" in flow for flow in flows)
            and not names_files(value.get("seen"))
        )

    def to_text(self) -> str:
        """Return `to_json` as text."""
        return json.dumps(self.to_json())

    def to_json(self) -> dict[str, Any]:
        """Return the fields of an equal incident, without names of files, for JSON."""
        return self._fields(flow_dict, ModelTracks.to_dict, seen_dict)

    @property
    def identity(self) -> dict[str, Any]:
        """The fields of `to_json` with digests of flows and tracks; equal for equal incidents."""
        return self._fields(flow_identity, lambda tracks: tracks.sha256, seen_identity)

    def _fields(
        self,
        of_flow: Callable[[Flow, Uncertainty], Any],
        of_tracks: Callable[[ModelTracks], Any],
        of_seen: Callable[[Seen], Any],
    ) -> dict[str, Any]:
        search = {
            "search_start": utc(self.search_start_s),
            "base": None if self.base is None else list(self.base),
            "grid_summary": None if self.grid_summary is None else self.grid_summary._asdict(),
        }
        if self.model_tracks is not None:
            return {"tracks": of_tracks(self.model_tracks), **search}
        return self._drift_fields(of_flow) | {
            **search,
            "seen": [of_seen(sighting) for sighting in self.sightings],
            "shore": None if self.land is None else self.land.to_json(),
            "truth": None if self.truth is None else self.truth._drift_fields(of_flow),
            **({} if self.survival is None else {"survival": self.survival.to_json()}),
        }  # fmt: skip

    def _drift_fields(self, of_flow: Callable[[Flow, Uncertainty], Any]) -> dict[str, Any]:
        """Return the fields that state how the object drifts, for JSON."""
        return {
            "object": _object_fields(self.objects),
            "wind": of_flow(self.wind, self.wind_error),
            "current": of_flow(self.current, self.current_error),
            "waves": None if self.waves is None else of_flow(self.waves, Uncertainty()),
            "jibing": self.jibing,
        }

    def informed(self, seen: Sequence[Mapping[str, Any]], flows: Mapping[Kind, Any]) -> Incident:
        """Return the incident with further sightings, and with other wind or current.

        Args:
            seen: The fields of each sighting, as in YAML.
            flows: Those of wind or current, without files.

        Raises:
            ValueError: If one is not allowed.
        """
        changed: dict[str, Any] = {}
        for kind, value in flows.items():
            changed[kind], changed[f"{kind}_error"] = stated_flow(kind, kind, value)
        if seen:
            changed["sightings"] = near_each_other((*self.sightings, *read_seen(seen)))
        return replace(self, **changed)

    def tracks(
        self, times_s: NDArray[np.float64], count: int, rng: np.random.Generator
    ) -> DriftTracks:
        """Return tracks of particles, see `drift_tracks`; given ones keep their number.

        Raises:
            FieldError: If wind, current or given tracks do not cover them, or a sighting is on
                land.
        """
        return collected(times_s, self.drift_steps(times_s, count, rng))

    def drift_steps(
        self, times_s: NDArray[np.float64], count: int, rng: np.random.Generator
    ) -> DriftSteps:
        """Return what `tracks` does, one time after the other.

        Raises:
            FieldError: If given tracks do not cover the times, or a sighting is on land; as
                positions are taken, if wind or current do not cover them.
        """
        if self.model_tracks is not None:
            return self._model_drift(self.model_tracks, times_s)
        return self._drifted(self.sightings, times_s, count, rng)

    def backtracked(
        self, found: Sighting, times_s: NDArray[np.float64], count: int, rng: np.random.Generator
    ) -> DriftTracks:
        """Return tracks back in time, from where an object was found to where it came from.

        Args:
            found: Where and when it was found.
            times_s: (T,) float64, decreasing.
            count: Number of particles.
            rng: Generator of the draws.

        Raises:
            FieldError: If wind or current do not cover them, only tracks are given, or it was found
                on land.
        """
        if self.model_tracks is not None:
            raise FieldError("incident: tracks of another model cannot be followed back")
        return collected(times_s, self._drifted([found], times_s, count, rng))

    def _drifted(
        self, seen: Sequence[Seen], times_s: NDArray[np.float64], count: int,
        rng: np.random.Generator,
    ) -> DriftSteps:  # fmt: skip
        shore = None if self.land is None else _shore_within(self.land, self._box())
        drift = Drift(
            self.objects, self.wind, self.current, self.wind_error, self.current_error,
            self.jibing, shore, self.waves,
        )  # fmt: skip
        with _field_errors():
            steps = steps_both_ways(drift, seen, times_s, count, rng)
        return steps._replace(positions=_taken(steps.positions))

    def _model_drift(self, tracks: ModelTracks, times_s: NDArray[np.float64]) -> DriftSteps:
        lats, lons = tracks.lats_deg.astype(np.float64), tracks.lons_deg.astype(np.float64)
        # Tracks of another model do not state when a particle strands.
        stranded = np.zeros(lats.shape, np.bool_)
        with _field_errors():
            _, *of_times = at_times(DriftTracks(tracks.times_s, lats, lons, stranded), times_s)[:4]
        return DriftSteps(map(DriftPositions, *of_times), None, None)

    def _box(self) -> Box:
        return _span(self.sightings, self.search_start_s).box


@contextlib.contextmanager
def _field_errors() -> Iterator[None]:
    """Raise errors of `dsse_ros.world.drift` as FieldError."""
    try:
        yield
    except ValueError as error:
        raise FieldError(f"incident: {error}") from None


def _taken(positions: Iterable[DriftPositions]) -> Iterator[DriftPositions]:
    """Yield these positions.

    Raises:
        FieldError: If wind or current are missing.
    """
    with _field_errors():
        yield from positions


def _incident(values: Mapping[str, Any], folder: str) -> Incident:
    """Return the incident with these fields."""
    check_known("the incident", values, _OF_INCIDENT)
    has_tracks = values.get("tracks") is not None
    for name in ("search_start",) if has_tracks else ("object", "seen", "search_start"):
        if values.get(name) is None:
            raise FieldError(f"incident.{name} must be given")
    start_s = time_of("incident.search_start", values["search_start"])
    base, grid_summary = _base(values.get("base")), _grid_summary(values.get("grid_summary"))
    if has_tracks:
        check_known("an incident with tracks", values, _OF_TRACKS)
        calm, still = (constant_flow(kind, 0.0, 0.0) for kind in _ALWAYS)
        tracks = ModelTracks.read(values["tracks"], folder)
        _check_base(base, (float(tracks.lats_deg[0, 0]), float(tracks.lons_deg[0, 0])))
        return Incident(
            (), (), start_s, base, calm, Uncertainty(), still, Uncertainty(),
            grid_summary=grid_summary, model_tracks=tracks,
        )  # fmt: skip
    sightings = read_seen(values["seen"], folder)
    _check_base(base, sightings[0].place)
    last = max(sighting.last_s for sighting in sightings)
    if start_s < last:
        raise FieldError(
            f"incident.search_start must not be before a sighting, got {utc(start_s)} and "
            f"{utc(last)}"
        )
    span = _span(sightings, start_s)
    drift_fields = _drift_fields("incident", {**dict.fromkeys(_ALWAYS), **values}, folder, span)
    land, survival = values.get("shore"), values.get("survival")
    incident = Incident(
        sightings=sightings, search_start_s=start_s, base=base,
        land=None if land is None else _land(land, folder), grid_summary=grid_summary,
        survival=None if survival is None else Survival.read(survival, folder), **drift_fields,
    )  # fmt: skip
    check_stokes_once("incident", incident.current, incident.waves)
    if values.get("truth") is None:
        return incident
    truth = mapping("incident.truth", values["truth"])
    check_known("incident.truth", truth, _OF_DRIFT)
    other = replace(
        incident, grid_summary=None, **_drift_fields("incident.truth", truth, folder, span)
    )
    check_stokes_once("incident.truth", other.current, other.waves)
    return replace(incident, truth=other)


def _drift_fields(name: str, values: Mapping[str, Any], folder: str, span: Span) -> dict[str, Any]:
    """Return the fields of an `Incident` that state how its object drifts, if they are stated.

    Args:
        name: Name of what states them, for messages.
        values: The fields as in YAML.
        folder: Folder to which paths of files are relative.
        span: Where and when the object may drift.
    """
    fields: dict[str, Any] = {}
    if "object" in values:
        fields["objects"] = _objects(name, values["object"])
    for kind in _ALWAYS:
        if kind in values:
            flow = read_flow(f"{name}.{kind}", kind, values[kind], folder, span)
            fields[kind], fields[f"{kind}_error"] = flow
    if values.get("waves") is not None:
        fields["waves"], stated = read_flow(f"{name}.waves", "waves", values["waves"], folder, span)
        if stated.std_mps:
            raise FieldError(f"{name}.waves must have no error, got {stated.std_mps:g}")
    if "jibing" in values:
        jibing = Spec("float", "", low=0, high=0.999)
        fields["jibing"] = jibing.check(f"{name}.jibing", values["jibing"])
    return fields


_OF_OBJECT = {
    "class": Spec("str", ""),
    "weight": Spec("float", "", above=0, high=1e6),
    **{name: specs(SensorFields)[name] for name in Appearance._fields},
}
MOST_OBJECTS = 16


def _objects(name: str, value: Any) -> tuple[PossibleObject, ...]:
    """Return what an incident may be about: a class of leeway, or several with their weights."""
    if not isinstance(value, list | tuple):
        return (PossibleObject(_leeway_class(f"{name}.object", value)),)
    if not 1 <= len(value) <= MOST_OBJECTS:
        raise FieldError(
            f"{name}.object must be a class of leeway, or 1 to {MOST_OBJECTS} of them with "
            f"weights, got {shown(value)}"
        )
    objects: list[PossibleObject] = []
    for number, one in enumerate(value):
        of_object = f"{name}.object[{number}]"
        fields = mapping(of_object, one)
        check_known(of_object, fields, _OF_OBJECT)
        category = _leeway_class(f"{of_object}.class", fields.get("class"))
        weight = _OF_OBJECT["weight"].check(f"{of_object}.weight", fields.get("weight", 1.0))
        if category in (known.category for known in objects):
            raise FieldError(f"{of_object}.class must not be stated twice, got {category.key!r}")
        seen = {
            field: _OF_OBJECT[field].check(f"{of_object}.{field}", fields[field])
            for field in Appearance._fields if fields.get(field) is not None
        }  # fmt: skip
        objects.append(PossibleObject(category, weight, Appearance(**seen)))
    return tuple(objects)


def _leeway_class(name: str, value: Any) -> LeewayClass:
    """Return the class of leeway with this name."""
    try:
        return leeway_class(Spec("str", "").check(name, value))
    except FieldError:
        raise
    except ValueError as error:
        raise FieldError(f"{name} {str(error).removeprefix('object ')}") from None


def _object_fields(objects: Sequence[PossibleObject]) -> Any:
    """Return the field `object` of these objects, for JSON."""
    if len(objects) == 1 and objects[0].appearance == Appearance():
        return objects[0].category.key
    return [
        {"class": category.key, "weight": weight}
        | {field: value for field, value in appearance._asdict().items() if value is not None}
        for category, weight, appearance in objects
    ]


def _grid_summary(value: Any) -> GridSummary | None:
    """Return the values that the grid of an incident determines.

    Raises:
        FieldError: If the value is not a valid `grid_summary`.
    """
    if value is None:
        return None
    values = mapping("incident.grid_summary", value)
    check_known("incident.grid_summary", values, GridSummary._fields)
    return GridSummary(
        **{
            name: Spec("float", "").check(f"incident.grid_summary.{name}", values.get(name))
            for name in GridSummary._fields
        }
    )


def _land(value: Any, folder: str) -> Area:
    """Return the land of an incident."""
    if isinstance(value, str) and not value.lstrip().startswith("{"):
        value = os.path.join(folder, value)
    return Area.read(value, "incident.shore")


def _base(value: Any) -> tuple[float, float] | None:
    """Return latitude and longitude of a base."""
    return None if value is None else place_of("incident.base", value)


def _check_base(base: tuple[float, float] | None, search: tuple[float, float]) -> None:
    """Check that a base, if there is one, is near the search."""
    if base is not None:
        check_near("incident.base", base, search)


def _span(sightings: tuple[Seen, ...], start_s: float) -> Span:
    """Return where and when a drift may need wind and current."""
    begin = min(sighting.first_s for sighting in sightings)
    end = start_s + LONGEST_SEARCH_S
    spread = min(FASTEST_DRIFT_MPS * (end - begin), FARTHEST_M)
    lines = [line for sighting in sightings for line in sighting.lines]
    lats, lons = (np.concatenate(axis) for axis in zip(*lines, strict=True))
    radius = max(sighting.radius_m for sighting in sightings)
    return Span(box_around(lats, lons, spread + 2 * radius), begin, end)


@while_alive
def _shore_within(land: Area, box: Box) -> Shore:
    """Return the shore of the land within a box, which may lie across the antimeridian."""
    south, north, west, east = np.array([*_boxes(land, box)]).T
    south_deg, north_deg = max(box.south_deg, south.min()), min(box.north_deg, north.max())
    west_deg, east_deg = max(box.west_deg, west.min()), min(box.east_deg, east.max())
    contains = land.prepared()

    def is_land(lat: NDArray[np.float64], lon: NDArray[np.float64]) -> NDArray[np.bool_]:
        return contains(lat, lon - 360.0 * np.round(lon / 360.0))

    # A box without land has a raster of one cell.
    return shore_of(
        is_land, Box(south_deg, max(north_deg, south_deg), west_deg, max(east_deg, west_deg))
    )


def _boxes(land: Area, box: Box) -> Iterator[Box]:
    """Yield the bounding boxes of polygons, with longitudes near those of a given box."""
    centre = (box.west_deg + box.east_deg) / 2
    for outline, *_ in land.polygons:
        lats, lons = np.array(outline).T
        west, east = float(lons.min()), float(lons.max())
        near = 360 * round((centre - (west + east) / 2) / 360)
        for turn in (near - 360, near, near + 360):
            # A polygon around a pole may be on both sides.
            if turn == near or (west + turn < box.east_deg and east + turn > box.west_deg):
                yield Box(float(lats.min()), float(lats.max()), west + turn, east + turn)
