# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Deprecated topics and services of `sim_node`: they work, and log a warning at their first use."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from nav_msgs.msg import Path
from nav_msgs.srv import GetMap
from std_msgs.msg import Int8

from dsse_ros.mission.command_intake import CommandIntake
from msg_adapters.occupancy import occupancy_grid

if TYPE_CHECKING:
    from dsse_ros.nodes.sim_node import SimNode

INSTEAD = {
    "cmd_action": "publish cmd_action_name",
    "command_path": "publish command_pose for one goal after the other",
    "~/get_map": "subscribe to probability_grid",
}
"""What to do instead of using each topic or service."""

Take = Callable[[Any], bool]
"""Takes a message, and returns whether it is a new command."""


def serve(
    node: SimNode, intake: CommandIntake, subscribe: Callable[[Any, str, Take], None]
) -> None:
    """Subscribe to the deprecated topics, and offer the deprecated service.

    Args:
        node: The node.
        intake: Takes the commands.
        subscribe: Subscribes to a topic of commands.
    """

    @cache
    def warn(name: str) -> None:
        node.get_logger().warning(f"{name} is deprecated: {INSTEAD[name]}")

    def warned(name: str, take: Take) -> Take:
        def take_warned(message: Any) -> bool:
            warn(name)
            return take(message)

        return take_warned

    def get_map(_: GetMap.Request, response: GetMap.Response) -> GetMap.Response:
        warn("~/get_map")
        env, scaling = node.mission.env, node.settings.grid_scaling
        area = env.scenario.area_mask
        response.map = occupancy_grid(node.frame, env.probability, node.stamp(), scaling, area)
        return response

    for i, drone in enumerate(node.mission.env.possible_agents):
        for kind, name, take in (
            (Int8, "cmd_action", intake.action),
            (Path, "command_path", intake.path),
        ):
            subscribe(kind, f"{drone}/{name}", warned(name, partial(take, i)))
    node.create_service(GetMap, "~/get_map", get_map)
