# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of particles: when and where they start, how they move, where they end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from drifting import HOUR_S, displacements, drift_of
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.world.drift import tracks as tracks_module
from dsse_ros.world.drift.flow import Flow, Uncertainty, constant_flow, table_flow
from dsse_ros.world.drift.shore import Box, shore_of
from dsse_ros.world.drift.sightings import Sighting
from dsse_ros.world.drift.tracks import drift_tracks

AT_SEA = Sighting(-24.0, -46.0, 0.0)
NORTH = constant_flow("current", 1.0, 0.0)
EAST = constant_flow("current", 1.0, 90.0)


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def hours(*values: float) -> np.ndarray:
    return np.array(values) * HOUR_S


def test_the_same_generator_gives_the_same_tracks_bit_for_bit() -> None:
    drift = drift_of(
        "PIW-1", wind=constant_flow("wind", 8.0, 30.0), wind_error=Uncertainty(2.0, 600.0),
        current_error=Uncertainty(0.1, 0.0),
    )  # fmt: skip
    one, two = (
        drift_tracks(drift, [AT_SEA._replace(radius_m=300)], hours(0, 1, 2), 500, rng())
        for _ in range(2)
    )
    assert one.lats_deg.tobytes() == two.lats_deg.tobytes()
    assert one.lons_deg.tobytes() == two.lons_deg.tobytes()


@settings(deadline=None, max_examples=30)
@given(st.floats(-75, 75), st.floats(-180, 180), st.floats(0, 2), st.floats(0, 360))
def test_a_current_carries_a_buoy_as_far_as_the_ellipsoid_has_it(
    lat: float, lon: float, speed: float, toward: float
) -> None:
    start = Sighting(lat, lon, 0.0)
    drift = drift_of(current=constant_flow("current", speed, toward))
    tracks = drift_tracks(drift, [start], hours(0, 1), 1, rng())
    east, north = displacements(tracks, start)
    distance = speed * HOUR_S
    # A course is constant along a rhumb line, not along the geodesic between its ends.
    bent = distance**2 / 6.3e6 * abs(math.tan(math.radians(lat))) + 0.01
    assert east[0] == pytest.approx(distance * math.sin(math.radians(toward)), abs=bent)
    assert north[0] == pytest.approx(distance * math.cos(math.radians(toward)), abs=bent)


def test_stokes_drift_adds_to_the_current() -> None:
    one = drift_tracks(
        drift_of("PIW-1", current=NORTH, waves=EAST), [AT_SEA], hours(0, 1), 50, rng()
    )
    both = drift_of("PIW-1", current=constant_flow("current", math.sqrt(2), 45.0))
    other = drift_tracks(both, [AT_SEA], hours(0, 1), 50, rng())
    assert one.lats_deg == pytest.approx(other.lats_deg, abs=1e-9)
    assert one.lons_deg == pytest.approx(other.lons_deg, abs=1e-9)
    short = table_flow(hours(0, 0.5), [(1.0, 0.0)] * 2, "waves.nc")
    with pytest.raises(ValueError, match="waves 'waves.nc' has no value at .*; it covers 1970-01-"):
        drift_tracks(drift_of(waves=short), [AT_SEA], hours(0, 1), 1, rng())


def test_wind_is_stated_by_where_it_comes_from() -> None:
    drift = drift_of("SPORT-BOAT", wind=constant_flow("wind", 10.0, 0.0))
    _, north = displacements(drift_tracks(drift, [AT_SEA], hours(0, 1), 100, rng()), AT_SEA)
    assert north.max() < 0


def test_half_of_the_step_is_enough_to_see_second_order() -> None:
    """In an eddy the error of the midpoint rule falls by four when the step is halved."""
    axis = np.linspace(-0.2, 0.2, 3)
    east, north = -20 * axis[:, None] + 0 * axis, 20 * axis + 0 * axis[:, None]
    eddy = Flow(
        np.zeros(1), axis, axis, east[None].astype(np.float32), north[None].astype(np.float32)
    )
    start = Sighting(0.1, 0.0, 0.0)

    def end(step_s: float) -> np.ndarray:
        times = np.array([0.0, 9600.0])
        tracks = drift_tracks(drift_of(current=eddy), [start], times, 1, rng(), step_s=step_s)
        return np.array([tracks.lats_deg[-1, 0], tracks.lons_deg[-1, 0]])

    exact = end(5.0)
    coarse, fine = (np.linalg.norm(end(step) - exact) for step in (2400.0, 1200.0))
    assert coarse / fine == pytest.approx(4.0, rel=0.3)


def test_a_long_drift_of_many_particles_takes_longer_steps_that_move_no_moment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drift = drift_of(
        "PIW-1", wind=constant_flow("wind", 8.0, 30.0), wind_error=Uncertainty(2.0, 3600.0),
        current=EAST,
    )  # fmt: skip
    taken: list[int] = []

    def places() -> np.ndarray:
        step = tracks_module._step
        taken.append(0)

        def counted(*arguments: Any) -> None:
            taken[-1] += 1
            step(*arguments)

        monkeypatch.setattr(tracks_module, "_step", counted)
        found = drift_tracks(drift, [AT_SEA], hours(12), 4000, rng())
        monkeypatch.setattr(tracks_module, "_step", step)
        return np.array(displacements(found, AT_SEA))

    usual = places()
    monkeypatch.setattr(tracks_module, "MOST_MOVES", 1)
    longer = places()
    # At most ten minutes, and a sixth of the time in which the error changes.
    assert taken == [720, 72]
    spread = usual.std(axis=1)
    assert (abs(longer.mean(axis=1) - usual.mean(axis=1)) < 0.06 * spread).all()
    assert longer.std(axis=1) == pytest.approx(spread, rel=0.05)


def test_particles_drift_from_the_time_of_their_sighting() -> None:
    seen = [AT_SEA, AT_SEA._replace(time_s=1.5 * HOUR_S + 7)]
    tracks = drift_tracks(drift_of(current=NORTH), seen, hours(0, 1, 2), 1000, rng())
    north = np.array([displacements(tracks, AT_SEA, i)[1] for i in range(3)])
    early, late = north[:, north[1] > 1], north[:, north[1] < 1]
    assert early.shape == late.shape == (3, 500)
    assert early[2] == pytest.approx(7200, abs=0.1)
    assert late[1] == pytest.approx(0, abs=1e-6) and late[2] == pytest.approx(1793, abs=0.1)


def test_sightings_share_the_particles_by_weight() -> None:
    seen = [AT_SEA._replace(weight=3.0), Sighting(-23.0, -46.0, 0.0, weight=1.0)]
    tracks = drift_tracks(drift_of(), seen, hours(0), 1001, rng())
    assert (tracks.lats_deg[0] < -23.5).sum() in (750, 751)


def test_a_sighting_has_99_percent_within_its_radius() -> None:
    start = AT_SEA._replace(radius_m=500.0)
    tracks = drift_tracks(drift_of(), [start], hours(0), 20_000, rng())
    distance = np.hypot(*displacements(tracks, start))
    assert (distance < 500).mean() == pytest.approx(0.99, abs=0.004)


def test_backward_tracks_end_where_forward_ones_began() -> None:
    wind = table_flow(hours(0, 2), [(5.0, 1.0), (-3.0, 6.0)])
    drift = drift_of("SLDMB", wind=wind, current=NORTH)
    ahead = drift_tracks(drift, [AT_SEA], hours(0, 2), 1, rng())
    found = Sighting(ahead.lats_deg[-1, 0], ahead.lons_deg[-1, 0], 2 * HOUR_S)
    back = drift_tracks(drift, [found], hours(2, 0), 1, rng())
    assert back.lats_deg[-1, 0] == pytest.approx(AT_SEA.lat_deg, abs=1e-9)
    assert back.lons_deg[-1, 0] == pytest.approx(AT_SEA.lon_deg, abs=1e-9)


@pytest.mark.parametrize("correlation_s", [0.0, 900.0, math.inf])
def test_the_error_of_a_current_spreads_as_its_correlation_time_has_it(
    correlation_s: float,
) -> None:
    std, step, count, time = 0.2, 60.0, 4000, 2 * HOUR_S
    drift = drift_of(current=EAST, current_error=Uncertainty(std, correlation_s))
    east, north = displacements(
        drift_tracks(drift, [AT_SEA], np.array([0.0, time]), count, rng()), AT_SEA
    )
    n = round(time / step)
    kept = math.exp(-step / correlation_s) if correlation_s else 0.0
    squares = n + 2 * sum((n - lag) * kept**lag for lag in range(1, n))
    wanted = std * step * math.sqrt(squares)
    for values, mean in ((east, time), (north, 0.0)):
        assert values.mean() == pytest.approx(mean, abs=5 * wanted / math.sqrt(count) + 5)
        assert values.std() == pytest.approx(wanted, rel=5 / math.sqrt(2 * count))


def test_the_drift_does_not_depend_on_the_times_that_are_asked_for() -> None:
    drift = drift_of("PIW-1", wind=constant_flow("wind", 8.0, 200.0))
    often = drift_tracks(drift, [AT_SEA], hours(0, 0.5, 1), 100, rng())
    once = drift_tracks(drift, [AT_SEA], hours(0, 1), 100, rng())
    assert often.lats_deg[-1] == pytest.approx(once.lats_deg[-1], abs=1e-12)


def test_particles_strand_at_the_shore_and_stay_there() -> None:
    shore = shore_of(lambda lat, lon: lon > -45.98, Box(-24.1, -23.9, -46.1, -45.9))
    drift = drift_of(current=EAST, shore=shore)
    tracks = drift_tracks(drift, [AT_SEA], hours(0, 0.5, 1, 2), 10, rng())
    assert tracks.stranded.all(axis=1).tolist() == [False, False, True, True]
    assert (tracks.lons_deg[2] == tracks.lons_deg[3]).all()
    # The last position at sea is at most a cell of the raster, 20 m, from the shore.
    assert tracks.lons_deg[3] == pytest.approx(-45.98, abs=2.1e-4)


def test_no_particle_crosses_a_spit_in_a_long_step() -> None:
    shore = shore_of(lambda lat, lon: abs(lon + 45.98) < 0.0002, Box(-24.1, -23.9, -46.1, -45.9))
    drift = drift_of(current=EAST, shore=shore)
    tracks = drift_tracks(drift, [AT_SEA], hours(0, 2), 10, rng(), step_s=2 * HOUR_S)
    assert tracks.stranded[-1].all() and (tracks.lons_deg[-1] < -45.98).all()


def test_a_sighting_near_the_shore_is_of_an_object_at_sea() -> None:
    shore = shore_of(lambda lat, lon: lon > -46.0, Box(-24.1, -23.9, -46.1, -45.9))
    seen = AT_SEA._replace(radius_m=500.0)
    tracks = drift_tracks(drift_of(shore=shore), [seen], hours(0), 1000, rng())
    assert (tracks.lons_deg < -45.9998).all() and not tracks.stranded.any()
    with pytest.raises(ValueError, match="a sighting must be at sea, got -24, -45.95 within 100 m"):
        inland = Sighting(-24.0, -45.95, 0.0, 100.0)
        drift_tracks(drift_of(shore=shore), [inland], hours(0), 1000, rng())


def test_a_time_that_the_wind_does_not_cover_is_refused_in_a_line() -> None:
    wind = table_flow(hours(0, 1), [(1.0, 0.0), (1.0, 0.0)], "wind.csv")
    with pytest.raises(
        ValueError, match="wind 'wind.csv' has no value at -24.* it covers 1970-01-"
    ):
        drift_tracks(drift_of(wind=wind), [AT_SEA], hours(0, 2), 10, rng())


def test_a_current_with_land_at_one_side_is_that_of_the_sea() -> None:
    lons = np.array([-46.1, -46.0, -45.9])
    east = np.array([[[1.0, 1.0, np.nan]] * 2], np.float32)
    current = Flow(np.zeros(1), np.array([-24.1, -23.9]), lons, east, 0 * east)
    tracks = drift_tracks(drift_of(current=current), [AT_SEA], hours(0, 1), 1, rng())
    assert displacements(tracks, AT_SEA)[0][0] == pytest.approx(3600, abs=1)
    with pytest.raises(ValueError, match="current '' has no value"):
        drift_tracks(drift_of(current=current), [AT_SEA], hours(0, 9), 1, rng())
