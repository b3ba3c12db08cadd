# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A straight path looks once at each cell beside it, with the POD of its lateral range."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.world.sensors.lateral_range import LAWS, MIN_POD, in_place, inverse_cube
from dsse_ros.world.sensors.search_theory import inverse_cube_pod, random_search_pod
from dsse_ros.world.sensors.sensor import MAX_LOOKS
from dsse_ros.world.sensors.swept_strip import MAX_WIDTH

HEADINGS = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)]
laws = st.sampled_from(sorted(LAWS))
widths = st.floats(0.01, MAX_WIDTH)


@pytest.mark.slow
@given(laws, widths, st.sampled_from(HEADINGS))
def test_a_straight_path_looks_once_at_each_cell_beside_it(
    law: str, width: float, heading: tuple[int, int]
) -> None:
    pods = LAWS[law](width, heading)
    east, south = heading
    seen = [(dx + k * east, dy + k * south) for k in range(-9, 10) for dx, dy in pods]
    assert len(seen) == len(set(seen))
    assert len(pods) <= MAX_LOOKS
    assert {(k * east, k * south) for k in range(-3, 4)} <= set(seen)
    assert all(MIN_POD <= pod <= 1.0 for pod in pods.values())


@given(st.floats(0.05, MAX_WIDTH), st.sampled_from(HEADINGS))
def test_inverse_cube_pods_beside_a_path_add_up_to_the_sweep_width(
    width: float, heading: tuple[int, int]
) -> None:
    swept = sum(inverse_cube(width, heading).values()) / math.hypot(*heading)
    assert swept == pytest.approx(width, rel=0.04)


@given(laws, widths)
def test_a_search_in_place_has_the_effort_of_a_pass(law: str, width: float) -> None:
    row, column = (LAWS[law](width, heading) for heading in HEADINGS[:2])
    both = in_place((row, column))
    assert len(both) <= MAX_LOOKS
    assert both[0, 0] == pytest.approx(row[0, 0])

    def effort(pods: dict[tuple[int, int], float]) -> float:
        return -sum(math.log1p(-min(pod, 1 - 1e-9)) for pod in pods.values())

    assert effort(both) == pytest.approx(effort(row), abs=1e-6)


@pytest.mark.parametrize(
    ("law", "width", "spacing", "error"),
    [
        ("inverse_cube", 1, 1, 0.012),
        ("inverse_cube", 2, 4, 0.001),
        ("inverse_cube", 8, 4, 0.003),
        ("inverse_cube", 4, 4, 0.003),
        ("inverse_cube", 4, 8, 0.001),
        ("random_search", 0.5, 1, 1e-9),
        ("random_search", 2, 1, 1e-9),
        ("random_search", 4, 2, 1e-9),
    ],
)
def test_parallel_tracks_have_the_pod_of_their_coverage(
    law: str, width: float, spacing: int, error: float
) -> None:
    pods = {dy: pod for (_, dy), pod in LAWS[law](width, (1, 0)).items()}
    missed = [
        np.prod([1.0 - pods.get(row - spacing * track, 0.0) for track in range(-20, 21)])
        for row in range(spacing)
    ]
    of_coverage = {"inverse_cube": inverse_cube_pod, "random_search": random_search_pod}[law]
    assert 1.0 - np.mean(missed) == pytest.approx(of_coverage(width / spacing), abs=error)
