# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Record where OpenDrift's particles are, in an environment where OpenDrift is installed.

Usage: python test/oracles/record_opendrift.py [FILE]. See README.md beside it.
"""

from __future__ import annotations

import importlib.metadata
import json
import platform
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from opendrift.models.leeway import Leeway
from pyproj import Geod

VERSION = "1.14.12"
COUNT = 100_000
HOURS, WIND_MPS = 6, 10.0
LAT_DEG, LON_DEG = 0.0, -30.0
START = datetime(2026, 1, 1)
JIBING = [(1, 0.04), (1, 0.5), (20, 0.04), (44, 0.5)]
"""Types of objects and probabilities per hour; their sides are mirror images without offset, which
OpenDrift changes as we do."""


def row(kind: int, jibing: float, step_s: float) -> dict[str, object]:
    """Return the mean and the standard deviation of the particles of a type of object, in m.

    Up to 1.14.12 a positive crosswind component points to the left.
    """
    model = Leeway(loglevel=50, seed=1000 * kind + round(100 * jibing))
    for name, value in {
        "environment:constant:x_wind": WIND_MPS,
        "environment:constant:y_wind": 0.0,
        "environment:constant:x_sea_water_velocity": 0.0,
        "environment:constant:y_sea_water_velocity": 0.0,
        "environment:constant:land_binary_mask": 0,
        "general:use_auto_landmask": False,
        "seed:jibe_probability": jibing,
    }.items():
        model.set_config(name, value)
    model.seed_elements(
        lon=LON_DEG, lat=LAT_DEG, time=START, number=COUNT, object_type=kind,
        jibe_probability=jibing,
    )  # fmt: skip
    model.run(
        duration=timedelta(hours=HOURS), time_step=step_s, time_step_output=3600 * HOURS,
        export_variables=["lon", "lat"],
    )  # fmt: skip
    lons, lats = np.asarray(model.elements.lon), np.asarray(model.elements.lat)
    assert len(lons) == COUNT
    start = np.full(COUNT, LON_DEG), np.full(COUNT, LAT_DEG)
    azimuth_deg, _, distance_m = Geod(ellps="WGS84").inv(*start, lons, lats)
    downwind, left = (distance_m * f(np.radians(azimuth_deg)) for f in (np.sin, np.cos))
    return {
        "class": model.leewayprop[kind]["OBJKEY"],
        "jibing": jibing,
        "step_s": step_s,
        "downwind_m": [round(float(downwind.mean()), 2), round(float(downwind.std()), 2)],
        "left_m": [round(float(left.mean()), 2), round(float(left.std()), 2)],
    }


def main() -> None:
    if importlib.metadata.version("opendrift") != VERSION:
        raise SystemExit(f"OpenDrift {VERSION} must be installed")
    kinds = range(1, len(Leeway(loglevel=50).leewayprop) + 1)
    # The wind is constant, so longer steps change nothing without jibing.
    rows = [row(kind, 0.0, 3600.0) for kind in kinds]
    rows += [row(kind, jibing, 600.0) for kind, jibing in JIBING]
    source = {
        "what": f"{COUNT} particles after {HOURS} h in a wind of {WIND_MPS:g} m/s",
        "package": f"OpenDrift {VERSION} from PyPI",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "recorded": time.strftime("%Y-%m"),
    }
    file = Path(__file__).with_name("data") / "opendrift_leeway.json"
    lines = ",\n".join(f"  {json.dumps(of_class)}" for of_class in rows)
    Path(sys.argv[1] if len(sys.argv) > 1 else file).write_text(
        f'{{\n "provenance": {json.dumps(source)},\n "rows": [\n{lines}\n ]\n}}\n', encoding="utf-8"
    )


if __name__ == "__main__":
    main()
