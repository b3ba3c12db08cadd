# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of particles from a NetCDF file of OpenDrift, or of another model in its format.

The file has the variables `lon` and `lat` along the dimensions `trajectory` and `time` (CF, feature
type trajectory). A particle has no positions before its release and after its deactivation.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.drift.netcdf import Unfit, check_installed, opened, times_of
from dsse_ros.world.drift.tracks import DriftTracks

MAX_POSITIONS = 20_000_000
_DIMENSIONS = ("time", "trajectory")


def read_tracks(path: str | os.PathLike[str]) -> DriftTracks:
    """Return the tracks of a file.

    A particle waits at its first position until its release and stays at its last one from its
    deactivation on, as if it were stranded. Particles without any position are left out.

    Raises:
        ValueError: If the file cannot be read, or has no tracks of OpenDrift; one line.
    """
    name = os.fspath(path)
    check_installed(f"tracks {name!r}")
    try:
        with opened(path) as dataset:
            times_s, lats, lons = _positions(dataset)
    except Unfit as unfit:
        raise ValueError(f"tracks {name!r}: {unfit}") from None
    except (KeyError, OSError, RuntimeError, TypeError, ValueError) as error:
        reason = reason_of(error)
        raise ValueError(f"tracks {name!r} must be a NetCDF file of OpenDrift: {reason}") from None
    return _filled(times_s, lats, lons)


def _positions(
    dataset: Any,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times (T,), latitudes and longitudes (T, M), NaN where there are none."""
    for name in ("time", "lat", "lon"):
        if name not in dataset.variables:
            raise Unfit(
                f"file must have a variable {name}, got {', '.join(map(str, dataset.variables))}"
            )
    for name in ("lat", "lon"):
        if set(dataset[name].dims) != set(_DIMENSIONS):
            dims = " and ".join(map(str, dataset[name].dims)) or "none"
            raise Unfit(f"{name} must be along {' and '.join(_DIMENSIONS)}, got {dims}")
    if dataset["lat"].size > MAX_POSITIONS:
        raise Unfit(f"file must have at most {MAX_POSITIONS} positions, got {dataset['lat'].size}")
    times_s = times_of(dataset["time"])
    if not len(times_s) or not (np.diff(times_s) > 0).all():
        raise Unfit("times must increase")
    lats, lons = (
        np.asarray(dataset[name].transpose(*_DIMENSIONS).values, np.float64)
        for name in ("lat", "lon")
    )
    on_earth = (np.abs(lats) <= 90) & (np.abs(lons) <= 360)
    lats, lons = np.where(on_earth, lats, np.nan), np.where(on_earth, lons, np.nan)
    some = on_earth.any(axis=0)
    if not some.any():
        raise Unfit("file must have positions")
    return times_s, lats[:, some], lons[:, some]


def _filled(
    times_s: NDArray[np.float64], lats: NDArray[np.float64], lons: NDArray[np.float64]
) -> DriftTracks:
    """Return tracks without gaps, filled with the last position or else the first."""
    there = np.isfinite(lats)
    steps = np.arange(len(times_s))[:, None]
    last = np.maximum.accumulate(np.where(there, steps, -1), axis=0)
    index = np.where(last >= 0, last, there.argmax(axis=0))
    final = len(times_s) - 1 - there[::-1].argmax(axis=0)
    return DriftTracks(
        times_s,
        np.take_along_axis(lats, index, axis=0),
        np.take_along_axis(lons, index, axis=0),
        steps > final,
    )


def at_times(tracks: DriftTracks, times_s: NDArray[np.float64]) -> DriftTracks:
    """Return tracks at other times, by linear interpolation.

    Raises:
        ValueError: If they do not cover these times.
    """
    first, last = float(tracks.times_s[0]), float(tracks.times_s[-1])
    if times_s.min() < first or times_s.max() > last:
        raise ValueError(
            f"the tracks must cover {utc(times_s.min())} to {utc(times_s.max())}, got {utc(first)} "
            f"to {utc(last)}"
        )
    low = np.clip(np.searchsorted(tracks.times_s, times_s, "right") - 1, 0, None)
    high = np.minimum(low + 1, len(tracks.times_s) - 1)
    length = np.where(high > low, tracks.times_s[high] - tracks.times_s[low], 1.0)
    share = ((times_s - tracks.times_s[low]) / length)[:, None]
    lats = tracks.lats_deg[low] + share * (tracks.lats_deg[high] - tracks.lats_deg[low])
    # A track may cross the antimeridian.
    turn = (tracks.lons_deg[high] - tracks.lons_deg[low] + 180.0) % 360.0 - 180.0
    lons = tracks.lons_deg[low] + share * turn
    return DriftTracks(times_s, lats, lons, tracks.stranded[low])
