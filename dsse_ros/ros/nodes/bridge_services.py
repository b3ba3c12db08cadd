# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The services of `mavlink_bridge`: an operator clears, holds, recalls and lands vehicles."""

from __future__ import annotations

from functools import partial
from typing import Any

from rclpy.node import Node

from dsse_ros.base.defects import describe
from dsse_ros.ros.nodes.operator_services import OPERATOR_SERVICES
from dsse_ros.vehicles.fleet.fleet_controller import FleetController


def serve(node: Node, fleet: FleetController) -> None:
    """Create the services for all vehicles, such as `~/arm`, and for each, `drone<i>/arm`."""
    for drone, prefix in [(None, "~"), *enumerate(fleet.names)]:
        for what, kind in OPERATOR_SERVICES.items():
            node.create_service(kind, f"{prefix}/{what}", partial(_operate, fleet, drone, what))


def _operate(
    fleet: FleetController, drone: int | None, what: str, request: Any, response: Any
) -> Any:
    try:
        if what == "arm":
            response.success, response.message = fleet.arm(drone, bool(request.data))
        else:
            response.success, response.message = fleet.operate(drone, what)
    except Exception as error:
        # An exception that escapes would end the node.
        response.success, response.message = False, f"defect: {describe(error)}"
    return response
