# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Golden traces of DSSE 1.1.9, the oracle of the profile `v2`."""

from __future__ import annotations

import contextlib
import importlib
import io
import random
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from oracle_common import STEPS, WHOLE, Json, plain, statistics

LEFT, RIGHT, UP, DOWN, UP_LEFT, UP_RIGHT, DOWN_LEFT, DOWN_RIGHT, SEARCH = range(9)

Cell = tuple[int, int]


def make(drones: Iterable[Cell] = ((0, 0),), options: Json | None = None, **arguments: Any) -> Any:
    """Return an environment after its reset. What its constructor prints is swallowed."""
    starts = list(drones)
    with contextlib.redirect_stdout(io.StringIO()):
        env = importlib.import_module("DSSE").DroneSwarmSearch(
            drone_amount=len(starts), **{"timestep_limit": 10**6, **arguments}
        )
    env.reset(options={"drones_positions": starts, **(options or {})})
    return env


def record_map(
    grid: int, vector: tuple[float, float], start: Cell, inc: float, **more: Any
) -> tuple[Json, dict[str, np.ndarray]]:
    """Maps 0 (as returned by reset) to 59; `sigma` is the dispersion used in that map."""
    env = make(
        grid_size=grid, vector=vector, person_initial_position=start, dispersion_inc=inc, **more
    )
    model = env.probability_matrix
    first = env.dispersion_start
    for _ in range(env.pre_render_steps):
        first += inc
    stats, datum, sigma, maps = [], [], [first], []
    for k in range(STEPS):
        p = model.get_matrix()
        if k in WHOLE:
            maps.append(p.copy())
        stats.append(statistics(p))
        row, col = model.supposed_position
        datum.append((col, row))
        sigma.append(model.spacement)
        env.step({"drone0": LEFT})
    case: Json = {"grid": grid, "vector": vector, "start": start, "dispersion_inc": inc, **more}
    case["pre_search_steps"] = env.pre_render_steps
    return case, {
        "maps": np.array(maps),
        "statistics": np.array(stats),
        "datum": np.array(datum, np.int16),
        "sigma": np.array(sigma[:STEPS]),
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
            ((-2.2, 1.7), (last - 1, 1)),
            ((3.5, 0.5), (0, middle)),
            ((5, -4), (0, last)),
        ]
        for n, (vector, start) in enumerate(drifts):
            for m, inc in enumerate((0.0, 0.05, 0.1)):
                if grid < 40 or m == n % 3:
                    out.append(record_map(grid, vector, start, inc))
    out.append(record_map(20, (1.1, 1), (5, 5), 0.1, pre_render_time=3))
    out.append(record_map(20, (1.1, 1), (5, 5), 0.1, drone_speed=20, grid_cell_size=100))
    out.append(record_map(20, (-2, 1.5), (15, 5), 0.2, dispersion_start=1.5, drone_speed=5))
    return out


def record_drift() -> tuple[list[Json], np.ndarray]:
    """Return 300 cases and their datums (case, step 0 to 100, 2) as (col, row).

    One in three vectors lies along an axis: there a sum of increments comes to a whole cell most
    often, and its last bit decides the step.
    """
    grid, calls, rng = 60, 100, random.Random(9)
    cases, datums = [], []
    for n in range(300):
        decimals = 1 + n % 2
        vector = [round(rng.uniform(-1.5, 1.5), decimals) for _ in range(2)]
        if n % 3 == 0:
            vector[n // 3 % 2] = 0.0
        case: Json = {"grid": grid, "vector": vector, "start": (grid // 2, grid // 2)}
        if n >= 200:
            case["grid_cell_size"] = rng.choice([50, 80, 100, 150])
            case["drone_speed"] = rng.choice([5, 7, 12, 20])
        more = {name: case[name] for name in ("grid_cell_size", "drone_speed") if name in case}
        env = make(
            grid_size=grid, vector=tuple(vector), person_initial_position=case["start"], **more
        )
        path = []
        for _ in range(calls + 1):
            row, col = env.probability_matrix.supposed_position
            path.append((col, row))
            env.step({"drone0": LEFT})
        cases.append(case)
        datums.append(path)
    return cases, np.array(datums, np.uint8)


@dataclass
class Episode:
    """A script. Persons do not drift (vector 0), so they stay where `place` puts them."""

    name: str
    drones: list[Cell]
    calls: list[list[int]]
    place: dict[int, list[Cell]] = field(default_factory=dict)
    options: Json = field(default_factory=dict)
    limit: int = 100
    grid: int = 20
    pod: float = 1.0


def episodes() -> list[Episode]:
    corners: list[Cell] = [(0, 0), (19, 0), (0, 19), (19, 19)]
    three: list[Cell] = [(2, 6), (4, 6), (6, 6)]
    far: Cell = (10, 10)
    rng = random.Random(5)
    return [
        Episode("every_move", [(5, 5)], [[a] for a in range(9)], {0: [far]}),
        Episode("every_move_in_every_corner", corners, [[a] * 4 for a in range(9)], {0: [far]}),
        Episode("one_row", [(3, 0), (4, 0)], [[a, a] for a in (4, 2, 5, 7, 5, 5)], {0: [far]}),
        Episode("cells_are_shared", [(1, 1), (3, 1)], [[RIGHT, LEFT], [8, 8], [6, 7]], {0: [far]}),
        Episode("invalid_action", [(1, 1), (3, 1)], [[RIGHT, 9]], {0: [far]}),
        Episode("negative_action", [(1, 1), (3, 1)], [[RIGHT, -1]], {0: [far]}),
        Episode(
            "time_out",
            [(1, 1), (3, 1)],
            [[1, 8], [3, 8], [0, 8], [1, 8], [1, 8]],
            {0: [far]},
            limit=3,
        ),
        Episode("find_at_once", [(5, 5)], [[SEARCH]], {0: [(5, 5)]}),
        Episode(
            "find_late", [(5, 5)], [[UP_LEFT]] + [[DOWN]] * 6 + [[SEARCH]], {0: [(4, 10)]}, limit=30
        ),
        Episode("find_on_the_last_call", [(5, 5)], [[0], [1], [SEARCH]], {0: [(5, 5)]}, limit=3),
        Episode("too_late_to_find", [(5, 5)], [[0], [1], [0], [SEARCH]], {0: [(4, 5)]}, limit=3),
        *(
            Episode(
                f"find_by_{finder}_others_{name}",
                three,
                [[UP_RIGHT] * 3, [SEARCH if i == finder else other for i in range(3)]],
                {0: [(three[finder][0] + 1, 5)]},
            )
            for finder in range(3)
            for name, other in (("move", RIGHT), ("search", SEARCH), ("rest", DOWN_LEFT))
        ),
        Episode(
            "three_persons_one_after_another",
            [(2, 6), (9, 9)],
            [[8, 8], [1, 8], [8, 4], [1, 8], [8, 7], [8, 0]],
            {0: [(2, 6), (3, 6), (4, 6)]},
        ),
        Episode(
            "three_persons_in_one_cell",
            [(2, 6), (9, 9)],
            [[8, 8], [8, 8], [8, 8]],
            {0: [(2, 6), (2, 6), (2, 6)]},
        ),
        Episode(
            "two_drones_find_two_persons_in_one_cell",
            [(2, 6), (3, 6), (9, 9)],
            [[8, 0, 8], [8, 8, 1]],
            {1: [(2, 6), (2, 6)]},
        ),
        Episode(
            "two_drones_search_for_one_person", [(2, 6), (3, 6)], [[1, 8], [8, 8]], {1: [(3, 6)]}
        ),
        Episode(
            "multipliers_0_and_1",
            [(2, 6), (4, 6)],
            [[8, 8], [8, 8], [1, 0], [8, 8], [1, 0], [8, 8]],
            {0: [(2, 6), (4, 6)]},
            {"person_pod_multipliers": [0, 1]},
        ),
        Episode(
            "lowest_index_in_the_cell_shields_the_next",
            [(2, 6)],
            [[SEARCH]] * 3,
            {0: [(2, 6), (2, 6)]},
            {"person_pod_multipliers": [0, 1]},
        ),
        Episode(
            "multiplier_2_makes_pod_half_certain",
            [(2, 6), (4, 6)],
            [[8, 8]],
            {0: [(2, 6), (4, 6)]},
            {"person_pod_multipliers": [2, 2.5]},
            pod=0.5,
        ),
        Episode("pod_0", [(2, 6)], [[SEARCH]] * 4, {0: [(2, 6)]}, pod=0.0, limit=4),
        Episode(
            "walk", corners, [[rng.randrange(9) for _ in range(4)] for _ in range(80)], {0: [far]}
        ),
    ]


def play(script: Episode) -> Json:
    """Play one script. A step's `persons` are their cells by index before the call; null: found."""
    random.seed(2026)  # Persons that the script does not place.
    count = max(len(cells) for cells in script.place.values())
    env = make(
        script.drones,
        script.options,
        grid_size=script.grid,
        vector=(0, 0),
        person_initial_position=(10, 10),
        person_amount=count,
        timestep_limit=script.limit,
        probability_of_detection=script.pod,
    )
    agents = list(env.possible_agents)
    steps: list[Json] = []
    for n, actions in enumerate(script.calls):
        persons = {person.index: person for person in env.persons_set}
        for i, (x, y) in enumerate(script.place.get(n, [])):
            persons[i].x, persons[i].y = x, y
        p = env.probability_matrix.get_matrix()
        step: Json = {
            "t": env.timestep,
            "actions": actions,
            "persons": [
                (persons[i].x, persons[i].y) if i in persons else None for i in range(count)
            ],
            "p": [float(p[y, x]) for x, y in env.agents_positions],
        }
        steps.append(step)
        try:
            _, rewards, terminated, truncated, infos = env.step(
                dict(zip(agents, actions, strict=True))
            )
        except ValueError as error:
            step["error"] = type(error).__name__
            break
        step.update(
            rewards=[plain(rewards[a]) for a in agents if a in rewards],
            terminated=[terminated[a] for a in agents if a in terminated],
            truncated=[truncated[a] for a in agents if a in truncated],
            found=[infos[a]["Found"] for a in agents if a in infos],
            positions=list(env.agents_positions),
            agents_left=len(env.agents),
        )
    return {
        "name": script.name,
        "grid": script.grid,
        "vector": (0, 0),
        "person_initial_position": (10, 10),
        "person_amount": count,
        "probability_of_detection": script.pod,
        "timestep_limit": script.limit,
        "options": {"drones_positions": script.drones, **script.options},
        "steps": steps,
    }


def record_draws(
    name: str, cell: Cell, acc: tuple[float, float], drift: tuple[float, float], k: int = 20
) -> Json:
    """20000 moves of a person, from one state over one map, as counts[dy + 1][dx + 1].

    `acc` is the person's accumulator before the step and `drift` its increment per step.
    """
    grid, draws, vector, start, inc = 12, 20000, (1.1, 1), (5, 6), 0.1
    env = make(grid_size=grid, vector=vector, person_initial_position=start, dispersion_inc=inc)
    for _ in range(k):
        env.step({"drone0": LEFT})
    (person,) = env.persons_set
    person.movement_vector = drift
    person.time_step_relation = 1
    counts = np.zeros((3, 3), int)
    for _ in range(draws):
        person.x, person.y = cell
        person.inc_x, person.inc_y = acc
        person.step(env.build_movement_matrix(person))
        counts[person.y - cell[1] + 1, person.x - cell[0] + 1] += 1
    return {
        "name": name,
        "grid": grid,
        "vector": vector,
        "start": start,
        "dispersion_inc": inc,
        "map_index": k,
        "person": cell,
        "accumulator": acc,
        "increment": drift,
        "accumulator_after": [plain(person.inc_x), plain(person.inc_y)],
        "draws": draws,
        "counts": counts.tolist(),
        "map": env.probability_matrix.get_matrix().tolist(),
    }


def record_drifts() -> Json:
    """20000 drift vectors of persons, as a histogram of their angle from v and of their length.

    Rows: 24 bins of the angle from -pi to pi, turned from +x towards +y; columns: 12 bins of
    |drift| / |v| from 0 to 1.2.
    """
    vector, draws = (1.1, 1), 2000
    env = make(vector=vector, person_initial_position=(10, 10), person_amount=10)
    drifts = []
    for _ in range(draws):
        env.reset()
        drifts += [complex(*person.movement_vector) for person in env.persons_set]
    ratio = np.array(drifts) / complex(*vector)
    counts, _, _ = np.histogram2d(
        np.angle(ratio), np.abs(ratio), bins=(24, 12), range=((-np.pi, np.pi), (0, 1.2))
    )
    return {
        "name": "drift_vectors",
        "vector": vector,
        "draws": len(drifts),
        "mean": [float(ratio.real.mean()), float(ratio.imag.mean())],
        "counts": counts.astype(int).tolist(),
    }


def record_places() -> Json:
    """Where the persons are put: counts per cell over 4000 resets, 4 persons beside a corner."""
    grid, resets, centre, amount = 8, 4000, (1, 0), 4
    env = make(grid_size=grid, person_initial_position=centre, person_amount=amount)
    counts = np.zeros((grid, grid), int)
    for _ in range(resets):
        env.reset()
        for person in env.persons_set:
            counts[person.y, person.x] += 1
    return {
        "name": "places",
        "grid": grid,
        "person_initial_position": centre,
        "person_amount": amount,
        "resets": resets,
        "counts": counts.tolist(),
    }


def record_runs() -> Json:
    """Where 4000 free persons are after 45 calls: holds the order of person and map too."""
    grid, runs, calls, vector, start, inc = 14, 4000, 45, (1.6, 1.2), (4, 5), 0.05
    env = make(grid_size=grid, vector=vector, person_initial_position=start, dispersion_inc=inc)
    counts = np.zeros((grid, grid), int)
    for _ in range(runs):
        env.reset()
        (person,) = env.persons_set
        for _ in range(calls):
            env.step({"drone0": LEFT})
        counts[person.y, person.x] += 1
    return {
        "name": "free_runs",
        "grid": grid,
        "vector": vector,
        "start": start,
        "dispersion_inc": inc,
        "calls": calls,
        "draws": runs,
        "counts": counts.tolist(),
    }


def record_person() -> list[Json]:
    random.seed(2026)
    np.random.seed(2026)
    return [
        record_draws("drift_to_the_right", (7, 8), (1.05, 0.1), (0.1, 0.05)),
        record_draws("drift_down_and_right", (6, 7), (1.0, 0.52), (0.11, 0.09)),
        record_draws("half_rounds_to_even", (6, 7), (-1.0, 0.5), (0.0, 0.0)),
        record_draws("far_from_the_map", (1, 11), (0.2, -1.02), (0.01, -0.03)),
        record_draws("drift_out_of_the_corner", (11, 11), (1.1, 1.2), (0.15, 0.1)),
        record_draws("no_move_below_one", (6, 7), (0.97, 0.99), (0.1, 0.1)),
        record_drifts(),
        record_places(),
        record_runs(),
    ]
