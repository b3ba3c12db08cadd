# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands of drones that fly in metres, without ROS: a turn and a speed each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.command_parsers import parse_point
from dsse_ros.mission.track_follower import TrackLeft, has_arrived, steer
from dsse_ros.result import Accepted, Rejected, Result
from dsse_ros.scenario.fields import shown
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.search.flight_env import STRAIGHT_ON
from dsse_ros.search.flights import Flights
from dsse_ros.step.flight_paths import shares_of

if TYPE_CHECKING:
    from msg_adapters.poses import FramedPose
    from msg_adapters.velocities import FramedTwist

Action = tuple[float, float]
"""A turn and a speed, -1 to 1, see `step.flight_paths`."""

MAX_POINTS = 10_000
"""Largest number of points of a track."""
_NO_ACTION = STRAIGHT_ON
"""In a joint command: the place of a drone that is not live."""


class Velocity(NamedTuple):
    """A commanded velocity in the body frame.

    Attributes:
        forward: Airspeed, m/s.
        yaw_rate: To the left, rad/s.
    """

    forward: float
    yaw_rate: float


def parse_joint_command(
    data: Sequence[float], mission: int, step: int, live: Sequence[bool]
) -> Result[tuple[Action, ...]]:
    """Return the actions of a `joint_command`, for all drones or for none.

    Args:
        data: The command, [mission, step, turn0, speed0, turn1, ...].
        mission: Number of the mission.
        step: Number of the step that the actions must be for: that of the last report.
        live: For each of the N drones whether it takes part; the others' entries are ignored.

    Returns:
        N actions, any where a drone is not live, or `wrong_size`, `stale_mission`, `stale_step`
        or `out_of_range`.
    """
    if len(data) != 2 + 2 * len(live):
        reason = (
            f"data must be mission, step and {len(live)} turns and speeds, got {len(data)} numbers"
        )
        return Rejected("wrong_size", reason)
    for code, name, expected, got in (
        ("stale_mission", "data[0] must be mission", mission, data[0]),
        ("stale_step", "data[1] must be step", step, data[1]),
    ):
        if got != expected:
            return Rejected(code, f"{name} {expected}, got {got:g}")
    chosen = []
    for drone, takes_part in enumerate(live):
        action = _NO_ACTION
        if takes_part:
            for index in (2 + 2 * drone, 3 + 2 * drone):
                # This form of the comparison also refuses NaN.
                if not abs(data[index]) <= 1.0:
                    reason = f"data[{index}] must be from -1 to 1, got {data[index]:g}"
                    return Rejected("out_of_range", reason)
            action = float(data[2 + 2 * drone]), float(data[3 + 2 * drone])
        chosen.append(action)
    return Accepted(tuple(chosen))


def parse_velocity(twist: FramedTwist, body_frame: str) -> Result[Velocity]:
    """Return the velocity of a `cmd_vel`.

    Args:
        twist: The command, in the body frame of the drone (REP-103): x forward, y left, z up.
        body_frame: Its name.

    Returns:
        The velocity, or `foreign_frame`, `not_finite` or `not_forward`.
    """
    if twist.frame_id not in ("", body_frame):
        reason = f"header.frame_id must be {body_frame!r} or empty, got {shown(twist.frame_id)}"
        return Rejected("foreign_frame", reason)
    for part in ("linear", "angular"):
        for axis, value in zip("xyz", getattr(twist, part), strict=True):
            if not math.isfinite(value):
                reason = f"twist.{part}.{axis} must be a finite number, got {value!r}"
                return Rejected("not_finite", reason)
            if value and (part, axis) not in (("linear", "x"), ("angular", "z")):
                reason = f"twist.{part}.{axis} must be 0: drones fly forward, got {value:g}"
                return Rejected("not_forward", reason)
    return Accepted(Velocity(twist.linear[0], twist.angular[2]))


def action_of(velocity: Velocity, flyer: np.record, step_s: float) -> Action:
    """Return the action that flies a velocity for a step, as far as the kind of drone can.

    Args:
        velocity: The velocity.
        flyer: The kind of drone, one of `flight_paths.FLYERS`.
        step_s: Time of the step.
    """
    speed = min(max(velocity.forward, float(flyer.slowest)), float(flyer.cruise))
    return shares_of(flyer, -velocity.yaw_rate * step_s, speed, step_s)


def parse_track(poses: Sequence[FramedPose], frame: GridFrame) -> Result[NDArray[np.float64]]:
    """Return the points (M, 2) of a `command_path`, or of one `command_pose`.

    Args:
        poses: Where to fly, in turn; altitudes and headings are not used, but must be finite.
        frame: The grid.

    Returns:
        Metres to the east and to the south of the grid's north-west corner, or `wrong_size`,
        `foreign_frame`, `not_finite` or `outside_grid`.
    """
    if not 1 <= len(poses) <= MAX_POINTS:
        return Rejected("wrong_size", f"poses must be 1 to {MAX_POINTS}, got {len(poses)}")
    points = []
    for number, pose in enumerate(poses):
        parsed = parse_point(pose, frame)
        if isinstance(parsed, Rejected):
            where = f"poses[{number}]: " if len(poses) > 1 else ""
            return Rejected(parsed.code, f"{where}{parsed.reason}")
        x_m, y_m = parsed.value
        points.append((x_m, frame.side_m - y_m))
    return Accepted(np.array(points))


class FlightCommands:
    """The last command of each drone: the turn and the speed of the next step, or a track.

    Args:
        flights: The flights of a batch of one.
        kinds: (N,) kind of each drone.

    Attributes:
        flyers: (N,) of `flight_paths.FLYERS`, of each drone.
    """

    def __init__(self, flights: Flights, kinds: NDArray[Any]) -> None:
        self._flights = flights
        self.flyers = flights.flyers[kinds].view(np.recarray)
        self.clear()

    def clear(self) -> None:
        """Drop all commands and previous actions."""
        self._actions: dict[int, Action] = {}
        self._tracks: dict[int, TrackLeft] = {}
        # The points of each drone's last track, also after it has reached the end of it.
        self._goals: dict[int, NDArray[np.float64]] = {}
        self._last: dict[int, Action] = {}

    def state(self) -> dict[str, Any]:
        """Return the state that outlasts a step, as JSON values: tracks and previous actions."""
        tracks = [(drone, track.points.tolist()) for drone, track in self._tracks.items()]
        return {"tracks": tracks, "last": list(self._last.items())}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over the state of another buffer; actions for the next step are cleared."""
        self.clear()
        self._tracks = {drone: TrackLeft(np.array(points)) for drone, points in state["tracks"]}
        self._last = {drone: (turn, speed) for drone, (turn, speed) in state["last"]}

    def set_action(self, drone: int, action: Action) -> None:
        """Set the drone's action for the next step; this replaces any other command."""
        self.drop_goal(drone)
        self._actions[drone] = action

    def set_track(self, drone: int, points: NDArray[np.float64]) -> None:
        """Send the drone along points (M, 2), see `parse_track`, in place of any other command.

        A drone that is at the end of the track has no command.
        """
        self._actions.pop(drone, None)
        flight = self._flights.flights[0, drone]
        here = np.array([[flight["east"], flight["south"]]])
        self._goals[drone], self._tracks[drone] = points, TrackLeft(np.vstack([here, points]))
        self._end_track(drone, np.vstack([here, here]))

    def track_of(self, drone: int) -> TrackLeft | None:
        """Return what is left of a drone's track, None without one."""
        return self._tracks.get(drone)

    def goal_of(self, drone: int) -> NDArray[np.float64] | None:
        """Return the points of a drone's last track, None if another command has replaced it.

        They are the same object for the same command.
        """
        return self._goals.get(drone)

    def drop_goal(self, drone: int) -> None:
        """Take the track of a drone back: it has no command."""
        self._tracks.pop(drone, None)
        self._goals.pop(drone, None)

    def after_step(self) -> None:
        """Take what was flown off the tracks; one whose end is reached is no command any more."""
        for drone, track in list(self._tracks.items()):
            path = self._flights.paths[0, drone]
            self._tracks[drone] = track.after(path)
            self._end_track(drone, path)

    def _end_track(self, drone: int, path: NDArray[np.float64]) -> None:
        """End the track of a drone if this path (K + 1, 2) has reached its end."""
        if has_arrived(self._tracks[drone], path, float(self.flyers[drone].radius)):
            del self._tracks[drone]

    def missing(self, live: Sequence[int], cells: NDArray[np.int64]) -> list[int]:
        """Return the live drones without a command."""
        return [i for i in live if i not in self._actions and i not in self._tracks]

    def take(
        self, live: Sequence[int], cells: NDArray[np.int64], missing_action: str
    ) -> NDArray[np.float64]:
        """Return the joint command (N, 2) and clear the commands for one step.

        Args:
            live: Drones still in flight; the others hold.
            cells: (N, 2) cells of the drones.
            missing_action: What a drone without a command does: `search` flies straight on at
                cruise, `repeat` flies its last action again, `hold` stops or, if it cannot, circles
                to the right.
        """
        joint = np.tile(np.array(STRAIGHT_ON), (len(self.flyers), 1))
        for i in live:
            joint[i] = self._commanded(i) or self._without(i, missing_action)
            self._last[i] = (float(joint[i, 0]), float(joint[i, 1]))
        self._actions.clear()
        return joint

    def _commanded(self, drone: int) -> Action | None:
        if drone not in self._tracks:
            return self._actions.get(drone)
        flight, wind = self._flights.flights[0, drone], self._flights.wind
        return steer(self._tracks[drone], flight, self.flyers[drone], wind)

    def _without(self, drone: int, missing_action: str) -> Action:
        if missing_action == "hold":
            return (0.0, -1.0) if self.flyers[drone].slowest <= 0.0 else (1.0, -1.0)
        if missing_action == "repeat":
            return self._last.get(drone, STRAIGHT_ON)
        return STRAIGHT_ON
