# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small live searches, with steps of drones that fly at random."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.mission.live.admission import Admission, Clocks
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.inputs import parse
from dsse_ros.mission.live.live_search import Entry, LiveSearch
from dsse_ros.mission.live.step_looks import StepLooks
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv

INCIDENT: dict[str, Any] = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
    "wind": {"speed": 4, "from": 90, "error": 1},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:50Z", "radius": 150},
}  # fmt: skip
AREA = {
    "type": "Polygon",
    "coordinates": [[[-46.31, -24.01], [-46.3, -24.01], [-46.3, -23.99], [-46.31, -23.99],
                     [-46.31, -24.01]]],
}  # fmt: skip
LINE = {"type": "LineString", "coordinates": [[-46.31, -24.005], [-46.29, -24.0]]}


def live_env(rules: str = "sea", **fields: Any) -> SearchEnv:
    """Return a live search with two drones over the datum, unless fields state other ones."""
    if rules in ("sea", "flight"):
        fields = {"incident": INCIDENT, "particles": 400, "timestep_limit": 30, **fields}
    else:
        fields = {"grid_size": 9, "timestep_limit": 30, **fields}
    fields = {"num_drones": 2, "probability_of_detection": 0.8, "false_alarm_rate": 0.05, **fields}
    env = parallel_env(fields, rules=rules, truth="none")
    col, row = env.scenario.person_initial_position
    starts = [(col + drone, row) for drone in range(env.world.num_drones)]
    env.reset(seed=3, options={"drones_positions": starts})
    return env


def fly(env: SearchEnv, steps: int, seed: int = 0) -> list[StepLooks]:
    """Fly at random, and return the looks of the steps."""
    world, rng = env.world, np.random.default_rng(seed)
    beliefs = LiveBeliefs(world)
    for _ in range(steps):
        joint = rng.integers(0, max(len(env.rules.actions), 1), world.num_drones).astype(np.int8)
        if world.metres is not None:
            world.metres.actions[0] = rng.uniform(-1.0, 1.0, (world.num_drones, 2))
        beliefs.before_step(joint[None])
        env.advance(joint)
        beliefs.after_step()
    return list(beliefs.live_search.steps)


def decide(live_search: LiveSearch, kind: str, **values: Any) -> Entry | Rejected | None:
    """Return the entry of an input, or why it is refused; times are s since the search began."""
    parsed = parse(kind, json.dumps(values))
    if isinstance(parsed, Rejected):
        return parsed
    now_s = len(live_search.steps) * live_search.scenario.step_duration_s
    checked = Admission(live_search).check(parsed.value, Clocks(now_s, now_s, float))
    return checked.value if isinstance(checked, Accepted) else checked


def put(live_search: LiveSearch, kind: str, **values: Any) -> Entry:
    """Have a live search take up an input."""
    entry = decide(live_search, kind, **values)
    assert isinstance(entry, Entry), entry
    live_search.apply(entry)
    return entry


def kept(live_search: LiveSearch) -> tuple[bytes, float]:
    """Return the belief and the POS of a live search, for comparison bit for bit."""
    return live_search.belief.density.tobytes(), live_search.pos
