# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`DsseRosEnv`, against live nodes and beside the environment that they run."""

from __future__ import annotations

import contextlib
import re
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from pettingzoo.test import parallel_api_test
from rclpy.executors import SingleThreadedExecutor
from rig import LATCHED, TIMEOUT_S, Rig, Sim
from sensor_msgs.msg import PointCloud2

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.scenario_files import find_scenario
from dsse_ros.ros.ros_env import TIMEOUT_S as TIMEOUT_S_OF_ENV
from dsse_ros.ros.ros_env import DsseRosEnv, SearchLostError
from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.stamps import to_stamp
from msg_adapters.vehicle_tasks import vehicle_tasks_from_message
from msg_adapters.vehicles import Progress, vehicle_state_message

SMALL: dict[str, Any] = {"grid_size": 6, "timestep_limit": 12}
SEARCHES: dict[str, dict[str, Any]] = {
    "paper": {"num_drones": 3, "person_amount": 2, "person_initial_position": (3, 3), **SMALL},
    "v1": {"num_drones": 2, "sigma": 2.0, **SMALL},
    "v2": {"num_drones": 4, "dispersion_inc": 0.05, **SMALL},
    "coverage": {
        "num_drones": 3,
        "person_initial_position": (0, 0),
        "vector": (0.0, 0.0),
        "cover_min_probability": 0.08,
        **SMALL,
    },
    "santos": {"num_drones": 3, "timestep_limit": 12},
}


def direct(name: str) -> Any:
    """The search in this process."""
    if name == "santos":
        return parallel_env(find_scenario("santos"), **SEARCHES[name])
    return parallel_env(rules=name, **SEARCHES[name])


def parameters(name: str) -> dict[str, Any]:
    """The search as parameters of a node."""
    fields = SEARCHES[name]
    if name != "santos":
        return fields | {"rules": name}
    return fields | {"scenario": name, "vehicle_time": "awaited"}


@pytest.fixture(scope="module")
def sims(rig: Rig) -> dict[str, Sim]:
    """A node for each search, in a namespace of that name."""
    for name in SEARCHES:
        rig.start("sim_node", parameters(name), "-r", f"__ns:=/{name}")
    return {name: Sim(rig, rig.processes[i], f"/{name}") for i, name in enumerate(SEARCHES)}


@pytest.fixture
def env(rig: Rig, sims: dict[str, Sim]) -> Iterator[DsseRosEnv]:
    """The search of the node `paper`."""
    made = DsseRosEnv("/paper", timeout_s=TIMEOUT_S, domain_id=rig.domain)
    yield made
    made.close()


def assert_equal(mine: Any, theirs: Any) -> None:
    """Compare what two environments have returned, types and bits of the arrays too."""
    assert type(mine) is type(theirs) or isinstance(mine, tuple) and isinstance(theirs, tuple)
    if isinstance(mine, dict):
        assert list(mine) == list(theirs)
        for name, value in mine.items():
            assert_equal(value, theirs[name])
    elif isinstance(mine, tuple):
        for own, other in zip(mine, theirs, strict=True):
            assert_equal(own, other)
    elif isinstance(mine, np.ndarray):
        assert mine.dtype == theirs.dtype and mine.shape == theirs.shape
        assert mine.tobytes() == theirs.tobytes()
    else:
        assert mine == theirs


@pytest.mark.parametrize("name", ["paper", "v1", "v2", "coverage"])
def test_twenty_missions_are_those_of_the_direct_environment_bit_for_bit(
    rig: Rig, sims: dict[str, Sim], name: str
) -> None:
    env, beside = DsseRosEnv(f"/{name}", timeout_s=TIMEOUT_S, domain_id=rig.domain), direct(name)
    try:
        for agent in beside.possible_agents:
            assert env.observation_space(agent) == beside.observation_space(agent)
            assert env.action_space(agent) == beside.action_space(agent)
        ends = [fly_both(env, beside, seed) for seed in range(20)]
    finally:
        env.close()
    assert {True, False} == set(ends)


def fly_both(env: DsseRosEnv, beside: Any, seed: int, before_step: Any = None) -> bool:
    """Fly a mission on the node and beside it, step by step equal; returns who has found."""
    draw = np.random.default_rng(seed)
    search = beside.rules.actions.index("search") if "search" in beside.rules.actions else 0
    assert_equal(env.reset(seed=seed), beside.reset(seed=seed))
    found = False
    while beside.agents:
        if before_step is not None:
            before_step()
        joint = {
            agent: search if draw.random() < 0.4 else int(env.action_space(agent).n * draw.random())  # type: ignore[attr-defined]
            for agent in beside.agents
        }
        mine, theirs = env.step(joint), beside.step(joint)
        assert_equal(mine, theirs)
        assert env.agents == beside.agents
        found = any(info["Found"] for info in theirs[4].values())
    assert env.step({}) == ({}, {}, {}, {}, {})
    return found


IN_METRES: dict[str, Any] = {
    "person_motion": "constant_drift", "grid_size": 20, "particles": 300, "sigma": 1.5,
    "wind_speed": 4.0, "wind_toward": 30.0, "probability_of_detection": 0.7, "timestep_limit": 20,
}  # fmt: skip
CELLS = ((9, 9), (10, 10), (3, 3))


@pytest.fixture(scope="module")
def in_metres(rig: Rig) -> Sim:
    """The node of a search in metres."""
    fields = {"rules.profile": "flight", "drones_positions": [at for cell in CELLS for at in cell]}
    return rig.sim(IN_METRES | fields, namespace="/metres")


def test_missions_in_metres_are_those_of_the_direct_environment_bit_for_bit(
    rig: Rig, in_metres: Sim
) -> None:
    beside = parallel_env(rules="flight", drones_positions=CELLS, **IN_METRES)
    env, ends = DsseRosEnv("/metres", timeout_s=TIMEOUT_S, domain_id=rig.domain), []
    try:
        for agent in beside.possible_agents:
            assert env.observation_space(agent) == beside.observation_space(agent)
            assert env.action_space(agent) == beside.action_space(agent)
        for seed in range(8):
            draw = np.random.default_rng(seed)
            assert_equal(env.reset(seed=seed), beside.reset(seed=seed))
            while beside.agents:
                joint = {
                    agent: draw.uniform(-1, 1, 2).astype(np.float32) for agent in beside.agents
                }
                theirs = beside.step(joint)
                assert_equal(env.step(joint), theirs)
                assert env.agents == beside.agents
            ends.append(any(info["Found"] for info in theirs[4].values()))
        assert {True, False} == set(ends)
        env.reset(seed=1)
        for actions, line in (
            (dict.fromkeys(env.agents, (0.5, 1.5)), "action of drone0 must be two numbers from -1"),
            ({"drone0": (0.5, 0.5)}, "actions: drone1 is missing"),
            ((0.5, 0.5), "actions must be one per live agent"),
        ):
            with pytest.raises(FieldError, match=line):
                env.step(actions)  # type: ignore[arg-type]
        parallel_api_test(env, num_cycles=30)
    finally:
        env.close()


def test_another_command_in_metres_is_noticed(rig: Rig, in_metres: Sim) -> None:
    env = DsseRosEnv("/metres", timeout_s=TIMEOUT_S, domain_id=rig.domain)
    try:
        env.reset(seed=3)
        talker = in_metres.talk(TwistStamped, "drone1/cmd_vel")
        rig.until(lambda: in_metres.search[1] == env.info.mission, "the mission")
        in_metres.health()
        talker.publish(TwistStamped())
        in_metres.health_when(lambda found: found["missing_drones"] == "drone0, drone2")
        # Its joint command comes later and replaces the velocity.
        env.step(dict.fromkeys(env.agents, (0.0, 0.5)))
        rig.until(lambda: in_metres.step_number == 1, "step 1")
        for drone in range(3):
            in_metres.talk(TwistStamped, f"drone{drone}/cmd_vel").publish(TwistStamped())
        rig.until(lambda: in_metres.step_number == 2, "step 2")
        with pytest.raises(SearchLostError, match="another node commands"):
            env.step(dict.fromkeys(env.agents, (0.0, 0.5)))
    finally:
        env.close()


def state_of(drone: int, progress: Progress) -> DiagnosticArray:
    return vehicle_state_message(
        f"drone{drone}", "none", to_stamp(0), progress, level="ok", message="", values={}
    )


@contextlib.contextmanager
def prompt_vehicles(rig: Rig, namespace: str, count: int) -> Iterator[None]:
    """Run vehicles that have done each task as soon as they get it, in a thread."""
    node = rclpy.create_node("vehicles", namespace=namespace, context=rig.context)
    executor = SingleThreadedExecutor(context=rig.context)
    executor.add_node(node)
    states, poses = (
        [node.create_publisher(kind, f"drone{i}/{name}", 10) for i in range(count)]
        for kind, name in ((DiagnosticArray, "vehicle_state"), (PoseStamped, "vehicle_pose"))
    )

    def arrive(message: PointCloud2) -> None:
        for drone, task in enumerate(vehicle_tasks_from_message(message)[-1]):
            number, pose = int(task["task"]), PoseStamped()
            states[drone].publish(state_of(drone, Progress(number, number, number)))
            pose.header.frame_id = message.header.frame_id
            pose.pose.position.x, pose.pose.position.y = float(task["x"]), float(task["y"])
            poses[drone].publish(pose)

    node.create_subscription(PointCloud2, "vehicle_tasks", arrive, LATCHED)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()
        node.destroy_node()


def test_missions_that_lose_a_drone_are_those_of_the_direct_environment(
    rig: Rig, sims: dict[str, Sim]
) -> None:
    env, beside = DsseRosEnv("/santos", timeout_s=TIMEOUT_S, domain_id=rig.domain), direct("santos")
    sim, lost_at = sims["santos"], 3

    def lose_a_vehicle() -> None:
        rig.until(lambda: sim.search[1] == env.info.mission, "the mission")
        rig.until(lambda: sim.step_number == beside.steps_done, "the step")
        # With the last drone the mission ends between two steps: no map is drawn for that.
        loses = beside.steps_done == lost_at and {"drone2"} < set(beside.agents)
        if loses:
            seen, progress = len(sim.reports), Progress(int(sim.tasks()["task"][2]), lost="low")
            sim.talk(DiagnosticArray, "drone2/vehicle_state").publish(state_of(2, progress))
            assert sim.next_report(seen)["terminated"].tolist()[2]
            beside.withdraw(2)

    try:
        with prompt_vehicles(rig, "/santos", len(beside.possible_agents)):
            for seed in range(20):
                fly_both(env, beside, seed, lose_a_vehicle)
    finally:
        env.close()


def test_the_node_passes_pettingzoo_s_parallel_test(env: DsseRosEnv) -> None:
    parallel_api_test(env, num_cycles=60)


def test_missions_without_a_seed_differ_and_come_again_after_the_same_seed(env: DsseRosEnv) -> None:
    def seeds() -> list[int | None]:
        env.reset(seed=3)
        return [env.info.seed, *(env.reset() and env.info.seed for _ in range(2))]

    first = seeds()
    assert len(set(first)) == 3 and first[0] == 3
    assert seeds() == first


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"options": {"vector": (1, 0)}}, "options must be empty over ROS, got 'vector'"),
        ({"seed": -1}, "seed must be an integer >= 0, got -1"),
        ({"seed": 2**63}, f"got {2**63}"),
    ],
)
def test_what_a_reset_over_ros_cannot_carry_is_refused_and_the_mission_goes_on(
    env: DsseRosEnv, arguments: dict[str, Any], line: str
) -> None:
    env.reset(seed=1)
    with pytest.raises(FieldError, match=re.escape(line)):
        env.reset(**arguments)
    assert env.step(dict.fromkeys(env.agents, 4))[0]


def test_an_action_that_the_rules_do_not_have_is_refused_and_the_mission_goes_on(
    env: DsseRosEnv,
) -> None:
    env.reset(seed=1)
    for actions, line in (
        (dict.fromkeys(env.agents, 99), "action of drone0 must be one of 0 left.* got 99"),
        ({"drone0": 1}, "actions: drone1 is missing"),
    ):
        with pytest.raises(FieldError, match=line):
            env.step(actions)
    assert env.step(dict.fromkeys(env.agents, 4))[0]


def test_environments_of_two_namespaces_fly_in_turn_in_a_process_that_uses_ros(
    rig: Rig, env: DsseRosEnv
) -> None:
    rclpy.init(args=[], domain_id=rig.domain)
    try:
        other = DsseRosEnv("/v2", timeout_s=TIMEOUT_S, domain_id=rig.domain)
        pairs = [(env, direct("paper")), (other, direct("v2"))]
        for mine, beside in pairs:
            assert_equal(mine.reset(seed=8), beside.reset(seed=8))
        for _ in range(3):
            for mine, beside in pairs:
                joint = dict.fromkeys(beside.agents, 3)
                assert_equal(mine.step(joint), beside.step(joint))
        other.close()
        other.close()
        assert rclpy.ok()
        names = rig.node.get_node_names_and_namespaces
        rig.until(lambda: ("ros_env", "/v2") not in names(), "the node of the environment gone")
    finally:
        rclpy.shutdown()


def test_a_mission_that_somebody_else_resets_or_steps_is_lost_and_another_can_be_flown(
    env: DsseRosEnv, sims: dict[str, Sim]
) -> None:
    sim = sims["paper"]
    env.reset(seed=1)
    sim.reset()
    with pytest.raises(SearchLostError, match="was cut short"):
        env.step(dict.fromkeys(env.agents, 4))
    assert env.agents == []
    env.reset(seed=1)
    sim.rig.until(lambda: sim.search[1] == env.info.mission, "the mission")
    sim.fly(4, 4, 4)
    with pytest.raises(SearchLostError, match="another node commands"):
        env.step(dict.fromkeys(env.agents, 0))
    assert env.reset(seed=1)[0]


def test_a_node_that_does_not_wait_for_actions_is_refused(rig: Rig, sims: dict[str, Sim]) -> None:
    sims["v1"].set(auto_reset=True)
    try:
        with pytest.raises(FieldError, match="auto_reset of sim_node must be False, got True"):
            DsseRosEnv("/v1", timeout_s=TIMEOUT_S, domain_id=rig.domain)
    finally:
        sims["v1"].set(auto_reset=False)


def test_a_killed_node_is_an_error_within_ten_seconds_and_a_new_one_is_noticed(rig: Rig) -> None:
    assert TIMEOUT_S_OF_ENV < 10
    sim = rig.sim(parameters("paper"), namespace="/killed")
    env = DsseRosEnv("/killed", timeout_s=TIMEOUT_S, domain_id=rig.domain)
    try:
        env.reset(seed=1)
        sim.kill()
        env.timeout_s = 2.0
        began_s = time.monotonic()
        with pytest.raises(
            TimeoutError, match="no step_report and probability of step 1 of mission 2"
        ):
            env.step(dict.fromkeys(env.agents, 4))
        # Not the time-out that the environment was made with, however busy the machine is.
        assert time.monotonic() - began_s < TIMEOUT_S / 2
        assert env.agents == []
        env.timeout_s = TIMEOUT_S
        sim = rig.sim(parameters("paper"), namespace="/killed")
        env.reset(seed=1)
        sim.kill()
        # Who has an action under way when a node starts again gets no step of another search.
        rig.sim(parameters("paper"), namespace="/killed")
        with pytest.raises(SearchLostError, match="was restarted"):
            env.step(dict.fromkeys(env.agents, 4))
        assert_equal(env.reset(seed=1), direct("paper").reset(seed=1))
    finally:
        env.close()


def test_a_request_that_a_killed_node_was_sent_is_repeated(
    env: DsseRosEnv, monkeypatch: pytest.MonkeyPatch
) -> None:
    client, sent = env._set, []
    call = client.call_async

    def call_async(request: Any) -> Any:
        sent.append(request)
        return call(request) if len(sent) > 1 else rclpy.Future()

    monkeypatch.setattr(client, "call_async", call_async)
    assert_equal(env.reset(seed=1), direct("paper").reset(seed=1))
    assert len(sent) > 1


def test_a_simulation_that_is_not_there_is_named(rig: Rig) -> None:
    with pytest.raises(
        TimeoutError, match="no service /nowhere/sim_node/get_parameters within 0.2 s"
    ):
        DsseRosEnv("/nowhere", timeout_s=0.2, domain_id=rig.domain)
