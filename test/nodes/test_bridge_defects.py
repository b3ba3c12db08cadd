# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A defect in what one vehicle is led by takes its drone out, and the others are flown on."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rig import LATCHED, Process, Rig, Sim

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "flight"))

from autopilot.running import free_udp_port  # noqa: E402

PROGRAM = """\
import sys
from dsse_ros.bridge import fleet_controller, vehicle_follower
from dsse_ros.nodes import mavlink_bridge

class VehicleFollower(vehicle_follower.VehicleFollower):
    number = 0

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.mine, VehicleFollower.number = VehicleFollower.number, VehicleFollower.number + 1

    def advance(self, *arguments, **options):
        if self.mine == 1:
            raise ZeroDivisionError("one that nobody knew of")
        return super().advance(*arguments, **options)

fleet_controller.VehicleFollower = VehicleFollower
sys.exit(mavlink_bridge.main())
"""


def test_a_defect_of_one_vehicle_ends_neither_the_bridge_nor_the_others(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    (rig.folder / "defective_bridge.py").write_text(PROGRAM)
    monkeypatch.setenv("PYTHONPATH", str(rig.folder), prepend=os.pathsep)
    search: dict[str, Any] = {"vehicle_time": "awaited", "num_drones": 2, "grid_size": 6}
    sim: Sim = rig.sim(search)
    connections = [f"udpin:127.0.0.1:{free_udp_port()}" for _ in range(2)]
    parameters = {"connections": connections, "state_directory": str(rig.folder / "state")}
    arguments = [f"{name}:={json.dumps(value)}" for name, value in parameters.items()]
    words = ["--ros-args", *(word for argument in arguments for word in ("-p", argument))]
    bridge = Process(["defective_bridge", *words], rig.folder / "bridge.log", rig.domain)
    rig.processes.append(bridge)
    states = [rig.listen(DiagnosticArray, f"drone{i}/vehicle_state", LATCHED) for i in range(2)]

    def lost(i: int) -> str:
        values = states[i].last.status[0].values if states[i] else []
        return next((pair.value for pair in values if pair.key == "lost"), "")

    rig.until(lambda: lost(1), "the defect")
    assert lost(1) == "defect: ZeroDivisionError: one that nobody knew of"
    seen = len(states[0])
    rig.until(lambda: len(states[0]) >= seen + 3, "news of the other one")
    assert lost(0) == "" and bridge.running
    # It is reported once, not at every turn.
    assert bridge.output.count("one that nobody knew of") <= 3
    assert sim.process.running
