# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The scenario of a search: area, camera, sea, persons, drones and limits."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import CustomField, FieldError, Spec, check_all, check_known, field, specs
from dsse_ros.base.grid_shape import GridExtent, GridShape
from dsse_ros.world.drift.leeway import Appearance
from dsse_ros.world.scenario.area import Area, area_mask, grid_around
from dsse_ros.world.scenario.battery_fields import FULL
from dsse_ros.world.scenario.cell_checks import (
    check_cell,
    check_multipliers,
    check_positions,
    check_scatter,
)
from dsse_ros.world.scenario.current import mean_drift, resolve_vector
from dsse_ros.world.scenario.fault_fields import FaultFields
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.incident_fields import IncidentFields
from dsse_ros.world.scenario.limits import CELL_SIZE_M, DEFAULT_ORIGIN_DEG, check_pre_search
from dsse_ros.world.scenario.probability_matrix import ProbabilityMatrix
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario_array import ScenarioArray, check_use
from dsse_ros.world.scenario.searcher_fields import SearcherFields
from dsse_ros.world.scenario.sensor_fields import SensorFields
from dsse_ros.world.scenario.target_fields import EnsembleFields, MarkovChainFields
from dsse_ros.world.scenario.truth_fields import TruthFields
from dsse_ros.world.scenario.yaml_file import read_yaml
from dsse_ros.world.sensors.camera import PAPER_FIELD_OF_VIEW_DEG, footprint_m
from dsse_ros.world.targets.registry import MOTIONS, drifts_with_incident

SYNONYMS = {"dispersion_start": "sigma"}
"""Other names of fields, from DSSE 1.1.9."""

OF_INCIDENT = (
    "origin_lat", "origin_lon", "vector", "current_speed", "current_toward",
    "person_initial_position", "sigma", "sigma_x", "sigma_y", "dispersion_inc",
    "pre_search_minutes",
)  # fmt: skip
"""Fields that an incident determines or has no use for."""


@dataclass(frozen=True, kw_only=True)
class Scenario(
    IncidentFields, MarkovChainFields, EnsembleFields, SensorFields, SearcherFields, FaultFields,
    TruthFields,
):  # fmt: skip
    """The setting of a search; None means "derive it" or "the profile's default".

    `resolve` fills in every such field.

    Raises:
        FieldError: If a value is not allowed.
    """

    name: str = field("str", "Name of the place, for users.", "")
    origin_lat: float | None = field(
        "float", "WGS84 latitude of the south-west corner; by default -24.04.", None,
        low=-90, high=90, unit="deg",
    )  # fmt: skip
    origin_lon: float | None = field(
        "float", "WGS84 longitude of the south-west corner; by default -46.17.", None,
        low=-180, high=180, unit="deg",
    )  # fmt: skip
    origin_alt: float = field(
        "float", "Ellipsoidal height of the sea at the origin.", 0.0, low=-500, high=9000, unit="m"
    )
    area: Area | None = field(
        "custom",
        "Polygons to search, by the centres of cells: a GeoJSON file or, in YAML and Python, a "
        "list of [lat, lon]. Empty for the whole grid.",
        None,
        reader=Area,
    )
    land: bool = field(
        "bool",
        "Whether to exclude cells on land (GSHHG shoreline, 6 s, 1.3 GB).",
        False,
    )
    probability_matrix: ProbabilityMatrix | None = field(
        "custom",
        "Probability to cover, or the prior of a drifting_map: a .npy, CSV or GeoTIFF file or, in "
        "Python, an array. Empty, for coverage: the map after pre_search_minutes.",
        None,
        reader=ProbabilityMatrix,
    )
    grid_size: GridShape | tuple[int, int] | int | None = field(
        "grid", "Columns and rows of the grid, or one number for a square.",
        None, low=1, high=10000, unit="cells",
    )  # fmt: skip
    zone_size: GridExtent | tuple[float, float] | float | None = field(
        "extent",
        "Width and height of the grid, or one number for a square, instead of grid_size; rounded "
        "up to whole cells.",
        None, above=0, high=1e7, unit="m",
    )  # fmt: skip
    fit_grid: bool = field(
        "bool",
        "Whether the grid is as wide and high as the particles of an incident need, or else the "
        "area, and no square.",
        False,
    )
    cell_size: float | None = field(
        "float", "Side of a cell; by default the camera's footprint.", None,
        low=CELL_SIZE_M[0], high=CELL_SIZE_M[1], unit="m",
    )  # fmt: skip
    field_of_view: float = field(
        "float", "Full angle of the camera across a cell.", PAPER_FIELD_OF_VIEW_DEG,
        above=0, high=175, unit="deg",
    )  # fmt: skip
    num_drones: int | None = field(
        "int", "By default one per start cell, else 1.", None,
        low=1, high=10**8,
    )  # fmt: skip
    drones_positions: tuple[tuple[int, int], ...] | None = field(
        "cells", "Start cells (col, row); by default row by row from the north-west corner.", None
    )
    vector: tuple[float, float] | None = field(
        "vector", "Drift of the datum, x to the east, y to the south; see drift_by_speed.",
        None, low=-1e6, high=1e6, unit="cells per step",
    )  # fmt: skip
    current_speed: float | None = field(
        "float", "Speed of the current, instead of vector.", None, low=0, high=100, unit="m/s"
    )
    current_toward: float | None = field(
        "float", "Direction the current flows to, clockwise from north.", None,
        low=-360, high=360, unit="deg",
    )  # fmt: skip
    person_initial_position: tuple[int, int] | None = field(
        "cell", "Last known cell (col, row).", None
    )
    person_amount: int = field("int", "Number of persons.", 1, low=1, high=10000)
    sigma: float | None = field("float", "Spread of the probability.", None, low=1e-6, unit="cells")
    sigma_x: float | None = field(
        "float", "Spread along x, if different from sigma.", None, low=1e-6, unit="cells"
    )
    sigma_y: float | None = field(
        "float", "Spread along y, if different from sigma.", None, low=1e-6, unit="cells"
    )
    dispersion_inc: float | None = field(
        "float", "Growth of the spread per step.", None, low=0, unit="cells"
    )
    probability_of_detection: float | None = field(
        "float", "Sensors own_cell and flown_over: POD; by default 1, in a live search 0.5.", None,
        low=0, high=1,
    )  # fmt: skip
    person_pod_multipliers: tuple[float, ...] | None = field(
        "floats", "Factor on the POD, one per person; by default 1.", None,
        low=0,
    )  # fmt: skip
    pre_search_minutes: float = field(
        "float", "Time of drift before the drones arrive.", 0.0, low=0, high=1e6, unit="min"
    )
    timestep_limit: int | None = field(
        "int", "Maximum number of steps.", None, low=1, high=10**9, unit="steps"
    )

    def __post_init__(self) -> None:
        check_all(self, Scenario)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Scenario:
        """Return the scenario with these fields.

        Raises:
            FieldError: If a key is unknown or a value is not allowed.
        """
        if not isinstance(values, Mapping):
            raise FieldError("the scenario must be a mapping of field names to values")
        return cls(**_renamed(values))

    @classmethod
    def from_yaml(cls, path: str | os.PathLike[str]) -> Scenario:
        """Return the scenario from a YAML file of field names and values.

        Paths in the file are relative to its folder.

        Raises:
            FieldError: If the file cannot be read, is not YAML, or does not fit.
        """
        try:
            values = read_yaml(path)
            for name in FILES if isinstance(values, dict) else ():
                if values.get(name) and isinstance(values[name], str):
                    values[name] = os.path.join(os.path.dirname(path), values[name])
            if isinstance(values, dict) and values.get("incident") is not None:
                values["incident"] = Incident.read(values["incident"], os.path.dirname(path))
            return cls.from_dict({} if values is None else values)
        except FieldError as error:
            raise FieldError(f"scenario {os.fspath(path)!r}: {error}") from None

    @classmethod
    def read(cls, source: ScenarioSource) -> Scenario:
        """Return a scenario from any source: a scenario, a mapping, a YAML path or None.

        Raises:
            FieldError: If the source is none of these, or its fields are not allowed.
        """
        if source is None:
            return cls()
        if isinstance(source, Scenario):
            return source
        if isinstance(source, str | os.PathLike):
            return cls.from_yaml(source)
        return cls.from_dict(source)

    def override(self, **values: Any) -> Scenario:
        """Return the scenario with these fields replaced; a None leaves a field as it is.

        An override of grid_size, vector or num_drones also replaces the alternative field
        (zone_size, current_speed and current_toward, drones_positions), and vice versa.

        Raises:
            FieldError: If a key is unknown or a value is not allowed.
        """
        stated = _renamed(values, {k: v for k, v in values.items() if v is not None})
        if "sigma" in stated:
            stated = {"sigma_x": None, "sigma_y": None, **stated}
        for ways in _ALTERNATIVES:
            for way, other in (ways, ways[::-1]):
                if any(name in stated for name in way):
                    stated = {**dict.fromkeys(set(other) - set(stated), None), **stated}
        return dataclasses.replace(self, **stated)

    def resolve(self, rules: Rules) -> ResolvedScenario:
        """Return the scenario with nothing left to derive.

        Raises:
            FieldError: If fields contradict each other or do not fit the grid.
        """
        arrays, on_grid = self._arrays(rules), _on_own_grid(self, rules)
        if on_grid is not self:
            return dataclasses.replace(on_grid.resolve(rules), stated=self)
        grid, cell = self.grid_of(rules)
        lat = DEFAULT_ORIGIN_DEG[0] if self.origin_lat is None else self.origin_lat
        lon = DEFAULT_ORIGIN_DEG[1] if self.origin_lon is None else self.origin_lon
        origin = (lat, lon, self.origin_alt)
        on_cells = {name: array.on_grid(grid, cell, origin) for name, array in arrays.items()}
        mask = area_mask(self.area, self.land, grid, cell, origin)
        positions = self._resolve_positions(grid, mask, rules.collisions)
        count, has_battery = len(positions), self.battery_move > 0
        searchers = self.resolved_searchers(count, rules, has_battery=has_battery)
        fastest, slowest = max(self.speeds), min(self.speeds)
        sigma = self.sigma if self.sigma is not None else rules.sigma
        growth = rules.dispersion_inc if self.dispersion_inc is None else self.dispersion_inc
        person = self.person_initial_position or rules.person_initial_position
        person = person or (grid.columns // 2, grid.rows // 2)
        check_cell("person_initial_position", person, grid, mask)
        speed, toward = self.current_speed, self.current_toward
        vector = resolve_vector(rules, self.vector, speed, toward, fastest)
        check_multipliers(self.person_pod_multipliers, self.person_amount)
        if rules.person_scatter and rules.person_motion in MOTIONS:
            check_scatter(self.person_amount, person, grid, rules.person_scatter, mask)
        derived = {
            "origin_lat": lat,
            "origin_lon": lon,
            "grid_size": grid,
            "zone_size": None,
            "cell_size": cell,
            "num_drones": count,
            "drones_positions": positions,
            "searchers": searchers,
            "sensor": self.sensor or rules.sensor,
            "vector": vector,
            "drift": mean_drift(rules, vector, fastest),
            "current_speed": None,
            "current_toward": None,
            "person_initial_position": person,
            "probability_of_detection": self.pod_of(self.probability_of_detection),
            "person_pod_multipliers": self.person_pod_multipliers or (1.0,) * self.person_amount,
            "sigma": sigma,
            "sigma_x": self.sigma_x or sigma,
            "sigma_y": self.sigma_y or sigma,
            "dispersion_inc": growth,
            "timestep_limit": self.timestep_limit or rules.timestep_limit,
            **on_cells,
            **self.resolved_faults(count, slowest),
        }
        stated = {name: getattr(self, name) for name in SPECS}
        resolved = ResolvedScenario(**{**stated, **derived, "stated": self})
        check_pre_search(
            self.pre_search_minutes, resolved.pre_search_steps, resolved.step_duration_s
        )
        return resolved

    def grid_of(self, rules: Rules) -> tuple[GridShape, float]:
        """Return the shape of the grid, and the side of a cell in metres.

        Raises:
            FieldError: If fields contradict each other, or the grid is impossible.
        """
        on_grid, cell = _on_own_grid(self, rules), self.cell_m
        return on_grid.grid_of_cells(rules, cell), cell

    @property
    def begins_s(self) -> float | None:
        """When the search begins, s since 1970-01-01 UTC; None but of an incident with its grid."""
        if self.incident is None or self.incident.grid_summary is None:
            return None
        return self.incident.grid_summary.begins_s

    @property
    def cell_m(self) -> float:
        """Side of a cell in metres.

        Raises:
            FieldError: If altitude and field of view give none that is allowed.
        """
        cell = self.cell_size
        if cell is None:
            cell = footprint_m(self.altitude, self.field_of_view)
            derived_from = "cell_size (of altitude and field_of_view)"
            cell = SPECS["cell_size"].check(derived_from, round(cell, 3))
        return cell

    def grid_of_cells(self, rules: Rules, cell: float) -> GridShape:
        """Return the shape of the grid, without regard to an incident.

        Args:
            rules: The rules of the search.
            cell: Side of a cell in metres.

        Raises:
            FieldError: If fields contradict each other.
        """
        arrays, name = self._arrays(rules), "grid_size"
        zone: GridExtent | None = SPECS["zone_size"].check("zone_size", self.zone_size)
        if zone is None:
            shape = self.grid_size or next(
                (array.grid for array in arrays.values()), rules.grid_size
            )
        else:
            # The tolerance keeps rounding from adding a cell to a zone of exactly n cells.
            shape = GridShape(*(max(math.ceil(m / cell - 1e-9), 1) for m in zone))
            if self.grid_size not in (None, shape):
                raise FieldError("grid_size and zone_size must agree; give only one")
            name = "grid_size (of zone_size)"
        grid: GridShape = SPECS["grid_size"].check(name, shape)
        if rules.leave_policy == "fly_on" and grid.columns != grid.rows:
            raise FieldError(
                f"{name} must be a square with rules {rules.profile}, got {list(grid)}"
            )
        return grid

    def _arrays(self, rules: Rules) -> dict[str, ScenarioArray]:
        """Return the given arrays by field.

        Raises:
            FieldError: If the rules have no use for one.
        """
        values = {name: getattr(self, name) for name in CUSTOM_FIELDS}
        arrays = {name: value for name, value in values.items() if isinstance(value, ScenarioArray)}
        for name in arrays:
            check_use(name, rules)
        return arrays

    def _resolve_positions(
        self, grid: GridShape, mask: NDArray[np.bool_] | None, apart: bool
    ) -> tuple[tuple[int, int], ...]:
        count = self.num_drones
        if self.drones_positions is None:
            count = 1 if count is None else count
            most = grid.cells if mask is None else int(mask.sum())
            if count > most:
                place = f"a {grid} grid" if mask is None else "the area"
                raise FieldError(
                    f"num_drones must be at most {most}, one per cell of {place}, got {count}"
                )
            cells = range(count) if mask is None else np.flatnonzero(mask)[:count].tolist()
            return tuple((i % grid.columns, i // grid.columns) for i in cells)
        check_positions(self.drones_positions, grid, count, mask, apart)
        return self.drones_positions


@dataclass(frozen=True, kw_only=True)
class ResolvedScenario(Scenario):
    """A scenario with nothing left to derive.

    Attributes:
        stated: The scenario that it was derived from.
        drift: Mean drift of the datum per step, to the east and to the south, in cells, under the
            rules that the scenario was resolved with.
    """

    origin_lat: float
    origin_lon: float
    grid_size: GridShape
    cell_size: float
    num_drones: int
    drones_positions: tuple[tuple[int, int], ...]
    vector: tuple[float, float]
    person_initial_position: tuple[int, int]
    sigma: float
    sigma_x: float
    sigma_y: float
    dispersion_inc: float
    probability_of_detection: float
    person_pod_multipliers: tuple[float, ...]
    sensor: str
    timestep_limit: int
    battery_search: float
    battery_hover: float
    battery_return: float
    stated: Scenario = dataclasses.field(repr=False, compare=False)
    drift: tuple[float, float] = dataclasses.field(repr=False, compare=False)

    def override(self, **values: Any) -> Scenario:
        """Return the scenario as it was stated, with these fields replaced.

        Derived fields are derived again: the cell size from a new altitude, the drift in cells from
        a new drone speed. If no field is replaced, derived fields keep their values.

        Raises:
            FieldError: If a key is unknown or a value is not allowed.
        """
        changed = self.stated.override(**values)
        return self if changed == self.stated else changed

    @property
    def area_mask(self) -> NDArray[np.bool_] | None:
        """The searched cells, (R, C) bool [row, col], read-only; None for all."""
        origin = (self.origin_lat, self.origin_lon, self.origin_alt)
        return area_mask(self.area, self.land, self.grid_size, self.cell_size, origin)

    @property
    def followed(self) -> ResolvedScenario:
        """The scenario whose drift the persons follow; beliefs follow this one's."""
        if self.incident is None or self.incident.truth is None:
            return self
        return dataclasses.replace(self, incident=self.incident.followed)

    @property
    def seen_as(self) -> tuple[ResolvedScenario, ...]:
        """The scenario as sensors see it, once for each of `Incident.appearances`."""
        if self.incident is None or self.incident.appearances == (Appearance(),):
            return (self,)
        return tuple(
            dataclasses.replace(
                self, **{name: v for name, v in appearance._asdict().items() if v is not None}
            )
            for appearance in self.incident.appearances
        )

    def incident_positions(
        self, times_s: NDArray[np.float64], rng: np.random.Generator, count: int
    ) -> tuple[
        Iterator[NDArray[np.float64]], NDArray[np.int8] | None,
        Callable[[], NDArray[np.float64]] | None,
    ]:  # fmt: skip
        """Return positions, objects and `dies_s` of particles, see `ensemble.TracksBySteps`.

        Args:
            times_s: (T,) float64, increasing, seconds since the search began; also before it.
            rng: Generator of the draws.
            count: M; given tracks keep their number.

        Raises:
            FieldError: See `Incident.drift_steps`.
        """
        from dsse_ros.world.scenario.incident_grid import positions

        assert self.incident is not None
        origin = (self.origin_lat, self.origin_lon, self.origin_alt)
        height_m = self.grid_size.rows * self.cell_size
        return positions(self.incident, origin, height_m, times_s, rng, count)

    @property
    def step_duration_s(self) -> float:
        """Time that the fastest drone needs for a cell (13 s for the paper's), in seconds."""
        return self.cell_size / max(self.speeds)

    @property
    def other_ways(self) -> dict[str, Any]:
        """The fields equivalent to grid_size and vector, with their derived values."""
        east, south = self.drift
        return {
            "zone_size": self.grid_size.extent(self.cell_size),
            "current_speed": math.hypot(east, south) * max(self.speeds),
            "current_toward": math.degrees(math.atan2(east, -south)) % 360.0,
        }

    @property
    def pre_search_steps(self) -> int:
        """Steps of drift before the drones arrive."""
        return round(self.pre_search_minutes * 60 / self.step_duration_s)


_ALTERNATIVES = (
    (("grid_size",), ("zone_size",)),
    (("vector",), ("current_speed", "current_toward")),
    (("num_drones",), ("drones_positions",)),
)

SPECS: dict[str, Spec] = specs(Scenario)
"""The `Spec` of each field of a scenario."""

CUSTOM_FIELDS: dict[str, type[CustomField]] = {
    name: spec.reader for name, spec in SPECS.items() if spec.reader is not None
}
"""The fields whose values have classes of their own."""

FILES = tuple(name for name, reader in CUSTOM_FIELDS.items() if reader.IS_FILE)
"""Fields whose string values are paths."""

ScenarioSource = Scenario | Mapping[str, Any] | str | os.PathLike[str] | None
"""A scenario, its fields, the path of its YAML file, or None for the profile's defaults."""


def scenario_and_rules(
    scenario: ScenarioSource = None, rules: str | Rules = "auto", **fields: Any
) -> tuple[Scenario, Rules]:
    """Return scenario and rules with single fields of either overridden by name.

    A field of both is overridden in the scenario. A None leaves a field as it is. The rules may be
    `auto`, see `IncidentFields.rules_of`.

    Raises:
        FieldError: If a field is unknown or a value is not allowed.
    """
    of_scenario = {*SPECS, *SYNONYMS}
    check_known("the scenario or the rules", fields, [*of_scenario, *specs(Rules)])
    of_rules = {k: v for k, v in fields.items() if k not in of_scenario and v is not None}
    for_scenario = {k: v for k, v in fields.items() if k in of_scenario}
    stated = Scenario.read(scenario).override(**for_scenario)
    chosen = rules if isinstance(rules, Rules) else profile(stated.rules_of(rules))
    return stated, chosen.override(**of_rules)


def _renamed(values: Mapping[str, Any], stated: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the values, or those given, without synonyms; all names must be known.

    Raises:
        FieldError: If a name is unknown, or a field is given twice.
    """
    check_known("the scenario", values, [*specs(Scenario), *SYNONYMS])
    stated = values if stated is None else stated
    renamed = {SYNONYMS.get(name, name): value for name, value in stated.items()}
    if len(renamed) < len(stated):
        raise FieldError("dispersion_start and sigma are the same field; give one")
    return renamed


def _on_own_grid(scenario: Scenario, rules: Rules) -> Scenario:
    """Return a scenario with the grid of its incident or area, if it has none of its own.

    Raises:
        FieldError: If other fields contradict them, or no grid fits.
    """
    fits, incident = scenario.fit_grid, scenario.incident
    if fits and (scenario.grid_size is not None or scenario.zone_size is not None):
        raise FieldError("fit_grid must be false with grid_size or zone_size, got true")
    if incident is not None:
        return _on_incident_grid(scenario, rules)
    return _on_area_grid(scenario) if fits else scenario


def _on_area_grid(scenario: Scenario) -> Scenario:
    """Return a scenario with the grid around its area.

    Raises:
        FieldError: If it has no area, or states where the grid lies.
    """
    if scenario.area is None:
        raise FieldError("fit_grid must come with an incident or an area, got true")
    for name in ("origin_lat", "origin_lon"):
        if getattr(scenario, name) is not None:
            raise FieldError(f"{name} must not be given with fit_grid, which determines it")
    cell = scenario.cell_m
    grid, origin = grid_around(scenario.area, cell, scenario.origin_alt)
    datum = scenario.person_initial_position
    if datum is None:
        mask = area_mask(scenario.area, scenario.land, grid, cell, origin)
        datum = _nearest_searched((grid.columns // 2, grid.rows // 2), mask)
    return dataclasses.replace(
        scenario, fit_grid=False, origin_lat=origin[0], origin_lon=origin[1], grid_size=grid,
        person_initial_position=datum,
    )  # fmt: skip


def _on_incident_grid(scenario: Scenario, rules: Rules) -> Scenario:
    """Return a scenario with the grid of its incident; the scenario itself if it has one already.

    Raises:
        FieldError: If other fields contradict the incident, or no grid fits it.
    """
    incident = scenario.incident
    if incident is None or incident.grid_summary is not None:
        return scenario
    from dsse_ros.world.scenario.incident_grid import check_transit, lay_grid, nearest_cells

    if not drifts_with_incident(rules.person_motion):
        raise FieldError(f"incident must come with rules sea or flight, got {rules.profile}")
    for name in OF_INCIDENT:
        # An incident has no drift before the search anyway.
        nothing = 0.0 if name == "pre_search_minutes" else None
        if getattr(scenario, name) != nothing:
            raise FieldError(f"{name} must not be given with an incident, which determines it")
    cell, speeds = scenario.cell_m, scenario.speeds
    stated = None
    if scenario.grid_size is not None or scenario.zone_size is not None:
        stated = scenario.grid_of_cells(rules, cell)
    grid = lay_grid(
        incident, cell_m=cell, alt_m=scenario.origin_alt, grid=stated, fits=scenario.fit_grid,
        steps=scenario.timestep_limit or rules.timestep_limit, step_s=cell / max(speeds),
        speed_mps=min(speeds), seed=scenario.ensemble_seed,
    )  # fmt: skip
    if scenario.battery_move:
        steps = (FULL - scenario.battery_reserve) / scenario.battery_move
        check_transit(incident, grid.summary.begins_s, min(speeds), steps * cell / max(speeds))
    starts = scenario.drones_positions
    mask = area_mask(scenario.area, scenario.land, grid.grid, cell, grid.origin)
    if starts is None and incident.base is not None:
        count = scenario.num_drones or 1
        starts = nearest_cells(grid.origin, grid.grid, cell, incident.base, count, mask)
        # The check of num_drones refuses more drones than cells.
        starts = starts if len(starts) == count else None
    return dataclasses.replace(
        scenario, incident=dataclasses.replace(incident, grid_summary=grid.summary),
        origin_lat=grid.origin[0], origin_lon=grid.origin[1], grid_size=grid.grid,
        zone_size=None, fit_grid=False, drones_positions=starts, vector=grid.vector,
        person_initial_position=_nearest_searched(grid.datum, mask),
        sigma_x=grid.sigma[0], sigma_y=grid.sigma[1],
    )  # fmt: skip


def _nearest_searched(cell: tuple[int, int], mask: NDArray[np.bool_] | None) -> tuple[int, int]:
    """Return the searched cell nearest to a cell (col, row)."""
    if mask is None:
        return cell
    rows, cols = np.nonzero(mask)
    nearest = int(np.argmin((cols - cell[0]) ** 2 + (rows - cell[1]) ** 2))
    return int(cols[nearest]), int(rows[nearest])


def altitudes_of(scenario: Scenario) -> tuple[float, ...]:
    """Return the `alts_m` of a frame, from a resolved scenario: none where all are the same."""
    altitudes = scenario.altitudes
    return () if set(altitudes) == {scenario.altitude} else altitudes


def scenario_frame(
    scenario: ResolvedScenario, *, map_frame: str = "map", frame_prefix: str = ""
) -> GridFrame:
    """Return where the grid of a scenario lies.

    Args:
        scenario: The scenario.
        map_frame: Name of the frame.
        frame_prefix: What the names of the drones' frames begin with.
    """
    return GridFrame(
        grid_size=scenario.grid_size,
        cell_size_m=scenario.cell_size,
        origin_lat_deg=scenario.origin_lat,
        origin_lon_deg=scenario.origin_lon,
        origin_alt_m=scenario.origin_alt,
        alt_m=scenario.altitude,
        alts_m=altitudes_of(scenario),
        map_frame=map_frame,
        frame_prefix=frame_prefix,
    )
