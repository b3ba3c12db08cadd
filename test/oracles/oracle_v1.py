# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Golden traces of DSSE 0.1.13, the oracle of the profile `v1`."""

from __future__ import annotations

import importlib
import random
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from oracle_common import STEPS, WHOLE, Json, plain, statistics

LEFT, RIGHT, UP, DOWN, SEARCH, UNKNOWN = 0, 1, 2, 3, 4, 9
MOVES = {LEFT: (-1, 0), RIGHT: (1, 0), UP: (0, -1), DOWN: (0, 1)}

Cell = tuple[int, int]


def make(
    grid: int,
    vector: tuple[float, float],
    person: Cell,
    sigma: float,
    limit: int = 10**6,
    drones: Iterable[Cell] = ((0, 0),),
) -> Any:
    """Return an environment after its reset."""
    starts = [list(cell) for cell in drones]
    env = importlib.import_module("DSSE.env").DroneSwarmSearch(
        grid_size=grid,
        n_drones=len(starts),
        vector=vector,
        person_initial_position=list(person),
        disperse_constant=sigma,
        timestep_limit=limit,
    )
    env.reset(drones_positions=starts)
    return env


def record_map(
    grid: int, vector: tuple[float, float], start: Cell, sigma: float
) -> tuple[Json, dict[str, np.ndarray]]:
    """Maps 0 (as returned by reset) to 59; `centre` and `radius` are of the circle in that map."""
    env = make(grid, vector, start, sigma)
    model = env.probability_matrix
    stats, datum, centre, radius, maps = [], [], [start], [1.0], []
    for k in range(STEPS):
        p = model.get_matrix()
        if k in WHOLE:
            maps.append(p.copy())
        stats.append(statistics(p))
        datum.append((model.initial_position[1], model.initial_position[0]))
        radius.append(model.params[0])
        centre.append((model.params[2], model.params[3]))
        env.person_x = env.person_y = grid // 2  # Left alone it walks off the grid: ValueError.
        env.step({"drone0": UNKNOWN})
    case = {"grid": grid, "vector": vector, "start": start, "sigma": sigma}
    return case, {
        "maps": np.array(maps),
        "statistics": np.array(stats),
        "datum": np.array(datum, np.int16),
        "centre": np.array(centre[:STEPS], np.int16),
        "radius": np.array(radius[:STEPS]),
    }


def record_maps() -> list[tuple[Json, dict[str, np.ndarray]]]:
    out = []
    for grid in (7, 20, 40):
        middle, last = grid // 2, grid - 1
        drifts: list[tuple[tuple[float, float], Cell]] = [
            ((1, 0.5), (last, 1)),
            ((-0.5, -0.5), (0, 0)),
            ((-0.5, -0.5), (middle, middle)),
            ((0.1, 0.1), (middle, middle)),
            ((0, 0), (middle, middle)),
            ((1.1, 1), (1, 0)),
            ((-1.3, 0.7), (last - 1, 1)),
            ((0.3, -0.25), (2, last - 1)),
            ((2.5, -2), (0, last)),
        ]
        for n, (vector, start) in enumerate(drifts):
            for m, sigma in enumerate((1, 3, 10)):
                if grid < 40 or m == n % 3:
                    out.append(record_map(grid, vector, start, sigma))
    return out


@dataclass
class Episode:
    """A script. The person is put on `park`, or on the cell given for a call, before each call."""

    name: str
    drones: list[Cell]
    calls: list[list[int]]
    find: dict[int, Cell] = field(default_factory=dict)
    grid: int = 20
    vector: tuple[float, float] = (0.1, 0.1)
    person: Cell = (9, 9)
    sigma: float = 3
    limit: int = 200
    park: Cell = (0, 19)


def walk(seed: int, grid: int, drones: list[Cell], calls: int) -> list[list[int]]:
    """Random valid actions: half of them searches, no drone leaves the grid."""
    rng = random.Random(seed)
    cells = list(drones)
    script = []
    for _ in range(calls):
        actions = []
        for i, (x, y) in enumerate(cells):
            inside = [
                a for a, (dx, dy) in MOVES.items() if 0 <= x + dx < grid and 0 <= y + dy < grid
            ]
            action = SEARCH if rng.random() < 0.5 else rng.choice(inside)
            if action != SEARCH:
                cells[i] = (x + MOVES[action][0], y + MOVES[action][1])
            actions.append(action)
        script.append(actions)
    return script


def episodes() -> list[Episode]:
    across = [[SEARCH], [RIGHT]] * 19 + [[SEARCH]]
    still = [[UNKNOWN]]
    small: dict[str, Any] = {"grid": 7, "person": (3, 3), "park": (6, 6), "vector": (0.0, 0.0)}
    three: list[Cell] = [(0, 5), (2, 5), (4, 5)]
    out = [
        Episode("moves", [(5, 5)], [[LEFT], [UP], [RIGHT], [RIGHT], [DOWN], [DOWN]]),
        Episode("unknown_actions", [(5, 5)], [[5], [99], [-1], [SEARCH]]),
        Episode("search_the_only_cell_after_reset", [(9, 9)], [[SEARCH]] * 4),
        Episode("find_after_reset", [(9, 9)], [[SEARCH]], {0: (9, 9)}),
        Episode("search_across_the_map", [(0, 10)], still * 30 + across),
        Episode(
            "search_across_a_wide_map", [(0, 11)], still * 35 + across, sigma=10, vector=(0.3, -0.2)
        ),
        Episode("search_across_a_narrow_map", [(0, 9)], still * 5 + across, sigma=1),
        Episode("every_border", [(0, 3)], [[LEFT], [RIGHT], [UP]] + [[UP]] * 3, **small),
        Episode("leave_right_and_return", [(6, 3)], [[RIGHT], [RIGHT], [LEFT], [LEFT]], **small),
        Episode("leave_below_and_return", [(3, 6)], [[DOWN], [LEFT], [UP], [UP]], **small),
        Episode(
            "leave_and_go_on",
            [(0, 0), (5, 5)],
            [
                [LEFT, UP],
                [LEFT, SEARCH],
                [DOWN, LEFT],
                [UNKNOWN, 2],
                [RIGHT, 3],
                [RIGHT, 3],
                [1, 4],
            ],
            **small,
        ),
        Episode("defect_search_off_grid_wraps_low", [(-1, 0)], [[SEARCH]], **small),
        Episode(
            "defect_search_off_grid_wraps_high",
            [(0, 3)],
            still * 8 + [[LEFT], [SEARCH], [LEFT], [SEARCH]],
            grid=7,
            person=(5, 3),
            park=(0, 6),
            vector=(0.0, 0.0),
            sigma=3,
        ),
        Episode("defect_search_off_grid_fails", [(6, 3)], [[RIGHT], [SEARCH]], **small),
        Episode("swap", [(1, 1), (2, 1)], [[RIGHT, LEFT], [LEFT, RIGHT], [UP, DOWN]], **small),
        Episode(
            "collide_and_go_on",
            [(1, 1), (3, 1), (5, 5)],
            [[RIGHT, LEFT, UP], [UNKNOWN, UNKNOWN, UP], [SEARCH, SEARCH, UP], [LEFT, RIGHT, UP]],
            **small,
        ),
        Episode("move_into_a_searcher", [(1, 1), (2, 1)], [[RIGHT, SEARCH]], **small),
        Episode("three_in_one_cell", [(1, 1), (2, 0), (3, 1)], [[RIGHT, DOWN, LEFT]], **small),
        Episode("collide_off_grid", [(0, 0), (0, 1)], [[LEFT, LEFT], [DOWN, UNKNOWN]], **small),
        Episode("start_in_one_cell_and_part", [(1, 1), (1, 1)], [[LEFT, RIGHT]], **small),
        Episode("start_in_one_cell_and_stay", [(1, 1), (1, 1)], [[SEARCH, SEARCH]], **small),
        Episode("time_out", [(6, 6), (0, 6)], [[LEFT, SEARCH], [RIGHT, SEARCH]] * 4, limit=3),
        Episode(
            "time_out_after_a_collision",
            [(1, 1), (3, 1), (6, 6)],
            [[RIGHT, LEFT, SEARCH], [LEFT, RIGHT, UP]] + [[UP, UP, 0], [DOWN, DOWN, 1]] * 2,
            limit=3,
        ),
        Episode(
            "time_out_and_collision_in_one_call",
            [(1, 1), (4, 1), (6, 6)],
            [[SEARCH] * 3] * 2 + [[RIGHT, LEFT, UP], [RIGHT, UNKNOWN, 4], [4, 0, 4], [4, 4, 4]],
            limit=2,
        ),
        Episode("time_out_while_leaving", [(0, 0)], [[SEARCH]] * 4 + [[LEFT]] * 2, limit=3),
        Episode(
            "find_on_the_last_call", [(5, 5), (7, 7)], [[4, 1]] * 4 + [[4, 0]], {3: (5, 5)}, limit=3
        ),
        Episode("find_on_the_time_out_call", [(5, 5), (7, 7)], [[4, 1]] * 6, {4: (5, 5)}, limit=3),
        Episode("find_again_and_again", [(5, 5)], [[4]] * 3, {0: (5, 5), 1: (5, 5), 2: (5, 5)}),
        Episode("find_late", [(5, 5)], [[UNKNOWN]] * 7 + [[4]], {7: (5, 5)}, limit=30),
        Episode("two_finders_collide", [(5, 5), (5, 5)], [[4, 4], [4, 1]], {0: (5, 5)}),
        Episode("finder_is_hit", [(4, 5), (5, 5)], [[RIGHT, SEARCH]], {0: (5, 5)}),
        Episode("other_leaves_the_finders_cell", [(5, 5), (5, 5)], [[4, 1]], {0: (5, 5)}),
        Episode("search_the_cell_that_the_mover_enters", [(5, 5)], [[RIGHT], [4]], {0: (6, 5)}),
        Episode("person_off_grid_is_found_there", [(0, 5)], [[LEFT], [4]], {1: (-1, 5)}),
    ]
    for finder in range(3):
        for name, other in (
            ("move", RIGHT),
            ("search", SEARCH),
            ("idle", UNKNOWN),
            ("leave", LEFT),
        ):
            calls = [[UNKNOWN] * 3, [SEARCH if i == finder else other for i in range(3)]]
            cell = three[finder]
            out.append(Episode(f"find_by_{finder}_others_{name}", three, calls, {1: cell}))
    starts: list[Cell] = [(8, 8), (10, 9), (12, 12)]
    out += [
        Episode("walk_20", starts, walk(1, 20, starts, 120)),
        Episode(
            "walk_7",
            [(3, 3)],
            walk(2, 7, [(3, 3)], 60),
            grid=7,
            vector=(-0.5, -0.5),
            person=(6, 6),
            sigma=10,
            park=(0, 6),
        ),
        Episode(
            "walk_fast_drift",
            starts,
            walk(3, 20, starts, 40),
            vector=(1.1, 1),
            person=(2, 3),
            sigma=1,
        ),
    ]
    return out


def play(script: Episode) -> Json:
    """Play one script. A step's `p` is the map of the last observation in each drone's cell."""
    env = make(script.grid, script.vector, script.person, script.sigma, script.limit, script.drones)
    agents = env.possible_agents
    steps: list[Json] = []
    for n, actions in enumerate(script.calls):
        env.person_x, env.person_y = person = script.find.get(n, script.park)
        p = env.probability_matrix.get_matrix()
        here = [tuple(env.agents_positions[a]) for a in agents]
        step: Json = {
            "t": env.timestep,
            "actions": actions,
            "person": person,
            "p": [
                float(p[y, x]) if 0 <= x < script.grid and 0 <= y < script.grid else None
                for x, y in here
            ],
        }
        steps.append(step)
        try:
            _, rewards, terminated, truncated, infos = env.step(
                dict(zip(agents, actions, strict=True))
            )
        except IndexError as error:
            step["error"] = type(error).__name__
            break
        step.update(
            rewards=[plain(rewards[a]) for a in agents],
            terminated=[terminated[a] for a in agents],
            truncated=[truncated[a] for a in agents],
            found=infos["Found"],
            positions=[tuple(env.agents_positions[a]) for a in agents],
            running_sums=[plain(env.rewards_sum[a]) for a in agents],
            total_reward=plain(rewards["total_reward"]),
        )
    return {
        "name": script.name,
        "grid": script.grid,
        "vector": script.vector,
        "person_initial_position": script.person,
        "sigma": script.sigma,
        "timestep_limit": script.limit,
        "drones_positions": script.drones,
        "steps": steps,
    }


def record_draws(
    name: str, start: Cell, vector: tuple[float, float], sigma: float, k: int, person: Cell
) -> Json:
    """20000 moves of a person from one cell of one frozen map, as counts[dy + 1][dx + 1]."""
    grid, draws = 12, 20000
    env = make(grid, vector, start, sigma)
    for _ in range(k):
        env.person_x = env.person_y = grid // 2
        env.step({"drone0": UNKNOWN})
    p = env.probability_matrix.get_matrix().copy()
    env.probability_matrix.step = lambda: None
    counts = np.zeros((3, 3), int)
    for _ in range(draws):
        env.person_x, env.person_y = person
        env.create_observations()
        counts[env.person_y - person[1] + 1, env.person_x - person[0] + 1] += 1
    return {
        "name": name,
        "grid": grid,
        "vector": vector,
        "start": start,
        "sigma": sigma,
        "map_index": k,
        "person": person,
        "draws": draws,
        "counts": counts.tolist(),
        "map": p.tolist(),
    }


def record_runs() -> Json:
    """Where 4000 free persons are after 12 calls: holds the order of map and person too."""
    grid, runs, calls = 9, 4000, 12
    vector, start, sigma = (0.4, -0.3), (3, 5), 2
    counts = np.zeros((grid, grid), int)
    env = make(grid, vector, start, sigma)
    for _ in range(runs):
        env.reset(drones_positions=[[0, 0]])
        for _ in range(calls):
            env.step({"drone0": UNKNOWN})
        counts[env.person_y, env.person_x] += 1
    return {
        "name": "free_runs",
        "grid": grid,
        "vector": vector,
        "start": start,
        "sigma": sigma,
        "calls": calls,
        "draws": runs,
        "counts": counts.tolist(),
    }


def record_person() -> list[Json]:
    random.seed(2026)
    slow, fast = (0.1, 0.1), (0.5, -0.5)
    return [
        record_draws("on_the_datum", (6, 6), slow, 3, 14, (6, 6)),
        record_draws("beside_the_datum", (6, 6), slow, 1, 14, (8, 5)),
        record_draws("in_the_corner", (1, 1), (0.0, 0.0), 3, 14, (0, 0)),
        record_draws("at_the_right_edge", (10, 6), fast, 10, 14, (11, 4)),
        record_draws("half_outside_the_circle", (6, 6), slow, 10, 5, (7, 8)),
        record_draws("all_zero_window", (2, 2), (0.0, 0.0), 10, 2, (8, 8)),
        record_runs(),
    ]
