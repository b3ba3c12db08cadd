# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The services of `sim_node`; those of simulation_interfaces are in the module of that name."""

from __future__ import annotations

from nav_msgs.srv import GetMap
from std_srvs.srv import SetBool, Trigger

from dsse_ros.nodes.mission_export import export_tracks
from dsse_ros.nodes.operated import Operated
from msg_adapters.occupancy import occupancy_grid


def serve(node: Operated) -> None:
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
        node.set_paused(bool(request.data))
        response.success, response.message = True, "paused" if node.paused else "running"
        return response

    def get_map(_: GetMap.Request, response: GetMap.Response) -> GetMap.Response:
        env, scaling = node.mission.env, node.settings.grid_scaling
        area = env.scenario.area_mask
        response.map = occupancy_grid(node.frame, env.probability, node.stamp(), scaling, area)
        return response

    def export_mission(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = export_tracks(node.mission, node.frame, node.settings)
        return response

    for kind, callback in (
        (Trigger, reset),
        (Trigger, step),
        (Trigger, export_mission),
        (SetBool, pause),
        (GetMap, get_map),
    ):
        node.create_service(kind, f"~/{callback.__name__}", callback)
