# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The standard services of simulators, on a node in this process and classes without DDS."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from interfaces_double import Double, modules
from rig import free_domain
from std_srvs.srv import SetBool, Trigger

from dsse_ros.ros.nodes.settings import FULL_NAMES
from dsse_ros.ros.nodes.sim_node import SimNode

STEP_NS = 13 * 10**9
STOPPED, PLAYING, PAUSED, QUITTING = range(4)
UNSUPPORTED, OK, FAILED, ALREADY = 0, 1, 4, 101
DEFAULT, TIME, STATE, SPAWNED, ALL = 0, 1, 2, 4, 255
RESET_TIME, RESET_STATE, RESET_SPAWNED = 21, 22, 23


class Simulator(SimNode):
    """A node that hands out the handlers of the standard services instead of serving them."""

    def __init__(self) -> None:
        self.handlers: dict[str, tuple[Any, Any]] = {}
        self.own_handlers: dict[str, Any] = {}
        super().__init__()

    def create_service(self, kind: Any, name: str, callback: Any, **more: Any) -> Any:
        """Create a service, or keep the handler of one that DDS cannot carry."""
        if issubclass(getattr(kind, "Request", object), Double):
            self.handlers[name.removeprefix("~/")] = kind, callback
            return None
        self.own_handlers[name.removeprefix("~/")] = callback
        return super().create_service(kind, name, callback, **more)

    def own(self, name: str, kind: Any, **fields: Any) -> Any:
        """Return the response of a service of the node."""
        return self.own_handlers[name](kind.Request(**fields), kind.Response())

    def call(self, name: str, **fields: Any) -> Any:
        """Return the response of a standard service."""
        kind, handler = self.handlers[name]
        return handler(kind.Request(**fields), kind.Response())

    def standard_state(self) -> int:
        """Return the state that the service returns."""
        response = self.call("get_simulation_state")
        assert response.result.result == OK
        return int(response.state.state)

    def set_standard_state(self, state: int) -> Any:
        """Return the result of setting a state."""
        kind = sys.modules["simulation_interfaces.msg"].SimulationState
        return self.call("set_simulation_state", state=kind(state=state)).result

    def where(self) -> tuple[int, int, int, int]:
        """Return run, mission, step and mission time."""
        result = self.mission.result
        return self.publishers_.run_id, self.mission.number, result.step, result.stamp_ns


@pytest.fixture
def parameters() -> dict[str, Any]:
    return {}


@pytest.fixture
def version() -> int:
    return 1


@pytest.fixture
def sim(
    monkeypatch: pytest.MonkeyPatch, parameters: dict[str, Any], version: int
) -> Iterator[Simulator]:
    for name, module in modules(version).items():
        monkeypatch.setitem(sys.modules, name, module)
    stated = {"num_drones": 2, "probability_of_detection": 0.0, "seed": 3} | parameters
    named = {FULL_NAMES.get(name, name): value for name, value in stated.items()}
    options = [part for name, value in named.items() for part in ("-p", f"{name}:={value}")]
    rclpy.init(args=["--ros-args", *options], domain_id=free_domain())
    node = Simulator()
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.shutdown()


def test_setting_the_present_state_says_so_and_changes_nothing(sim: Simulator) -> None:
    for state in (PLAYING, PAUSED, STOPPED, PLAYING):
        if state != sim.standard_state():
            assert sim.set_standard_state(state).result == OK
        before = sim.where()
        assert sim.set_standard_state(state).result == ALREADY
        assert sim.standard_state() == state and sim.where() == before


def test_stopped_is_a_state_at_the_start_of_a_run_that_can_be_played_or_paused(
    sim: Simulator,
) -> None:
    for leave in (PLAYING, PAUSED):
        sim.step()
        run, number, _, _ = sim.where()
        assert sim.set_standard_state(STOPPED).result == OK
        assert sim.standard_state() == STOPPED
        assert sim.where()[0] != run and sim.where()[1:] == (number + 1, 0, STEP_NS)
        assert sim.set_standard_state(leave).result == OK
        assert sim.standard_state() == leave and sim.where()[1:] == (number + 1, 0, STEP_NS)


@pytest.mark.parametrize("state", [STOPPED, PLAYING, PAUSED])
def test_services_of_the_node_and_of_the_standard_share_one_state(
    sim: Simulator, state: int
) -> None:
    services = {"set playing": PLAYING, "set paused": PAUSED, "pause": PAUSED, "continue": PLAYING}
    for service, after in services.items():
        if state != sim.standard_state():
            sim.set_standard_state(state)
        if service.startswith("set"):
            sim.set_standard_state(after)
        else:
            assert sim.own("pause", SetBool, data=service == "pause").success
        assert sim.standard_state() == after
    for service in ("step", "reset"):
        if state != sim.standard_state():
            sim.set_standard_state(state)
        response = sim.own(service, Trigger)
        assert response.success == (service == "reset" or state != STOPPED), response
        assert sim.standard_state() == state


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("state", [QUITTING, 4, 5, 200])
def test_a_state_that_there_is_not_is_unsupported(sim: Simulator, state: int) -> None:
    before = sim.where()
    result = sim.set_standard_state(state)
    assert result.result == UNSUPPORTED and str(state) in result.error_message
    assert sim.standard_state() == PLAYING and sim.where() == before


@pytest.mark.parametrize("state", [PLAYING, STOPPED])
def test_only_a_paused_simulation_is_stepped_through_the_service(
    sim: Simulator, state: int
) -> None:
    if state != PLAYING:
        sim.set_standard_state(state)
    refused = sim.call("step_simulation").result
    assert refused.result == FAILED
    assert refused.error_message.startswith("the simulation must be paused, got ")
    sim.set_standard_state(PAUSED)
    assert sim.call("step_simulation").result.result == OK
    assert sim.call("step_simulation", steps=3).result.result == OK
    assert sim.mission.result.step == 4 and sim.standard_state() == PAUSED


@pytest.mark.parametrize("parameters", [{"timestep_limit": 10**9}])
def test_a_request_for_steps_without_end_ends_and_says_how_many_were_made(sim: Simulator) -> None:
    sim.set_standard_state(PAUSED)
    result = sim.call("step_simulation", steps=2**63).result
    done = sim.mission.result.step
    assert result.result == FAILED and done > 0
    assert result.error_message.startswith(f"{done} of {2**63} steps were made in 1 s")
    assert sim.standard_state() == PAUSED


@pytest.mark.parametrize("scope", [DEFAULT, ALL, TIME | STATE])
def test_a_reset_of_all_is_like_a_new_start_of_the_node(sim: Simulator, scope: int) -> None:
    sim.step()
    run, number, _, _ = sim.where()
    assert sim.call("reset_simulation", scope=scope).result.result == OK
    assert sim.where()[0] != run and sim.where()[1:] == (number + 1, 0, STEP_NS)


def test_a_reset_of_the_state_is_a_new_mission_at_a_later_time(sim: Simulator) -> None:
    sim.step()
    run, number, _, stamp_ns = sim.where()
    assert sim.call("reset_simulation", scope=STATE).result.result == OK
    assert sim.where() == (run, number + 1, 0, stamp_ns + STEP_NS)


def test_a_reset_of_the_time_keeps_the_drones_where_they_are(sim: Simulator) -> None:
    sim.step()
    sim.step()
    run, number, step, _ = sim.where()
    assert sim.call("reset_simulation", scope=TIME).result.result == OK
    assert sim.where() == (run, number, step, STEP_NS)
    sim.step()
    assert sim.where() == (run, number, step + 1, 2 * STEP_NS)


@pytest.mark.parametrize("scope", [SPAWNED, SPAWNED | STATE, 8, 254])
def test_a_reset_of_what_there_is_not_is_unsupported(sim: Simulator, scope: int) -> None:
    sim.step()
    before = sim.where()
    result = sim.call("reset_simulation", scope=scope).result
    assert result.result == UNSUPPORTED and f", got {scope}: " in result.error_message
    assert sim.where() == before


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("parameters", [{}, {"publish_clock": False}], ids=["clock", "no clock"])
def test_the_features_are_the_scopes_that_are_honoured(sim: Simulator) -> None:
    features = sim.call("get_simulator_features").features.features
    for scope, feature in ((TIME, RESET_TIME), (STATE, RESET_STATE), (SPAWNED, RESET_SPAWNED)):
        result = sim.call("reset_simulation", scope=scope).result.result
        assert (result == OK) == (feature in features), scope
    assert sorted(features) == features and {20, 24, 25, 26, 31, 32} <= set(features)
    assert len(features) == len(set(features))
