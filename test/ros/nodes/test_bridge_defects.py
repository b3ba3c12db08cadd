# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A defect in what one vehicle is led by takes its drone out, and the others are flown on."""

from __future__ import annotations

import json
import os
from typing import Any

import pytest
from autopilot.running import free_udp_port
from diagnostic_msgs.msg import DiagnosticArray
from rig import LATCHED, Process, Rig, Sim

PROGRAM = """\
import sys
from dsse_ros.vehicles.fleet import fleet_controller, vehicle_dispatcher
from dsse_ros.ros.nodes import mavlink_bridge

class VehicleDispatcher(vehicle_dispatcher.VehicleDispatcher):
    number = 0

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.mine, VehicleDispatcher.number = VehicleDispatcher.number, VehicleDispatcher.number + 1

    def advance(self, *arguments, **options):
        if self.mine == 1:
            raise ZeroDivisionError("one that nobody knew of")
        return super().advance(*arguments, **options)

fleet_controller.VehicleDispatcher = VehicleDispatcher
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
