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


def is_under_way(info: Mapping[str, Any]) -> bool:
    """Return whether a slower drone is between two cells: it takes no commands until it arrives."""
    return info.get("status") == "under_way"


def heed_masks(
    actions: Mapping[str, int],
    present: Mapping[str, Cell],
    infos: Mapping[str, Mapping[str, Any]],
    action_set: ActionSet,
    *,
    apart: bool = False,
) -> dict[str, int]:
    """Return the actions, with others in place of those that the masks forbid.

    Such a drone searches where it is, or does the first action that is left to it if it may not.
    One that would meet another then searches: if it may not, it is sent home, above the others.

    Args:
        actions: By agent.
        present: Cells of the agents.
        infos: By agent; one without `action_mask` may do anything.
        action_set: The actions.
        apart: Whether drones are kept out of the cells of others, see `keep_apart`.
    """
    heeded = dict(actions)
    for agent, action in actions.items():
        mask = infos[agent].get("action_mask") if agent in infos else None
        if mask is not None and not mask[action] and mask.any():
            allowed = mask[action_set.search]
            heeded[agent] = action_set.search if allowed else int(np.flatnonzero(mask)[0])
    if apart:
        return keep_apart(heeded, present, infos, action_set)
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


def keep_apart(
    actions: Mapping[str, int],
    present: Mapping[str, Cell],
    infos: Mapping[str, Mapping[str, Any]],
    action_set: ActionSet,
) -> dict[str, int]:
    """Return the actions, with a search in place of each move to a cell that may not be free.

    A drone that is slower than others stays in its cell for some steps after it has been commanded
    to leave it, and arrives later in the next one. Neither is free for others until then. So no
    drone goes where another one is, and those that have no choice, as they are under way, have
    their next cells before all others.

    Args:
        actions: By agent; the masks allow them.
        present: Cells of the agents.
        infos: By agent; one without `action_mask` may do anything.
        action_set: The actions.
    """
    kept = dict(actions)
    agents = [agent for agent in actions if not is_aloft(infos.get(agent, {}))]
    taken = {present[agent] for agent in agents}
    bound = {agent for agent in agents if is_under_way(infos.get(agent, {}))}
    kept |= {agent: int(np.argmax(infos[agent]["action_mask"])) for agent in bound}
    for agent in sorted(agents, key=lambda one: one not in bound):
        (col, row), (dx, dy) = present[agent], action_set.moves[kept[agent]]
        end = (col + dx, row + dy)
        if end in taken and (dx, dy) != (0, 0) and agent not in bound:
            kept[agent] = action_set.search
        taken.add(end)
    return kept
