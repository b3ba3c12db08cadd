# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Coverage, POD and search radius are those that a search coordinator works out by hand."""

from __future__ import annotations

import pytest

from dsse_ros.world.sensors.search_theory import (
    coverage,
    inverse_cube_pod,
    random_search_pod,
    search_radius,
    total_probable_error,
)


def test_a_coverage_of_one_gives_63_or_79_percent() -> None:
    # Ten tracks of 20 nm, 2 nm apart, with a sweep width of 2 nm.
    of_area = coverage(2.0, 10 * 20.0, 400.0)
    assert of_area == 1.0
    assert round(random_search_pod(of_area), 2) == 0.63
    assert round(inverse_cube_pod(of_area), 2) == 0.79


@pytest.mark.parametrize("covered", [0.1, 0.5, 1.0, 2.0])
def test_equal_spacing_never_detects_less_than_random_tracks(covered: float) -> None:
    assert 0 < random_search_pod(covered) < inverse_cube_pod(covered) < min(covered, 1.0)


def test_searches_widen_around_a_total_probable_error_of_13_nm() -> None:
    error = total_probable_error(3.0, 12.0, 4.0)
    radii = [search_radius(error, search) for search in range(1, 6)]
    assert error == 13.0
    assert [round(radius, 1) for radius in radii] == [14.3, 20.8, 26.0, 29.9, 32.5]
    assert [round(4 * radius**2) for radius in radii] == [818, 1731, 2704, 3576, 4225]


def test_a_first_search_by_hand() -> None:
    # A visual fix of 1 nm, a drift error of 0.3 of 6 nm, navigation by GPS: all with one decimal.
    error = total_probable_error(1.0, 0.3 * 6.0, 0.1)
    assert round(error, 1) == 2.1
    assert round(search_radius(error), 1) == 2.3


@pytest.mark.parametrize("search", [0, 6])
def test_a_search_without_a_factor_is_refused(search: int) -> None:
    with pytest.raises(ValueError, match=f"search must be from 1 to 5, got {search}"):
        search_radius(1.0, search)
