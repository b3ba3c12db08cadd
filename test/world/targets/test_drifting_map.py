# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A drifting map is the given one, moved by whole cells."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.search.step.cell_tracks import tracks_of
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

RULES = profile("paper", person_motion="drifting_map")
SIDE, STEPS = 9, 6


@given(
    cell=st.floats(0.1, 5000.0),
    # Of eighths every multiple is exact, and halves lie on the edges of cells.
    eighths=st.tuples(st.integers(-16, 16), st.integers(-16, 16)),
)
def test_whatever_the_cell_size_every_cell_moves_by_the_same_whole_cells(
    cell: float, eighths: tuple[int, int]
) -> None:
    matrix = np.arange(1.0, SIDE**2 + 1).reshape(SIDE, SIDE)
    scenario = Scenario(
        probability_matrix=matrix, cell_size=cell, vector=(eighths[0] / 8, eighths[1] / 8),
        timestep_limit=STEPS,
    )  # fmt: skip
    tracks = tracks_of(scenario.resolve(RULES), RULES)
    assert tracks is not None
    for step in range(STEPS):
        dx, dy = (math.floor(part * step / 8 + 0.5) for part in eighths)
        moved = np.zeros((3 * SIDE, 3 * SIDE))
        if max(abs(dx), abs(dy)) < SIDE:
            moved[SIDE + dy : 2 * SIDE + dy, SIDE + dx : 2 * SIDE + dx] = matrix
        there = moved[SIDE : 2 * SIDE, SIDE : 2 * SIDE] / matrix.sum()
        assert np.allclose(tracks.maps[step], there, atol=1e-7)
