# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Writes an example of a current as CF-NetCDF: a tidal ellipse and an eddy off Santos.

    pip install '.[drift]'
    python examples/santos_current.py examples/santos_current.nc

The field is made up. Forecasts of Copernicus Marine or HYCOM have the same form.
"""

from __future__ import annotations

import sys

import netCDF4
import numpy as np
from numpy.typing import NDArray

START = "2026-01-17 12:00:00"
HOURS = np.arange(13.0)
LATS_DEG = np.linspace(-24.6, -23.4, 25)
LONS_DEG = np.linspace(-47.0, -45.7, 27)
TIDE_H = 12.42
"""Period of the tide M2."""
TIDE_MPS = (0.25, 0.08)
"""Semi-axes of the tidal ellipse."""
TIDE_DEG = 60.0
"""Direction of its major axis, clockwise from north: along the coast."""
EDDY = (-24.15, -46.30)
"""Latitude and longitude of the eddy's centre."""
EDDY_MPS = 0.3
"""Fastest current of the eddy, clockwise as cyclones of the southern hemisphere."""
EDDY_M = 15_000.0
"""Distance of the fastest current from the centre."""
METRES_PER_DEG = 111_195.0

Floats = NDArray[np.float64]


def current(hours: Floats, lats_deg: Floats, lons_deg: Floats) -> tuple[Floats, Floats]:
    """Return the current to the east and to the north in m/s, at these times and places."""
    phase, axis = 2 * np.pi * hours / TIDE_H, np.radians(TIDE_DEG)
    along, across = TIDE_MPS[0] * np.cos(phase), TIDE_MPS[1] * np.sin(phase)
    y_m = (lats_deg - EDDY[0]) * METRES_PER_DEG
    x_m = (lons_deg - EDDY[1]) * METRES_PER_DEG * np.cos(np.radians(EDDY[0]))
    turn = EDDY_MPS / EDDY_M * np.exp(0.5 * (1 - (x_m**2 + y_m**2) / EDDY_M**2))
    east = along * np.sin(axis) - across * np.cos(axis) + turn * y_m
    north = along * np.cos(axis) + across * np.sin(axis) - turn * x_m
    return east, north


def main(path: str) -> None:
    """Write the file."""
    with netCDF4.Dataset(path, "w") as file:
        file.Conventions = "CF-1.8"
        file.title = "A made-up current off Santos, Brazil: a tidal ellipse and an eddy"
        for name, standard_name, units, values in (
            ("time", "time", f"hours since {START}", HOURS),
            ("lat", "latitude", "degrees_north", LATS_DEG),
            ("lon", "longitude", "degrees_east", LONS_DEG),
        ):
            file.createDimension(name, len(values))
            axis = file.createVariable(name, "f8", (name,))
            axis.standard_name, axis.units = standard_name, units
            axis[:] = values
        velocities = current(HOURS[:, None, None], LATS_DEG[:, None], LONS_DEG)
        names = ("uo", "eastward"), ("vo", "northward")
        for (name, direction), values in zip(names, velocities, strict=True):
            # Steps of 0.1 mm/s fit into 16 bits.
            variable = file.createVariable(
                name, "i2", ("time", "lat", "lon"), compression="zlib", fill_value=-32768
            )
            variable.standard_name = f"{direction}_sea_water_velocity"
            variable.units, variable.scale_factor = "m s-1", 1e-4
            variable[:] = values


if __name__ == "__main__":
    main(*sys.argv[1:])
