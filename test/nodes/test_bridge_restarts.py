# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""After a restart of the bridge or of the simulation no vehicle takes off that must not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from bridge_rig import SEARCH, SEARCHED, UP, Bridge, autopilots, fly, take_off_orders
from diagnostic_msgs.msg import DiagnosticStatus
from rig import Rig

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


@pytest.mark.parametrize("where", ["on the ground", "in the air"])
@pytest.mark.parametrize("search", ["running", "over", "drone lost"])
def test_a_bridge_started_again_has_nobody_take_off_who_is_out_of_the_search(
    rig: Rig, search: str, where: str
) -> None:
    """The vehicle is met again where it is: before take-off, aloft, landed, or with a pilot."""
    landed, lost = where == "on the ground", search == "drone lost"
    faults = ("pilot@airborne:20=LAND" if landed else "pilot@airborne:20=LOITER",) if lost else ()
    waits = search == "running" and landed
    sim = rig.sim(
        SEARCHED | {"drones_positions": [0, 5], "wait_for_vehicles": True, "timestep_limit": 1}
    )
    with autopilots(faults, ready_s=READY_LATE_S if waits else 10.0) as vehicles:
        at_end = {"at_end": "return" if landed else "hold"}
        first = Bridge(rig, vehicles, **at_end)
        if waits:
            rig.until(lambda: first.state(0).get("order", "").startswith("TakeOff"), "the order")
        elif lost:
            rig.until(lambda: first.state(0).get("lost"), "the loss")
            rig.until(lambda: sim.report["terminated"].all(), "drone0 terminated")
        else:
            first.until(0, arrived="true", cell="0 5")
            if search == "over":
                fly(sim, UP)
                fly(sim, UP)
        if landed:
            first.until(0, flying="false", armed="false")
        else:
            first.until(0, flying="true", **({"order": "Hold()"} if search == "over" else {}))
        first.process.kill()
        again = Bridge(rig, vehicles, **at_end)
        states = again.states[0]
        if search == "running":
            if not waits:
                fly(sim, UP)
            again.until(0, arrived="true", flying="true", cell="0 5" if waits else "0 4")
            assert take_off_orders(again) == waits
        else:
            flying = "false" if landed else "true"
            again.until(0, connected="true", flying=flying, armed=flying)
            if lost:
                rig.until(lambda: again.state(0)["lost"].startswith("taken over"), "the loss")
                again.until(0, mode="LAND" if landed else "LOITER")
            seen = len(states)
            rig.until(lambda: len(states) >= seen + 5, "more of its state")
            assert take_off_orders(again) == 0
            state = again.state(0)
            assert state["flying"] == state["armed"] == flying
            if lost:
                assert state["order"] == ""


@pytest.mark.parametrize("where", ["on the ground", "in the air"])
@pytest.mark.parametrize("search", ["running", "over", "drone lost"])
def test_a_simulation_started_again_is_a_search_for_all_but_those_a_pilot_has(
    rig: Rig, search: str, where: str
) -> None:
    landed, lost = where == "on the ground", search == "drone lost"
    faults = ("pilot@airborne:20=LAND" if landed else "pilot@airborne:20=LOITER",) if lost else ()
    waits = search == "running" and landed
    searched = SEARCHED | {
        "drones_positions": [0, 5], "wait_for_vehicles": True, "timestep_limit": 1
    }  # fmt: skip
    sim = rig.sim(searched)
    with autopilots(faults, ready_s=READY_LATE_S if waits else 10.0) as vehicles:
        bridge = Bridge(rig, vehicles, at_end="return" if landed else "hold")
        if waits:
            rig.until(lambda: bridge.state(0).get("order", "").startswith("TakeOff"), "the order")
        elif lost:
            rig.until(lambda: bridge.state(0).get("lost"), "the loss")
        else:
            bridge.until(0, arrived="true", cell="0 5")
            if search == "over":
                fly(sim, UP)
                fly(sim, UP)
                bridge.until(0, **({"armed": "false"} if landed else {"order": "Hold()"}))
        if landed:
            bridge.until(0, flying="false", armed="false")
        sim.process.kill()
        before = take_off_orders(bridge)
        sim = rig.sim(searched | {"drones_positions": [1, 4]})
        if lost:
            rig.until(lambda: sim.report["terminated"].all(), "drone0 terminated")
            count = len(bridge.states[0])
            rig.until(lambda: len(bridge.states[0]) >= count + 4, "more of its state")
            assert bridge.state(0)["mode"] == ("LAND" if landed else "LOITER")
            assert bridge.state(0)["flying"] == ("false" if landed else "true")
            return
        state = bridge.until(0, arrived="true", flying="true", cell="1 4")
        assert state["lost"] == ""
        # A take-off that was waiting for the first search is called off and ordered anew.
        assert take_off_orders(bridge) - before <= landed


def test_a_foreign_simulation_stops_nothing_but_the_take_offs(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5], "wait_for_vehicles": True})
        bridge = Bridge(rig, vehicles)
        bridge.until(0, arrived="true", cell="0 5")
        foreign = rig.sim(SEARCHED | {"drones_positions": [0, 5, 1, 5, 2, 5, 3, 5]})
        trouble = "1 vehicles for 4 drones: nothing is flown"
        rig.until(lambda: trouble in bridge.state(0)["message"], trouble)
        assert bridge.states[0].last.status[0].level == DiagnosticStatus.ERROR
        # From then on an interrupt ends it in peace.
        rig.until(lambda: "waiting for commands" in foreign.process.output, "what it waits for")
        foreign.process.stop()
        fly(sim, UP)
        state = bridge.until(0, arrived="true", cell="0 4", refused="")
        assert state["flying"] == "true" and take_off_orders(bridge) == 1


def test_a_simulation_restarted_before_its_first_step_is_followed_anew(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5], "wait_for_vehicles": True})
        bridge = Bridge(rig, vehicles)
        bridge.until(0, arrived="true", cell="0 5")
        sim.process.kill()
        again = {"drones_positions": [1, 4], "wait_for_vehicles": True, "seed": 2}
        sim = rig.sim(SEARCHED | again)
        bridge.until(0, arrived="true", cell="1 4")
        fly(sim, SEARCH)
        assert sim.cells == [(1, 4)]


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
