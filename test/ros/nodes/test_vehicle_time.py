# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""sim_node follows the clocks of vehicles, which the test publishes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from numpy.typing import NDArray
from rig import LATCHED, Rig, Sim
from sensor_msgs.msg import TimeReference
from std_msgs.msg import Float64MultiArray, Header

from dsse_ros.mission.files.mission_journal import replayed
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.fault_kernels import SEARCHING, UNDER_WAY
from msg_adapters.commands import joint_command_message
from msg_adapters.poses import pose_stamped
from msg_adapters.stamps import to_stamp
from msg_adapters.step_report import looked_of, path_of, wind_of
from msg_adapters.vehicles import Progress, vehicle_state_message, vehicle_time
from msg_adapters.winds import wind_message

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
STEP_S = 10.0
BOOTS_S = (4_294_967.0 - 25.0, 5.0)
"""Vehicles that were started at different times; the clock of the first wraps in the mission."""
WRAP_S = 2**32 * 1e-3


class Vehicles:
    """Two vehicles whose time passes when the test says so."""

    def __init__(self, sim: Sim) -> None:
        self.sim, self.time_s, self.stamp = sim, 0.0, 0
        self.places: dict[int, tuple[float, float]] = {}
        self.pass_time(0.0)

    def pass_time(self, seconds: float, only: int | None = None) -> None:
        """Report clocks that have advanced, or that of one vehicle only, with its places."""
        # A vehicle looks where its places are known at most two seconds apart.
        for passed_s in (seconds - 1.0, 1.0) if seconds > 1.0 else (seconds,):
            self.time_s += passed_s
            self.stamp += 1
            header = Header(stamp=to_stamp(self.stamp), frame_id="map")
            for drone, boot_s in enumerate(BOOTS_S):
                if only not in (None, drone):
                    continue
                if drone in self.places:
                    pose = pose_stamped(header, (*self.places[drone], 120.0))
                    self.sim.talk(PoseStamped, f"drone{drone}/vehicle_pose").publish(pose)
                message = vehicle_time(header, "none", (boot_s + self.time_s) % WRAP_S)
                self.sim.talk(TimeReference, f"drone{drone}/vehicle_time").publish(message)

    def report(
        self, drone: int, *, looked: bool = True, arrived: bool = True, east_m: float = 0.0
    ) -> None:
        """Report how far a vehicle is with its task; it is beside the cell where the task ends."""
        task = self.sim.tasks()[drone]
        number = int(task["task"])
        progress = Progress(number, number if looked else -1, number if arrived else -1)
        message = vehicle_state_message(
            f"drone{drone}", "none", to_stamp(0), progress, level="ok", message="", values={}
        )
        self.sim.talk(DiagnosticArray, f"drone{drone}/vehicle_state").publish(message)
        self.places[drone] = float(task["x"]) + east_m, float(task["y"])
        self.pass_time(0.0, only=drone)

    def step(self, *actions: int) -> NDArray[Any]:
        """Begin a step with these commands, and return the report of it after its time."""
        self.sim.wait_until_quiet()
        seen = len(self.sim.reports)
        self.sim.joint(*actions)
        self.sim.wait_until_quiet()
        assert len(self.sim.reports) == seen
        self.pass_time(STEP_S)
        return self.sim.next_report(seen)


@pytest.fixture(scope="module")
def node(rig: Rig) -> Sim:
    return rig.sim(
        {
            "grid_size": 8, "cell_size": 100.0, "drones_positions": [2, 5, 7, 7],
            "person_initial_position": [2, 5], "person_motion": "random_walk",
            "person_steps": [0.0] * 4 + [1.0] + [0.0] * 4, "probability_of_detection": 1.0,
            "vehicle_time": "followed", "seed": 3,
        }
    )  # fmt: skip


@pytest.fixture
def sim(node: Sim) -> Iterator[Sim]:
    node.reset()
    yield node


def test_the_sea_stands_still_until_the_vehicles_are_where_their_drones_start(sim: Sim) -> None:
    vehicles = Vehicles(sim)
    vehicles.report(0)
    seen = len(sim.reports)
    sim.joint(RIGHT, LEFT)
    sim.health_when(lambda h: "waiting for vehicles of drone1" in h["message"])
    vehicles.pass_time(5 * STEP_S)
    sim.wait_until_quiet()
    assert len(sim.reports) == seen
    vehicles.report(1)
    sim.rig.until(lambda: sim.tasks()["action"].tolist() == [RIGHT, LEFT], "the step")
    vehicles.pass_time(STEP_S)
    assert sim.next_report(seen)["step"][0] == 1


def test_a_find_is_drawn_when_the_vehicle_has_looked_and_each_step_takes_its_time(
    sim: Sim,
) -> None:
    vehicles = Vehicles(sim)
    for drone in range(2):
        vehicles.report(drone)
    for step in range(1, 4):
        report = vehicles.step(SEARCH, LEFT)
        assert report["step"][0] == step
        assert report["status"].tolist() == [UNDER_WAY, UNDER_WAY]
        assert report["action"].tolist() == [-1, -1] and not report["found"].any()
        assert report["work"].tolist() == [2, 2]
    vehicles.report(1)
    report = vehicles.step(SEARCH, LEFT)
    assert report["action"].tolist() == [-1, LEFT] and sim.cells[1] == (6, 7)
    assert report["status"].tolist() == [UNDER_WAY, SEARCHING]
    vehicles.report(0, arrived=False)
    report = vehicles.step(SEARCH, LEFT)
    assert report["action"].tolist() == [SEARCH, -1] and report["found"].tolist() == [1, 0]
    assert report[["look_action", "look_col", "look_row"]].tolist()[0] == (SEARCH, 2, 5)
    assert report["work"].tolist() == [1, 2] and report["terminated"].all()
    # The sea has taken as long as the vehicles.
    assert report["step"][0] * STEP_S == vehicles.time_s


def test_a_search_counts_where_the_vehicle_was(sim: Sim) -> None:
    vehicles = Vehicles(sim)
    for drone in range(2):
        vehicles.report(drone)
    vehicles.step(SEARCH, LEFT)
    vehicles.report(0, arrived=False, east_m=100.0)
    report = vehicles.step(SEARCH, LEFT)
    assert report["action"].tolist() == [SEARCH, -1] and not report["found"].any()
    assert report[["look_action", "look_col", "look_row"]].tolist()[0] == (SEARCH, 3, 5)


def test_a_delay_of_the_planner_is_made_up_for(sim: Sim) -> None:
    vehicles = Vehicles(sim)
    for drone in range(2):
        vehicles.report(drone)
    vehicles.step(RIGHT, LEFT)
    vehicles.pass_time(3 * STEP_S)
    for step in range(2, 5):
        assert sim.fly(RIGHT, LEFT)["step"][0] == step
    seen = len(sim.reports)
    sim.joint(RIGHT, LEFT)
    sim.wait_until_quiet()
    assert len(sim.reports) == seen


def test_the_clock_of_a_vehicle_whose_drone_is_out_of_the_search_does_not_hold_it_up(
    sim: Sim,
) -> None:
    vehicles = Vehicles(sim)
    for drone in range(2):
        vehicles.report(drone)
    # The rules terminate a drone that leaves the grid.
    vehicles.step(LEFT, RIGHT)
    vehicles.report(1)
    assert vehicles.step(LEFT, RIGHT)["terminated"].tolist() == [0, 1]
    seen = len(sim.reports)
    sim.joint(LEFT, RIGHT)
    sim.wait_until_quiet()
    vehicles.pass_time(STEP_S, only=0)
    assert sim.next_report(seen)["step"][0] == 3


def test_the_node_says_when_the_clocks_stand_still(sim: Sim) -> None:
    vehicles = Vehicles(sim)
    for drone in range(2):
        vehicles.report(drone)
    sim.begin(RIGHT, LEFT)
    sim.health_when(lambda h: "waiting for the clocks of the vehicles" in h["message"])


IN_METRES: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 20, "seed": 5,
    "drones_positions": [9, 9, 12, 12], "particles": 500, "vehicle_time": "followed",
}  # fmt: skip
WIND_MPS = 6.0, -2.0


def fly_north(sim: Sim, since_s: float, until_s: float, seen_until_s: float = math.inf) -> None:
    """Fly north at 8 m/s from the starts, the second one without a position after a time."""
    for time_s in np.arange(since_s, until_s + 0.01, 0.5).tolist():
        for drone, cell in enumerate((9, 12)):
            x, y = (cell + 0.5) * 130.0, (19.5 - cell) * 130.0
            header = Header(stamp=to_stamp(round((100.0 + time_s) * 1e9)), frame_id="map")
            pose = pose_stamped(header, (x, y + 8.0 * time_s, 120.0))
            if drone == 0 or time_s <= seen_until_s:
                sim.talk(PoseStamped, f"drone{drone}/vehicle_pose").publish(pose)
            clock = vehicle_time(header, "none", 50.0 * drone + time_s)
            sim.talk(TimeReference, f"drone{drone}/vehicle_time").publish(clock)
        sim.wait_until_quiet()


def begin(sim: Sim) -> None:
    """Begin a step straight on."""
    number = int(sim.tasks()["task"].max())
    message = joint_command_message(1, sim.step_number, [(0.0, 1.0)] * 2)
    sim.talk(Float64MultiArray, "joint_command").publish(message)
    sim.rig.until(lambda: sim.tasks()["task"].max() > number, "the step")


def blow(sim: Sim, east: float, north: float) -> None:
    wind = wind_message(Header(frame_id="map"), (east, north))
    sim.talk(Vector3Stamped, "vehicle_wind").publish(wind)


def test_in_metres_the_path_of_a_step_is_what_the_vehicles_flew_by_their_own_clocks(
    rig: Rig,
) -> None:
    sim = rig.sim(IN_METRES, namespace="/metres")
    fly_north(sim, 0.0, 0.0)
    seen = len(sim.reports)
    begin(sim)
    fly_north(sim, 0.5, 13.0, seen_until_s=5.0)
    report = sim.next_report(seen)
    path, looked = path_of(report), looked_of(report)
    assert looked is not None and looked[0, 1:].all()
    assert np.ptp(path[0], axis=0) == pytest.approx((0.0, 104.0), abs=8.0)
    assert report["airspeed"][0] == pytest.approx(8.0, abs=0.1)
    # Its clock goes on, but where it is nobody knows.
    assert looked[1, 1:6].all() and not looked[1, 8:].any()
    assert np.ptp(path[1], axis=0) == pytest.approx((0.0, 40.0), abs=1.0)


def test_planners_fly_in_the_wind_that_vehicles_report(rig: Rig) -> None:
    options = {"samples": 200, "horizon": 5, "width": 4}
    fields = {name: IN_METRES[name] for name in ("person_motion", "grid_size", "particles")}
    env = parallel_env(
        rules="flight", vehicle_timed_actions=True, drones_positions=((9, 9), (12, 12)), **fields
    )

    def planned() -> list[float]:
        actions = planner_for(env, "belief", seed=2, **options)(*env.reset(seed=5))
        return [float(part) for action in actions.values() for part in action]

    calm = planned()
    env.world.set_wind(WIND_MPS)
    windy = planned()
    assert windy != calm

    sim = rig.sim(IN_METRES, namespace="/windy")
    commands = rig.listen(Float64MultiArray, "/windy/joint_command")
    for mps, code in (((8.0, -8.0), "too_strong"), ((math.nan, 0.0), "not_finite")):
        blow(sim, *mps)
        sim.health_after(code)
    assert wind_of(sim.report) == (0.0, 0.0)
    blow(sim, *WIND_MPS)
    rig.until(lambda: wind_of(sim.report) == WIND_MPS)
    rig.start(
        "planner_node",
        {"planner": "belief", "seed": 2,
         "planner_options": [f"{name}={value}" for name, value in options.items()]},
        "-r", "__ns:=/windy",
    )  # fmt: skip
    rig.until(lambda: commands, "a command")
    assert commands.last.data.tolist() == [1.0, 0.0, *windy]


def test_a_journal_goes_on_in_the_wind_that_vehicles_reported(rig: Rig, tmp_path: Path) -> None:
    journal = tmp_path / "journal.mcap"
    fields = IN_METRES | {
        "truth": "none", "step_rate": 0.0, "journal": str(journal), "run_id": 7,
    }  # fmt: skip
    pos = rig.listen(Float64MultiArray, "/kept/probability_of_success", LATCHED)
    sim = rig.sim(fields, namespace="/kept")
    fly_north(sim, 0.0, 0.0)
    begin(sim)
    blow(sim, *WIND_MPS)
    sim.wait_until_quiet()
    assert wind_of(sim.report) == (0.0, 0.0)
    fly_north(sim, 0.5, 13.0)
    rig.until(lambda: sim.step_number == 1)
    first = sim.report
    assert wind_of(first) == WIND_MPS
    sim.kill()
    again = rig.sim(fields, namespace="/kept")
    assert again.report.tobytes() == first.tobytes()
    # It waits for the vehicles to be where the drones are.
    fly_north(again, 13.0, 13.0)
    begin(again)
    fly_north(again, 13.5, 27.0)
    rig.until(lambda: again.step_number == 2)
    assert wind_of(again.report) == WIND_MPS
    # Through the air it flies against the wind, too.
    assert again.report["airspeed"][0] == pytest.approx(math.hypot(-6.0, 10.0), abs=0.1)
    rig.until(lambda: pos.last.data[2] == 2.0)
    again.kill()
    found = replayed(journal, print)
    assert found is not None and (found.steps, found.pos) == (2, pos.last.data[3])
