# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of an object that was seen after they begin: from there on forward, before it backward."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.drift.tracks import Drift, DriftTracks, Sighting, drift_tracks


def tracks_both_ways(
    drift: Drift, sightings: Sequence[Sighting], times_s: NDArray[np.float64], count: int,
    rng: np.random.Generator,
) -> DriftTracks:  # fmt: skip
    """Return tracks as `drift_tracks` does, but of particles that drift before they are seen too.

    A particle of a sighting that is later than the first time has drifted to where it was seen,
    with the same leeway and the same constant errors of wind and current.

    Args:
        drift: See `drift_tracks`.
        sightings: See there.
        times_s: See there; increasing.
        count: See there.
        rng: See there.

    Raises:
        ValueError: If wind or current are missing at a place or time, or a sighting is on land.
    """
    first_s = min(sighting.time_s - sighting.time_error_s for sighting in sightings)
    last_s = max(sighting.time_s + sighting.time_error_s for sighting in sightings)
    if last_s <= times_s[0]:
        return drift_tracks(drift, sightings, times_s, count, rng)
    # A copy of the generator draws the same particles.
    again = copy.deepcopy(rng)
    seen_first = np.concatenate([[min(first_s, times_s[0])], times_s])
    forward = drift_tracks(drift, sightings, seen_first, count, rng)
    seen_last = np.concatenate([[max(last_s, times_s[-1])], times_s[::-1]])
    backward = drift_tracks(drift, sightings, seen_last, count, again)
    # Until it is seen, or back to then, a particle stays where it is seen.
    lats = forward.lats_deg[1:] + backward.lats_deg[:0:-1] - backward.lats_deg[0]
    turned = backward.lons_deg[:0:-1] - backward.lons_deg[0]
    lons = forward.lons_deg[1:] + (turned + 180.0) % 360.0 - 180.0
    ashore = forward.stranded[1:] | backward.stranded[:0:-1]
    return DriftTracks(times_s, lats, (lons + 180.0) % 360.0 - 180.0, ashore)
