# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What DSSE 1.1.9 does once a script has set an attribute of its environments, at each stage.

`play` also plays the scripts on an environment with the same names.
"""

from __future__ import annotations

import contextlib
import functools
import gzip
import importlib
import io
import json
import random
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from oracle_common import Json, plain

STAGES = ("made", "reset", "flying")
"""Before the first reset, after it, and after `FLOWN` steps."""
FLOWN = 3

SEARCH: Json = {
    "grid_size": 5, "drone_amount": 2, "person_amount": 2, "timestep_limit": 12,
    "person_initial_position": (2, 2), "vector": (0.0, 0.0),
}  # fmt: skip
DRIFTING: Json = {**SEARCH, "vector": (1.6, -1.1), "probability_of_detection": 0}
ALONE: Json = {**SEARCH, "person_amount": 1}
COVERAGE: Json = {"drone_amount": 2, "timestep_limit": 12}
MATRIX = [[0.1, 0.2, 0.0], [0.3, 0.0, 0.1], [0.2, 0.0, 0.1]]

STARTS = {"search": [(1, 2), (3, 4)], "coverage": [(1, 1), (2, 2)]}
PERSONS = [(2, 2), (4, 4)]
"""Where persons are put after a reset: without a drift they stay there."""
L, R, U, D, S = 0, 1, 2, 3, 8
JOINT = {
    "search": [(S, L), (L, D), (R, R), (R, R), (S, U), (S, D), (L, S), (L, L), (L, L), (L, L),
               (L, L), (L, L), (L, L)],
    "coverage": [(L, D), (U, U), (R, R), (L, L), (D, U), (D, U), (R, L), (L, L), (L, L), (L, L),
                 (L, L), (L, L)],
}  # fmt: skip
"""Moves, a move off the grid, a search in vain, and one where each person was put."""
SHORTER = 5
"""Steps of the second mission."""

TASKS: dict[str, tuple[str, Json, list[str]]] = {
    "rewards": ("search", SEARCH, [
        "env.reward_scheme = type(env.reward_scheme)(-1.0, -2.0, -3.0, -4.0, -5.0, 9.0)",
        "env.reward_scheme = env.reward_scheme._replace(search_and_find=7.0)",
        "type(env).reward_scheme = env.reward_scheme._replace(default=-0.5, leave_grid=-8.0)",
    ]),
    "time": ("search", SEARCH, [
        "env.timestep = 7", "env.timestep = 11", "env.timestep_limit = 5",
        "env.timestep_limit = 30",
    ]),
    "drones": ("search", SEARCH, [
        "env.drone.pod = 0.0", "env.drone = type(env.drone)(2, 10, 0.0)", "env.drone.speed = 25",
        "env.drone.amount = 1", "env.probability_of_detection = 0.0",
        "env.agents_positions[0] = (2, 2)", "env.agents_positions = [(4, 4), (2, 2)]",
    ]),
    "agents": ("search", SEARCH, [
        "env.agents = ['drone0']", "env.agents = ['drone1']", "env.agents = ['a', 'b']",
        "env.agents = []", "env.possible_agents = ['a', 'b']", "env.possible_agents = ['a']",
    ]),
    "sums": ("search", SEARCH, [
        "env.rewards_sum = {'drone0': 5, 'drone1': 7, 'total': 1}",
        "env.rewards_sum['drone0'] = 3",
    ]),
    "without effect": ("search", SEARCH, [
        "env.action_spaces = {}", "env.observation_spaces = {}", "env.possible_actions = set()",
        "env.metadata = {'name': 'x'}", "env.render_mode = 'ansi'",
    ]),
    "persons": ("search", SEARCH, [
        "for person in env.persons_set: person.set_mult(0.0)",
        "for person in env.persons_set: person.mult = 0.0",
        "for person in env.persons_set: person.x, person.y = person.y, 3",
        "env.persons_set = {person for person in env.persons_set if person.index}",
        "env.persons_set.remove(min(env.persons_set, key=lambda person: person.index))",
        "env.persons_set.clear()", "env.person_amount = 1", "env.person_amount = 3",
        "for person in env.persons_set: person.angle_range = (0, 1)",
        "for person in env.persons_set: person.initial_position = (0, 0)",
        "for person in env.persons_set: person.grid_size = 3",
        "for person in env.persons_set: person.time_step_relation = 2",
        "for person in env.persons_set: person.index = 7",
    ]),
    "persons who drift": ("search", DRIFTING, [
        "for person in env.persons_set: person.movement_vector = (0.0, 0.0); person.inc_x = 0.0; "
        "person.inc_y = 0.0",
    ]),
    "start": ("search", ALONE, [
        "env.person_initial_position = (3, 1)", "env.disaster_position = (3, 1)",
        "env.person_initial_position = env.disaster_position = (1, 3)",
        "env.disaster_position = (3, 1); env.pre_render_steps = 3",
    ]),
    "map": ("search", DRIFTING, [
        "env.vector = (-0.8, 1.4)", "env.dispersion_inc = 0.7", "env.dispersion_inc = 0.0",
        "env.dispersion_start = 1.7", "env.pre_render_steps = 4", "env.cell_size = 40",
        "env.time_step_relation = 40.0", "env.grid_size = 7",
        "env.disaster_position = (4, 0)",
    ]),
    "matrix": ("search", DRIFTING, [
        "env.probability_matrix.supposed_position = (3, 1)",
        "env.probability_matrix.inc_x = 0.95", "env.probability_matrix.inc_y = -0.95",
        "env.probability_matrix.movement_vector = (-1.6, 0.5)",
        "env.probability_matrix.time_step_relation = 1.5",
        "env.probability_matrix.spacement = 2.0", "env.probability_matrix.spacement_inc = 1.0",
        "env.probability_matrix.amplitude = 3", "env.probability_matrix.map = None",
        "env.probability_matrix.map_prob = env.probability_matrix.map_prob * 0",
        "env.probability_matrix = None", "env.pygame_renderer = None",
    ]),
    "coverage": ("coverage", COVERAGE, [
        "env.reward_scheme.update(default=-1.0, search_cell=5.0, exceed_timestep=-7.0)",
        "env.reward_scheme.update(done=500.0, reward_poc=0.0)",
        "env.reward_scheme = {'default': -1, 'exceed_timestep': -2, 'search_cell': 3, 'done': 4, "
        "'reward_poc': 5}",
        "env.timestep = 6", "env.timestep_limit = 4", "env.timestep_limit = 30",
        "env.drone.pod = 0.1", "env.drone.speed = 25", "env.drone.amount = 1",
        "env.repeated_coverage = 9", "env.cumm_pos = 0.25",
        "env.agents_positions[0] = (0, 2)", "env.agents = ['drone0']",
        "env.possible_agents = ['a', 'b']", "env.disaster_position = (0, 0)",
        "env.probability_of_detection = 0.0", "env.cell_size = 10",
        "env.time_step_relation = 3.0", "env.grid_size = 2",
        "env.seen_states = set()", "env.not_seen_states = {(0, 0)}",
        "env.not_seen_states.clear()", "env.all_states = {(0, 0)}",
        "env.probability_matrix = None",
        "env.probability_matrix.probability_map = env.probability_matrix.original_map / 2",
        "env.probability_matrix.original_map = env.probability_matrix.original_map / 2",
        "env.probability_matrix.get_matrix()[0, 1] = 0.5",
        "env.action_spaces = {}", "env.observation_spaces = {}", "env.metadata = {'name': 'x'}",
        "env.render_mode = 'ansi'", "env.pygame_renderer = None",
    ]),
}  # fmt: skip
"""By subject: the task, the arguments of its environment, and statements that set attributes."""


def scripts() -> list[Json]:
    """Return all statements at each stage."""
    return [
        {"subject": subject, "task": task, "arguments": arguments, "stage": stage, "code": code}
        for subject, (task, arguments, codes) in TASKS.items()
        for code in codes
        for stage in STAGES
    ]


def published(task: str, folder: Path) -> Callable[..., Any]:
    """Return a function that makes an environment of the package."""
    package = importlib.import_module("DSSE")
    if task == "search":
        return package.DroneSwarmSearch  # type: ignore[no-any-return]
    path = str(folder / "matrix.npy")
    np.save(path, np.array(MATRIX))
    return functools.partial(package.CoverageDroneSwarmSearch, prob_matrix_path=path)


def write(path: Path, source: Json) -> None:
    """Write the attributes of the package's environments, and the calls of all scripts."""
    items: list[Json] = []
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        make = {task: published(task, Path(folder)) for task in JOINT}
        for task, arguments in (("search", SEARCH), ("coverage", COVERAGE)):
            env = make[task](**arguments)
            env.reset(options={"drones_positions": STARTS[task]})
            items.append({"task": task, "attributes": attributes(env)})
        items += [{**script, "calls": play(script, make[script["task"]])} for script in scripts()]
    for item in items:
        for call in item.get("calls", ()):
            # It may have an address.
            call.pop("line", None)
    text = json.dumps({"provenance": source, "scripts": items}, indent=0)
    path.write_bytes(gzip.compress(text.encode(), mtime=0))


def attributes(env: Any) -> dict[str, list[str]]:
    """Return the public attributes, not methods, of an environment after a reset, and its parts."""
    parts = {"env": env, "drone": env.drone, "probability_matrix": env.probability_matrix}
    if hasattr(env, "persons_set"):
        parts["person"] = next(iter(env.persons_set))
    return {
        name: [
            one for one in dir(part)
            if not one.startswith("_") and not callable(getattr(part, one, None))
        ]
        for name, part in parts.items()
    }  # fmt: skip


def play(script: Json, make: Callable[..., Any]) -> list[Json]:
    """Return the outcome of each call of two missions; an exception ends a mission.

    Args:
        script: One of `scripts`.
        make: Returns an environment for its arguments.
    """
    # Fixed seeds of both generators: what the persons draw is not compared.
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002
    env, task = make(**script["arguments"]), script["task"]
    before = type(env).reward_scheme
    kept = dict(before) if isinstance(before, dict) else before
    calls: list[Json] = []
    try:
        for length in (len(JOINT[task]), SHORTER):
            set_at = script["stage"] if not calls else ""
            with warnings.catch_warnings():
                # The package divides by the norm of a drift of 0.
                warnings.simplefilter("ignore")
                _fly(env, script, set_at, JOINT[task][:length], calls)
    finally:
        type(env).reward_scheme = kept
    return calls


def _fly(env: Any, script: Json, set_at: str, joint: list[Any], calls: list[Json]) -> None:
    task = script["task"]
    try:
        if set_at == "made":
            _set(env, script)
        start = {"drones_positions": STARTS[task]}
        if len(env.possible_agents) < 2:
            start = {"drones_positions": STARTS[task][:1]}
        observations, infos = env.reset(options=start)
        if task == "search" and script["subject"] != "start":
            for person in env.get_persons():
                person.x, person.y = PERSONS[person.index % 2]
        calls.append(_state(env, observations, infos))
        if set_at == "reset":
            _set(env, script)
        for number, actions in enumerate(joint):
            if set_at == "flying" and number == FLOWN:
                _set(env, script)
            if not env.agents:
                return
            agents = list(env.agents)
            observations, rewards, terminated, truncated, infos = env.step(
                dict(zip(agents, actions, strict=False))
            )
            calls.append(
                {
                    "rewards": [float(rewards[agent]) for agent in agents],
                    "terminated": [bool(terminated[agent]) for agent in agents],
                    "truncated": [bool(truncated[agent]) for agent in agents],
                    **_state(env, observations, infos),
                }
            )
    except Exception as error:
        calls.append({"error": type(error).__name__, "line": str(error)})


def _set(env: Any, script: Json) -> None:
    exec(script["code"], {"env": env})  # noqa: S102


def _state(env: Any, observations: Any, infos: Any) -> Json:
    """Return what a script sees of a mission, for JSON."""
    state: Json = {
        "agents": list(env.agents),
        "timestep": env.timestep,
        "positions": [list(map(plain, cell)) for cell in env.agents_positions],
        "infos": [
            {name: plain(value) for name, value in info.items()} for info in infos.values()
        ],
        "map": [],
    }  # fmt: skip
    for _, probability in list(observations.values())[:1]:
        if not np.isnan(probability).any():
            # The size and the middle rows differ between maps.
            rows = np.asarray(probability, float).round(6)
            state["map"] = [len(rows), *rows[1:3].ravel().tolist()]
    if hasattr(env, "persons_set"):
        state["persons"] = sorted([p.index, plain(p.x), plain(p.y)] for p in env.persons_set)
        state["sums"] = {name: plain(value) for name, value in env.rewards_sum.items()}
        state["datum"] = list(map(plain, env.probability_matrix.supposed_position))
    return state
