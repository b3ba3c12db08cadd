# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make sitl-demo`: a search flown by simulated autopilots, each program a process of its own.

It starts the autopilots, `sim_node`, `mavlink_bridge` and `planner_node`, waits until the search is
over and all vehicles are down again, and checks from the positions that the vehicles reported that
each was within the acceptance radius of every cell its drone was in.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path[:0] = [
    str(Path(__file__).parent),
    str(Path(__file__).resolve().parents[2] / "ros" / "nodes"),
]

from domains import free_domain  # noqa: E402

# Left to itself each run has a domain of its own.
if "ROS_DOMAIN_ID" not in os.environ:
    os.environ["ROS_DOMAIN_ID"] = str(free_domain())
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import numpy as np  # noqa: E402
import rclpy  # noqa: E402
from autopilot.running import running_autopilot  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402

from dsse_ros.base.fields import FieldError, specs  # noqa: E402
from dsse_ros.cli.command_line import Parser, make_folder, search_of  # noqa: E402
from dsse_ros.cli.node_process import MissionFailed, check_running, process  # noqa: E402
from dsse_ros.picture.rendering import save_picture  # noqa: E402
from dsse_ros.results.report.logs import read_csv  # noqa: E402
from dsse_ros.results.report.recomputed import mission_views  # noqa: E402
from dsse_ros.ros.nodes.settings import SimSettings  # noqa: E402
from dsse_ros.ros.runtime.exit_codes import fail  # noqa: E402
from dsse_ros.ros.runtime.qos import COMPLETE  # noqa: E402
from dsse_ros.ros.runtime.run_node import new_executor  # noqa: E402
from dsse_ros.vehicles.fleet.vehicle_missions import FlightSettings  # noqa: E402
from dsse_ros.vehicles.fleet.vehicle_time import FOLLOWED, IGNORED  # noqa: E402
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map  # noqa: E402
from dsse_ros.world.scenario.geodesy import map_to_geodetic  # noqa: E402
from dsse_ros.world.scenario.scenario import scenario_frame  # noqa: E402
from msg_adapters.step_report import step_report_from_message  # noqa: E402

RADIUS_M = 10.0
HOMES_APART_M = 30.0
PATIENCE_S = 600.0
MAX_SPEEDUP = 100.0
MANY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)


@dataclass
class Flight:
    """What was seen of one drone and its vehicle; places are metres in the map frame."""

    cells: list[tuple[int, int]] = field(default_factory=list)
    searched: list[tuple[int, int]] = field(default_factory=list)
    places: list[tuple[float, float, float]] = field(default_factory=list)
    state: dict[str, str] = field(default_factory=dict)

    @property
    def down(self) -> bool:
        """Whether the vehicle has landed and is disarmed."""
        return self.state.get("flying") == self.state.get("armed") == "false"


class Witness(Node):
    """Writes down what goes over the topics."""

    def __init__(self, drones: int, search_action: int) -> None:
        super().__init__("witness")
        self.flights = [Flight() for _ in range(drones)]
        self.step = -1
        self.over = self.found = False
        self._search = search_action
        self.create_subscription(PointCloud2, "step_report", self._on_report, COMPLETE)
        for i in range(drones):
            name = f"drone{i}"
            self.create_subscription(
                PoseStamped, f"{name}/vehicle_pose", partial(self._on_pose, i), MANY
            )
            self.create_subscription(
                DiagnosticArray, f"{name}/vehicle_state", partial(self._on_state, i), MANY
            )

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        self.step = int(report["step"][0])
        self.over = bool((report["terminated"] | report["truncated"]).all())
        self.found = self.found or bool(report["found"].any())
        for flight, entry in zip(self.flights, report, strict=True):
            cell = (int(entry["col"]), int(entry["row"]))
            flight.cells.append(cell)
            if self.step and entry["action"] == self._search:
                flight.searched.append(cell)

    def _on_pose(self, i: int, message: PoseStamped) -> None:
        place = message.pose.position
        self.flights[i].places.append((place.x, place.y, place.z))

    def _on_state(self, i: int, message: DiagnosticArray) -> None:
        self.flights[i].state = {pair.key: pair.value for pair in message.status[0].values}


def nearest_m(flight: Flight, frame: GridFrame) -> list[tuple[tuple[int, int], float]]:
    """Return each cell of a drone's track, in order, and how near to it its vehicle came.

    The track must have been flown in this order: what counts for a cell comes after what counts
    for the one before.
    """
    places = np.array(flight.places)[:, :2]
    track = [
        c for c, before in zip(flight.cells, [None, *flight.cells], strict=False) if c != before
    ]
    found, start = [], 0
    for cell in track:
        away = np.hypot(*(places[start:] - cell_to_map(frame, *cell)).T)
        inside = np.flatnonzero(away <= RADIUS_M)
        found.append((cell, float(away.min(initial=np.inf))))
        if len(inside):
            # From the first time it was there; how near it came until it left.
            outside = np.flatnonzero(away[inside[0] :] > RADIUS_M)
            stay = away[inside[0] :][: outside[0]] if len(outside) else away[inside[0] :]
            found[-1] = (cell, float(stay.min()))
            start += int(inside[0])
    return found


def save_flight(
    witness: Witness, arguments: argparse.Namespace, scenario: Any, rules: Any, path: Path
) -> None:
    """Draw the places of the vehicles over the mission of their drones."""
    record = read_csv(arguments.out / "mission.csv")[-1]
    belief = SimSettings().has_belief(scenario.grid_size) and not rules.covers
    *_, view = mission_views(record, belief=belief)
    flown = tuple(np.array(flight.places)[:, :2] for flight in witness.flights)
    save_picture(replace(view, flown=flown), path)


def run(arguments: argparse.Namespace, scenario: Any, rules: Any, path: Path) -> int:
    """Fly; returns the exit code."""
    drones = scenario.num_drones
    frame = scenario_frame(scenario)
    homes = [(HOMES_APART_M * (i + 1), 10.0) for i in range(drones)]
    if scenario.incident is not None:
        # The base is farther away than the fence allows; the drones enter the grid here.
        homes = [cell_to_map(frame, *cell) for cell in scenario.drones_positions]
    out: Path = arguments.out
    with contextlib.ExitStack() as stack:
        autopilots = [
            stack.enter_context(
                running_autopilot(
                    arguments.autopilot,
                    link="udp",
                    system=i + 1,
                    home=map_to_geodetic(frame, *homes[i], 0.0),
                    speedup=arguments.speedup,
                    seed=i,
                )
            )
            for i in range(drones)
        ]
        witness = Witness(drones, rules.actions.index("search"))
        executor = new_executor()
        executor.add_node(witness)
        parameters: dict[str, dict[str, Any]] = {
            "sim_node": {
                "scenario.file": str(path), "rules.profile": rules.profile, "seed": arguments.seed,
                "vehicle_time": arguments.vehicle_time, "acceptance_radius": RADIUS_M,
                "record_file": str(out / "mission.csv"), "scenario.num_drones": drones,
                "scenario.drones_positions": [
                    part for cell in scenario.drones_positions for part in cell
                ],
            },
            "mavlink_bridge": {
                "connections": [autopilot.connection for autopilot in autopilots],
                "autopilot": arguments.autopilot, "arm": "always",
                "speed": float(scenario.drone_speed),
                "acceptance_radius": RADIUS_M, "pose_rate": min(50.0, 200.0 / drones),
                "state_directory": str(out / "state"),
                # Wall time, in which vehicle time goes faster.
                "planner_timeout": 60.0, "setpoint_rate": min(5.0 * arguments.speedup, 200.0),
            },
            "planner_node": {
                "planner": arguments.planner, "model": arguments.model or "",
                "seed": arguments.seed,
            },
        }  # fmt: skip
        processes = {
            name: stack.enter_context(process(name, values, out / f"{name}.log"))
            for name, values in parameters.items()
        }
        began = reported_s = time.monotonic()
        shown = -1
        while not (witness.over and all(flight.down for flight in witness.flights)):
            executor.spin_once(timeout_sec=0.1)
            for name, child in processes.items():
                check_running(child, name, out / f"{name}.log")
            if not all(autopilot.running for autopilot in autopilots):
                raise MissionFailed("an autopilot has ended")
            if any(flight.state.get("lost") for flight in witness.flights):
                lost = [flight.state.get("lost", "") for flight in witness.flights]
                raise MissionFailed(f"a vehicle is lost: {lost}")
            if witness.step > shown:
                shown, reported_s = witness.step, time.monotonic()
                where = ", ".join(
                    f"({c[-1][0]}, {c[-1][1]})" for c in (f.cells for f in witness.flights)
                )
                print(f"step {shown}: drones in {where}", flush=True)
            if time.monotonic() - reported_s > PATIENCE_S:
                raise MissionFailed(f"nothing happens for {PATIENCE_S:g} s; see {out}")
        took_s = time.monotonic() - began
    title = f"{scenario.name}: {witness.step} steps, {'found' if witness.found else 'not found'}"
    save_flight(witness, arguments, scenario, rules, out / "flight.png")
    worst = 0.0
    for i, flight in enumerate(witness.flights):
        near = nearest_m(flight, frame)
        farthest = max(away for _, away in near)
        worst = max(worst, farthest)
        # Zero has no sign.
        down_m = round(flight.places[-1][2], 1) + 0.0
        print(
            f"drone{i}: {len(near)} cells flown, {len(flight.searched)} searches, "
            f"at most {farthest:.2f} m off, down at z = {down_m:.1f} m"
        )
    print(f"{title}; {took_s:.0f} s; picture {out / 'flight.png'}")
    if worst > RADIUS_M:
        print("a cell was missed")
    return 0 if worst <= RADIUS_M else 1


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(prog="sitl_demo", description="Fly a search with simulated autopilots.")
    autopilots = specs(FlightSettings)["autopilot"].choices
    parser.add_search("sitl")
    parser.add("--autopilot", default="ardupilot", choices=autopilots, help="which autopilots")
    parser.add("--speedup", type=float, default=20.0, help="of vehicle time")
    times = [one for one in specs(SimSettings)["vehicle_time"].choices if one != IGNORED]
    parser.add("--vehicle-time", default=FOLLOWED, choices=times, help="of the simulation")
    parser.add("--out", type=Path, default=Path("out"), help="folder of the results")
    # It has no ROS arguments.
    parser.set_defaults(fields={})
    return parser.parse_args(argv)


def check_speedup(speedup: float) -> None:
    """Check how much faster vehicle time goes.

    Raises:
        FieldError: If it is not allowed.
    """
    if not 0 < speedup <= MAX_SPEEDUP:
        raise FieldError(f"speedup must be > 0 and <= {MAX_SPEEDUP:g}, got {speedup:g}")


def main(argv: list[str] | None = None) -> int:
    """Run the demonstration; returns 0 if every cell was flown."""
    arguments = parse(argv)
    try:
        check_speedup(arguments.speedup)
        path, scenario, rules = search_of(arguments)
        make_folder("out", arguments.out)
    except FieldError as error:
        return fail("sitl_demo", error)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        return run(arguments, scenario, rules, path)
    except MissionFailed as error:
        fail("sitl_demo", error)
        return 1
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    sys.exit(main())
