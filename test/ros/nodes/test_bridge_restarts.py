# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""After a restart of the bridge or of the simulation no vehicle takes off that must not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bridge_rig import RIGHT, SEARCHED, UP, Bridge, autopilots, fly, take_off_orders
from diagnostic_msgs.msg import DiagnosticStatus
from rig import Rig, Sim
from std_srvs.srv import SetBool, Trigger


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    """Replace the domain of the module: bridges of other tests would speak in between."""
    made = Rig(tmp_path)
    try:
        yield made
    finally:
        made.close()


SITUATIONS = pytest.mark.parametrize("over", [False, True], ids=["in the air", "on the ground"])
"""The tests of the fleet controller have many more, without ROS."""
SEARCHED_FOR_LONG: dict[str, Any] = SEARCHED | {
    "drones_positions": [0, 5],
    "vehicle_time": "awaited",
    "timestep_limit": 2,
}


def flown_until(rig: Rig, sim: Sim, bridge: Bridge, *, over: bool) -> None:
    """Fly a search with one vehicle until it is in the air, or the search over and it landed."""
    sim.joint(UP)
    bridge.until(0, arrived="true", cell="0 4")
    rig.until(lambda: sim.step_number == 1, "the step")
    if over:
        fly(sim, UP)
        fly(sim, UP)
        bridge.until(0, flying="false", armed="false")


def stays(rig: Rig, bridge: Bridge) -> None:
    """Wait for some news of a vehicle, in which nothing is new."""
    before, seen = bridge.state(0), len(bridge.states[0])
    rig.until(lambda: len(bridge.states[0]) >= seen + 5, "more of its state")
    keys = ("flying", "armed", "mode")
    assert [bridge.state(0)[key] for key in keys] == [before[key] for key in keys]


@SITUATIONS
def test_a_bridge_started_again_has_nobody_take_off_who_is_out_of_the_search(
    rig: Rig, *, over: bool
) -> None:
    sim = rig.sim(SEARCHED_FOR_LONG)
    with autopilots(()) as vehicles:
        first = Bridge(rig, vehicles, at_end="return")
        flown_until(rig, sim, first, over=over)
        first.process.kill()
        again = Bridge(rig, vehicles, at_end="return")
        if over:
            again.until(0, connected="true", flying="false", armed="false")
            stays(rig, again)
        else:
            fly(sim, UP)
            again.until(0, arrived="true", flying="true", cell="0 3", lost="")
        assert take_off_orders(again) == 0


@SITUATIONS
def test_a_simulation_started_again_moves_nobody_without_a_person(rig: Rig, *, over: bool) -> None:
    sim = rig.sim(SEARCHED_FOR_LONG)
    with autopilots(()) as vehicles:
        bridge = Bridge(rig, vehicles, at_end="return")
        flown_until(rig, sim, bridge, over=over)
        sim.process.kill()
        before = take_off_orders(bridge)
        sim = rig.sim(SEARCHED_FOR_LONG | {"drones_positions": [1, 4]})
        sim.joint(RIGHT)
        stays(rig, bridge)
        if not over:
            bridge.until(0, flying="true", cell="0 4")
            assert rig.call(Trigger, "mavlink_bridge/return").success
            bridge.until(0, flying="false", armed="false")
        rig.until(lambda: bridge.process.output.count("mission 1 of run") == 2, "the other search")
        stays(rig, bridge)
        assert take_off_orders(bridge) == before
        assert rig.call(SetBool, "mavlink_bridge/arm", data=True).success
        state = bridge.until(0, arrived="true", flying="true", cell="2 4")
        assert state["lost"] == "" and take_off_orders(bridge) == before + 1


def test_a_foreign_simulation_stops_nothing_but_the_take_offs(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5], "vehicle_time": "awaited"})
        bridge = Bridge(rig, vehicles)
        sim.joint(UP)
        bridge.until(0, arrived="true", cell="0 4")
        foreign = rig.sim(SEARCHED | {"drones_positions": [0, 5, 1, 5, 2, 5, 3, 5]})
        trouble = "2 nodes publish step_report: no other search is followed"
        rig.until(lambda: trouble in bridge.state(0)["message"], trouble)
        assert bridge.states[0].last.status[0].level == DiagnosticStatus.ERROR
        # From then on an interrupt ends it in peace.
        rig.until(lambda: "waiting for commands" in foreign.process.output, "what it waits for")
        foreign.process.stop()
        sim.joint(UP, step=1)
        state = bridge.until(0, arrived="true", cell="0 3", refused="")
        assert state["flying"] == "true" and take_off_orders(bridge) == 1


def test_a_mission_that_was_flown_is_not_flown_again_by_a_bridge_started_again(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5], "timestep_limit": 1})
        for _ in range(2):
            fly(sim, UP)
        first = Bridge(rig, vehicles, mode="mission")
        first.until(0, mode="AUTO", flying="true")
        first.process.kill()
        second = Bridge(rig, vehicles, mode="mission")
        second.until(0, connected="true", armed="false", order="", lost="")
        assert second.process.output.count("order") == 0
        second.process.kill()
        third = Bridge(rig, vehicles, mode="mission", exit_at_end=True)
        rig.until(lambda: not third.process.running, "the end of the bridge")
        third.process.stop()
