# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""mavlink_bridge between sim_node and simulated autopilots, as its peers see it."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from autopilot.running import Running, running_autopilot
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rig import ALL, Process, Rig, Sim

from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import map_to_geodetic

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
SPEEDUP = 20.0
FRAME = GridFrame(6, 130.0, -24.04, -46.17, 0.0, 60.0)
SEARCHED: dict[str, Any] = {
    "grid_size": 6,
    "cell_size": 130.0,
    "altitude": 60.0,
    "origin_lat": -24.04,
    "origin_lon": -46.17,
    "person_initial_position": [5, 0],
    "probability_of_detection": 0.0,
    "seed": 1,
}


@contextlib.contextmanager
def autopilots(*faults: tuple[str, ...], first: int = 1, **options: Any) -> Iterator[list[Running]]:
    """Run autopilots beside the first cells of the southern row, with these faults each.

    Their system ids count from `first`.
    """
    with contextlib.ExitStack() as stack:
        yield [
            stack.enter_context(
                running_autopilot(
                    link="udp",
                    system=i + first,
                    home=map_to_geodetic(FRAME, 65.0 + 130.0 * (i % 6), 40.0 * (1 + i // 6), 0.0),
                    faults=each,
                    **{"speedup": SPEEDUP, **options},
                )
            )
            for i, each in enumerate(faults)
        ]


class Bridge:
    """The bridge as its peers see it."""

    def __init__(self, rig: Rig, vehicles: list[Running], **parameters: Any) -> None:
        settings = {"connections": [v.connection for v in vehicles], "arm": True, "speed": 10.0}
        self.rig = rig
        self.process: Process = rig.start(
            "mavlink_bridge",
            settings
            | {"pose_rate": 20.0, "state_directory": str(rig.folder / "state")}
            | parameters,
        )
        names = [f"drone{i}" for i in range(len(vehicles))]
        self.states = [rig.listen(DiagnosticArray, f"{n}/vehicle_state", ALL) for n in names]
        self.poses = [rig.listen(PoseStamped, f"{n}/vehicle_pose") for n in names]

    def state(self, i: int) -> Mapping[str, str]:
        """Return the last state of a vehicle."""
        if not self.states[i]:
            return {}
        status = self.states[i].last.status[0]
        return {pair.key: pair.value for pair in status.values} | {"message": status.message}

    def until(self, i: int, **values: str) -> Mapping[str, str]:
        """Return the state of a vehicle as soon as it has these values."""
        try:
            self.rig.until(lambda: self.state(i).items() >= values.items(), f"{values} of drone{i}")
        except AssertionError as failed:
            raise AssertionError(f"drone{i} is in the state {self.state(i)}") from failed
        return self.state(i)


def health_when(rig: Rig, message: str) -> dict[str, str]:
    """Return the bridge's diagnostics with this message."""
    with rig.listening(DiagnosticArray, "/diagnostics") as inbox:

        def found() -> Any:
            for array in inbox:
                for status in array.status:
                    if status.name == "dsse_ros: mavlink_bridge" and status.message == message:
                        return status
            return None

        status = rig.until(found, message)
    return {pair.key: pair.value for pair in status.values}


def away_m(message: PoseStamped, cell: tuple[int, int]) -> float:
    here = message.pose.position
    return float(np.hypot(*np.subtract((here.x, here.y), cell_to_map(FRAME, *cell))))


def detour_m(poses: Sequence[PoseStamped], cell: tuple[int, int]) -> float:
    """Return how far off its way, as the poses show it, a vehicle would have passed over a cell.

    A vehicle that gets its next cell as it arrives is there for less time than between two poses.
    """
    away = [away_m(pose, cell) for pose in poses]
    ends = [(pose.pose.position.x, pose.pose.position.y) for pose in poses]
    return min(
        (a + b - math.dist(*leg)) / 2
        for a, b, leg in zip(away, away[1:], pairwise(ends), strict=False)
    )


def fly(sim: Sim, *actions: int) -> None:
    """Command all, again until the step is done: the barrier may wait for a minute."""
    seen = len(sim.reports)
    sim.joint(*actions)
    sim.next_report(seen)


def arming_orders(bridge: Bridge) -> int:
    """Return the number of take-offs that arm the vehicle; the others wait for somebody to."""
    return len(re.findall(r": TakeOff\(.*arm=True", bridge.process.output))


def take_off_orders(*bridges: Bridge) -> int:
    return sum(bridge.process.output.count(": TakeOff(") for bridge in bridges)
