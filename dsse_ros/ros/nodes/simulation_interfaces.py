# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The services of simulation_interfaces 1 and 2, if that package is installed.

Gazebo and Isaac Sim follow this standard. There is no ROS 2 wheel of it. Version 2 has the same
services and adds worlds, which `sim_node` neither loads nor unloads.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from dsse_ros.mission.run.simulation_state import Request, SimulationState

if TYPE_CHECKING:
    from dsse_ros.ros.nodes.sim_node import SimNode

LONGEST_S = 1.0
"""Time after which a request for many steps makes no more of them."""
_REQUESTS = {
    SimulationState.STOPPED: Request.STOP,
    SimulationState.PLAYING: Request.PLAY,
    SimulationState.PAUSED: Request.PAUSE,
}


class _Services:
    """The services, as methods.

    Args:
        node: The node that offers them.
        msg: `simulation_interfaces.msg`.
        srv: `simulation_interfaces.srv`.
    """

    def __init__(self, node: SimNode, msg: Any, srv: Any) -> None:
        self._node, self._result, self._features = node, msg.Result, msg.SimulatorFeatures
        self._scopes = srv.ResetSimulation.Request
        self._already = srv.SetSimulationState.Response.ALREADY_IN_TARGET_STATE
        self._has_time = node.settings.publish_clock

    def _answer(self, response: Any, code: int | None = None, reason: str = "") -> Any:
        """Return the response with a result, by default that it is done."""
        response.result.result = self._result.RESULT_OK if code is None else code
        response.result.error_message = reason
        return response

    def _unsupported(self, response: Any, reason: str) -> Any:
        return self._answer(response, self._result.RESULT_FEATURE_UNSUPPORTED, reason)

    def _failed(self, response: Any, reason: str) -> Any:
        return self._answer(response, self._result.RESULT_OPERATION_FAILED, reason)

    def reset(self, request: Any, response: Any) -> Any:
        """Reset the time, the mission or the run."""
        scopes, scope = self._scopes, request.scope
        if scope in (
            scopes.SCOPE_DEFAULT,
            scopes.SCOPE_ALL,
            scopes.SCOPE_TIME | scopes.SCOPE_STATE,
        ):
            self._node.restart()
        elif scope == scopes.SCOPE_STATE:
            self._node.reset()
        elif scope == scopes.SCOPE_TIME and self._has_time:
            self._node.restart_time()
        else:
            wanted = f"{'time, ' if self._has_time else ''}state or all"
            return self._unsupported(
                response, f"scope must be {wanted}, got {scope}: nothing can be spawned"
            )
        return self._answer(response)

    def step(self, request: Any, response: Any) -> Any:
        """Step a paused simulation, for at most `LONGEST_S`."""
        node = self._node
        number, begun_s = node.mission.number, time.monotonic()
        for done in range(int(request.steps)):
            if time.monotonic() - begun_s > LONGEST_S:
                # Signals and other requests wait meanwhile.
                return self._failed(
                    response,
                    f"{done} of {request.steps} steps were made in {LONGEST_S:g} s, the longest "
                    "time for a request: request the rest",
                )
            if refusal := node.try_step(Request.STEP_PAUSED):
                return self._failed(response, refusal)
            if node.mission.number != number:
                # With auto_reset, the remaining steps would belong to another mission.
                break
        return self._answer(response)

    def get_state(self, _: Any, response: Any) -> Any:
        """Return whether the simulation is stopped, playing or paused."""
        response.state.state = int(self._node.state)
        return self._answer(response)

    def set_state(self, request: Any, response: Any) -> Any:
        """Stop, play or pause the simulation."""
        wanted = request.state.state
        if wanted not in _REQUESTS:
            return self._unsupported(
                response, f"state must be stopped, playing or paused, got {wanted}"
            )
        if wanted == self._node.state:
            return self._answer(response, self._already)
        self._node.change_state(_REQUESTS[wanted])
        return self._answer(response)

    def get_features(self, _: Any, response: Any) -> Any:
        """Return what the services can do."""
        features = self._features
        response.features.features = [
            features.SIMULATION_RESET,
            *([features.SIMULATION_RESET_TIME] if self._has_time else []),
            features.SIMULATION_RESET_STATE,
            features.SIMULATION_STATE_GETTING,
            features.SIMULATION_STATE_SETTING,
            features.SIMULATION_STATE_PAUSE,
            features.STEP_SIMULATION_SINGLE,
            features.STEP_SIMULATION_MULTIPLE,
        ]
        return response


def serve(node: SimNode) -> bool:
    """Offer reset, step, state and features; return whether the package is installed."""
    try:
        from simulation_interfaces import msg, srv
    except ImportError:
        return False
    services = _Services(node, msg, srv)
    for name, kind, callback in (
        ("reset_simulation", srv.ResetSimulation, services.reset),
        ("step_simulation", srv.StepSimulation, services.step),
        ("get_simulation_state", srv.GetSimulationState, services.get_state),
        ("set_simulation_state", srv.SetSimulationState, services.set_state),
        ("get_simulator_features", srv.GetSimulatorFeatures, services.get_features),
    ):
        node.create_service(kind, f"~/{name}", callback)
    return True
