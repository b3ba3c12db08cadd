# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`backtrack`: from where an object was found to where it came from, without ROS."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.whole_files import whole_file
from dsse_ros.cli.command_line import Parser, place
from dsse_ros.mission.files.scenario_files import scenario_with_incident
from dsse_ros.ros.runtime.exit_codes import fail
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.drift.kernels import degrees_per_metre
from dsse_ros.world.drift.sightings import Sighting
from dsse_ros.world.scenario.geodesy import mean_lon
from dsse_ros.world.scenario.place_checks import check_near
from dsse_ros.world.scenario.sighting_fields import time_of

INTERVAL_S = 600.0
"""Time between two lines of the table."""
MAX_BACK_S = 10 * 86400.0


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(
        prog="backtrack",
        description="Follow an object back in time, from where it was found to where it came from, "
        "with the class, wind and current of an incident.",
    )
    add = parser.add
    add("--scenario", default="kayak", help="YAML file or name, with an incident")
    add(
        "--found",
        metavar="LAT,LON",
        required=True,
        help="place, such as -24.0,-46.4 or '24 00.0 S 046 24.0 W'",
    )
    add("--time", required=True, help="time of the find, ISO 8601, in UTC without an offset")
    add(
        "--radius",
        type=float,
        default=100.0,
        help="radius that holds the find in 99 %% of cases, m",
    )
    add("--until", help="earliest time, by default that of the first sighting")
    add("--particles", type=int, default=5000, help="number of particles")
    add("--seed", type=int, default=0, help="random seed of the particles")
    add("--out", type=Path, help="CSV file for the earliest positions of all particles")
    return parser.parse_args(argv)


def _times(first_s: float, last_s: float) -> NDArray[np.float64]:
    """Return times from the find back to the earliest, both included."""
    if not 0 < first_s - last_s <= MAX_BACK_S:
        raise FieldError(
            f"until must be before the find and at most 10 days, got {utc(last_s)} and "
            f"{utc(first_s)}"
        )
    return np.append(np.arange(first_s, last_s, -INTERVAL_S), last_s)


def main(argv: list[str] | None = None) -> int:
    """Print where the object came from; returns the exit code, 2 for bad input."""
    arguments = parse(argv)
    try:
        if not (0 <= arguments.radius <= 1e5 and 1 <= arguments.particles <= 10**6):
            raise FieldError(
                f"radius must be 0 to 100000 m and particles 1 to 1000000, got "
                f"{arguments.radius:g} and {arguments.particles}"
            )
        if arguments.seed < 0:
            raise FieldError(f"seed must be an integer >= 0, got {arguments.seed}")
        _, incident = scenario_with_incident(arguments.scenario)
        found = Sighting(
            *place("found", arguments.found), time_of("time", arguments.time), arguments.radius
        )
        for sighting in incident.sightings[:1]:
            check_near("found", found.place, sighting.place)
        if arguments.until is not None:
            until_s = time_of("until", arguments.until)
        else:
            until_s = min(
                (sighting.time_s for sighting in incident.sightings), default=found.time_s
            )
        rng = np.random.default_rng(arguments.seed)
        times_s = _times(found.time_s, until_s)
        tracks = incident.backtracked(found, times_s, arguments.particles, rng)
    except FieldError as error:
        return fail("backtrack", error)
    print("time                  lat        lon        95 % within")
    for time_s, lats, lons in zip(times_s, tracks.lats_deg, tracks.lons_deg, strict=True):
        lat, lon, within_m = _summary(lats, lons)
        print(f"{utc(time_s)}  {lat:9.5f}  {lon:10.5f}  {within_m:8.0f} m")
    if arguments.out is not None:
        table = np.stack([tracks.lats_deg[-1], tracks.lons_deg[-1]], axis=1)
        try:
            with whole_file(arguments.out) as part:
                np.savetxt(
                    part, table, "%.6f", delimiter=",", header="lat_deg,lon_deg", comments=""
                )
        except OSError as error:
            return fail("backtrack", f"out: {str(arguments.out)!r}: {error.strerror}")
    return 0


def _summary(lats: NDArray[np.float64], lons: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the mean position, and the distance from it in metres of 95 % of the particles."""
    lat, lon = float(lats.mean()), mean_lon(lons)
    lat_per_m, lon_per_m = degrees_per_metre(lat)
    east_m = ((lons - lon + 180) % 360 - 180) / lon_per_m
    away_m = np.hypot(east_m, (lats - lat) / lat_per_m)
    return lat, lon, float(np.quantile(away_m, 0.95))


if __name__ == "__main__":
    sys.exit(main())
