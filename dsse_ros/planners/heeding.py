# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Heeding the action masks: what is done in place of an action that a mask forbids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dsse_ros.planners.avoidance import resolve_conflicts
from dsse_ros.planners.planner import Cell
from dsse_ros.scenario.actions import ActionSet


def is_aloft(info: Mapping[str, Any]) -> bool:
    """Return whether a drone goes home, or is there: it takes no commands and meets nobody."""
    return info.get("status") in ("returning", "home")


def heed_masks(
    actions: Mapping[str, int],
    present: Mapping[str, Cell],
    infos: Mapping[str, Mapping[str, Any]],
    action_set: ActionSet,
) -> dict[str, int]:
    """Return the actions, with others in place of those that the masks forbid.

    Such a drone searches where it is, or does the first action that is left to it if it may not.
    One that would meet another then searches: if it may not, it is sent home, above the others.

    Args:
        actions: By agent.
        present: Cells of the agents.
        infos: By agent; one without `action_mask` may do anything.
        action_set: The actions.
    """
    heeded = dict(actions)
    for agent, action in actions.items():
        mask = infos[agent].get("action_mask") if agent in infos else None
        if mask is not None and not mask[action] and mask.any():
            allowed = mask[action_set.search]
            heeded[agent] = action_set.search if allowed else int(np.flatnonzero(mask)[0])
    if heeded == actions:
        return heeded
    agents = [agent for agent in heeded if not is_aloft(infos[agent])]
    cells = [present[agent] for agent in agents]
    moves = [action_set.moves[heeded[agent]] for agent in agents]
    requested = [(col + dx, row + dy) for (col, row), (dx, dy) in zip(cells, moves, strict=True)]
    granted = resolve_conflicts(cells, requested)
    for agent, cell, end in zip(agents, requested, granted, strict=True):
        if cell != end:
            heeded[agent] = action_set.search
    return heeded
