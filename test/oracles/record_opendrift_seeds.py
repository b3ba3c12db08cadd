# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Record where OpenDrift's particles are that it seeds along a line and within a polygon.

Usage: python test/oracles/record_opendrift_seeds.py [FILE]. See README.md beside it.
"""

from __future__ import annotations

import importlib.metadata
import json
import platform
import sys
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from opendrift.models.leeway import Leeway
from pyproj import Geod

VERSION = "1.14.12"
COUNT = 100_000
HOURS, WIND_MPS = 12, 10.0
LAT_DEG, LON_DEG = 0.0, -30.0
START = datetime(2026, 1, 1)
SEEDS: dict[str, dict[str, object]] = {
    # Along a line in six hours, with the standard deviation of each axis at both ends.
    "cone": {
        "lon": [-30.3, -29.9], "lat": [-0.2, 0.3], "radius": [1000.0, 4000.0],
        "time": [START, START + timedelta(hours=6)],
    },
    # A polygon that is not convex.
    "polygon": {
        "lons": [-30.2, -29.8, -29.8, -30.0, -30.2], "lats": [-0.2, -0.2, 0.3, -0.1, 0.2],
        "time": START,
    },
}  # fmt: skip
KINDS = (1, 4)
"""Types of objects: PIW-1 and PIW-4."""


def row(how: str, kind: int) -> dict[str, object]:
    """Return moments of the particles in m, to the east and to the north of a place.

    Up to 1.14.12 a positive crosswind component points to the left: here, in a wind to the east, to
    the north.
    """
    np.random.seed(1)
    model = Leeway(loglevel=50, seed=kind)
    for name, value in {
        "environment:constant:x_wind": WIND_MPS,
        "environment:constant:y_wind": 0.0,
        "environment:constant:x_sea_water_velocity": 0.0,
        "environment:constant:y_sea_water_velocity": 0.0,
        "environment:constant:land_binary_mask": 0,
        "general:use_auto_landmask": False,
        "seed:jibe_probability": 0.0,
    }.items():
        model.set_config(name, value)
    seed: dict[str, Callable[..., None]] = {
        "cone": model.seed_cone, "polygon": model.seed_within_polygon,
    }  # fmt: skip
    seed[how](number=COUNT, object_type=kind, jibe_probability=0.0, **SEEDS[how])
    model.run(
        end_time=START + timedelta(hours=HOURS), time_step=600, time_step_output=3600,
        export_variables=["lon", "lat"],
    )  # fmt: skip
    lons, lats = np.asarray(model.elements.lon), np.asarray(model.elements.lat)
    assert len(lons) == COUNT
    start = np.full(COUNT, LON_DEG), np.full(COUNT, LAT_DEG)
    azimuth_deg, _, distance_m = Geod(ellps="WGS84").inv(*start, lons, lats)
    east, north = (distance_m * f(np.radians(azimuth_deg)) for f in (np.sin, np.cos))
    return {
        "seed": how,
        "class": model.leewayprop[kind]["OBJKEY"],
        "east_m": [round(float(east.mean()), 2), round(float(east.std()), 2)],
        "north_m": [round(float(north.mean()), 2), round(float(north.std()), 2)],
        "correlation": round(float(np.corrcoef(east, north)[0, 1]), 5),
    }


def main() -> None:
    if importlib.metadata.version("opendrift") != VERSION:
        raise SystemExit(f"OpenDrift {VERSION} must be installed")
    rows = [row(how, kind) for how in SEEDS for kind in KINDS]
    source = {
        "what": f"{COUNT} particles {HOURS} h after the first one, in a wind of {WIND_MPS:g} m/s",
        "package": f"OpenDrift {VERSION} from PyPI",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "recorded": time.strftime("%Y-%m"),
    }
    file = Path(__file__).with_name("data") / "opendrift_seeds.json"
    lines = ",\n".join(f"  {json.dumps(of_seed)}" for of_seed in rows)
    Path(sys.argv[1] if len(sys.argv) > 1 else file).write_text(
        f'{{\n "provenance": {json.dumps(source)},\n "rows": [\n{lines}\n ]\n}}\n', encoding="utf-8"
    )


if __name__ == "__main__":
    main()
