# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Random actions: the baseline that any planner should beat."""

from __future__ import annotations

import copy

import numpy as np

from dsse_ros.planners.avoidance import resolve_actions
from dsse_ros.planners.masking import keep_apart
from dsse_ros.planners.mission_watch import MissionWatch
from dsse_ros.planners.planner import Infos, Observations, cells_of
from dsse_ros.world.scenario.swarm import Swarm


class RandomMoves:
    """Draws uniformly among the actions that the mask allows.

    If several drones draw a move to the same cell, only one moves: a drone that
    `resolve_conflicts` refuses searches where it is.

    Args:
        swarm: What the drones can do; the masks of the infos say it too.
        watch: Recognizes a mission's first observation, with which the draws begin again.
        seed: Seed of all draws.

    Attributes:
        drawn: See `Shareable`.
    """

    def __init__(self, swarm: Swarm, watch: MissionWatch | None = None, *, seed: int = 0) -> None:
        self._swarm, self._watch = swarm, watch or MissionWatch()
        self._seed, self._rng = seed, np.random.default_rng(seed)
        self.drawn = False

    def copy(self) -> RandomMoves:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._watch, twin._rng = self._watch.copy(), copy.deepcopy(self._rng)
        return twin

    def with_seed(self, seed: int) -> RandomMoves:
        """Return a copy that draws with this seed."""
        twin = self.copy()
        twin._seed, twin._rng = seed, np.random.default_rng(seed)
        return twin

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        if self._watch.is_new(observations, infos):
            self._rng = np.random.default_rng(self._seed)
        draws = self._rng.random(len(observations))
        self.drawn = True
        actions = []
        for agent, draw in zip(observations, draws, strict=True):
            allowed = np.flatnonzero(infos[agent]["action_mask"])
            actions.append(int(allowed[int(draw * allowed.size)]))
        present = cells_of(observations)
        if self._swarm.may_be_under_way:
            drawn = dict(zip(observations, actions, strict=True))
            cells = dict(zip(observations, present, strict=True))
            return keep_apart(drawn, cells, infos, self._swarm.actions)
        resolved = resolve_actions(self._swarm.actions, present, actions)
        return dict(zip(observations, resolved, strict=True))
