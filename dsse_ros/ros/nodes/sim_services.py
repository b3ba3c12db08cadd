# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The services of `sim_node`; those of simulation_interfaces are in the module of that name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from std_srvs.srv import SetBool, Trigger

from dsse_ros.mission.run.simulation_state import Request

if TYPE_CHECKING:
    from dsse_ros.ros.nodes.sim_node import SimNode


def serve(node: SimNode) -> None:
    """Create the services of the node."""

    def reset(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        node.reset()
        response.success = True
        response.message = f"mission {node.mission.number}, seed {node.mission.seed}"
        return response

    def step(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        refusal = node.try_step()
        response.success = not refusal
        response.message = refusal or f"step {node.mission.result.step}"
        return response

    def pause(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        node.change_state(Request.PAUSE if request.data else Request.PLAY)
        response.success, response.message = True, "paused" if request.data else "running"
        return response

    for kind, callback in ((Trigger, reset), (Trigger, step), (SetBool, pause)):
        node.create_service(kind, f"~/{callback.__name__}", callback)
