# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What must not be is refused at the start, on one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
from rig import ENVIRONMENT, free_domain

from dsse_ros.ros.nodes import planner_node, sim_node
from dsse_ros.search.environments.compiler import prepared_env
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario


@dataclass(frozen=True)
class Case:
    """A command line, what the line that refuses it says, and the node if it is another one.

    In the arguments {x} is a file of that name with the text of `files`.
    """

    arguments: str
    says: str
    node: str = "sim_node"
    files: Mapping[str, str] | None = None


def scenario(text: str, says: str) -> Case:
    return Case("-p scenario:={x}", says, files={"x": text})


CASES = {
    "unknown YAML key": scenario("sigmma: 2.0", "did you mean sigma?"),
    "wrong type in YAML": scenario("grid_size: wide", "grid_size must be an integer"),
    "wrong type of cells in YAML": scenario("drones_positions: [[0, 0], 3]", "drones_positions"),
    "person outside in YAML": scenario(
        "{grid_size: 8, person_initial_position: [8, 0]}", "from 0 to 7, got [8, 0]"
    ),
    "NaN vector in YAML": scenario("vector: [.nan, 0.0]", "cells per step, got [nan, 0.0]"),
    "not YAML": scenario("a: [1, 2", "not YAML"),
    "not a mapping": scenario("- 1\n- 2", "mapping"),
    "not text": Case("-p scenario:={x}", "not UTF-8", files={"x": "\udcff\udcfe"}),
    "missing scenario": Case(
        "-p scenario:=/no/such.yaml", "'/no/such.yaml' is not a file or a known scenario"
    ),
    "0 drones": Case("-p scenario.num_drones:=0", "num_drones must be an integer >= 1"),
    "more drones than cells": Case(
        "-p scenario.grid_size:=3 -p scenario.num_drones:=10", "at most 9"
    ),
    "more cells than there may be": Case(
        "-p scenario.grid_size:=101 -p max_cells:=10000",
        "grid_size must have at most 10000 cells, see max_cells, got 101 x 101",
    ),
    "zone of more cells than there may be": Case(
        "-p scenario.zone_size:=1300000.0 -p scenario.cell_size:=130.0",
        "at most 4000000 cells, see max_cells, got 10000 x 10000",
    ),
    "person outside": Case(
        "-p scenario.grid_size:=4 -p scenario.person_initial_position:=[-1,0]",
        "person_initial_position",
    ),
    "drone outside": Case(
        "-p scenario.grid_size:=4 -p scenario.drones_positions:=[4,0]", "drones_positions"
    ),
    "odd number of cell parts": Case("-p scenario.drones_positions:=[1,2,3]", "drones_positions"),
    "NaN vector": Case("-p scenario.vector:=[.nan,0.0]", "vector"),
    "infinite sigma": Case("-p scenario.sigma:=.inf", "sigma"),
    "unknown parameter in a file of its own": Case(
        "--params-file {x}",
        "did you mean scenario.num_drones?",
        files={"x": "sim_node: {ros__parameters: {scenario: {num_dornes: 3}}}"},
    ),
    "unknown field in a file for all": Case(
        "--params-file {x}",
        "did you mean rules.collision?",
        files={"x": "/**: {ros__parameters: {rules: {colision: -1.0}}}"},
    ),
    "name without its group": Case("-p sigma:=3.0", "did you mean scenario.sigma?"),
    "name without its group in a file": Case(
        "--params-file {x}",
        "did you mean rules.collision?",
        files={"x": "/**: {ros__parameters: {collision: -1.0}}"},
    ),
    "value not allowed in a file for all": Case(
        "--params-file {x}",
        "num_drones must be an integer >= 1",
        files={"x": "/**: {ros__parameters: {scenario: {num_drones: 0}}}"},
    ),
    "unknown parameter": Case("-p num_dornes:=3", "num_drones"),
    "wrong type": Case("-p scenario.num_drones:=three", "num_drones must be an integer"),
    "float for an integer": Case("-p scenario.num_drones:=3.0", "num_drones must be an integer"),
    **{
        f"empty list for {name}": Case(f"-p {name}:=[]", f"{name} must be ")
        for name in (
            "scenario.num_drones",
            "scenario.sigma",
            "scenario.vector",
            "scenario.file",
            "auto_reset",
            "use_sim_time",
        )  # fmt: skip
    },
    "no start cells": Case(
        "-p scenario.drones_positions:=[]", "drones_positions must be one cell per drone"
    ),
    "no multipliers": Case(
        "-p scenario.person_pod_multipliers:=[]", "person_pod_multipliers must be one per person"
    ),
    "empty list for no field": Case("-p num_dornes:=[]", "did you mean num_drones?"),
    "empty list for a QoS": Case(
        "-p qos_overrides./clock.publisher.depth:=[]", "depth must be an integer"
    ),
    "list for a number": Case(
        "-p scenario.sigma:=[1.0]", "sigma must be a finite number >= 1e-06 cells"
    ),
    "number for a list": Case(
        "-p scenario.vector:=0.5", "vector must be two finite numbers [x, y]"
    ),
    "number for a truth": Case("-p use_sim_time:=3", "use_sim_time must be true or false, got 3"),
    "number for a name": Case("-p rules:=3", "rules.profile must be one of"),
    "empty list in a file": Case(
        "--params-file {x}",
        "vector must be two finite numbers",
        files={"x": "sim_node: {ros__parameters: {scenario.vector: []}}"},
    ),
    "empty list for the planner": Case(
        "-p planner:=[]", "planner must be one of sweep", "planner_node"
    ),
    "key twice in YAML": scenario("sigma: 1.0\nsigma: 2.0", "'sigma' is given twice"),
    "aliases in YAML": scenario("a: &a [1]\nb: [*a, *a]", "must be written out, got an alias"),
    "unknown step mode": Case("-p step_mode:=fast", "lockstep, realtime, manual"),
    "unknown rules": Case("-p rules:=v9", "rules.profile must be one of"),
    "record file in no folder": Case("-p record_file:=/no/such/x.csv", "record_file"),
    "snapshot file in no folder": Case(
        "-p snapshot_file:=/no/such/x", "snapshot_file: '/no/such/x': No such file"
    ),
    "snapshot file that is a device": Case(
        "-p snapshot_file:=/dev/null", "snapshot_file must be a regular file or a new one, got "
    ),
    "snapshot file that is a folder": Case(
        "-p snapshot_file:=/", "snapshot_file must be a regular file or a new one, got '/'"
    ),
    "resume from nothing": Case("-p resume:=true", "resume must be false without snapshot_file"),
    "map frame without a name": Case("-p map_frame:=''", "map_frame must be a name"),
    "cells in lists of their own": Case(
        "-p scenario.drones_positions:=[[1,2],[3,4]]", "drones_positions must be a flat list"
    ),
    "a cell after numbers": Case(
        "-p scenario.drones_positions:=[1,2,[3,4]]", "must be a flat list [col0"
    ),
    "QoS of no topic": Case(
        "-p qos_overrides./nothing.publisher.depth:=3", "qos_overrides./nothing.publisher.depth"
    ),
    "unknown QoS policy": Case("-p qos_overrides./clock.publisher.dept:=3", "did you mean depth?"),
    "wrong QoS": Case("-p qos_overrides./clock.publisher.reliability:=maybe", "best_effort"),
    "wrong QoS depth": Case(
        "-p qos_overrides./clock.publisher.depth:=0", "depth must be an integer"
    ),
    "joint actions of another time": Case(
        "-p qos_overrides./joint_action.subscription.durability:=transient_local",
        "joint_action.subscription.durability must be volatile",
    ),
    "actions of another time": Case(
        "-p qos_overrides./drone0/cmd_action_name.subscription.durability:=transient_local",
        "drone0/cmd_action_name.subscription.durability must be volatile",
    ),
    "joint actions for another time": Case(
        "-p qos_overrides./joint_action.publisher.durability:=transient_local",
        "joint_action.publisher.durability must be volatile",
        "planner_node",
    ),
    "parameter without a value": Case("-p scenario.num_drones", "num_drones"),
    "two contradicting types": Case("-p scenario.num_drones:=[1,two]", "num_drones"),
    "missing parameter file": Case("--params-file /no/such.yaml", "/no/such.yaml"),
    "bad parameter file": Case("--params-file {x}", "x", files={"x": "a: [1, 2"}),
    "bad node name": Case("-r __node:=bad-name", "__node:=bad-name"),
    "bad namespace": Case("-r __ns:=bad-ns", "__ns:=bad-ns"),
    "bad log level": Case("--log-level loud", "loud"),
    "unknown ROS argument": Case("--no-such", "--no-such"),
    "no ROS argument": Case("-- --drones", "'--drones' is not an argument"),
    "parameter without -p": Case("-- scenario:=santos", "'scenario:=santos' is not an argument"),
    "file for another node": Case(
        "--params-file {x}",
        "must have parameters of /sim_node, got those of /simnode",
        files={"x": "simnode: {ros__parameters: {seed: 3}}"},
    ),
    "name that is no name": Case("-r __node:=my-sim", "'__node:=my-sim' must be a remapping"),
    "number that is read in two ways": Case("-p seed:=010", "must not begin with 0, got '010'"),
    "unknown planner": Case("-p planner:=oracle", "sweep, creeping_line", "planner_node"),
    "unknown parameter of the planner": Case("-p planer:=sweep", "planner", "planner_node"),
    "negative resend period": Case("-p resend_period:=-1.0", "resend_period", "planner_node"),
}


IN_PROCESSES_OF_THEIR_OWN = (
    "unknown YAML key", "more drones than cells", "parameter without a value", "bad node name",
    "unknown planner",
)  # fmt: skip
"""Some of each kind, as they were typed; for the others the imports would take a minute."""


def test_a_domain_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dsse_ros.ros.nodes.sim_node"]
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=180,
        env=os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": "233"},
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "sim_node: ROS_DOMAIN_ID must be from 0 to 232, got 233\n"


def arguments_of(case: Case, folder: Path) -> list[str]:
    places = {name: folder / name for name in case.files or {}}
    for name, text in (case.files or {}).items():
        places[name].write_text(text, encoding="utf-8", errors="surrogateescape")
    return ["--ros-args", *case.arguments.format(**places).split()]


def check(case: Case, code: int, output: str, errors: str) -> None:
    assert code == 2, errors
    (line,) = errors.splitlines()
    assert line.startswith(f"{case.node}: ") and case.says in line
    assert output == ""


@pytest.fixture
def signal_handlers() -> Iterator[None]:
    """Restore the signal handlers that a node replaces."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, handlers, strict=True):
        signal.signal(number, handler)


@pytest.fixture(scope="module")
def compiled() -> None:
    """Have the search compiled, which a node would say."""
    prepared_env(Scenario(), profile("paper"), has_belief=lambda grid_size: True)


@pytest.mark.usefixtures("compiled", "signal_handlers")
@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_refused_on_one_clear_line(
    name: str,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    case = CASES[name]
    node = {"sim_node": sim_node, "planner_node": planner_node}[case.node]
    code = node.main(arguments_of(case, tmp_path))
    check(case, code, *capfd.readouterr())


@pytest.mark.parametrize("name", IN_PROCESSES_OF_THEIR_OWN)
def test_the_program_ends_with_that_line_and_code(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    command = [
        sys.executable,
        "-m",
        f"dsse_ros.ros.nodes.{case.node}",
        *arguments_of(case, tmp_path),
    ]
    environment = os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(free_domain())}
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=180,
        env=environment,
    )  # fmt: skip
    check(case, done.returncode, done.stdout, done.stderr)
