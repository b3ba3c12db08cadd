# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission with faults over ROS: step by step the direct one, on topics and in its record."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
from rig import LATCHED, TIMEOUT_S, Rig
from sensor_msgs.msg import BatteryState

from dsse_ros.ros.ros_env import DsseRosEnv
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.fault_kernels import STATUSES

FIELDS: dict[str, Any] = {
    "grid_size": 8, "num_drones": 3, "timestep_limit": 40, "person_amount": 2, "rules": "v2",
    "probability_of_detection": 0.05, "battery_move": 6.0, "battery_search": 7.0,
    "relief_steps": 2, "loss_steps": (0, 25, 0), "stuck_rate": 0.03, "command_drop_rate": 0.05,
    "command_delay": 1, "false_alarm_rate": 0.5, "position_noise": 0.3, "wind_speed": 3.0,
}  # fmt: skip
SEED = 5


def test_a_mission_with_all_faults_is_the_direct_one_on_every_topic(
    rig: Rig, tmp_path: Path
) -> None:
    record = tmp_path / "mission.csv"
    sim = rig.sim({**FIELDS, "seed": SEED, "record_file": str(record)})
    batteries = rig.listen(BatteryState, "drone0/battery", LATCHED)
    env, beside = DsseRosEnv(timeout_s=TIMEOUT_S, domain_id=rig.domain), parallel_env(**FIELDS)
    draw = np.random.default_rng(1)
    try:
        np.testing.assert_equal(env.reset(seed=SEED), beside.reset(seed=SEED))
        seen, statuses = [], set()
        while beside.agents:
            joint = {agent: int(draw.integers(9)) for agent in beside.agents}
            mine, theirs = env.step(joint), beside.step(joint)
            np.testing.assert_equal(mine, theirs)
            assert beside.world.faults is not None
            seen.append(beside.world.faults.conditions[0].copy())
            statuses |= {STATUSES[k] for k in seen[-1]["status"]}
    finally:
        env.close()
    assert statuses >= {"searching", "stuck", "identifying", "home", "lost"}
    left = np.float32(seen[-1]["battery"][0] / 100)
    rig.until(lambda: batteries and batteries.last.percentage == left, "the last battery")
    assert batteries.last.present and np.isnan(batteries.last.voltage)
    with record.open(newline="") as file:
        rows = list(csv.DictReader(file))
    rows = [row for row in rows if row["mission"] == rows[-1]["mission"]]
    for drone in range(3):
        # The first row is the start.
        of_drone = [row for row in rows if row["agent"] == f"drone{drone}"][1:]
        assert [row["status"] for row in of_drone] == [STATUSES[c["status"][drone]] for c in seen]
        assert [float(row["battery"]) for row in of_drone] == [c["battery"][drone] for c in seen]
    health = sim.health_when(lambda values: "drone1" in values["lost_drones"])
    assert float(health["lowest_battery"]) == round(float(seen[-1]["battery"].min()), 1)
