# SPDX-License-Identifier: Apache-2.0
"""The services of simulation_interfaces, where that package is installed.

It is the standard that Gazebo and Isaac Sim follow; it is not among the ROS 2 wheels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dsse_ros.nodes.sim_node import SimNode


def serve(node: SimNode) -> bool:
    """Offer reset, step, state and features; returns whether the package is there."""
    try:
        from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
        from simulation_interfaces.srv import (
            GetSimulationState,
            GetSimulatorFeatures,
            ResetSimulation,
            SetSimulationState,
            StepSimulation,
        )
    except ImportError:
        return False

    def succeed(response: Any) -> Any:
        response.result.result = Result.RESULT_OK
        return response

    def fail(response: Any, reason: str) -> Any:
        response.result.result = Result.RESULT_OPERATION_FAILED
        response.result.error_message = reason
        return response

    def reset(_: Any, response: Any) -> Any:
        node.reset()
        return succeed(response)

    def step(request: Any, response: Any) -> Any:
        if not node.paused:
            return fail(response, "the simulation is not paused")
        number = node.mission.number
        for _ in range(int(request.steps)):
            refusal = node.try_step()
            if refusal:
                return fail(response, refusal)
            if node.mission.number != number:
                # auto_reset: the rest would be steps of another mission.
                break
        return succeed(response)

    def get_state(_: Any, response: Any) -> Any:
        paused = node.paused or node.mission.over
        response.state.state = (
            SimulationState.STATE_PAUSED if paused else SimulationState.STATE_PLAYING
        )
        return succeed(response)

    def set_state(request: Any, response: Any) -> Any:
        wanted = request.state.state
        if wanted == SimulationState.STATE_STOPPED:
            node.reset()
            node.set_paused(True)
        elif wanted in (SimulationState.STATE_PAUSED, SimulationState.STATE_PLAYING):
            node.set_paused(wanted == SimulationState.STATE_PAUSED)
        else:
            return fail(response, f"state {wanted} is not allowed; stopped, playing or paused")
        return succeed(response)

    def get_features(_: Any, response: Any) -> Any:
        response.features.features = [
            SimulatorFeatures.SIMULATION_RESET,
            SimulatorFeatures.SIMULATION_STATE_PAUSE,
            SimulatorFeatures.SIMULATION_STATE_GETTING,
            SimulatorFeatures.SIMULATION_STATE_SETTING,
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
