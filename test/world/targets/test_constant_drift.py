# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ensemble of a constant drift has the mean and the spread that it states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.targets.constant_drift import tracks

COUNT = 20_000


@pytest.mark.slow
@given(
    st.sampled_from(["paper", "v1", "v2"]),
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.floats(0.1, 4.0),
    st.floats(0.1, 4.0),
    st.floats(0.0, 0.3),
    st.floats(0.0, 50.0),
    st.integers(0, 15),
    st.integers(0, 2**32),
)
def test_particles_spread_about_the_drift_of_the_datum(
    rules: str, vector: tuple[float, float], sigma_x: float, sigma_y: float, growth: float,
    diffusivity: float, steps: int, seed: int,
) -> None:  # fmt: skip
    scenario = Scenario(
        grid_size=30, person_initial_position=(12, 17), vector=vector, sigma_x=sigma_x,
        sigma_y=sigma_y, dispersion_inc=growth, diffusivity=diffusivity, drone_speed=7.0,
    ).resolve(profile(rules))  # fmt: skip
    drawn = tracks(scenario, steps, np.random.default_rng(seed), COUNT)
    assert drawn.positions.shape == (steps + 1, COUNT, 2)
    assert drawn.weights.sum() == pytest.approx(1.0, abs=1e-9)
    cell, time_s = scenario.cell_size, steps * scenario.step_duration_s
    for axis, sigma in enumerate((sigma_x, sigma_y)):
        spread = np.sqrt(
            (sigma * cell) ** 2 + (growth * steps * cell) ** 2 + 2 * diffusivity * time_s
        )
        middle = ((12, 17)[axis] + 0.5 + scenario.drift[axis] * steps) * cell
        where = drawn.positions[-1, :, axis]
        # Five standard errors.
        assert where.mean() == pytest.approx(middle, abs=5 * spread / np.sqrt(COUNT))
        assert where.std() == pytest.approx(spread, rel=5 / np.sqrt(2 * COUNT))


def test_the_velocity_of_a_particle_lasts() -> None:
    scenario = Scenario(grid_size=9, dispersion_inc=0.2, diffusivity=0.0, sigma=1e-6)
    drawn = tracks(scenario.resolve(profile("paper")), 8, np.random.default_rng(0), 100)
    steps = np.diff(drawn.positions, axis=0)
    assert np.allclose(steps, steps[0])
    assert steps[0].std() > 0
