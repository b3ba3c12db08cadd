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

READY_LATE_S = 300.0
"""Vehicle time, 15 s of wall time, until a vehicle can be armed: much later than its position."""


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    """Replace the domain of the module: bridges of other tests would speak in between."""
    made = Rig(tmp_path)
    try:
        yield made
    finally:
        made.close()


# The tests of the fleet controller have the others, without ROS.
SITUATIONS = pytest.mark.parametrize(
    ("search", "where"),
    [
        ("running", "on the ground"),
        ("running", "in the air"),
        ("over", "on the ground"),
        ("drone lost", "in the air"),
    ],
)

SEARCHED_FOR_LONG: dict[str, Any] = SEARCHED | {
    "drones_positions": [0, 5],
    "vehicle_time": "awaited",
    "timestep_limit": 2,
}


def flown_until(rig: Rig, sim: Sim, bridge: Bridge, search: str, *, landed: bool) -> None:
    """Fly a search with one vehicle until it is running, over or lost, in the air or landed."""
    waits = search == "running" and landed
    if waits:
        rig.until(lambda: bridge.state(0).get("order", "").startswith("MakeReady"), "the order")
        return
    sim.joint(UP)
    if search == "drone lost":
        rig.until(lambda: bridge.state(0).get("lost"), "the loss")
        rig.until(lambda: sim.report["terminated"].all(), "drone0 terminated")
    else:
        bridge.until(0, arrived="true", cell="0 4")
        rig.until(lambda: sim.step_number == 1, "the step")
    if search == "over":
        fly(sim, UP)
        fly(sim, UP)
    if landed:
        bridge.until(0, flying="false", armed="false")
    else:
        bridge.until(0, flying="true", **({"order": "Hold()"} if search == "over" else {}))


def conditions(search: str, *, landed: bool) -> tuple[tuple[str, ...], float, dict[str, str]]:
    """Return the faults of a vehicle, when it is ready, s, and parameters of the bridge."""
    mode = "LAND" if landed else "LOITER"
    faults = (f"pilot@airborne:20={mode}",) if search == "drone lost" else ()
    ready_s = READY_LATE_S if search == "running" and landed else 10.0
    return faults, ready_s, {"at_end": "return" if landed else "hold"}


def stays(rig: Rig, bridge: Bridge) -> None:
    """Wait for some news of a vehicle, in which nothing is new."""
    before, seen = bridge.state(0), len(bridge.states[0])
    rig.until(lambda: len(bridge.states[0]) >= seen + 5, "more of its state")
    keys = ("flying", "armed", "mode")
    assert [bridge.state(0)[key] for key in keys] == [before[key] for key in keys]


@SITUATIONS
def test_a_bridge_started_again_has_nobody_take_off_who_is_out_of_the_search(
    rig: Rig, search: str, where: str
) -> None:
    """The bridge meets the vehicle before take-off, in the air, landed, or with a pilot."""
    landed = where == "on the ground"
    faults, ready_s, at_end = conditions(search, landed=landed)
    sim = rig.sim(SEARCHED_FOR_LONG)
    with autopilots(faults, ready_s=ready_s) as vehicles:
        first = Bridge(rig, vehicles, **at_end)
        flown_until(rig, sim, first, search, landed=landed)
        first.process.kill()
        again = Bridge(rig, vehicles, **at_end)
        if search == "running":
            fly(sim, UP)
            cell = "0 4" if landed else "0 3"
            again.until(0, arrived="true", flying="true", cell=cell, lost="")
            assert take_off_orders(again) == landed
            return
        flying = "false" if landed else "true"
        again.until(0, connected="true", flying=flying, armed=flying)
        if search == "drone lost":
            rig.until(lambda: again.state(0)["lost"].startswith("taken over"), "the loss")
            state = again.until(0, mode="LAND" if landed else "LOITER")
            assert state["order"] == "" and state["custody"] == "taken over"
        stays(rig, again)
        assert take_off_orders(again) == 0


@SITUATIONS
def test_a_simulation_started_again_moves_nobody_without_a_person(
    rig: Rig, search: str, where: str
) -> None:
    landed = where == "on the ground"
    faults, ready_s, at_end = conditions(search, landed=landed)
    sim = rig.sim(SEARCHED_FOR_LONG)
    with autopilots(faults, ready_s=ready_s) as vehicles:
        bridge = Bridge(rig, vehicles, **at_end)
        flown_until(rig, sim, bridge, search, landed=landed)
        sim.process.kill()
        before = take_off_orders(bridge)
        sim = rig.sim(SEARCHED_FOR_LONG | {"drones_positions": [1, 4]})
        sim.joint(RIGHT)
        stays(rig, bridge)
        if search == "drone lost" and not landed:
            assert bridge.state(0)["mode"] == "LOITER"
            return
        if not landed:
            bridge.until(0, flying="true", cell="0 4" if search == "running" else "0 3")
            assert rig.call(Trigger, "mavlink_bridge/return").success
            bridge.until(0, flying="false", armed="false")
        rig.until(lambda: bridge.process.output.count(" is followed") == 2, "the other search")
        stays(rig, bridge)
        assert take_off_orders(bridge) == before
        assert rig.call(SetBool, "mavlink_bridge/arm", data=True).success
        state = bridge.until(0, arrived="true", flying="true", cell="2 4")
        assert state["lost"] == "" and take_off_orders(bridge) == before + 1


def test_with_arm_always_a_simulation_started_again_is_flown_too(rig: Rig) -> None:
    sim = rig.sim(SEARCHED_FOR_LONG)
    with autopilots(()) as vehicles:
        bridge = Bridge(rig, vehicles, arm="always", at_end="return")
        rig.until(lambda: "arm:=always" in bridge.process.output, "the warning")
        flown_until(rig, sim, bridge, "over", landed=True)
        sim.process.kill()
        sim = rig.sim(SEARCHED_FOR_LONG | {"drones_positions": [1, 4]})
        sim.joint(RIGHT)
        bridge.until(0, arrived="true", flying="true", cell="2 4", lost="")


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
