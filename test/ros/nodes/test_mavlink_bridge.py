# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""mavlink_bridge between sim_node and simulated autopilots, each a process of its own."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from bridge_rig import (
    LEFT,
    RIGHT,
    SEARCH,
    SEARCHED,
    UP,
    Bridge,
    arming_orders,
    autopilots,
    away_m,
    detour_m,
    fly,
    health_when,
    take_off_orders,
)
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rig import BEST_EFFORT, LATCHED, Rig
from sensor_msgs.msg import BatteryState, NavSatFix, PointCloud2, TimeReference
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from msg_adapters.stamps import to_nanoseconds


def call(rig: Rig, kind: Any, service: str, **request: Any) -> tuple[bool, str]:
    """Call a service of the bridge."""
    response = rig.call(kind, service, **request)
    return response.success, response.message


def boot_s(inbox: Sequence[TimeReference]) -> float:
    """Return the last clock of a vehicle."""
    return to_nanoseconds(inbox[-1].time_ref) * 1e-9


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    """Replace the domain of the module: bridges of other tests would speak in between."""
    made = Rig(tmp_path)
    try:
        yield made
    finally:
        made.close()


def test_vehicles_fly_the_cells_of_their_drones_and_the_search_waits_for_them(rig: Rig) -> None:
    start = {"drones_positions": [0, 5, 1, 5], "timestep_limit": 3}
    with autopilots((), ()) as vehicles:
        sim = rig.sim(SEARCHED | start | {"vehicle_time": "awaited"})
        bridge = Bridge(rig, vehicles, search_hold=20.0)
        fixes = rig.listen(NavSatFix, "drone1/vehicle_fix", BEST_EFFORT)
        batteries = rig.listen(BatteryState, "drone1/vehicle_battery", LATCHED)
        visits, first = [], 0
        for actions in ((UP, RIGHT), (SEARCH, RIGHT), (RIGHT, UP)):
            cells, begun = list(sim.cells), [len(poses) for poses in bridge.poses]
            fly(sim, *actions)
            visits.append((cells, begun))
            first = first or len(bridge.poses[0])
        down = len(bridge.poses[0])
        assert fixes and abs(fixes.last.latitude + 24.04) < 0.01
        rig.until(lambda: batteries and 0.5 < batteries.last.percentage <= 1.0, "its battery")
        fly(sim, SEARCH, SEARCH)
        assert not sim.flying
        for i in range(2):
            state = bridge.until(i, flying="false", armed="false", arrived="true")
            assert state["lost"] == "" and state["mode"] == "RTL"
        rig.until(lambda: bridge.poses[0].last.pose.position.z < 1.0, "its pose on the ground")
        for cells, begun in visits:
            for poses, cell, since in zip(bridge.poses, cells, begun, strict=True):
                assert detour_m(poses[max(since - 1, 0) :], cell) <= 10.0
        # The search was a descent to where it belongs.
        lowest = min(pose.pose.position.z for pose in bridge.poses[0][first:down])
        assert 25.0 <= lowest <= 35.0


def test_the_sea_takes_as_long_as_the_vehicles_and_finds_when_they_have_looked(rig: Rig) -> None:
    place = {"drones_positions": [0, 5, 1, 5], "person_initial_position": [0, 4]}
    stays = {"person_motion": "random_walk", "person_steps": [0.0] * 4 + [1.0] + [0.0] * 4}
    found = {"probability_of_detection": 1.0, "vehicle_time": "followed", "altitude": 120.0}
    with autopilots((), ()) as vehicles:
        sim = rig.sim(SEARCHED | place | stays | found)
        bridge = Bridge(rig, vehicles, search_hold=20.0)
        clocks = [rig.listen(TimeReference, f"drone{i}/vehicle_time") for i in range(2)]
        sim.begin(UP, RIGHT)
        begun_s, since = [boot_s(inbox) for inbox in clocks], len(bridge.poses[0])
        while sim.flying:
            fly(
                sim,
                UP if sim.cells[0] == (0, 5) else SEARCH,
                RIGHT if sim.cells[1][0] == 1 else LEFT,
            )
        took_s = [boot_s(inbox) - before for inbox, before in zip(clocks, begun_s, strict=True)]
        assert sim.report["found"].tolist() == [1, 0]
        look = ["look_action", "look_col", "look_row"]
        assert sim.report[look].tolist()[0] == (SEARCH, 0, 4)
        heights = [pose.pose.position.z for pose in bridge.poses[0][since:]]
        assert min(heights) < 31.0
        assert bridge.state(0)["looked_task"] == str(sim.tasks()["task"][0])
        sea_s = 13.0 * sim.step_number
        # A move, and a search of 90 m down and 20 s there.
        assert sea_s > 60.0
        # Positions come once a second of the vehicles' time, and messages take some.
        assert took_s == pytest.approx([sea_s] * 2, abs=4.0)


@pytest.mark.parametrize(
    ("fault", "mode", "lost"),
    [
        ("pilot@airborne:30=LOITER", "LOITER", "taken over: in LOITER"),
        ("battery@airborne:60", "RTL", "battery failsafe"),
    ],
)
def test_who_drops_out_is_lost_and_let_alone_and_the_other_goes_on(
    rig: Rig, fault: str, mode: str, lost: str
) -> None:
    start = {"drones_positions": [0, 5, 1, 5]}
    with autopilots((), (fault,)) as vehicles:
        sim = rig.sim(SEARCHED | start | {"vehicle_time": "awaited"})
        bridge = Bridge(rig, vehicles)
        sim.joint(UP, UP)
        rig.until(lambda: bridge.state(1).get("lost"), "drone1 is lost")
        assert lost in bridge.state(1)["lost"]
        bridge.until(1, mode=mode)
        rig.until(lambda: sim.report["terminated"].tolist() == [0, 1], "drone1 terminated")
        rig.until(lambda: sim.cells[0] == (0, 4), "the step")
        fly(sim, RIGHT, RIGHT)
        assert sim.cells[0] == (1, 4) and sim.report["terminated"].tolist() == [0, 1]
        assert bridge.state(1)["mode"] == mode
        assert lost in sim.health()["lost.drone1"]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_who_is_lost_on_the_ground_stays_there_when_it_is_connected_again(
    rig: Rig, autopilot: str
) -> None:
    rig.sim(SEARCHED | {"drones_positions": [0, 5], "vehicle_time": "awaited"})
    # It is ready some time after the order to be so.
    with autopilots((), autopilot=autopilot, ready_s=240.0) as vehicles:
        bridge = Bridge(rig, vehicles, autopilot=autopilot, link_timeout=4.0, lost_timeout=4.0)
        rig.until(lambda: bridge.state(0).get("order", "").startswith("MakeReady"), "the order")
        os.kill(vehicles[0].pid, signal.SIGSTOP)
        silent = f"nothing from system 1 on {vehicles[0].connection}"
        bridge.until(0, connected="false", lost=f"link lost: no heartbeat for 4 s: {silent}")
        os.kill(vehicles[0].pid, signal.SIGCONT)
        bridge.until(0, connected="true", ready="true", order="", custody="grounded")
        seen = len(bridge.states[0])
        rig.until(lambda: len(bridge.states[0]) >= seen + 3, "more of its state")
        states = [
            {pair.key: pair.value for pair in message.status[0].values}
            for message in bridge.states[0]
        ]
        assert {(state["armed"], state["flying"]) for state in states} == {("false", "false")}
        assert bridge.state(0)["lost"]


def test_a_take_off_is_called_off_when_a_search_comes_that_cannot_be_flown(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5]})
        # The take-off waits for somebody to arm it, for as long as that takes.
        bridge = Bridge(rig, vehicles, arm=False)
        sim.joint(UP)
        rig.until(lambda: bridge.state(0).get("order", "").startswith("TakeOff"), "the order")
        sim.process.kill()
        rig.sim(SEARCHED | {"drones_positions": [0, 5, 1, 5]})
        bridge.until(0, order="MakeReady(arm=False, from_modes=())", armed="false", flying="false")
        trouble = "1 vehicles for 2 drones"
        rig.until(lambda: trouble in bridge.state(0)["message"], trouble)
        assert take_off_orders(bridge) == 1


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"ready_s": 10_000.0}, "no position within 12 s"),
        ({"key": True}, "within 12 s"),
    ],
)
def test_who_cannot_take_off_is_lost_with_the_reason_and_the_other_goes_on(
    rig: Rig, options: dict[str, Any], why: str
) -> None:
    key = rig.folder / "key"
    key.write_text("07" * 32)
    settings = {"key_file": key} if options.pop("key", False) else options
    with autopilots(()) as one, autopilots((), first=2, **settings) as other:
        vehicles = [one[0], other[0]]
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5, 1, 5], "vehicle_time": "awaited"})
        bridge = Bridge(rig, vehicles, join_timeout=12.0)
        rig.until(lambda: bridge.state(1).get("lost"), "the second is lost")
        assert why in bridge.state(1)["lost"]
        assert bridge.process.output.count("drone1 is lost") == 1
        fly(sim, UP, UP)
        assert sim.report["terminated"].tolist() == [0, 1]


def test_each_vehicle_flies_in_a_layer_of_its_own(rig: Rig) -> None:
    with autopilots((), (), ()) as vehicles:
        sim = rig.sim(
            SEARCHED | {"drones_positions": [0, 5, 1, 5, 2, 5], "vehicle_time": "awaited"}
        )
        bridge = Bridge(rig, vehicles)
        sim.joint(UP, UP, UP)
        for i, alt_m in enumerate((60.0, 55.0, 50.0)):
            bridge.until(i, arrived="true")
            assert abs(bridge.poses[i].last.pose.position.z - alt_m) < 3.5


def test_layers_that_do_not_fit_between_the_altitudes_are_not_flown(rig: Rig) -> None:
    with autopilots((), ()) as vehicles:
        rig.sim(SEARCHED | {"drones_positions": [0, 5, 1, 5]})
        bridge = Bridge(rig, vehicles, altitude_step=30.0, min_altitude=40.0)
        trouble = "altitude_step must be at most 20 m for 2 vehicles from 60 m down to 40 m"
        rig.until(lambda: trouble in bridge.state(0).get("message", ""), trouble)
        assert take_off_orders(bridge) == 0


def test_the_bridge_ends_when_its_vehicles_are_home_if_it_is_to(rig: Rig) -> None:
    with autopilots((), ()) as vehicles:
        sim = rig.sim(
            SEARCHED
            | {"drones_positions": [0, 5, 1, 5], "vehicle_time": "awaited", "timestep_limit": 1}
        )
        bridge = Bridge(rig, vehicles, exit_at_end=True)
        fly(sim, UP, UP)
        fly(sim, UP, UP)
        rig.until(lambda: not bridge.process.running, "the end of the bridge")
        bridge.process.stop()
        for i in range(2):
            state = bridge.until(i, armed="false")
            assert state["lost"] == "" and state["arrived"] == "true"


def test_why_a_vehicle_cannot_be_reached_is_reported_once_and_for_the_lost(rig: Rig) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        connections = ["/dev/nope,57600", "tcp:127.0.0.1:1", f"udpin:127.0.0.1:{port}"]
        reasons = ["No such file or directory", "Connection refused", "Address already in use"]
        rig.sim(SEARCHED | {"drones_positions": [0, 5, 1, 5, 2, 5]})
        bridge = Bridge(rig, [], connections=connections, join_timeout=3.0)
        states = rig.listen(DiagnosticArray, "drone0/vehicle_state", LATCHED)
        lost = f"lost: no heartbeat within 3 s: {connections[0]}: {reasons[0]}"
        rig.until(lambda: states and states.last.status[0].message == lost, lost)
        lines = bridge.process.output
        for i, (connection, reason) in enumerate(zip(connections, reasons, strict=True)):
            assert f"drone{i}: waiting for system {i + 1} on {connection}" in lines
            assert lines.count(f"drone{i}: {connection}: {reason}") == 1


def test_who_has_no_heartbeat_any_more_is_lost_and_the_other_goes_on(rig: Rig) -> None:
    start = {"drones_positions": [0, 5, 1, 5]}
    with autopilots((), ()) as vehicles:
        sim = rig.sim(SEARCHED | start | {"vehicle_time": "awaited"})
        bridge = Bridge(rig, vehicles, link_timeout=4.0, lost_timeout=6.0)
        sim.joint(UP, UP)
        bridge.until(1, flying="true")
        vehicles[1].kill()
        silent = f"nothing from system 2 on {vehicles[1].connection}"
        bridge.until(1, lost=f"link lost: no heartbeat for 6 s: {silent}")
        rig.until(lambda: sim.cells[0] == (0, 4), "the step")
        fly(sim, RIGHT, RIGHT)
        assert sim.report["terminated"].tolist() == [0, 1]


def test_nothing_is_armed_unless_that_is_allowed(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5]})
        bridge = Bridge(rig, vehicles, arm=False)
        sim.joint(UP)
        state = bridge.until(0, reason="waiting for GUIDED: it is in STABILIZE", ready="true")
        assert state["armed"] == "false" and state["custody"] == "cleared"


def test_nothing_takes_off_before_a_planner_has_commanded_all_drones(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5], "vehicle_time": "awaited"})
        bridge = Bridge(rig, vehicles)
        bridge.until(0, ready="true", blocked="waiting for the first commands of a planner")
        assert take_off_orders(bridge) == 0
        sim.joint(UP)
        bridge.until(0, flying="true")


def test_an_operator_holds_recalls_and_clears_vehicles(rig: Rig) -> None:
    """After each call nothing moves again but by ~/arm."""
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5], "vehicle_time": "awaited"})
        bridge = Bridge(rig, vehicles, arm=False)
        sim.joint(UP)
        bridge.until(0, custody="cleared", ready="true")
        assert call(rig, SetBool, "drone0/arm", data=True)[0]
        bridge.until(0, arrived="true", cell="0 4")
        assert call(rig, Trigger, "mavlink_bridge/hold") == (True, "ordered to hold: drone0")
        bridge.until(0, custody="held", order="Hold()", status="done")
        sim.joint(UP)
        assert call(rig, SetBool, "mavlink_bridge/arm", data=True)[0]
        bridge.until(0, custody="following", arrived="true", cell="0 3")
        assert call(rig, Trigger, "drone0/land")[0]
        bridge.until(0, custody="recalled", mode="LAND")
        state = bridge.until(0, custody="taken over", armed="false", flying="false")
        assert state["lost"] == "recalled by the operator: land"
        rig.until(lambda: sim.report["terminated"].all(), "drone0 terminated")
        kept = (True, "kept on the ground: drone0")
        assert call(rig, Trigger, "mavlink_bridge/return") == kept
        assert arming_orders(bridge) == 1


def test_without_a_planner_the_vehicles_hold_until_it_goes_on(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5]})
        bridge = Bridge(rig, vehicles, planner_timeout=0.5)
        fly(sim, UP)
        bridge.until(0, order="Hold()", status="done")
        assert health_when(rig, "no steps: the vehicles hold")["flying"] == "1"
        fly(sim, UP)
        bridge.until(0, arrived="true", cell="0 3")
        bridge.until(0, order="Hold()", status="done")


def test_px4_flies_cells_and_searches_too(rig: Rig) -> None:
    # A busy machine may keep the bridge from sending for a while.
    patient = ("--param", "COM_OF_LOSS_T=200")
    with autopilots((), autopilot="px4", options=patient) as vehicles:
        sim = rig.sim(
            SEARCHED | {"drones_positions": [0, 5], "timestep_limit": 1, "vehicle_time": "awaited"}
        )
        bridge = Bridge(rig, vehicles, autopilot="px4", setpoint_rate=100.0)
        fly(sim, SEARCH)
        fly(sim, UP)
        state = bridge.until(0, arrived="true", flying="false", armed="false")
        assert state["lost"] == ""
        heights = [pose.pose.position.z for pose in bridge.poses[0]]
        assert max(heights) >= 57.0
        assert min(away_m(pose, (0, 5)) for pose in bridge.poses[0]) <= 10.0


def test_signed_links_fly_and_keys_that_differ_do_not(rig: Rig) -> None:
    keys = [rig.folder / "key", rig.folder / "other"]
    for number, key in enumerate(keys):
        key.write_text(f"{number:02x}" * 32)
        key.chmod(0o600)
    with autopilots((), key_file=keys[0]) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5]})
        sim.joint(UP)
        foreign = Bridge(rig, vehicles, signing_key_file=str(keys[1]))
        rig.until(lambda: int(foreign.state(0).get("count.forged", 0)) > 0, "a forged message")
        assert foreign.state(0)["connected"] == "false"
        foreign.process.stop()
        bridge = Bridge(rig, vehicles, signing_key_file=str(keys[0]))
        bridge.until(0, arrived="true", flying="true")


def test_an_open_loop_goes_after_the_latest_step(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5]})
        bridge = Bridge(rig, vehicles)
        fly(sim, UP)
        bridge.until(0, arrived="true")
        for action in (UP, RIGHT):
            fly(sim, action)
        bridge.until(0, arrived="true", cell="1 3")
        rig.until(lambda: away_m(bridge.poses[0].last, (1, 3)) <= 10.0, "the vehicle's pose")


@pytest.mark.parametrize(("autopilot", "mode"), [("ardupilot", "AUTO"), ("px4", "MISSION")])
def test_a_mission_is_flown_when_the_search_is_over(rig: Rig, autopilot: str, mode: str) -> None:
    with autopilots((), autopilot=autopilot) as vehicles:
        sim = rig.sim(SEARCHED | {"drones_positions": [0, 5], "timestep_limit": 3})
        bridge = Bridge(rig, vehicles, mode="mission", autopilot=autopilot)
        bridge.until(0, ready="true")
        for action in (UP, UP, SEARCH, SEARCH):
            assert bridge.state(0)["armed"] == "false"
            fly(sim, action)
        bridge.until(0, mode=mode, flying="true")
        state = bridge.until(0, arrived="true", armed="false")
        # Take-off, start, end of the leg, descent, climb, return; ArduPilot begins with home.
        assert int(state["item_reached"]) >= 4 and state["lost"] == ""
        assert min(away_m(pose, (0, 3)) for pose in bridge.poses[0]) <= 10.0


def test_a_search_whose_report_does_not_come_is_an_error_until_it_comes(rig: Rig) -> None:
    with autopilots((), speedup=5.0, ready_s=5.0) as vehicles:
        sim = rig.sim(
            SEARCHED | {"drones_positions": [0, 5], "timestep_limit": 1},
            "-r", "mission_report:=kept",
        )  # fmt: skip
        for _ in range(2):
            fly(sim, UP)
        Bridge(rig, vehicles, mode="mission")
        health_when(rig, "the search is over, and its mission_report has not arrived")
        kept = rig.first(PointCloud2, "kept")
        rig.talk(PointCloud2, "mission_report", LATCHED).publish(kept)
        health_when(rig, "following")


def test_messages_that_make_no_sense_are_reported_once_and_end_nothing(rig: Rig) -> None:
    bridge = rig.start("mavlink_bridge", {"state_directory": str(rig.folder / "state")})
    agents, report = (
        rig.talk(kind, topic, LATCHED)
        for kind, topic in ((String, "agents"), (PointCloud2, "step_report"))
    )
    for text in ("", "[]", '{"agents": 3}', "9" * 5000):
        agents.publish(String(data=text))
    report.publish(PointCloud2())
    report.publish(PointCloud2(width=2, height=1, point_step=8, row_step=16, data=bytes(16)))
    rig.until(lambda: "agents: " in bridge.output and "step_report: " in bridge.output)
    assert bridge.running and bridge.output.count("agents: ") < 5
    bridge.stop()


def test_vehicles_for_another_number_of_drones_stay_where_they_are(rig: Rig) -> None:
    with autopilots(()) as vehicles:
        rig.sim(SEARCHED | {"drones_positions": [0, 5, 1, 5]})
        bridge = Bridge(rig, vehicles)
        health_when(rig, "1 vehicles for 2 drones: nothing is flown")
        state = bridge.until(0, ready="true")
        assert state["order"] == "" and state["armed"] == "false"
        assert bridge.states[0].last.status[0].level == DiagnosticStatus.ERROR


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({"mode": "auto"}, "mode must be one of guided, mission, got 'auto'"),
        ({"connections": ["udp:here"]}, "connections must be udpin:HOST:PORT, "),
        ({"connections": ["/dev/ttyS99,RKINT"]}, "connections must have a rate of "),
        (
            {"connections": ["tcp::5760"] * 2},
            "connections must differ, got 'tcp:127.0.0.1:5760' for 2",
        ),
        ({"num_vehicles": 2, "system_ids": [1]}, "system_ids must be one for each of 2 vehicles"),
        ({"num_vehicles": 2, "system_ids": [1, 300]}, "system_ids must be a list of integers"),
        ({"num_vehicles": 2, "system_ids": [7, 7]}, "system_ids must differ, got 7 for 2 vehicles"),
        ({"min_altitude": 200.0}, "min_altitude must be at most max_altitude, 150 m, got 200"),
        ({"lost_timeout": 2.0}, "lost_timeout must be at least link_timeout, 5 s, got 2"),
        ({"signing_key_file": "/nonexistent"}, "signing_key_file: /nonexistent: No such file"),
        ({"own_system_id": 1}, "own_system_id"),
        ({"arm": "maybe"}, "arm must be one of false, true, always, got 'maybe'"),
        ({"fence_center": [91.0, 0.0]}, "fence_center must be latitude and longitude, got"),
        ({"conections": ["x"]}, "did you mean connections?"),
    ],
)
def test_what_is_not_allowed_ends_the_bridge_with_one_line(
    rig: Rig, parameters: dict[str, Any], line: str
) -> None:
    process = rig.start("mavlink_bridge", parameters)
    assert process.wait() == 2
    assert process.output.startswith("mavlink_bridge: ") and process.output.count("\n") == 1
    assert line in process.output
    rig.processes.remove(process)
