# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state of a mission, and the reasons why it waits, as texts and numbers; without ROS."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_scheduler import StepScheduler
from dsse_ros.search.step.fault_kernels import (
    HOME,
    IDENTIFYING,
    RETURNING,
    STATUSES,
    STUCK,
    UNDER_WAY,
)
from msg_adapters.diagnostics import OF_OBJECT, Level

_MOST_NAMES = 8
"""Largest number of drones named in a log line."""


def counted(number: int, noun: str) -> str:
    """Return a number with its noun."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def names(mission: Mission, drones: Sequence[int]) -> str:
    """Return the names of drones, for a line."""
    return ", ".join(mission.env.possible_agents[i] for i in drones)


def actions(mission: Mission, joint: NDArray[np.int8]) -> str:
    """Return the names of the drones' actions (N,)."""
    action_names = mission.env.rules.actions
    return ", ".join(action_names[action] if action >= 0 else "none" for action in joint.tolist())


def begun(mission: Mission, grid: GridShape) -> str:
    """Return the log line for the start of a mission."""
    return (
        f"mission {mission.number}: {counted(len(mission.tracks), 'drone')} on "
        f"{grid} cells, "
        f"rules {mission.env.rules.profile}, seed {mission.seed}"
    )


def ended(mission: Mission) -> str:
    """Return the log line for the end of a mission."""
    steps = counted(mission.steps, "step")
    return f"mission {mission.number} over after {steps}: {mission.outcome}"


def awaited(
    mission: Mission,
    scheduler: StepScheduler,
    late: Sequence[int],
    *,
    clock_stopped: bool = False,
) -> str:
    """Return a text of what the next step waits for, empty for nothing.

    Args:
        late: The drones whose vehicles have to arrive first.
        clock_stopped: Whether the time of the vehicles has not passed for a while.
    """
    mode = scheduler.timing.mode
    by_vehicles = scheduler.timing.by_vehicles
    if scheduler.paused or mission.done or (mode == "realtime" and not by_vehicles):
        return ""
    if mode == "manual":
        return "waiting for a call of ~/step"
    if mission.begun and by_vehicles:
        return "waiting for the clocks of the vehicles" if clock_stopped else ""
    shown = [
        f"{what} of {_some_names(mission, drones)}"
        for what, drones in (("commands", mission.missing), ("vehicles", late))
        if drones
    ]
    return f"waiting for {' and '.join(shown)}" if shown else ""


def reasons_without_commands(
    mission: Mission, publishers: Mapping[str, int], of_all: Sequence[str]
) -> str:
    """Return why drones have no command for the next step, from the publishers of its topics.

    Args:
        publishers: Number of publishers by topic: `<drone>/<name>`, or one of `of_all`.
        of_all: The topics that command all drones.
    """
    topics: dict[str, list[str]] = {}
    for topic in publishers:
        topics.setdefault(topic.partition("/")[0], []).append(topic)
    silent: list[str] = []
    heard: list[str] = []
    for i in mission.missing:
        own = topics[mission.env.possible_agents[i]]
        active = [topic for topic in (*of_all, *own) if publishers[topic]]
        (heard if active else silent).append((active or own)[0])
    causes = []
    if silent:
        *first, last = [*of_all, *_first(silent)]
        causes.append(f"no publisher on {', '.join(first)} or {last}")
    if heard:
        causes.append(
            f"a publisher on {', '.join(_first(list(dict.fromkeys(heard))))}, but no command for "
            f"step {mission.result.step} since it was discovered"
        )
    return "; ".join(causes)


def health(
    mission: Mission,
    scheduler: StepScheduler,
    *,
    stopped: bool,
    awaited: str,
    publishers: Mapping[str, int],
    lost: Collection[int],
    rejected: Mapping[str, int],
) -> tuple[Level, str]:
    """Return the state of a mission as a level and a line.

    Args:
        stopped: Whether it was stopped: reset and paused.
        awaited: Text of what it has been waiting for; empty for nothing.
        publishers: Number of publishers of topics that should have at most one.
        lost: The drones whose vehicles have dropped out.
        rejected: Messages that were refused, by code.
    """
    level: Level = "ok"
    message = "running"
    if mission.aborted:
        level, message = "error", "mission aborted"
    elif mission.done:
        message = "mission over"
    elif scheduler.paused:
        message = "stopped" if stopped else "paused"
    causes = [f"{count} nodes publish {topic}" for topic, count in publishers.items() if count > 1]
    lost = {*lost, *mission.fallen}
    if lost:
        causes.append(f"{names(mission, sorted(lost))} lost")
    if rejected:
        causes.append(f"{counted(sum(rejected.values()), 'message')} refused")
    if causes and level == "ok":
        level = "warning"
    return level, "; ".join([message, *([awaited] if awaited else []), *causes])


def values(
    mission: Mission,
    run: Mapping[str, object],
    *,
    publishers: Mapping[str, int],
    late: Sequence[int] | None,
    lost: Mapping[int, str],
    rejected: Mapping[str, int],
) -> dict[str, object]:
    """Return the numbers of a mission and of its run for diagnostics.

    Args:
        run: Numbers of the run by name.
        publishers: Number of publishers of topics that should have at most one.
        late: The drones whose vehicles have to arrive first; None without vehicles.
        lost: Reasons why vehicles have dropped out, by drone.
        rejected: Messages that were refused, by code.
    """
    found: dict[str, object] = {
        "step": mission.result.step,
        "mission": mission.number,
        "seed": mission.seed,
        **run,
        "drones_in_flight": len(mission.live),
        "missing_drones": names(mission, [] if mission.done else mission.missing),
        "lost_drones": names(mission, [*mission.lost, *mission.fallen]),
        **_of_faults(mission),
        **({} if mission.pos is None else {"pos": f"{mission.pos:.6f}"}),
        **_of_incident(mission),
        **{name: f"{share:.6f}" for name, share in mission.coverage.items()},
        **{f"publishers.{topic}": count for topic, count in publishers.items()},
        "rejected": sum(rejected.values()),
    }
    if late is not None:
        found["awaited_vehicles"] = names(mission, late)
    found |= {f"lost.drone{i}": reason for i, reason in sorted(lost.items())}
    return found | {f"rejected.{code}": n for code, n in sorted(rejected.items())}


def of_drones(
    mission: Mission, lost: Mapping[int, str], *, waits: bool, blind: Mapping[int, str] = {}
) -> Iterator[tuple[str, Level, str, dict[str, object]]]:
    """Return the name, the level, a line and the values of each drone for diagnostics.

    Args:
        lost: Reasons why vehicles have dropped out, by drone.
        waits: Whether the step waits for commands.
        blind: Why vehicles cannot look, by drone; only those that cannot.
    """
    result, live, missing = mission.result, set(mission.live), set(mission.missing)
    fallen, action_names = {*mission.lost, *mission.fallen}, mission.env.rules.actions
    faults = mission.env.world.faults
    for i, name in enumerate(mission.env.possible_agents):
        level: Level = "ok"
        line = "in flight" if result.conditions is None else _condition(result.conditions[i])
        if i in lost or i in fallen:
            level, line = "error", f"lost: {lost[i]}" if i in lost else "lost"
        elif i not in live:
            line = "found a person" if result.found[i] else "the search is over"
        else:
            if waits and i in missing:
                line = f"{line}, waiting for a command"
            if i in blind:
                level, line = "warning", f"{line}; its vehicle does not look: {blind[i]}"
        action = int(result.actions[i])
        found: dict[str, object] = {
            "cell": "{} {}".format(*result.cells[i].tolist()),
            "action": action_names[action] if action >= 0 else "none",
        }
        if result.conditions is not None and faults is not None and faults.has_battery:
            found["battery"] = f"{result.conditions['battery'][i]:.1f}"
        yield name, level, line, found


def _condition(condition: np.void) -> str:
    return STATUSES[condition["status"]].replace("_", " ")


def _of_incident(mission: Mission) -> dict[str, object]:
    """Return `pos_alive`, `poc_outside`, `stranded` and the shares of objects, as far as known."""
    outside, incident = mission.poc_outside, mission.env.scenario.incident
    found: dict[str, object] = {} if outside is None else {"poc_outside": f"{outside:.6f}"}
    if mission.pos_alive is not None:
        found["pos_alive"] = f"{mission.pos_alive:.6f}"
    if incident is not None and incident.grid_summary is not None:
        found["stranded"] = f"{incident.grid_summary.stranded:.6f}"
    return found | {
        f"{OF_OBJECT}{key}": f"{share:.6f}" for key, share in mission.object_shares.items()
    }


def _of_faults(mission: Mission) -> dict[str, object]:
    """Return the conditions of the drones; empty without faults."""
    conditions, faults = mission.result.conditions, mission.env.world.faults
    if conditions is None or faults is None:
        return {}
    found: dict[str, object] = {
        f"{STATUSES[status]}_drones": names(
            mission, np.flatnonzero(conditions["status"] == status).tolist()
        )
        for status in (STUCK, IDENTIFYING, RETURNING, HOME, UNDER_WAY)
    }
    if faults.has_battery:
        found["lowest_battery"] = f"{conditions['battery'].min():.1f}"
    return found


def _some_names(mission: Mission, drones: Sequence[int]) -> str:
    return ", ".join(_first([mission.env.possible_agents[i] for i in drones]))


def _first(texts: Sequence[str]) -> list[str]:
    """Return the first `_MOST_NAMES` texts; the last of them counts the others."""
    kept, more = list(texts[:_MOST_NAMES]), len(texts) - _MOST_NAMES
    return [*kept[:-1], f"{kept[-1]} and {more} more"] if more > 0 else kept
