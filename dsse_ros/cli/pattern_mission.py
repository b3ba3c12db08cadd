# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search pattern as the mission of one vehicle, with the numbers that a coordinator checks."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dsse_ros.base.fields import FieldError, specs
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.cli.command_line import Parser, place
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.fleet.vehicle_missions import FlightSettings
from dsse_ros.vehicles.mission_items.items import NAV_WAYPOINT, Home, VehicleMission
from dsse_ros.vehicles.mission_items.track_missions import TrackStyle, track_mission
from dsse_ros.world.scenario.geodesy import cell_to_geodetic
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame
from dsse_ros.world.sensors.search_theory import (
    coverage,
    inverse_cube_pod,
    random_search_pod,
    search_radius,
    total_probable_error,
)
from dsse_ros.world.sensors.swept_strip import width_of

OPTIONS = specs(SearchPattern)
_OTHERS = ("datum", "sweep_width", "errors", "search")


def add_pattern(parser: Parser) -> None:
    """Add the options of a pattern."""
    add = parser.add_argument_group(
        "search pattern of one vehicle, instead of a search"
    ).add_argument
    for name, spec in OPTIONS.items():
        unit = f", {spec.unit}" if spec.unit else ""
        add(f"--{name.replace('_', '-')}", type=str if spec.choices else float,
            choices=spec.choices or None, help=spec.doc.rstrip(".") + unit)  # fmt: skip
    datum = "by default the last known cell of the scenario"
    add("--datum", metavar="LAT,LON", help=datum)
    errors = (
        "probable errors of position, drift and navigation, m: sides of the area that are not "
        "given follow from the search radius"
    )
    add("--errors", metavar="X,DE,Y", help=errors)
    add("--search", type=int, help="number of the search with --errors, 1 to 5, by default 1")
    width = "sweep width W, m: for coverage and POD; by default of the scenario's sensor"
    add("--sweep-width", type=float, help=width)


class PatternMission:
    """The mission of a command line with `add_pattern` and the option `pattern`.

    Args:
        arguments: The command line.
        scenario: Where the datum is if not given, and how high and fast the vehicle flies.

    Attributes:
        frame: A grid of one cell of 1 m, with the datum as its origin.

    Raises:
        FieldError: If a value is not allowed.
    """

    def __init__(self, arguments: argparse.Namespace, scenario: ResolvedScenario) -> None:
        values = {name: getattr(arguments, name) for name in OPTIONS}
        self._radius_m: float | None = None
        if arguments.errors is not None:
            self._radius_m = _radius_m(arguments.errors, arguments.search or 1)
            across = 1 if arguments.pattern == "VS" else 2
            values["length"] = values["length"] or across * self._radius_m
            if arguments.pattern in ("PS", "CS"):
                values["width"] = values["width"] or across * self._radius_m
        elif arguments.search is not None:
            raise FieldError(f"search must be given with errors, got {arguments.search}")
        if arguments.sweep_width is not None and not 0 < arguments.sweep_width <= 1e6:
            raise FieldError(
                f"sweep_width must be > 0 and <= 1000000 m, got {arguments.sweep_width}"
            )
        self._sweep_width_m: float | None = arguments.sweep_width
        kind = scenario.kinds[scenario.kind_of[0]]
        if self._sweep_width_m is None and kind.sensor == "sweep_width":
            self._sweep_width_m = width_of(scenario, kind)
        optional = ("heading", "first_turn")
        self._pattern = SearchPattern(
            **{k: v for k, v in values.items() if v is not None or k not in optional}
        )
        self._speed_mps = scenario.speeds[0]
        frame = scenario_frame(scenario)
        if arguments.datum is None:
            col, row = scenario.person_initial_position
            lat_deg, lon_deg, _ = cell_to_geodetic(frame, float(col), float(row), 0.0)
        else:
            lat_deg, lon_deg = place("datum", arguments.datum)
        # Cells of 1 m, and the datum as their origin: headings are true there.
        self.frame = replace(
            frame, grid_size=GridShape.square(1), cell_size_m=1.0, origin_lat_deg=lat_deg,
            origin_lon_deg=lon_deg, alt_m=frame.alt_of(0), alts_m=(),
        )  # fmt: skip

    def mission(self, settings: FlightSettings, home: Home | None) -> VehicleMission:
        """Return the mission: the turning points, at the altitude of the scenario."""
        spacing_m = self._pattern.track_spacing or self._pattern.length
        return track_mission(
            self.frame,
            self._pattern.track.points_m * (1, -1) + (-0.5, 0.5),
            home=home,
            style=TrackStyle(
                acceptance_radius_m=min(settings.acceptance_radius, spacing_m / 2),
                speed_mps=self._speed_mps,
                airspeed=AUTOPILOTS[settings.autopilot].circles,
            ),
        )

    def summary(self, mission: VehicleMission) -> Iterator[str]:
        """Yield lines with what a coordinator checks."""
        track, spacing_m = self._pattern.track, self._pattern.track_spacing
        start = next(item for item in mission.items if item.command == NAV_WAYPOINT)
        minutes, seconds = divmod(round(track.length_m / self._speed_mps), 60)
        if self._radius_m is not None:
            yield f"search radius           {self._radius_m:.0f} m"
        yield f"commence search point   {start.lat_deg:.6f}, {start.lon_deg:.6f}"
        yield f"legs                    {len(track.points_m) - 1}"
        yield (
            f"track length            {track.length_m:.0f} m, {minutes} min {seconds} s at "
            f"{self._speed_mps:g} m/s"
        )
        yield f"area                    {track.area_m2 / 1e6:.3f} km2"
        if self._sweep_width_m is not None:
            yield f"sweep width             {self._sweep_width_m:.0f} m"
            factor = coverage(self._sweep_width_m, track.length_m, track.area_m2)
            by_spacing = (
                "" if spacing_m is None else f", W / S = {self._sweep_width_m / spacing_m:.2f}"
            )
            yield f"coverage C = W L / A    {factor:.2f}{by_spacing}"
            yield (
                f"POD                     {random_search_pod(factor):.1%} random search, "
                f"{inverse_cube_pod(factor):.1%} inverse cube"
            )


def check_no_pattern(arguments: argparse.Namespace) -> None:
    """Raise if a command line without a pattern has options of one.

    Raises:
        FieldError: If it has.
    """
    for name in (*OPTIONS, *_OTHERS):
        if getattr(arguments, name) is not None:
            raise FieldError(f"{name} must be given with pattern, got no pattern")


def _radius_m(text: str, search: int) -> float:
    try:
        position, drift, navigation = (float(part) for part in text.split(","))
    except ValueError:
        position = drift = navigation = np.nan
    if not all(0 <= error <= 1e6 for error in (position, drift, navigation)):
        raise FieldError(f"errors must be X,DE,Y from 0 to 1e+06 m, got {text!r}")
    try:
        return search_radius(total_probable_error(position, drift, navigation), search)
    except ValueError as error:
        raise FieldError(str(error)) from None
