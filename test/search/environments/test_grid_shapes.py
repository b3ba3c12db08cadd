# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Grids that are no squares."""

from __future__ import annotations

import numpy as np
import pytest
from areas import scenario_of
from hypothesis import given, settings
from hypothesis import strategies as st
from play import person_cells, some_actions

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import parallel_env

SIZES = st.integers(1, 8)


@settings(deadline=None, max_examples=12)
@given(
    st.sampled_from(["paper", "v2"]), st.sampled_from(["map", "belief"]), SIZES, SIZES,
    st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_a_grid_is_a_square_whose_rest_is_outside_the_area(
    rules: str, observe: str, columns: int, rows: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    mask = np.zeros((max(columns, rows),) * 2, np.bool_)
    mask[:rows, :columns] = True
    # Cells with the same probability but for rounding would draw lots for the person.
    spread = {"sigma_x": rng.uniform(1, 4), "sigma_y": rng.uniform(1, 4)}
    fields = scenario_of(mask, rng, 3) | spread | {"rules": rules, "observe": observe}
    square = parallel_env(**fields)
    grid = parallel_env(**fields | {"area": None, "grid_size": (columns, rows)})
    for env in (square, grid):
        env.reset(seed=seed)
    for _ in range(12):
        assert grid.probability.shape == (rows, columns)
        np.testing.assert_allclose(square.probability[mask].reshape(rows, columns),
                                   grid.probability, rtol=0, atol=1e-6)  # fmt: skip
        assert person_cells(square) == person_cells(grid)
        assert square.positions.tolist() == grid.positions.tolist()
        assert square.action_masks().tolist() == grid.action_masks().tolist()
        if not grid.agents:
            break
        actions = some_actions(grid, rng, careful=True)
        (_, rewards, *_), (_, expected, *_) = grid.step(actions), square.step(actions)
        assert rewards == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_the_grid_of_an_area_is_its_bounding_box_and_v1_takes_squares_only() -> None:
    mask = np.zeros((9, 9), np.bool_)
    mask[2:4, 1:8] = True
    area = scenario_of(mask, np.random.default_rng(0), 1)["area"]
    env = parallel_env(area=area, fit_grid=True, cell_size=130.0)
    assert env.scenario.grid_size == (7, 2) and env.scenario.area_mask is None
    for fields, line in (
        ({"rules": "v1", "grid_size": (7, 2)}, "^grid_size must be a square with rules v1"),
        ({"fit_grid": True}, "^fit_grid must come with an incident or an area"),
        ({"fit_grid": True, "area": area, "grid_size": 3}, "^fit_grid must be false with grid"),
        ({"fit_grid": True, "area": area, "origin_lat": 1.0}, "^origin_lat must not be given"),
    ):
        with pytest.raises(FieldError, match=line):
            parallel_env(**fields)
