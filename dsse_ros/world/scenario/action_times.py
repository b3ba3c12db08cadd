# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long the actions of a kind of drone take, in steps.

A step lasts as long as the fastest kind needs for a straight move without wind. Rules with
`timed_actions` give each action its own time: a move its length over the ground speed, a search
what the kind needs to come down, look and climb. Other rules give each action one step; only wind,
or a kind that is slower than the fastest one, makes a move take longer. With
`vehicle_timed_actions` these times are estimates: the vehicles report when they are over.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from dsse_ros.base.compiled.breadth_first import ROUNDING
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.searchers.searcher import Searcher
from dsse_ros.world.sensors.sensor import SEARCH


class ActionTimes(NamedTuple):
    """The times of a kind's actions.

    Attributes:
        shares: (A,) share of each action that one step covers, at most 1; 0 for an action that the
            kind cannot do.
        takes: (A,) steps from the command to the effect of each action, at least 1.
        after: (A,) steps from the effect until the drone takes its next command.
        binding: Whether a drone finishes each action that it begins: meanwhile it is under way.
    """

    shares: list[float]
    takes: list[float]
    after: list[float]
    binding: bool


def action_times(
    scenario: ResolvedScenario, rules: Rules, kind: Searcher | None = None
) -> ActionTimes:
    """Return how long the actions of a kind take in the wind.

    Args:
        scenario: Sets the wind and the length of a step.
        rules: Set the actions.
        kind: One of the scenario's kinds; by default as fast as the fastest, with all actions.
    """
    fastest = max(scenario.speeds)
    speed = fastest if kind is None or kind.speed is None else kind.speed
    slower, shares, takes, after = speed < fastest, [], [], []
    for name, move in zip(rules.actions, rules.action_set.moves, strict=True):
        on_track = ground_speed(scenario, speed, move)
        steps, left = 1.0, 0.0
        if rules.timed_actions and name == SEARCH:
            steps, left = _search_steps(scenario, kind)
        elif rules.timed_actions:
            steps = max(math.hypot(*move) * fastest / on_track, 1.0)
        elif slower and move != (0, 0):
            steps = float(whole_steps(fastest, on_track))
        share = 1.0 / steps if rules.timed_actions or slower else min(on_track / speed, 1.0)
        shares.append(share if kind is None or kind.can_do(name) else 0.0)
        takes.append(steps)
        after.append(left)
    longest = max(map(sum, zip(takes, after, strict=True)))
    binding = slower or (rules.timed_actions and longest > 1.0) or rules.vehicle_timed_actions
    return ActionTimes(shares, takes, after, binding)


def action_times_of_kinds(scenario: ResolvedScenario, rules: Rules) -> list[ActionTimes]:
    """Return the `action_times` of each kind."""
    return [action_times(scenario, rules, kind) for kind in scenario.kinds]


def action_times_of_drones(scenario: ResolvedScenario, rules: Rules) -> list[ActionTimes]:
    """Return the `action_times` of each drone."""
    of_kinds = action_times_of_kinds(scenario, rules)
    return [of_kinds[number] for number in scenario.kind_of]


def any_binding(scenario: ResolvedScenario, rules: Rules) -> bool:
    """Return whether a drone may be under way for more than a step."""
    return any(times.binding for times in action_times_of_kinds(scenario, rules))


def ground_speed(scenario: ResolvedScenario, airspeed: float, move: tuple[int, int]) -> float:
    """Return the speed over ground, m/s, of a drone that holds its track in the wind.

    With airspeed v, crosswind c and tailwind w it is sqrt(v^2 - c^2) + w.

    Args:
        scenario: Sets the wind.
        airspeed: v, m/s.
        move: Cells (dx, dy) to the east and to the south; (0, 0) is in still air.
    """
    dx, dy = move
    toward, length = math.radians(scenario.wind_toward), math.hypot(dx, dy) or 1.0
    east, south = scenario.wind_speed * math.sin(toward), -scenario.wind_speed * math.cos(toward)
    along, across = (east * dx + south * dy) / length, (east * dy - south * dx) / length
    return math.sqrt(airspeed**2 - across**2) + along


def whole_steps(fastest: float, speed: float) -> int:
    """Return the steps per cell at a ground speed, where the fastest drone needs one.

    Args:
        fastest: Airspeed of the fastest drone, m/s.
        speed: The ground speed, m/s.
    """
    return max(math.ceil(fastest / speed - ROUNDING), 1)


def _search_steps(scenario: ResolvedScenario, kind: Searcher | None) -> tuple[float, float]:
    """Return the steps of a search until it has looked, and until the drone is back."""
    step_s = scenario.step_duration_s
    if kind is None or kind.search_altitude is None:
        return 1.0, 0.0
    height_m = max((kind.altitude or scenario.altitude) - kind.search_altitude, 0.0)
    until_looked_s = height_m / kind.descent_speed + kind.search_time
    return max(until_looked_s / step_s, 1.0), height_m / kind.climb_speed / step_s
