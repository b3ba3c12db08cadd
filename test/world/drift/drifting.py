# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drifts that the tests have in common."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymap3d.vincenty import vdist

from dsse_ros.world.drift.flow import Flow, constant_flow
from dsse_ros.world.drift.leeway import PossibleObject, leeway_class
from dsse_ros.world.drift.sightings import Sighting
from dsse_ros.world.drift.tracks import Drift, DriftTracks

HOUR_S = 3600.0
STILL = constant_flow("current", 0.0, 0.0)
CALM = constant_flow("wind", 0.0, 0.0)


def drift_of(
    key: str = "SLDMB", *, wind: Flow = CALM, current: Flow = STILL, **options: Any
) -> Drift:
    return Drift((PossibleObject(leeway_class(key)),), wind, current, **options)


def displacements(
    tracks: DriftTracks, start: Sighting, index: int = -1
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Metres to the east and to the north along the geodesic, by pymap3d."""
    distance, azimuth = vdist(
        start.lat_deg, start.lon_deg, tracks.lats_deg[index], tracks.lons_deg[index]
    )
    distance, azimuth = np.atleast_1d(distance), np.atleast_1d(azimuth)
    return distance * np.sin(np.radians(azimuth)), distance * np.cos(np.radians(azimuth))


@contextmanager
def little_memory() -> Iterator[None]:
    """Let this process have 256 MB more than now; beyond, allocations fail."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    limit = pages * resource.getpagesize() + (256 << 20)
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
