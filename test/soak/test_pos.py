# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compare the POS with finds for a short time. A wrong belief does not pass."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from promises import keep

from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from soak.pos import SEED, SIGMAS, Combination, figures_of, play


def test_the_pos_is_the_share_that_missions_find(tmp_path: Path) -> None:
    keep("pos", "pos", tmp_path)


class _WrongPod(WorldBeliefs):
    """Assume a POD that is a fifth too high."""

    def reset(self, *args: Any) -> None:
        super().reset(*args)
        self._pods = self._pods * 1.2


class _NoDrift(WorldBeliefs):
    """Assume that there is no current."""

    def reset(self, *args: Any) -> None:
        world = self._world
        still = world.placed_scenario().override(vector=(0.0, 0.0)).resolve(world.rules)
        with patch.object(world, "placed_scenario", lambda: still):
            super().reset(*args)


class _NoScatter(WorldBeliefs):
    """Assume that all persons start in one cell."""

    def reset(self, *args: Any) -> None:
        super().reset(*args)
        for of_classes in self.masses:
            first, second = np.split(of_classes, 2, axis=1)
            second[:] = first


class _FindsForgotten(WorldBeliefs):
    """Assume after each find that all persons are still missing."""

    def after_step(self, *args: Any) -> None:
        super().after_step(*args)
        self.missing[:] = 1.0


@pytest.mark.parametrize(
    ("belief", "pods"),
    [
        (_WrongPod, (0.3,)),
        (_NoDrift, (0.5, 0.5)),
        (_NoScatter, (0.5, 0.5)),
        (_FindsForgotten, (0.5, 0.5)),
    ],
)
def test_a_wrong_belief_is_beyond_three_standard_errors(
    belief: type[WorldBeliefs], pods: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("soak.pos.WorldBeliefs", belief)
    figures = figures_of(play(Combination(pods, one_find=True), 500, SEED))
    assert max(abs(figures["share_z"]), abs(figures["hazard_z"])) > SIGMAS
    assert figures["shares_beyond"] + figures["hazards_beyond"] > 0
