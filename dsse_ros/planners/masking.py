# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Masking: replaces actions that an action mask forbids or that would end in an occupied cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dsse_ros.planners.avoidance import resolve_actions
from dsse_ros.planners.planner import Cell, Infos
from dsse_ros.world.scenario.actions import ActionSet
from dsse_ros.world.scenario.swarm import Swarm


def is_returning(info: Mapping[str, Any]) -> bool:
    """Return whether a drone is returning or home: it takes no commands and cannot collide."""
    return info.get("status") in ("returning", "home")


def is_under_way(info: Mapping[str, Any]) -> bool:
    """Return whether a drone does an action of several steps and takes no commands meanwhile."""
    return info.get("status") == "under_way"


def apply_masks(
    actions: Mapping[str, int],
    present: Mapping[str, Cell],
    infos: Infos,
    swarm: Swarm,
) -> dict[str, int]:
    """Return the actions, with those that the masks forbid replaced.

    A drone whose action is forbidden searches where it is or, if it may not search, does its
    first allowed action. Then a drone that would enter another drone's cell searches instead. If
    it may not search, the search command sends it home, above the others.

    Args:
        actions: By agent.
        present: Cells of the agents.
        infos: By agent; an agent without `action_mask` may do anything.
        swarm: What the drones can do; if some are slower, see `keep_apart`.
    """
    masked, action_set = dict(actions), swarm.actions
    for agent, action in actions.items():
        mask = infos[agent].get("action_mask") if agent in infos else None
        if mask is not None and not mask[action] and mask.any():
            allowed = mask[action_set.search]
            masked[agent] = action_set.search if allowed else int(np.flatnonzero(mask)[0])
    if swarm.may_be_under_way:
        return keep_apart(masked, present, infos, action_set)
    if masked == actions:
        return masked
    agents = [agent for agent in masked if not is_returning(infos[agent])]
    cells, numbers = [present[agent] for agent in agents], [masked[agent] for agent in agents]
    return masked | dict(zip(agents, resolve_actions(action_set, cells, numbers), strict=True))


def masked_moves(
    present: Mapping[str, Cell],
    ends: Sequence[Cell],
    infos: Infos,
    swarm: Swarm,
) -> dict[str, int]:
    """Return the masked actions that take drones to these cells; see `apply_masks`."""
    actions = {
        agent: swarm.actions.action(cell, end)
        for (agent, cell), end in zip(present.items(), ends, strict=True)
    }
    return apply_masks(actions, present, infos, swarm)


def keep_apart(
    actions: Mapping[str, int],
    present: Mapping[str, Cell],
    infos: Infos,
    action_set: ActionSet,
) -> dict[str, int]:
    """Return the actions, with a search in place of each move to a cell that may not be free.

    A drone may stay in its cell for some steps after the command to leave it. Until it arrives
    in the next cell, neither cell is free for others. No drone may therefore enter the cell of
    another one, and drones under way, which have no choice, get their next cells before all others.

    Args:
        actions: By agent; the masks allow them.
        present: Cells of the agents.
        infos: By agent; an agent without `action_mask` may do anything.
        action_set: The actions.
    """
    kept = dict(actions)
    agents = [agent for agent in actions if not is_returning(infos.get(agent, {}))]
    taken = {present[agent] for agent in agents}
    bound = {agent for agent in agents if is_under_way(infos.get(agent, {}))}
    kept |= {agent: int(np.argmax(infos[agent]["action_mask"])) for agent in bound}
    for agent in sorted(agents, key=lambda name: name not in bound):
        end = action_set.end(present[agent], kept[agent])
        if end in taken and end != present[agent] and agent not in bound:
            kept[agent] = action_set.search
        taken.add(end)
    return kept
