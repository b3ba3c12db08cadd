# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many vehicles in closed loop, some of which fail, in all known ways."""

from __future__ import annotations

import contextlib
import random
import signal
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from autopilot.running import Running, running_autopilot

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from soak.rigs import DOWN, SEARCH, UP, Bridge, Sim, domain
from soak.row import Figures, Goal, Row, Run, zero

CELL_M = 130.0
ALTITUDE_M = 250.0
"""Room for fifty layers, each almost five metres high."""
ORIGIN = (-24.04, -46.17)

FAILURES: dict[str, dict[str, Any]] = {
    "link": {"faults": ("link@airborne:60",)},
    "link for a while": {"faults": ("link@airborne:60+8",)},
    "battery": {"faults": ("battery@airborne:60",)},
    "GPS": {"options": ("--no-gps",)},
    "pilot": {"faults": ("pilot@airborne:60=LOITER",)},
    "wrong mode": {"faults": ("pilot@airborne:60=STABILIZE",)},
    "slow": {"options": ("--param=WPNAV_SPEED=100",)},
    "no acknowledgements": {"faults": ("acks@airborne:60",)},
    "stuck": {},
    "restart": {},
    "flood": {},
}
"""How vehicles fail; the last three are caused from outside."""
HOME_S = 600.0
"""Time for the return and the descent, at the real speed of the vehicles."""
SURVIVED = ("link for a while", "flood")
"""Failures after which a vehicle continues."""


def _search(cells: Sequence[tuple[int, int]], side: int, steps: int) -> dict[str, Any]:
    """Return the parameters of a search with a drone in each of these cells."""
    return {
        "rules": "v2",
        "grid_size": side,
        "cell_size": CELL_M,
        "altitude": ALTITUDE_M,
        "origin_lat": ORIGIN[0],
        "origin_lon": ORIGIN[1],
        "drones_positions": [part for cell in cells for part in cell],
        "probability_of_detection": 0.0,
        "timestep_limit": steps,
        "vehicle_time": "awaited",
        "seed": 1,
    }


def fleet(run: Run) -> Figures:
    """Fly a fleet and let some vehicles fail."""
    number, steps, speedup = run.size((50, 56, 1.0), (6, 3, 20.0))
    failures = dict(list(FAILURES.items())[:: run.size(1, 5)])
    side = 10
    # One after the other from the west, row by row from the south.
    cells = [(i % side, side - 1 - i // side) for i in range(number)]
    failing = dict(zip(range(number - len(failures), number), failures, strict=True))
    with domain(run.folder) as rig, contextlib.ExitStack() as stack:
        vehicles = [
            stack.enter_context(
                vehicle_at(cells[i], i + 1, side, speedup, failures.get(failing.get(i, ""), {}))
            )
            for i in range(number)
        ]
        sim = rig.sim(_search(cells, side, steps))
        bridge = Bridge(
            rig, vehicles, max_altitude=ALTITUDE_M + 50, join_timeout=150.0, pose_rate=2.0,
            lost_timeout=20.0, at_end="land",
        )  # fmt: skip
        sound = [i for i in range(number) if i not in failing]
        for i in sound:
            bridge.until(i, flying="true")
        # A slow vehicle delays the others at most this long.
        sim.set(command_timeout=60.0 / speedup)
        beats, began_s = heartbeats(bridge, sound), time.monotonic()
        with Outside(vehicles, failing, speedup) as outside:
            while sim.flying:
                outside.act(late=sim.step_number >= steps // 3)
                fly(sim, number)
            # Home is a kilometre away, and 120 m below.
            rig.until(
                lambda: all(bridge.state(i)["armed"] == "false" for i in sound),
                "all sound ones home",
                HOME_S,
            )
        seconds = time.monotonic() - began_s
        missed = heartbeats(bridge, sound) - beats
        states = [bridge.state(i) for i in range(number)]
        died = int(not bridge.process.running)
        done = sim.step_number
        for vehicle in vehicles:
            vehicle.kill()
    lost = {failing[i] for i in failing if states[i].get("lost")}
    return {
        "vehicles": number,
        "failing": len(failing),
        "seconds": seconds,
        "steps": done,
        "steps_missing": max(steps - done, 0),
        "sound_lost": sum(bool(states[i]["lost"]) for i in sound),
        "not_home": sum(states[i]["flying"] == "true" for i in sound),
        "failing_lost": len(lost),
        "lost_by": sorted(lost),
        "survivors_lost": len(lost & set(SURVIVED)),
        "heartbeats_missed": missed,
        "died": died,
    }


@contextlib.contextmanager
def vehicle_at(
    cell: tuple[int, int], system: int, side: int, speedup: float, failure: Mapping[str, Any]
) -> Iterator[Running]:
    """Run a vehicle that stands in a cell."""
    frame = GridFrame(GridShape.square(side), CELL_M, *ORIGIN, 0.0, ALTITUDE_M)
    x, y = (cell[0] + 0.5) * CELL_M, (side - 1 - cell[1] + 0.5) * CELL_M
    with running_autopilot(
        link="udp",
        system=system,
        home=map_to_geodetic(frame, x, y - 25.0, 0.0),
        speedup=speedup,
        ready_s=10.0,
        **failure,
    ) as running:
        yield running


def heartbeats(bridge: Bridge, vehicles: list[int]) -> int:
    """Return how many heartbeats the bridge could not send in time."""
    return sum(int(bridge.state(i).get("count.heartbeats_missed", 0)) for i in vehicles)


def fly(sim: Sim, number: int) -> None:
    """Command all drones to search and to fly north and back in turn, and wait for the step."""
    seen, end_s = len(sim.reports), time.monotonic() + 1.0
    sim.joint(*[(UP, SEARCH, DOWN, SEARCH)[sim.step_number % 4]] * number)
    while len(sim.reports) == seen and time.monotonic() < end_s:
        sim.rig.executor.spin_once(timeout_sec=0.1)


class Outside(contextlib.ExitStack):
    """Failures of vehicles that are caused from outside.

    Args:
        vehicles: All of them.
        failing: The failure of each vehicle that fails.
        speedup: Vehicle time per wall time.
    """

    def __init__(self, vehicles: list[Running], failing: Mapping[int, str], speedup: float) -> None:
        super().__init__()
        self._of = {name: (i, vehicles[i]) for i, name in failing.items()}
        self._speedup = speedup
        self._draw = random.Random(13)
        self._socket = self.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))

    def act(self, *, late: bool) -> None:
        """Flood the links; later stop a vehicle and start another one."""
        if "flood" in self._of:
            _, vehicle = self._of["flood"]
            for _ in range(1000):
                self._socket.sendto(self._draw.randbytes(100), (vehicle.host, vehicle.port))
        if late and "stuck" in self._of:
            _, vehicle = self._of.pop("stuck")
            vehicle.process.send_signal(signal.SIGSTOP)
            self.callback(vehicle.process.send_signal, signal.SIGCONT)
        if late and "restart" in self._of:
            i, vehicle = self._of.pop("restart")
            vehicle.kill()
            again = running_autopilot(
                link="udp", port=vehicle.port, system=i + 1, speedup=self._speedup
            )
            self.enter_context(again)


ROWS = (
    Row(
        "fleet",
        "50 simulated vehicles in closed loop for 10 minutes, ten and one of which fail in as many "
        "ways: the others end their search, no heartbeat missed",
        fleet,
        "{vehicles} vehicles, {steps} steps in {seconds:.0f} s: {sound_lost} of those that are "
        "sound lost, {heartbeats_missed} heartbeats missed; {failing_lost} of {failing} failing "
        "ones lost",
        (
            *zero("steps_missing", "sound_lost", "not_home", "survivors_lost", "died"),
            Goal("heartbeats_missed", most=0, timed=True),
        ),
    ),
)
