# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Simulated tracks find the shares of persons that search theory gives for their coverage."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.sensors.search_theory import inverse_cube_pod, random_search_pod
from dsse_ros.world.sensors.sweep_width import KNOT_MPS

V2 = profile("v2")
SIDE, MISSIONS, PASS = 81, 4000, 3
SWEEP_WIDTH_M = 185.2
"""A person in the water, from a helicopter at 300 ft and 90 kt."""
SIGMAS = 3.5


def share_found(law: str, width: float, rows: NDArray[np.int64], seed: int) -> float:
    """Return the share of persons found near the middle of the grid.

    Args:
        law: Law of detection.
        width: Sweep width in cells.
        rows: (N,) or (`MISSIONS`, N) rows of the tracks, which go east.
        seed: Seed of the missions and of the persons' cells.
    """
    rng = np.random.default_rng(seed)
    count = rows.shape[-1]
    scenario = Scenario(
        grid_size=SIDE, num_drones=count, sensor="sweep_width", detection_law=law,
        cell_size=SWEEP_WIDTH_M / width, altitude=91.44, drone_speed=90 * KNOT_MPS,
    )  # fmt: skip
    world = World(scenario, V2, MISSIONS, write_maps=False)
    world.seed(seed)
    world.reset()
    world.drones["x"], world.drones["y"] = 0, rows
    # One period of up to 16 rows, and each column of the pass.
    place = {"x": rng.integers(1, PASS + 1, MISSIONS), "y": 32 + rng.integers(0, 16, MISSIONS)}
    found = np.zeros(MISSIONS, bool)
    for _ in range(PASS):
        for axis, cells in place.items():
            world.persons[axis][:, 0] = cells
        world.step(np.full((MISSIONS, count), V2.actions.index("right"), np.int8))
        found |= world.persons["found"][:, 0]
    return float(found.mean())


def assert_within_sampling_error(share: float, pod: float) -> None:
    assert share == pytest.approx(pod, abs=SIGMAS * (pod * (1 - pod) / MISSIONS) ** 0.5)


@pytest.mark.parametrize(("width", "spacing"), [(2, 8), (4, 8), (4, 4), (8, 4)])
def test_parallel_tracks_have_the_pod_of_the_inverse_cube_law(width: float, spacing: int) -> None:
    share = share_found("inverse_cube", width, np.arange(0, SIDE, spacing), seed=1)
    assert_within_sampling_error(share, inverse_cube_pod(width / spacing))


@pytest.mark.parametrize(("width", "spacing"), [(0.5, 1), (1, 1), (4, 2)])
def test_parallel_tracks_of_random_effort_have_the_pod_of_random_search(
    width: float, spacing: int
) -> None:
    share = share_found("random_search", width, np.arange(0, SIDE, spacing), seed=2)
    assert_within_sampling_error(share, random_search_pod(width / spacing))


@pytest.mark.parametrize("covered", [0.5, 1.0, 2.0])
def test_tracks_at_random_have_the_pod_of_random_search(covered: float) -> None:
    tracks = np.random.default_rng(3).integers(0, SIDE, (MISSIONS, round(covered * SIDE)))
    share = share_found("inverse_cube", 1.0, tracks, seed=3)
    assert_within_sampling_error(share, random_search_pod(covered))


def test_a_sweep_width_of_too_many_cells_is_refused_in_a_line() -> None:
    with pytest.raises(
        FieldError, match="cell_size must be at least 662.09 m for a sweep width of 5296.72 m"
    ) as error:
        parallel_env(sensor="sweep_width", search_object="raft_4_person")
    assert "\n" not in str(error.value)
