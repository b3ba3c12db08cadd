# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The same seed is the same mission, byte for byte, under any planner."""

from __future__ import annotations

import random

import pytest
from rig import Rig, Sim, content
from sensor_msgs.msg import Image

SCENARIO = {
    "grid_size": 8,
    "person_initial_position": [4, 4],
    "person_amount": 2,
    "vector": [-0.3, 0.4],
    "sigma": 1.5,
    "timestep_limit": 60,
}


def sims(rig: Rig, **seeds: int) -> list[Sim]:
    """Start one node per name, each in a namespace of that name, and keep all of its reports."""
    processes = {
        name: rig.start(
            "sim_node",
            {
                **SCENARIO,
                "num_drones": 6,
                "seed": seed,
                "run_id": 9,
                "record_file": str(rig.folder / f"{name}.csv"),
                f"qos_overrides./{name}/step_report.publisher.history": "keep_all",
            },
            "-r",
            f"__ns:=/{name}",
        )
        for name, seed in seeds.items()
    }
    return [Sim(rig, process, f"/{name}") for name, process in processes.items()]


def test_the_same_seed_and_commands_give_the_same_reports(rig: Rig) -> None:
    flown = sims(rig, first=5, again=5, other=6)
    draw = random.Random(1)
    # Five wait around the last known position, the sixth roams: who finds whom when is chance.
    script = [[1] * 3 + [3] * 3, *([3] * 6 for _ in range(3))]
    script += [[4] * 5 + [draw.choice([1, 3, 4])] for _ in range(12)]
    for actions in script:
        for sim in flown:
            if sim.flying:
                sim.fly(*actions)
    first, again, other = ([content(m) for m in sim.reports] for sim in flown)
    assert len(first) > 3
    assert first == again
    assert first != other
    images = [rig.first(Image, sim.topic("probability")) for sim in flown[:2]]
    assert images[0] == images[1]


@pytest.mark.parametrize("planner", ["greedy", "random"])
def test_the_same_seed_and_planner_give_the_same_reports(rig: Rig, planner: str) -> None:
    names = [f"{planner}1", f"{planner}2"]
    flown = sims(rig, **dict.fromkeys(names, 7))
    for name in names:
        rig.start("planner_node", {"planner": planner, "seed": 4}, "-r", f"__ns:=/{name}")
    for sim in flown:
        rig.until(lambda sim=sim: not sim.flying, "the end")  # type: ignore[misc]
    first, again = ([content(m) for m in sim.reports] for sim in flown)
    assert len(first) > 2 and len(first) == flown[0].step_number + 1
    assert first == again
    logs = [(rig.folder / f"{name}.csv").read_bytes() for name in names]
    assert logs[0] == logs[1]
