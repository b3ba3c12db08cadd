# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The services of simulation_interfaces 1 and 2, if that package is installed.

Gazebo and Isaac Sim follow this standard. There is no ROS 2 wheel of it. Version 2 has the same
services and adds worlds, which `sim_node` neither loads nor unloads.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from dsse_ros.mission.simulation_state import Request, SimulationState

if TYPE_CHECKING:
    from dsse_ros.nodes.sim_node import SimNode

LONGEST_S = 1.0
"""Time after which a request for many steps makes no more of them."""
_REQUESTS = {
    SimulationState.STOPPED: Request.STOP,
    SimulationState.PLAYING: Request.PLAY,
    SimulationState.PAUSED: Request.PAUSE,
}


def serve(node: SimNode) -> bool:
    """Offer reset, step, state and features; returns whether the package is installed."""
    try:
        from simulation_interfaces.msg import Result, SimulatorFeatures
        from simulation_interfaces.srv import (
            GetSimulationState,
            GetSimulatorFeatures,
            ResetSimulation,
            SetSimulationState,
            StepSimulation,
        )
    except ImportError:
        return False

    has_time = node.settings.publish_clock

    def answer(response: Any, code: int = Result.RESULT_OK, reason: str = "") -> Any:
        response.result.result = code
        response.result.error_message = reason
        return response

    def reset(request: Any, response: Any) -> Any:
        of, scope = ResetSimulation.Request, request.scope
        if scope in (of.SCOPE_DEFAULT, of.SCOPE_ALL, of.SCOPE_TIME | of.SCOPE_STATE):
            node.restart()
        elif scope == of.SCOPE_STATE:
            node.reset()
        elif scope == of.SCOPE_TIME and has_time:
            node.restart_time()
        else:
            return answer(
                response,
                Result.RESULT_FEATURE_UNSUPPORTED,
                f"scope must be {'time, ' if has_time else ''}state or all, got {scope}: "
                "nothing can be spawned",
            )
        return answer(response)

    def step(request: Any, response: Any) -> Any:
        number, begun_s = node.mission.number, time.monotonic()
        for made in range(int(request.steps)):
            if time.monotonic() - begun_s > LONGEST_S:
                # Signals and other requests wait meanwhile.
                return answer(
                    response,
                    Result.RESULT_OPERATION_FAILED,
                    f"{made} of {request.steps} steps were made in {LONGEST_S:g} s, the longest "
                    "time for a request: request the rest",
                )
            refusal = node.try_step(Request.STEP_PAUSED)
            if refusal:
                return answer(response, Result.RESULT_OPERATION_FAILED, refusal)
            if node.mission.number != number:
                # With auto_reset, the remaining steps would belong to another mission.
                break
        return answer(response)

    def get_state(_: Any, response: Any) -> Any:
        response.state.state = int(node.state)
        return answer(response)

    def set_state(request: Any, response: Any) -> Any:
        wanted = request.state.state
        if wanted not in _REQUESTS:
            return answer(
                response,
                Result.RESULT_FEATURE_UNSUPPORTED,
                f"state must be stopped, playing or paused, got {wanted}",
            )
        if wanted == node.state:
            return answer(response, SetSimulationState.Response.ALREADY_IN_TARGET_STATE)
        node.change_state(_REQUESTS[wanted])
        return answer(response)

    def get_features(_: Any, response: Any) -> Any:
        response.features.features = [
            SimulatorFeatures.SIMULATION_RESET,
            *([SimulatorFeatures.SIMULATION_RESET_TIME] if has_time else []),
            SimulatorFeatures.SIMULATION_RESET_STATE,
            SimulatorFeatures.SIMULATION_STATE_GETTING,
            SimulatorFeatures.SIMULATION_STATE_SETTING,
            SimulatorFeatures.SIMULATION_STATE_PAUSE,
            SimulatorFeatures.STEP_SIMULATION_SINGLE,
            SimulatorFeatures.STEP_SIMULATION_MULTIPLE,
        ]
        return response

    for name, kind, callback in (
        ("reset_simulation", ResetSimulation, reset),
        ("step_simulation", StepSimulation, step),
        ("get_simulation_state", GetSimulationState, get_state),
        ("set_simulation_state", SetSimulationState, set_state),
        ("get_simulator_features", GetSimulatorFeatures, get_features),
    ):
        node.create_service(kind, f"~/{name}", callback)
    return True
