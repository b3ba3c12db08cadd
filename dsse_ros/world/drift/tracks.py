# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of the particles of an object that was seen at sea: the entry point of this package."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.work import Work
from dsse_ros.world.drift.flow import Flow, Kind, Uncertainty, utc
from dsse_ros.world.drift.kernels import (
    MOVED,
    NO_CURRENT,
    NO_WAVES,
    NO_WIND,
    Particles,
    degrees_per_metre,
    mark_land,
    move,
)
from dsse_ros.world.drift.leeway import PossibleObject, draw_objects, systematic
from dsse_ros.world.drift.shore import Shore
from dsse_ros.world.drift.sightings import Seen, draw_sightings

LONGEST_STEP_S = 60.0
"""Longest step of the integration; longer steps between positions are divided."""
MOST_MOVES = 50_000_000
"""Particles times steps until the first position, above which the steps until there are longer."""
LONGEST_FIRST_STEP_S, OF_CORRELATION = 600.0, 1 / 6
"""Longest of these, and their longest share of the time in which an error changes."""
MAX_REDRAWS = 1000
_LACKING: dict[int, Kind] = {NO_WIND: "wind", NO_CURRENT: "current", NO_WAVES: "waves"}


@dataclass(frozen=True)
class Drift:
    """How an object drifts.

    Attributes:
        objects: What it may be, at least one.
        wind: The wind at 10 m.
        current: The current at the surface.
        wind_error: Uncertainty of the wind.
        current_error: Uncertainty of the current.
        jibing_per_hour: Probability that it has jibed after an hour, at most once per step, after
            it has moved; see `leeway`.
        shore: Land to strand on; None for none.
        waves: Stokes drift at the surface; None for none.
    """

    objects: tuple[PossibleObject, ...]
    wind: Flow
    current: Flow
    wind_error: Uncertainty = Uncertainty()
    current_error: Uncertainty = Uncertainty()
    jibing_per_hour: float = 0.04
    shore: Shore | None = None
    waves: Flow | None = None


class DriftTracks(NamedTuple):
    """Tracks of M particles.

    Attributes:
        times_s: (T,) float64, in seconds since 1970-01-01 UTC.
        lats_deg: (T, M) float64, WGS84.
        lons_deg: (T, M) float64.
        stranded: (T, M) bool, which particles lie ashore; these stay where they are.
        objects: (M,) int8, number of each particle's object among those of the drift; None if it
            has one.
        released_s: (M,) float64, time from which on each particle drifts; None if unknown.
    """

    times_s: NDArray[np.float64]
    lats_deg: NDArray[np.float64]
    lons_deg: NDArray[np.float64]
    stranded: NDArray[np.bool_]
    objects: NDArray[np.int8] | None = None
    released_s: NDArray[np.float64] | None = None


class DriftPositions(NamedTuple):
    """M particles at one time.

    Attributes:
        lats_deg: (M,) float64, WGS84.
        lons_deg: (M,) float64.
        stranded: (M,) bool, which ones lie ashore; these stay where they are.
    """

    lats_deg: NDArray[np.float64]
    lons_deg: NDArray[np.float64]
    stranded: NDArray[np.bool_]


class DriftSteps(NamedTuple):
    """The tracks of M particles, one time after the other: all at once may be large.

    Attributes:
        positions: At each time. They are computed as they are taken, so errors come then.
        objects: See `DriftTracks`.
        released_s: See there.
    """

    positions: Iterable[DriftPositions]
    objects: NDArray[np.int8] | None
    released_s: NDArray[np.float64] | None


def drift_tracks(
    drift: Drift,
    sightings: Sequence[Seen],
    times_s: NDArray[np.float64],
    count: int,
    rng: np.random.Generator,
    *,
    step_s: float = LONGEST_STEP_S,
) -> DriftTracks:
    """Return the tracks of particles of equal weight at these times.

    A particle stays where it was seen until that time. With decreasing times it drifts backward, to
    where it came from.

    Args:
        drift: How the object drifts.
        sightings: Where it was seen; their weights divide the particles.
        times_s: (T,) float64, increasing or decreasing. The first one may be later than the
            sightings: particles then drift until there.
        count: M.
        rng: Generator of all draws.
        step_s: Longest step of the integration.

    Raises:
        ValueError: If wind or current are missing at a place or time, or a sighting is on land.
    """
    return collected(times_s, drift_steps(drift, sightings, times_s, count, rng, step_s=step_s))


def collected(times_s: NDArray[np.float64], steps: DriftSteps) -> DriftTracks:
    """Return tracks with their positions at all times.

    Raises:
        ValueError: If wind or current are missing at a place or time.
    """
    tracks: DriftTracks | None = None
    for index, positions in enumerate(steps.positions):
        if tracks is None:
            shape = len(times_s), len(positions.lats_deg)
            tracks = DriftTracks(
                times_s, np.empty(shape), np.empty(shape), np.empty(shape, np.bool_), steps.objects,
                steps.released_s,
            )  # fmt: skip
        tracks.lats_deg[index], tracks.lons_deg[index], tracks.stranded[index] = positions
    assert tracks is not None
    return tracks


def drift_steps(
    drift: Drift,
    sightings: Sequence[Seen],
    times_s: NDArray[np.float64],
    count: int,
    rng: np.random.Generator,
    *,
    step_s: float = LONGEST_STEP_S,
) -> DriftSteps:
    """Return what `drift_tracks` does, one time after the other; use `rng` for nothing meanwhile.

    Raises:
        ValueError: If a sighting is on land.
    """
    particles, objects = _release(drift, sightings, count, rng)
    noises = [
        _Noise(scale, error, rng)
        for scale, error in (
            (particles.wind_error, drift.wind_error),
            (particles.current_error, drift.current_error),
        )
    ]
    positions = _drifting(drift, particles, noises, times_s, rng, step_s)
    return DriftSteps(positions, objects, particles.released_s)


def _drifting(
    drift: Drift, particles: Particles, noises: Sequence[_Noise], times_s: NDArray[np.float64],
    rng: np.random.Generator, step_s: float,
) -> Iterator[DriftPositions]:  # fmt: skip
    """Yield the positions of particles, which move meanwhile."""
    forward = len(times_s) < 2 or times_s[-1] > times_s[0]
    released, count = particles.released_s, len(particles.released_s)
    first = begin = min(released.min(), times_s[0]) if forward else max(released.max(), times_s[0])
    lasts_s, work = max(abs(times_s[-1] - first), 1e-9), Work("drift")
    for index, until_s in enumerate(times_s):
        span_s = abs(until_s - begin)
        longest_s = step_s if index else _first_step_s(drift, span_s, count, step_s)
        steps = max(math.ceil(span_s / longest_s - 1e-9), 1)
        ends = np.linspace(begin, until_s, steps + 1)
        for start_s, end_s in zip(ends[:-1], ends[1:], strict=True):
            if end_s != start_s:
                _step(drift, particles, float(start_s), float(end_s - start_s), rng)
                for noise in noises:
                    noise.advance(abs(end_s - start_s))
                work.done(abs(end_s - first) / lasts_s)
        begin = until_s
        yield DriftPositions(
            particles.lat_deg.copy(), (particles.lon_deg + 180.0) % 360.0 - 180.0, ~particles.afloat
        )


def _first_step_s(drift: Drift, span_s: float, count: int, step_s: float) -> float:
    """Return the longest step until the first position, longer than usual for much drift."""
    needed_s = span_s * count / MOST_MOVES
    changes_s = min(
        (
            error.correlation_s
            for error in (drift.wind_error, drift.current_error)
            if error.std_mps > 0
        ),
        default=math.inf,
    )
    return max(step_s, min(needed_s, LONGEST_FIRST_STEP_S, OF_CORRELATION * changes_s))


def _step(
    drift: Drift, particles: Particles, time_s: float, step_s: float, rng: np.random.Generator
) -> None:
    """Move the particles by one step."""
    jibing = rng.random(len(particles.lat_deg)) if drift.jibing_per_hour else np.empty(0)
    waves = None if drift.waves is None else drift.waves.arrays
    lacks, number = move(
        particles, time_s, step_s, (drift.wind.arrays, drift.current.arrays, waves), drift.shore,
        jibing, drift.jibing_per_hour,
    )  # fmt: skip
    if lacks == MOVED:
        return
    kind: Kind = _LACKING[lacks]
    flow = getattr(drift, kind)
    lat, lon = particles.lat_deg[number], particles.lon_deg[number]
    reason = flow.why_none(lat, lon, *sorted((time_s, time_s + step_s)))
    raise ValueError(
        f"{kind} {flow.source!r} has no value at {lat:.4f}, {lon:.4f} between {utc(time_s)} and "
        f"{utc(time_s + step_s)}; {reason}"
    )


class _Noise:
    """The error of a flow, a stationary autoregressive process of first order per particle.

    Args:
        errors: (2, M) float64, its present value, which `advance` replaces.
        uncertainty: Its law.
        rng: Generator of the draws.
    """

    def __init__(
        self, errors: NDArray[np.float64], uncertainty: Uncertainty, rng: np.random.Generator
    ) -> None:
        self._errors, self._law, self._rng = errors, uncertainty, rng
        if uncertainty.std_mps > 0:
            errors[:] = uncertainty.std_mps * rng.standard_normal(errors.shape)

    def advance(self, step_s: float) -> None:
        """Advance the error by a step."""
        std, correlation_s = self._law
        if not std > 0 or math.isinf(correlation_s):
            return
        kept = math.exp(-step_s / correlation_s) if correlation_s > 0 else 0.0
        self._errors *= kept
        drawn = self._rng.standard_normal(self._errors.shape)
        self._errors += std * math.sqrt(1.0 - kept * kept) * drawn


def _release(
    drift: Drift, sightings: Sequence[Seen], count: int, rng: np.random.Generator
) -> tuple[Particles, NDArray[np.int8] | None]:
    """Return the particles where the object was seen, at sea, and the numbers of their objects."""
    # In a random order the crosswind sides, which alternate, are independent of the sightings.
    chosen = systematic([sighting.weight for sighting in sightings], count, rng)
    seen = draw_sightings(sightings, chosen, rng)
    time_draws = rng.uniform(-1.0, 1.0, count)
    lats, lons = _near(seen, rng)
    if drift.shore is not None:
        on_land = np.empty(count, np.bool_)
        for _ in range(MAX_REDRAWS):
            mark_land(drift.shore, lats, lons, on_land)
            again = np.flatnonzero(on_land)
            seen[again] = draw_sightings(sightings, chosen[again], rng)
            lats[again], lons[again] = _near(seen[again], rng)
            if not len(again):
                break
        else:
            lat_deg, lon_deg, _, radius_m, *_ = seen[again[0]]
            raise ValueError(
                f"a sighting must be at sea, got {lat_deg:g}, {lon_deg:g} within {radius_m:g} m, "
                "on land"
            )
    released = seen[:, 2] + seen[:, 5] * time_draws
    leeway, objects = draw_objects(drift.objects, count, rng)
    particles = Particles(
        lats, lons, released, np.ones(count, np.bool_), leeway, np.zeros((2, count)),
        np.zeros((2, count)),
    )  # fmt: skip
    return particles, objects


NINETY_NINE_PERCENT = math.sqrt(2 * math.log(100))
"""Radius of the circle with 99 % of a bivariate normal distribution, in standard deviations."""


def _near(
    seen: NDArray[np.float64], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return latitudes and longitudes (M,) drawn around those of sightings (M, 6)."""
    north_m, east_m = seen[:, 3] / NINETY_NINE_PERCENT * rng.standard_normal((2, len(seen)))
    return displaced(seen[:, 0], seen[:, 1], east_m, north_m)


def displaced(lat_deg: Any, lon_deg: Any, east_m: Any, north_m: Any) -> tuple[Any, Any]:
    """Return latitude and longitude of places some metres away; numbers or arrays."""
    lat_per_m, lon_per_m = degrees_per_metre(lat_deg)
    return lat_deg + north_m * lat_per_m, lon_deg + east_m * lon_per_m


def steps_both_ways(
    drift: Drift, sightings: Sequence[Seen], times_s: NDArray[np.float64], count: int,
    rng: np.random.Generator,
) -> DriftSteps:  # fmt: skip
    """Return tracks as `drift_steps` does, but of particles that drift before they are seen too.

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
    first_s = min(sighting.first_s for sighting in sightings)
    last_s = max(sighting.last_s for sighting in sightings)
    if last_s <= times_s[0]:
        return drift_steps(drift, sightings, times_s, count, rng)
    # A copy of the generator draws the same particles.
    again = copy.deepcopy(rng)
    seen_first = np.concatenate([[min(first_s, times_s[0])], times_s])
    forward = drift_tracks(drift, sightings, seen_first, count, rng)
    seen_last = np.concatenate([[max(last_s, times_s[-1])], times_s[::-1]])
    backward = drift_tracks(drift, sightings, seen_last, count, again)
    return DriftSteps(_joined(forward, backward), forward.objects, forward.released_s)


def _joined(forward: DriftTracks, backward: DriftTracks) -> Iterator[DriftPositions]:
    """Yield the positions of tracks from where particles were seen, after it and before."""
    # Until it is seen, or back to then, a particle stays where it is seen.
    for ahead in range(1, len(forward.times_s)):
        lats = forward.lats_deg[ahead] + backward.lats_deg[-ahead] - backward.lats_deg[0]
        turned = backward.lons_deg[-ahead] - backward.lons_deg[0]
        lons = forward.lons_deg[ahead] + (turned + 180.0) % 360.0 - 180.0
        ashore = forward.stranded[ahead] | backward.stranded[-ahead]
        yield DriftPositions(lats, (lons + 180.0) % 360.0 - 180.0, ashore)
