# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The action `navigate_to_pose` of Nav2 for each drone, if nav2_msgs is installed.

There is no ROS 2 wheel of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from builtin_interfaces.msg import Duration
from rclpy.action import ActionServer, CancelResponse, GoalResponse

from dsse_ros.mission.run.command_intake import NAVIGATE_TO_POSE, CommandIntake
from dsse_ros.mission.run.navigation import Ended, Ending, GoalProgress, Navigation
from dsse_ros.world.scenario.frames import map_positions
from msg_adapters.poses import pose_stamped
from msg_adapters.stamps import header, to_stamp

if TYPE_CHECKING:
    from dsse_ros.ros.nodes.sim_node import SimNode

_FAILED = 9000
"""`UNKNOWN` among the error codes of this action; Jazzy has only `NONE`, 0."""


class _Server(ActionServer):  # type: ignore[misc]
    """An action server that runs a callback only at the end of a goal.

    Executors poll a callback that waits for the end, as often as they can.
    """

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        """Run a callback that makes the result; without one, the goal goes on."""
        if execute_callback is not None:
            super().notify_execute(goal_handle, execute_callback)


class NavigateToPose:
    """The action servers of all drones; none without nav2_msgs.

    Args:
        node: The simulation.
        intake: Takes the goals.
        late: Returns the drones whose vehicles have to arrive first.
        on_command: Called after a new or a canceled goal.
    """

    def __init__(
        self,
        node: SimNode,
        intake: CommandIntake,
        late: Callable[[], Sequence[int]],
        on_command: Callable[[], None],
    ) -> None:
        self._node = node
        self._intake = intake
        self._late = late
        self._on_command = on_command
        self._navigation = Navigation[Any](node.mission)
        self._servers: list[_Server] = []
        try:
            from nav2_msgs.action import NavigateToPose as Action
        except ImportError:
            return
        self._action = Action
        for i, name in enumerate(node.mission.env.possible_agents):
            action = f"{name}/{NAVIGATE_TO_POSE}"
            self._servers.append(
                _Server(
                    node,
                    Action,
                    action,
                    lambda _: Action.Result(),
                    goal_callback=node.isolated(
                        action, partial(self._request, i), otherwise=GoalResponse.REJECT
                    ),
                    handle_accepted_callback=node.isolated(action, partial(self._begin, i)),
                    cancel_callback=node.isolated(
                        action, self._cancel, otherwise=CancelResponse.REJECT
                    ),
                )
            )

    def check(self) -> None:
        """End the goals that have ended."""
        if self._navigation.active:
            self._finish(self._navigation.check(self._late()))

    def publish_feedback(self) -> None:
        """End the goals that have ended; publish how far the others are."""
        self.check()
        self._publish(self._navigation.progress())

    def destroy(self) -> None:
        """End the servers."""
        for server in self._servers:
            server.destroy()
        self._servers.clear()

    def _request(self, drone: int, goal: Any) -> GoalResponse:
        taken = self._intake.navigation(drone, goal)
        return GoalResponse.ACCEPT if taken else GoalResponse.REJECT

    def _begin(self, drone: int, handle: Any) -> None:
        handle.execute()
        self._finish(self._navigation.begin(drone, handle))
        self.check()
        self._publish(
            progress for progress in self._navigation.progress() if progress.drone == drone
        )
        self._on_command()

    def _cancel(self, handle: Any) -> CancelResponse:
        ended = self._navigation.cancel(handle)
        # The task that finishes it runs after the state of the goal has changed.
        self._finish(ended)
        self._on_command()
        return CancelResponse.ACCEPT if ended else CancelResponse.REJECT

    def _publish(self, all_progress: Iterable[GoalProgress[Any]]) -> None:
        for progress in all_progress:
            progress.handle.publish_feedback(self._feedback(progress))

    def _finish(self, all_ended: Iterable[Ended[Any]]) -> None:
        for ended in all_ended:
            action = f"drone{ended.drone}/{NAVIGATE_TO_POSE}"
            line = f"{action}: {ended.ending.name.lower()}"
            self._node.get_logger().info(f"{line}: {ended.reason}" if ended.reason else line)
            self._servers[ended.drone].notify_execute(ended.handle, partial(self._result, ended))

    def _result(self, ended: Ended[Any], handle: Any) -> Any:
        """Set the final state of a goal, and return its result."""
        result = self._action.Result()
        match ended.ending:
            case Ending.REACHED:
                handle.succeed()
            case Ending.CANCELED:
                handle.canceled()
            case Ending.ABORTED:
                handle.abort()
                result.error_code = _FAILED
                # Earlier releases lack it.
                if hasattr(result, "error_msg"):
                    result.error_msg = ended.reason
        return result

    def _feedback(self, progress: GoalProgress[Any]) -> Any:
        node, result, drone = self._node, self._node.mission.result, progress.drone
        (position,) = map_positions(node.frame, result.places[drone], drone)
        return self._action.Feedback(
            current_pose=pose_stamped(
                header(node.frame.map_frame, node.stamp()), position, result.yaws[drone]
            ),
            navigation_time=_duration(progress.elapsed_ns),
            estimated_time_remaining=_duration(round(progress.left_s * 1e9)),
            distance_remaining=progress.left_m,
        )


def _duration(nanoseconds: int) -> Duration:
    stamp = to_stamp(nanoseconds)
    return Duration(sec=stamp.sec, nanosec=stamp.nanosec)
