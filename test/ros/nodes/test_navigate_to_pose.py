# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The action of each drone over DDS, where nav2_msgs is installed; no wheel has it."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from rig import LATCHED, Rig, Sim

pytest.importorskip("nav2_msgs.action")
from nav2_msgs.action import NavigateToPose  # noqa: E402

CELL_M, GRID = 130.0, 8
SMALL = {
    "num_drones": 2, "grid_size": GRID, "cell_size": CELL_M, "probability_of_detection": 0.0,
    "seed": 3,
}  # fmt: skip
SEARCH = 4


class Sender:
    """A client of the action of one drone.

    Attributes:
        feedback: What has come of the goals.
    """

    def __init__(self, rig: Rig, sim: Sim, drone: int) -> None:
        self.rig = rig
        self.feedback: list[Any] = []
        name = sim.topic(f"drone{drone}/navigate_to_pose")
        self._client = ActionClient(rig.node, NavigateToPose, name)
        rig.until(self._client.server_is_ready, name)

    def send(self, col: float, row: float, frame: str = "map", tree: str = "") -> Any:
        """Return the handle of a goal, a cell or between cells, which may not be accepted."""
        goal = NavigateToPose.Goal(pose=PoseStamped(), behavior_tree=tree)
        goal.pose.header.frame_id = frame
        goal.pose.pose.position.x = (col + 0.5) * CELL_M
        goal.pose.pose.position.y = (GRID - 1 - row + 0.5) * CELL_M
        goal.pose.pose.orientation.w = 1.0
        sent = self._client.send_goal_async(goal, lambda got: self.feedback.append(got.feedback))
        self.rig.until(sent.done, "an answer to the goal")
        return sent.result()

    def end(self, handle: Any) -> Any:
        """Return status and result of a goal, when it has ended."""
        future = handle.get_result_async()
        self.rig.until(future.done, "the result")
        return future.result()

    def cancel(self, handle: Any) -> bool:
        """Return whether the goal was canceled."""
        future = handle.cancel_goal_async()
        self.rig.until(future.done, "an answer to the cancel")
        return bool(future.result().goals_canceling)

    def destroy(self) -> None:
        """End the client."""
        self._client.destroy()


@pytest.mark.slow
def test_a_goal_is_flown_to_with_feedback_and_a_result(rig: Rig) -> None:
    sim = rig.sim(SMALL, namespace="/nav")
    first, second = (Sender(rig, sim, drone) for drone in (0, 1))
    handle = first.send(3, 0)
    assert handle.accepted
    # In lockstep, the other drone needs a command too.
    rig.until(lambda: handle.status == GoalStatus.STATUS_EXECUTING, "the state of the goal")
    other = second.send(1, 4)
    end = first.end(handle)
    assert end.status == GoalStatus.STATUS_SUCCEEDED and end.result.error_code == 0
    assert sim.cells[0] == (3, 0)
    assert [got.distance_remaining for got in first.feedback] == [
        3 * CELL_M, 2 * CELL_M, CELL_M
    ]  # fmt: skip
    got = first.feedback[1]
    assert got.current_pose.header.frame_id == "map"
    assert got.current_pose.pose.position.x == 1.5 * CELL_M
    assert got.estimated_time_remaining.sec == 2 * got.navigation_time.sec > 0
    # Nobody commands the first drone any more.
    assert second.cancel(other)
    assert second.end(other).status == GoalStatus.STATUS_CANCELED
    assert not second.cancel(other)
    for sender in (first, second):
        sender.destroy()
    sim.process.stop()


def refuses_what_cannot_be_flown_to(sender: Sender, sim: Sim) -> None:
    for refused in (
        sender.send(3, 0, frame="odom"),
        sender.send(GRID, 0),
        sender.send(3, 0, tree="tree.xml"),
    ):
        assert not refused.accepted
    assert sim.health_after("foreign_frame", "outside_grid", "behavior_tree")


@pytest.mark.slow
def test_a_goal_that_cannot_be_flown_to_is_refused_and_one_that_is_replaced_is_aborted(
    rig: Rig,
) -> None:
    sim = rig.sim(SMALL, namespace="/nav_refused")
    sender = Sender(rig, sim, 0)
    refuses_what_cannot_be_flown_to(sender, sim)
    replaced, handle = sender.send(3, 0), sender.send(4, 0)
    end = sender.end(replaced)
    assert end.status == GoalStatus.STATUS_ABORTED and end.result.error_code == 9000
    sim.joint(SEARCH, SEARCH)
    assert sender.end(handle).status == GoalStatus.STATUS_ABORTED
    handle = sender.send(4, 0)
    sim.reset()
    end = sender.end(handle)
    assert end.status == GoalStatus.STATUS_ABORTED
    assert end.result.error_msg == "mission 1 was reset"
    # It ends quietly with a goal under way.
    assert sender.send(5, 5).accepted
    sender.destroy()
    sim.process.stop()


IN_METRES = SMALL | {
    "rules.profile": "flight", "person_motion": "constant_drift", "particles": 50,
    "drones_positions": [1, 1, 2, 2], "timestep_limit": 200,
}  # fmt: skip


@pytest.mark.slow
def test_in_metres_a_goal_is_flown_straight_to_with_feedback_cancel_and_preemption(
    rig: Rig,
) -> None:
    sim = rig.sim(IN_METRES, namespace="/nav_metres")
    first, second = (Sender(rig, sim, drone) for drone in (0, 1))
    refuses_what_cannot_be_flown_to(first, sim)
    with rig.listening(Path, "/nav_metres/drone1/remaining_path", LATCHED) as left:
        preempted, other = second.send(6, 2), second.send(2, 6.5)
        end = second.end(preempted)
        assert end.status == GoalStatus.STATUS_ABORTED and end.result.error_code == 9000
        assert end.result.error_msg == "another command of drone1 has replaced it"
        rig.until(lambda: left and left.last.poses)
        handle = first.send(1, 4.2)
        end = first.end(handle)
        assert end.status == GoalStatus.STATUS_SUCCEEDED and end.result.error_code == 0
        assert sim.report["y"][0] == pytest.approx((GRID - 4.7) * CELL_M, abs=10.0)
        assert sim.report["x"][0] == pytest.approx(1.5 * CELL_M)
        distances = [got.distance_remaining for got in first.feedback]
        expected = [3.2 * CELL_M, 2.2 * CELL_M, 1.2 * CELL_M, 0.2 * CELL_M]
        assert distances == pytest.approx(expected, abs=7.0)
        got = first.feedback[1]
        assert got.estimated_time_remaining.sec == int(got.distance_remaining / 10.0)
        pose = got.current_pose.pose
        assert pose.position.x == pytest.approx(195.0)
        assert pose.position.y == pytest.approx(5.5 * CELL_M, abs=2.1)
        # It points to the south.
        assert (pose.orientation.z, pose.orientation.w) == pytest.approx((-(0.5**0.5), 0.5**0.5))
        assert second.cancel(other)
        assert second.end(other).status == GoalStatus.STATUS_CANCELED
        rig.until(lambda: not left.last.poses)
    here = first.end(first.send(1, 4.2))
    assert here.status == GoalStatus.STATUS_SUCCEEDED
    for sender in (first, second):
        sender.destroy()
    sim.process.stop()
