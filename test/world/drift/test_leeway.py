# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every class drifts as its published coefficients have it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import HOUR_S, STILL, displacements, drift_of
from exact_leeway import exact
from published_speeds import PUBLISHED_SPEEDS

from dsse_ros.world.drift.flow import constant_flow
from dsse_ros.world.drift.leeway import (
    Component,
    LeewayClass,
    PossibleObject,
    draw_leeway,
    draw_objects,
    leeway_class,
    leeway_classes,
)
from dsse_ros.world.drift.sightings import Sighting
from dsse_ros.world.drift.tracks import Drift, drift_tracks

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


OPENDRIFT: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[2] / "oracles" / "data" / "opendrift_leeway.json").read_text()
)["rows"]
"""Mean and standard deviation of its particles, downwind and to the left, in m. Its sides are
mirrored. When an object jibes, the sign of the slope changes, which for the classes recorded with
jibing is the other side."""


def opendrift_moments(row: dict[str, Any]) -> tuple[float, float, float, float]:
    """As those of `exact`: up to 1.14.12, OpenDrift's left is right."""
    return (*row["downwind_m"], *row["left_m"])


@pytest.mark.parametrize("row", OPENDRIFT, ids=lambda row: f"{row['class']}-{row['jibing']}")
def test_each_class_drifts_as_in_opendrift_within_one_percent(row: dict[str, Any]) -> None:
    wanted = exact(leeway_class(row["class"]), 10.0, row["jibing"], row["step_s"], TIME_S)
    down, down_std, cross, cross_std = opendrift_moments(row)
    distance = math.hypot(*wanted)
    assert (down, cross) == pytest.approx((wanted.down, wanted.cross), abs=0.01 * distance)
    assert (down_std, cross_std) == pytest.approx((wanted.down_std, wanted.cross_std), rel=0.01)


def test_opendrift_was_recorded_for_each_class() -> None:
    recorded = [row["class"] for row in OPENDRIFT if not row["jibing"]]
    assert sorted(recorded) == sorted(leeway_classes())


PLAYED = ("PIW-1", "PIW-4", "SKIFF-2", "LIFE-RAFT-SB-6", "LIFE-RAFT-SB-10", "SKIFF-1")


@pytest.mark.slow
@pytest.mark.parametrize(
    "row",
    [row for row in OPENDRIFT if row["class"] in PLAYED],
    ids=lambda row: f"{row['class']}-{row['jibing']}",
)
def test_our_particles_are_where_those_of_opendrift_are(row: dict[str, Any]) -> None:
    count = 100_000
    down, left = after(row["class"], row["jibing"], row["step_s"], count)
    moments = opendrift_moments(row)
    for values, mean, std in zip((down, -left), moments[::2], moments[1::2], strict=True):
        # Both are samples, so their errors add up.
        error = 4 * std * np.sqrt(2 / count)
        assert values.mean() == pytest.approx(mean, abs=error)
        assert values.std() == pytest.approx(std, abs=error)


def test_all_published_classes_are_known_once_with_their_sources() -> None:
    classes = leeway_classes()
    assert len(classes) == 85
    assert len({category.description for category in classes.values()}) == 85
    sources = {"A99", "O06", "T06", "B11", "B12", "S10"}
    assert {category.source.split(", ")[0] for category in classes.values()} == sources


def components(category: LeewayClass) -> tuple[Component, Component, Component]:
    return category.downwind, category.right, category.left


def speeds_cmps(category: LeewayClass, wind_mps: float) -> list[float]:
    return [part.slope_pct * wind_mps + part.offset_cmps for part in components(category)]


@pytest.mark.parametrize("category", leeway_classes().values(), ids=lambda category: category.key)
def test_each_class_is_complete_and_plausible(category: LeewayClass) -> None:
    assert all(math.isfinite(value) for part in components(category) for value in part)
    assert all(part.std_cmps >= 0 for part in components(category))
    # A steady wind at sea: nothing drifts upwind, or faster than a tenth of the wind.
    for wind_mps in (10.0, 20.0):
        down, right, left = (
            part.slope_pct * wind_mps + part.offset_cmps for part in components(category)
        )
        assert 0 <= down <= 10 * wind_mps
        # docs/leeway.md: both halves of this one drift to the left.
        assert right >= left or category.key == "OVATEK-CRAFT-6"
        assert max(abs(right), abs(left)) <= 8 * wind_mps
    assert all(leeway_class(name) is category for name in (category.key, *category.aliases))


@pytest.mark.parametrize("key", PUBLISHED_SPEEDS)
def test_each_class_of_the_manual_has_the_speed_of_the_manual(key: str) -> None:
    category, published = leeway_class(key), PUBLISHED_SPEEDS[key]
    slope = math.hypot(category.downwind.slope_pct, category.right.slope_pct)
    angle_deg = math.degrees(math.atan2(category.right.slope_pct, category.downwind.slope_pct))
    is_slope = slope == pytest.approx(published.slope_pct, abs=0.05)
    is_slope &= angle_deg == pytest.approx(published.divergence_deg, abs=4)
    down, right, left = speeds_cmps(category, 10.0)
    speed = (math.hypot(down, right) + math.hypot(down, left)) / 2
    is_speed = speed == pytest.approx(published.at(10.0), rel=0.09)
    # docs/leeway.md names these two.
    assert (is_slope or is_speed) == (key not in ("PIW-6", "LIFE-RAFT-NB-5"))


def test_particles_of_several_objects_drift_as_each_of_these_by_its_weight() -> None:
    weights = {"PIW-1": 1.0, "LIFE-RAFT-DB-12": 2.0, "SLDMB": 0.5}
    objects = tuple(PossibleObject(leeway_class(key), weight) for key, weight in weights.items())
    drift = Drift(objects, WEST, STILL, jibing_per_hour=0.0)
    # Half of the particles begin at each sighting.
    seen = [AT_SEA, AT_SEA._replace(time_s=HOUR_S)]
    times = np.array([0.0, TIME_S])
    tracks = drift_tracks(drift, seen, times, 7 * COUNT, np.random.default_rng(7), step_s=600.0)
    down, left = displacements(tracks, AT_SEA)
    assert tracks.objects is not None
    assert np.bincount(tracks.objects) == pytest.approx([2 * COUNT, 4 * COUNT, COUNT], abs=1)
    for number, (category, _, _) in enumerate(objects):
        own = tracks.objects == number
        early, late = (
            exact(category, 10.0, 0.0, 600.0, time) for time in (TIME_S, TIME_S - HOUR_S)
        )
        count = own.sum()
        for values, means, stds in (
            (down, (early.down, late.down), (early.down_std, late.down_std)),
            (-left, (early.cross, late.cross), (early.cross_std, late.cross_std)),
        ):
            mean, square = np.mean(means), np.mean(np.square(means) + np.square(stds))
            std = np.sqrt(max(square - mean**2, 0.0))
            assert values[own].mean() == pytest.approx(mean, abs=5 * std / np.sqrt(count) + 1.0)
            assert values[own].std() == pytest.approx(std, abs=5 * std / np.sqrt(count) + 1.0)


def test_a_single_object_draws_as_if_there_were_no_choice() -> None:
    alone, drawn = draw_objects(
        (PossibleObject(leeway_class("PIW-4"), 3.0),), 100, np.random.default_rng(1)
    )
    assert drawn is None
    wanted = draw_leeway(leeway_class("PIW-4"), 100, np.random.default_rng(1))
    assert all(np.array_equal(*pair) for pair in zip(alone, wanted, strict=True))


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


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("piw-1", "PIW-1"),
        ("PIW1", "PIW-1"),
        ("person in water", "PIW-1"),
        ("kayak", "PERSON-POWERED-VESSEL-1"),
        ("Surf-Board", "PERSON-POWERED-VESSEL-2"),
        ("LIFE_RAFT_NB1", "LIFE-RAFT-NB-1"),
        ("sailboat 6B", "SAILBOAT-6b"),
    ],
)
def test_a_class_has_the_names_that_people_use(name: str, key: str) -> None:
    assert leeway_class(name).key == key


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("PIW-9", "did you mean PIW-"),
        ("kayac", "did you mean PERSON-POWERED-VESSEL-1?"),
        ("deceased", "did you mean PIW-6?"),
        ("life raft", "did you mean LIFE-RAFT-NB-1 or LIFE-RAFT-SB-6 or LIFE-RAFT-DB-10 or "),
        ("catamaran", "known are PIW-1, PIW-2, "),
        ("", "known are PIW-1, PIW-2, "),
    ],
)
def test_an_unknown_class_is_refused_with_those_that_may_be_meant(name: str, hint: str) -> None:
    with pytest.raises(ValueError) as refused:
        leeway_class(name)
    assert str(refused.value).startswith(f"object must be a class of leeway, got {name!r}; {hint}")
