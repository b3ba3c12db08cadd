# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner as a process: what it answers to the topics, lost messages and restarts."""

from __future__ import annotations

import itertools
import json
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from nav_msgs.msg import Path as NavPath
from rcl_interfaces.srv import ListParameters
from rclpy.qos import DurabilityPolicy
from rig import LATCHED, Inbox, Process, Rig
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Int32MultiArray, String

from dsse_ros.cli.node_process import working
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import step_report_of
from dsse_ros.planners.planner import Planning
from dsse_ros.planners.registry import make_planner
from dsse_ros.search.environments.agents import Observation
from dsse_ros.search.environments.compiler import COMPILING
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.images import probability_image
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_message

PLANNER = "expanding_square"
RESEND_S = 0.1


class Stage:
    """The topics of a simulation, without one: they say what the test wants them to say."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._runs: dict[Mission, int] = {}
        self.answers: Inbox = rig.listen(Int32MultiArray, "joint_action")
        self._topics = {
            name: rig.node.create_publisher(kind, name, LATCHED)
            for name, kind in (("agents", String), ("probability", Image))
        }
        self._topics["step_report"] = rig.node.create_publisher(PointCloud2, "step_report", LATCHED)

    def show(self, mission: Mission, *topics: str) -> None:
        """Publish where the mission stands, by default on all topics; each one is a run."""
        run_id = self._runs.setdefault(mission, len(self._runs) + 1)
        env, result = mission.env, mission.result
        scenario = env.scenario
        info = AgentsInfo(
            agents=tuple(env.possible_agents), actions=env.rules.actions, rules="paper",
            seed=mission.seed,
            frame=GridFrame(env.world.grid_size, scenario.cell_size, 0.0, 0.0, 0.0, 120.0),
            timestep_limit=scenario.timestep_limit, step_duration_s=scenario.step_duration_s,
            mission=mission.number, run_id=run_id,
        )  # fmt: skip
        stamp = to_stamp(result.stamp_ns)
        report = step_report_of(mission, info.frame, run_id)
        messages = {
            "agents": String(data=agents_json(info)),
            "probability": probability_image(header(info.frame.map_frame, stamp), env.probability),
            "step_report": step_report_message(header(info.frame.map_frame, stamp), report),
        }
        for topic in topics or messages:
            self.publish(topic, messages[topic])

    def publish(self, topic: str, message: Any) -> None:
        """Publish any message."""
        self._topics[topic].publish(message)

    def answer(self, mission: Mission) -> list[int]:
        """Return the first answer to the step of a mission whose number no other has."""
        step, size = mission.result.step, 2 + mission.env.world.num_drones
        self.rig.until(
            lambda: (
                self.answers
                and list(self.answers.last.data[:2]) == [mission.number, step]
                and len(self.answers.last.data) == size
            ),
            f"an answer to step {step}",
        )
        return list(self.answers.last.data[2:])

    def until_answered(self, mission: Mission, *actions: int) -> None:
        """Wait until the last answer is this one to the mission's step."""
        wanted = [mission.number, mission.result.step, *actions]
        self.rig.until(
            lambda: self.answers and list(self.answers.last.data) == wanted, f"answer {wanted}"
        )

    def steps_answered(self, mission: Mission) -> set[int]:
        """Return the steps of the mission that have been answered."""
        return {data[1] for data in self.datas() if data[0] == mission.number}

    def datas(self) -> set[tuple[int, ...]]:
        """Return mission, step and actions of all answers."""
        return {tuple(message.data) for message in self.answers}


_numbers = itertools.count(1, 100)
"""Of missions: an answer that is sent again is none to the mission of a later test."""


def mission(seed: int = 0, drones: int = 3, grid: int = 6, **options: Any) -> Mission:
    env = parallel_env(
        num_drones=drones, grid_size=grid, probability_of_detection=0.0, sigma=2.0,
        timestep_limit=40, **options,
    )  # fmt: skip
    new = Mission(env, seed)
    new.number = next(_numbers)
    return new


def expected(flown: Mission, planner: object) -> list[int]:
    env = flown.env
    observations = {
        name: Observation(flown.result.cells[i], env.probability)
        for i, name in enumerate(env.possible_agents)
        if i in flown.live
    }
    infos = {
        name: {"Found": False, "action_mask": mask}
        for name, mask in zip(env.possible_agents, env.action_masks(), strict=True)
        if name in observations
    }
    chosen = planner(observations, infos)  # type: ignore[operator]
    return [chosen.get(name, -1) for name in env.possible_agents]


@pytest.fixture(scope="module")
def stage(rig: Rig) -> Stage:
    made = Stage(rig)
    fields = {"planner": PLANNER, "resend_period": RESEND_S}
    # Its topic is there once the drones are known.
    volatile = {"qos_overrides./drone2/plan.publisher.durability": "volatile"}
    rig.start("planner_node", fields | volatile)
    return made


@pytest.fixture
def quiet(stage: Stage) -> Iterator[Stage]:
    stage.answers.clear()
    yield stage


def test_the_answers_are_those_of_the_planner_mission_after_mission(quiet: Stage) -> None:
    flown = mission()
    for seed in (1, 2):
        flown.reset(seed)
        planner = make_planner(PLANNER, flown.env.rules.actions)
        for _ in range(12):
            quiet.show(flown)
            actions = quiet.answer(flown)
            assert actions == expected(flown, planner)
            flown.command_all(actions)
            flown.advance("hold")


def test_an_unanswered_command_is_sent_again(quiet: Stage) -> None:
    flown = mission()
    quiet.show(flown)
    actions = quiet.answer(flown)
    quiet.answers.clear()
    quiet.rig.until(lambda: len(quiet.answers) >= 3, "the command again and again")
    assert quiet.datas() == {(flown.number, 0, *actions)}
    flown.command_all(actions)
    flown.advance("hold")
    quiet.show(flown)
    quiet.answer(flown)
    quiet.answers.clear()
    quiet.rig.until(lambda: len(quiet.answers) >= 2)
    assert quiet.steps_answered(flown) == {1}


def test_a_report_is_answered_with_the_map_of_its_step(quiet: Stage) -> None:
    flown = mission()
    quiet.show(flown)
    actions = quiet.answer(flown)
    flown.command_all(actions)
    flown.advance("hold")
    quiet.show(flown, "step_report")
    quiet.show(flown, "probability")
    planner = make_planner(PLANNER, flown.env.rules.actions)
    expected(mission(), planner)
    assert quiet.answer(flown) == expected(flown, planner)


def test_nobody_is_commanded_when_the_mission_is_over(quiet: Stage) -> None:
    flown = mission()
    quiet.show(flown)
    quiet.answer(flown)
    flown.command_all([0, 2, 2])
    flown.advance("hold")
    assert flown.done
    quiet.show(flown)
    other = mission(drones=2)
    other.advance("hold")
    other.advance("hold")
    quiet.show(other)
    quiet.answer(other)
    assert quiet.steps_answered(flown) == {0} and quiet.steps_answered(other) == {2}


def test_nobody_is_commanded_any_more_when_all_drones_are_lost(quiet: Stage) -> None:
    flown = mission()
    quiet.show(flown)
    quiet.answer(flown)
    for drone in range(3):
        flown.lose(drone)
        quiet.show(flown, "step_report")
    planner, over = quiet.rig.processes[0], f"mission {flown.number} is over"
    quiet.rig.until(lambda: over in planner.output, over)
    # What it sent before it was asked is here once it has replied.
    quiet.rig.call(ListParameters, "planner_node/list_parameters")
    quiet.answers.clear()
    # As long as ten answers would take.
    end = time.monotonic() + 10 * RESEND_S
    while time.monotonic() < end:
        quiet.rig.executor.spin_once(timeout_sec=0.02)
    assert not quiet.answers


def test_the_plan_is_stated_until_the_mission_is_over(quiet: Stage) -> None:
    flown, planner = mission(), make_planner(PLANNER, mission().env.rules.actions)
    expected(flown, planner)
    assert isinstance(planner, Planning)
    with quiet.rig.listening(NavPath, "drone1/plan", LATCHED) as plans:
        quiet.show(flown)
        quiet.rig.until(lambda: plans and plans.last.poses, "a plan")
        cells = [flown.result.cells[1], *planner.plans()["drone1"]]
        stated = [(pose.pose.position.x, pose.pose.position.y) for pose in plans.last.poses]
        assert stated == [((col + 0.5) * 130.0, (5.5 - row) * 130.0) for col, row in cells]
        assert plans.last.header.frame_id == "map"
        durable = [
            quiet.rig.node.get_publishers_info_by_topic(f"/drone{i}/plan")[0].qos_profile.durability
            for i in (1, 2)
        ]
        assert durable == [DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE]
        for drone in range(3):
            flown.lose(drone)
            quiet.show(flown, "step_report")
        quiet.rig.until(lambda: not plans.last.poses, "no plan")


def test_a_foreign_simulation_that_comes_and_goes_leaves_the_mission_answered(quiet: Stage) -> None:
    flown, foreign = mission(), mission(seed=4, drones_positions=[(5, 5), (5, 4), (4, 5)])
    foreign.number = flown.number
    quiet.show(flown)
    actions = quiet.answer(flown)
    wanted = expected(foreign, make_planner(PLANNER, foreign.env.rules.actions))
    assert wanted != actions
    quiet.show(foreign)
    quiet.until_answered(foreign, *wanted)
    flown.command_all(actions)
    flown.advance("hold")
    quiet.show(flown, "probability", "step_report")
    assert len(quiet.answer(flown)) == 3


def test_a_simulation_of_another_size_is_answered_whatever_comes_first(quiet: Stage) -> None:
    small, large = mission(drones=2, grid=5), mission(drones=4, grid=9)
    orders = (("agents", "probability", "step_report"), ("step_report", "probability", "agents"))
    for order in orders:
        for flown in (small, large):
            flown.reset(flown.seed + 1)
            for topic in order:
                quiet.show(flown, topic)
            planner = make_planner(PLANNER, flown.env.rules.actions)
            assert quiet.answer(flown) == expected(flown, planner)


@pytest.mark.parametrize(
    "topics",
    [
        ("agents", "probability", "step_report"),
        ("step_report", "probability", "agents"),
        ("probability", "agents", "step_report"),
    ],
)
def test_a_simulation_restarted_before_its_first_step_is_answered_for_where_its_drones_are(
    quiet: Stage, topics: tuple[str, ...]
) -> None:
    killed = mission()
    restarted = mission(
        seed=9, drones_positions=[(5, 5), (5, 4), (4, 5)], person_initial_position=(1, 4)
    )
    restarted.number = killed.number
    quiet.show(killed)
    before = quiet.answer(killed)
    wanted = expected(restarted, make_planner(PLANNER, restarted.env.rules.actions))
    assert wanted != before
    for topic in topics:
        quiet.show(restarted, topic)
    quiet.until_answered(restarted, *wanted)
    quiet.answers.clear()
    quiet.rig.until(lambda: len(quiet.answers) >= 3, "the answer again and again")
    assert quiet.datas() == {(restarted.number, 0, *wanted)}


def test_messages_that_make_no_sense_are_survived(quiet: Stage) -> None:
    flown = mission()
    quiet.show(flown)
    quiet.answer(flown)
    planner = quiet.rig.processes[0]
    for topic, message in (
        ("agents", String(data='{"agents": 3}')),
        ("probability", Image(width=3, height=2, encoding="rgb8")),
        ("step_report", PointCloud2(width=3)),
    ):
        quiet.publish(topic, message)
        quiet.rig.until(lambda topic=topic: f"{topic}: " in planner.output)  # type: ignore[misc]
    for text in ("", "[]", "{", "NaN", "\x00"):
        quiet.publish("agents", String(data=text))
    flown.command_all([1, 1, 1])
    flown.advance("hold")
    quiet.show(flown)
    assert len(quiet.answer(flown)) == 3


def test_a_planner_that_was_restarted_goes_on_with_the_mission(rig: Rig) -> None:
    sim = rig.sim(
        {
            "num_drones": 3,
            "grid_size": 8,
            "probability_of_detection": 0.0,
            "timestep_limit": 10**6,
            "step_rate": 100.0,
            "seed": 2,
        },
        namespace="/restart",
    )
    for planner in ("sweep", "greedy"):
        until = sim.step_number + 20
        process = rig.start("planner_node", {"planner": planner}, "-r", "__ns:=/restart")
        rig.until(lambda until=until: sim.step_number >= until, f"step {until}")  # type: ignore[misc]
        process.stop()
        # Its last command may still be waiting for the rate.
        health = sim.health_when(lambda h: h["missing_drones"] == "drone0, drone1, drone2")
        rig.until(lambda step=health["step"]: str(sim.step_number) == step, "the last step")  # type: ignore[misc]


FAILING = """
import sys
from dsse_ros.ros.nodes import planner_node

class Failing:
    asked = 0

    def __call__(self, observations, infos):
        self.asked += 1
        step = self.asked
        if step == 2:
            raise KeyError("of the\\nsecond time")
        if step == 4:
            return {"nobody": 0}
        return dict.fromkeys(observations, 4)

planner = Failing()
planner_node.planner_with = lambda *arguments, **options: planner
sys.exit(planner_node.main())
"""


@pytest.mark.parametrize("level", ["info", "debug"])
def test_a_planner_that_fails_is_reported_on_a_line_and_asked_again(
    rig: Rig, level: str, tmp_path: Path
) -> None:
    script = tmp_path / "failing.py"
    script.write_text(FAILING)
    sim = rig.sim({"num_drones": 2, "grid_size": 6, "probability_of_detection": 0.0},
                  namespace=f"/{level}")  # fmt: skip
    options = [
        "--ros-args",
        "-r",
        f"__ns:=/{level}",
        "--log-level",
        f"{level}.planner_node:={level}",
    ]
    process = Process([str(script), *options], tmp_path / "planner.log", rig.domain)
    rig.processes.append(process)
    # Each of the two failures holds the step up, and the next try answers it.
    rig.until(lambda: sim.step_number >= 5, "the steps after both")
    errors = [line for line in process.output.splitlines() if "[ERROR]" in line]
    assert [line.partition(" failed in ")[2] for line in errors] == [
        "step 1 of mission 1: KeyError: 'of the\\nsecond time'",
        "step 2 of mission 1: KeyError: 'nobody'",
    ]
    assert process.output.count("Traceback") == (2 if level == "debug" else 0)
    process.kill()


SLOW = """
import time

class Slow:
    def __init__(self, search, *, seed=0):
        self.right = search.rules.actions.index("right")

    def __call__(self, observations, infos):
        time.sleep(3 * infos["drone0"]["decision_time_s"])
        return dict.fromkeys(observations, self.right)
"""


def test_a_planner_slower_than_the_step_is_reported_and_its_decisions_are_done_later(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    registered = tmp_path / "slow-1.0.dist-info"
    registered.mkdir()
    (registered / "METADATA").write_text("Metadata-Version: 2.1\nName: slow\nVersion: 1.0\n")
    (registered / "entry_points.txt").write_text("[dsse_ros.planners]\nslow = slow:Slow\n")
    paths = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    sim = rig.sim(
        {
            "num_drones": 2, "grid_size": 10, "probability_of_detection": 0.0,
            "timestep_limit": 10**6, "step_mode": "realtime", "step_rate": 4.0,
            "publish_clock": False,
        },
        namespace="/slow",
    )  # fmt: skip
    agents = rig.listen(String, sim.topic("agents"), LATCHED)
    process = rig.start("planner_node", {"planner": "slow"}, "-r", "__ns:=/slow")
    # From one move to the next there are several steps, in which the drones search.
    rig.until(lambda: min(sim.cells)[0] >= 2, "the drones have moved")
    line = r"planner slow is too slow: (.*) s for step \d+ of mission 1, which waited 0\.25 s\n"
    took_s = [float(number) for number in re.findall(line, process.output)]
    assert took_s and min(took_s) >= 0.6, process.output
    # The time that there is goes out again when it changes.
    assert json.loads(agents.last.data)["decision_time_s"] == 0.25
    sim.set(step_mode="manual")
    rig.until(lambda: json.loads(agents.last.data)["decision_time_s"] is None, "that it may wait")


def test_the_planner_says_what_it_waits_for(rig: Rig) -> None:
    planner = rig.start("planner_node", {"resend_period": 0.1}, "-r", "__ns:=/wait")

    def says(*words: str) -> bool:
        return any(all(word in line for word in words) for line in planner.output.splitlines())

    rig.until(
        lambda: says("waiting for", "/wait/agents", "/wait/probability", "/wait/step_report"),
        "what it waits for",
    )
    sim = rig.sim(
        {"num_drones": 2, "grid_size": 6, "probability_of_detection": 0.0, "timestep_limit": 5},
        namespace="/wait",
    )
    rig.until(lambda: not sim.flying, "the end")
    rig.until(lambda: says("waiting for a new mission", "mission 1 is over"), "that it is over")
    sim.pause(True)
    sim.reset()
    rig.until(lambda: says("waiting for step 1 of mission 2"), "the step that does not come")
    sim.process.stop()
    rig.until(lambda: says("waiting for a simulation that listens to /wait/joint_action"))


def test_a_planner_that_compiles_says_so_and_that_it_is_ready_as_it_commands(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fields = {"grid_size": 6, "num_drones": 2, "seed": 1, "probability_of_detection": 0.0}
    sim = rig.sim(fields, namespace="/compiled")
    answers = rig.listen(Int32MultiArray, "/compiled/joint_action")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    # What is compiled for this run alone is not worth optimising.
    monkeypatch.setenv("NUMBA_OPT", "0")
    process = rig.start("planner_node", {"planner": "belief_greedy"}, "-r", "__ns:=/compiled")

    def commanded() -> bool:
        return bool(json.loads(rig.first(String, "/compiled/agents").data)["commanded"])

    # As long as it compiles `run_mission` waits, and vehicles stay on the ground.
    rig.until(lambda: working(process.log), "the compiler")
    assert not answers and not commanded()
    rig.until(lambda: answers, "a command")
    rig.until(lambda: "planner belief_greedy is ready" in process.output, "the planner to be ready")
    assert not working(process.log)
    rig.until(commanded, "the simulation to be commanded")
    # Later steps need functions that the first one did not.
    rig.until(lambda: len({tuple(answer.data[:2]) for answer in answers}) > 3, "later steps")
    process.stop()
    assert process.output.count("is ready") == process.output.count(COMPILING) == 1
    sim.process.stop()
