# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every class drifts as its published coefficients have it."""

from __future__ import annotations

import numpy as np
import pytest
from drifting import HOUR_S, displacements, drift_of
from exact_leeway import exact

from dsse_ros.drift.flow import constant_flow
from dsse_ros.drift.leeway import draw_leeway, leeway_class, leeway_classes
from dsse_ros.drift.tracks import Sighting, drift_tracks

COUNT = 4_000
TIME_S = 6 * HOUR_S
AT_SEA = Sighting(0.0, -30.0, 0.0)
WEST = constant_flow("wind", 10.0, 270.0)


def after(key: str, jibing: float, step_s: float, count: int = COUNT, **options):
    """Metres to the east and to the north after six hours in a wind of 10 m/s to the east."""
    drift = drift_of(key, wind=WEST, jibing_per_hour=jibing, **options)
    rng = np.random.default_rng(7)
    times = np.array([0.0, TIME_S])
    return displacements(drift_tracks(drift, [AT_SEA], times, count, rng, step_s=step_s), AT_SEA)


# Classes differ in their coefficients only, so one of them shows what shorter steps change.
@pytest.mark.parametrize("jibing", [0.0, 0.04, 0.5])
@pytest.mark.parametrize(
    ("key", "step_s"), [*((key, 600.0) for key in leeway_classes()), ("PIW-1", 60.0)]
)
def test_each_class_has_the_exact_mean_and_spread(key: str, jibing: float, step_s: float) -> None:
    wanted = exact(leeway_class(key), 10.0, jibing, step_s, TIME_S)
    down, left = after(key, jibing, step_s)
    cross = -left
    for found, mean, std in ((down, *wanted[:2]), (cross, *wanted[2:])):
        # Five standard errors, and what the Earth's curvature does to a plane's metres.
        assert found.mean() == pytest.approx(mean, abs=5 * std / np.sqrt(COUNT) + 1.0)
        # The sides make two peaks, whose kurtosis is below a normal one.
        assert found.std() == pytest.approx(std, abs=5 * std / np.sqrt(2 * COUNT) + 1.0)


OPENDRIFT = [
    ("PIW-1", 0.04, (2371.6, 2304.9, 10797.2, 2301.6)),
    ("PIW-1", 0.0, (2371.6, 2304.9, 10795.8, 2343.6)),
    ("PIW-1", 0.5, (2371.6, 2304.9, 10797.8, 2099.6)),
    ("PIW-4", 0.0, (3933.6, 846.1, 10113.7, 1578.8)),
    ("SKIFF-2", 0.0, (7057.2, 716.9, 11328.1, 840.0)),
    ("LIFE-RAFT-DB-11", 0.0, (7168.0, 1377.8, 10863.5, 1261.1)),
]
"""Class, jibing per hour; mean and deviation to the east, then to the north, in m:
OpenDrift 1.14.12 with 100 000 particles after 6 h in steps of 600 s, wind 10 m/s to the east,
current .5 m/s to the north. The sides of its coefficients are mirrored, because up to 1.14.12 a
positive crosswind component points to the left. There jibing changes the sign of the slope, which
is the same for classes whose sides are mirror images."""


@pytest.mark.slow
@pytest.mark.parametrize(("key", "jibing", "wanted"), OPENDRIFT)
def test_the_drift_is_that_of_opendrift(
    key: str, jibing: float, wanted: tuple[float, float, float, float]
) -> None:
    count = 100_000
    north = constant_flow("current", 0.5, 0.0)
    found = after(key, jibing, 600.0, count, current=north)
    for values, mean, std in zip(found, wanted[::2], wanted[1::2], strict=True):
        # Both are samples, so their errors add up.
        error = 4 * std * np.sqrt(2 / count)
        assert values.mean() == pytest.approx(mean, abs=error)
        assert values.std() == pytest.approx(std, abs=error)


def test_a_positive_crosswind_component_points_to_the_right_of_downwind() -> None:
    # The even particles have the coefficients `right`: 1.36 % of 10 m/s less 3.3 cm/s for 6 h.
    down, north = after("PIW-4", 0.0, 600.0)
    assert north[::2].mean() == pytest.approx(-2227, abs=40)
    assert north[1::2].mean() == pytest.approx(854, abs=40)
    assert down.mean() == pytest.approx(3935, abs=80)


def test_who_jibes_takes_the_coefficients_of_the_other_side_and_keeps_the_draw() -> None:
    category = leeway_class("PIW-4")
    drawn = draw_leeway(category, 1000, np.random.default_rng(1))
    slope, offset, std = np.where(
        np.arange(1000)[:, None] % 2 == 0, category.right, category.left
    ).T
    other_slope, other_offset, other_std = np.where(
        slope[:, None] == category.right[0], category.left, category.right
    ).T
    draw = (100 * drawn.crosswind_slope - slope) * 20 / std
    assert 100 * drawn.crosswind_mps == pytest.approx(offset + std * draw / 2)
    assert 100 * drawn.other_slope == pytest.approx(other_slope + other_std * draw / 20)
    assert 100 * drawn.other_mps == pytest.approx(other_offset + other_std * draw / 2)
    # Nearly everybody jibes in the first step, and again in the second.
    always = {"wind": WEST, "jibing_per_hour": 0.999}
    times = np.array([0.0, 4 * HOUR_S, 8 * HOUR_S])
    tracks = drift_tracks(
        drift_of("PIW-4", **always), [AT_SEA], times, 1000, np.random.default_rng(7),
        step_s=4 * HOUR_S,
    )  # fmt: skip
    north = np.array([displacements(tracks, AT_SEA, index)[1] for index in (1, 2)])
    first, second = north[0], north[1] - north[0]
    assert first[::2].mean() == pytest.approx(second[1::2].mean(), abs=60)
    assert first[1::2].mean() == pytest.approx(second[::2].mean(), abs=60)


def test_the_error_spreads_particles_in_a_calm_and_the_downwind_slope_is_never_negative() -> None:
    piw = leeway_class("PIW-1")
    drawn = draw_leeway(piw, COUNT, np.random.default_rng(1))
    assert (drawn.downwind_slope >= 0).all()
    assert drawn.downwind_mps.std() > 0.03 and drawn.crosswind_mps.std() > 0.04


def test_an_unknown_class_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(ValueError, match="object must be a class of leeway, got 'piw1'; .*PIW-1"):
        leeway_class("piw1")
