# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""README, docs and examples say what the running code does."""

from __future__ import annotations

import ast
import functools
import json
import os
import re
import runpy
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from domains import free_domain
from PIL import Image
from sros2_policy import (
    EVERYTHING,
    WITH_SIM_TIME,
    WITH_SIMULATION_INTERFACES,
    WITH_TF2_MSGS,
    WITH_VISION_MSGS,
    as_expressions,
    policy,
)

from dsse_ros.cli.run_mission import parse, summary
from dsse_ros.mission.files.mission_log import COLUMNS
from dsse_ros.mission.run.command_buffer import MISSING_ACTIONS
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.ros.nodes.settings import SHORT_NAMES
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.rules import PROFILES
from msg_adapters.step_report import step_report_dtype
from msg_adapters.topics import published_by, subscribed_by

ROOT = Path(__file__).resolve().parents[2]
README, CONTRIBUTING = ROOT / "README.md", ROOT / "CONTRIBUTING.md"
DOCS = ROOT / "docs"
DASHBOARD, FLIGHT, OPERATE, PARAMETERS, RECORDING, ROS, RULES, TOPICS, VIEWERS = (
    DOCS / f"{name}.md"
    for name in (
        "dashboard",
        "flight",
        "operate",
        "parameters",
        "recording",
        "ros",
        "rules",
        "topics",
        "viewers",
    )
)
DECLARATIONS = [ROOT / "SECURITY.md", ROOT / "QUALITY_DECLARATION.md"]
PAGES = [README, CONTRIBUTING, *DECLARATIONS, *sorted(DOCS.rglob("*.md"))]
SCENARIO = ROOT / "config" / "paper_zone.yaml"
FOR_DEVELOPERS = {"browser", "compat", "docs", "learning", "quality", "sitl", "soak", "test"}
"""Extras that CONTRIBUTING is about."""
SCRIPTS = {path.name for path in (ROOT / "scripts").iterdir()}
# Of every ROS 2 node.
COMMON_TOPICS = {"/parameter_events", "/rosout"}
COMMON_PARAMETERS = {"use_sim_time", "start_type_description_service"}
PATIENCE_S = 600.0
"""A first run compiles, and the machine may be busy."""

Row = dict[str, str]


# Pages


def section(page: Path, heading: str) -> str:
    """Text below a heading, up to the next one."""
    parts = re.split(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return parts[parts.index(heading) + 1]


def table(page: Path, heading: str, column: str) -> dict[str, Row]:
    """Rows of the tables below a heading, by the names in a column."""
    found: dict[str, Row] = {}
    head: list[str] = []
    for line in section(page, heading).splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if head and cells and not cells[0].startswith("---"):
            row = dict(zip(head, cells, strict=True))
            assert row[column].strip("`") not in found, line
            found[row[column].strip("`")] = row
        elif not head or not cells:
            head = cells
    return found


def blocks(page: Path, language: str) -> list[str]:
    """Code blocks of a page in one language."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def commands() -> str:
    """Whatever stands on a page as code."""
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    inline = [code for text in texts for code in re.findall(r"`([^`\n]+)`", text)]
    return "\n".join([*inline, *(block for page in PAGES for block in blocks(page, "sh"))])


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


# Processes


@functools.cache
def domain() -> int:
    """ROS domain of all processes here, and of no other tests."""
    return free_domain()


def environment() -> dict[str, str]:
    """Environment of a process: the package that is tested, this machine, a domain of its own."""
    paths = [os.path.abspath(p) for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    return os.environ | {
        "PYTHONPATH": os.pathsep.join(paths),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(domain()),
    }


def python(script: Path, cwd: Path) -> str:
    """Run a script to its end and return what it prints; fail with its errors otherwise."""
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=cwd, env=environment(), capture_output=True, text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@contextmanager
def process(log: Path, *arguments: str | Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run Python beside the test; it is interrupted at the end, or killed if that does not help."""
    with log.open("wb") as output:
        child = subprocess.Popen(
            [sys.executable, *map(str, arguments)],
            cwd=log.parent, env=environment(), stdout=output, stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            yield child
        finally:
            child.send_signal(signal.SIGINT)
            try:
                child.wait(20)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


def finished(csv: Path) -> RecordedMission | None:
    """Return the mission once no drone is in flight; None while a step is being written."""
    try:
        record = read_csv(csv)[-1]
    except ValueError:
        return None
    return record if record.complete else None


@pytest.fixture(scope="module")
def interface(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Topics, services and parameters of the nodes, as they are when they run."""
    script = Path(__file__).with_name("show_interface.py")
    printed = python(script, tmp_path_factory.mktemp("interface"))
    nodes: dict[str, Any] = json.loads(printed.splitlines()[-1])
    return nodes


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> RecordedMission:
    """A whole mission of `sim_node`, commanded by the example over DDS."""
    folder = tmp_path_factory.mktemp("mission")
    csv, planner_log = folder / "mission.csv", folder / "planner.log"
    parameters = {
        "scenario": SCENARIO, "scenario.num_drones": 3, "seed": 1, "record_file": csv,
    }  # fmt: skip
    options = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
    sim = ("-m", "dsse_ros.ros.nodes.sim_node", "--ros-args", *options)
    deadline = time.monotonic() + PATIENCE_S
    with (
        process(folder / "sim.log", *sim) as simulation,
        process(planner_log, ROOT / "examples" / "my_planner.py") as planner,
    ):
        while (record := finished(csv)) is None:
            assert simulation.poll() is None, (folder / "sim.log").read_text()
            assert planner.poll() is None, planner_log.read_text()
            assert time.monotonic() < deadline, (folder / "sim.log").read_text()
            time.sleep(0.1)
        # An interrupt may come while rclpy makes a task, which then complains.
        assert planner_log.read_text() == ""
    return record


# The interface


@pytest.mark.slow
@pytest.mark.parametrize(
    ("heading", "kind"), [("Published", "published"), ("Subscribed", "subscribed")]
)
def test_the_topics_of_the_simulation_are_those_of_the_tables(
    interface: dict[str, Any], heading: str, kind: str
) -> None:
    documented = {
        name: [row["Type"].strip("`"), row["QoS"]]
        for name, row in table(TOPICS, heading, "Topic").items()
    }
    running = {k: v for k, v in interface["sim_node"][kind].items() if k not in COMMON_TOPICS}
    if kind == "published" and "/tf" not in running:
        # It needs tf2_msgs.
        del documented["/tf"], documented["/tf_static"]
    for topic in WITH_VISION_MSGS - running.keys():
        documented.pop(topic, None)
    assert documented == running


@pytest.mark.slow
@pytest.mark.parametrize(
    "node", ["planner_node", "mavlink_bridge", "dashboard", "cot_gateway", "show"]
)
def test_the_topics_of_the_other_nodes_are_those_of_the_pages_table(
    interface: dict[str, Any], node: str
) -> None:
    topic_row = runpy.run_path(str(ROOT / "docs" / "tables.py"))["topic_row"]
    for kind, topics in (("subscribed", subscribed_by(node)), ("published", published_by(node))):
        documented = {
            name.strip("`"): [of_type.strip("`"), qos]
            for name, of_type, qos in (
                topic_row(name, topic, node if kind == "subscribed" else "")
                for name, topic in topics.items()
            )
        }
        running = {k: v for k, v in interface[node][kind].items() if k not in COMMON_TOPICS}
        assert documented == running


@pytest.mark.slow
def test_the_services_are_those_of_the_table(interface: dict[str, Any]) -> None:
    documented = {
        name: row["Type"].strip("`") for name, row in table(TOPICS, "Services", "Service").items()
    }
    of_all = (
        interface["sim_node"]["services"].items() & interface["planner_node"]["services"].items()
    )
    assert documented.items() == interface["sim_node"]["services"].items() - of_all
    for node in ("planner_node", "dashboard"):
        assert not interface[node]["services"].items() - of_all
    of_bridge = interface["mavlink_bridge"]["services"].items() - of_all
    rows = table(OPERATE, "Operator services", "Service").items()
    operators = {(name, row["Type"].strip("`")) for name, row in rows}
    # Those for one vehicle do the same.
    operators |= {(name.replace("~", "drone<i>"), kind) for name, kind in operators}
    assert of_bridge == operators


@pytest.mark.slow
def test_the_policy_for_sros2_allows_what_the_nodes_do_and_nothing_else(
    interface: dict[str, Any],
) -> None:
    # rcl publishes /rosout by itself.
    optional = (
        {"/rosout"}
        | WITH_TF2_MSGS
        | WITH_SIMULATION_INTERFACES
        | WITH_SIM_TIME
        | as_expressions(WITH_VISION_MSGS)
    )
    for name, node in interface.items():
        rights = policy()[name]
        for right, kind in (
            ("publish", "published"),
            ("subscribe", "subscribed"),
            ("reply", "services"),
        ):
            does = as_expressions(set(node[kind]))
            if rights[right] != EVERYTHING:
                assert does <= rights[right], f"{name}, {right}: add them to the policy"
                assert rights[right] - does <= optional, f"{name}, {right}: more than it does"


def test_the_services_of_simulation_interfaces_are_those_of_the_docs() -> None:
    module = ast.parse((ROOT / "dsse_ros/ros/nodes/simulation_interfaces.py").read_text())
    offered = set()
    for node in ast.walk(module):
        match node:
            case ast.Tuple(
                elts=[
                    ast.Constant(value=str(name)),
                    ast.Attribute(value=ast.Name(id="srv")),
                    _,
                ]
            ):
                offered.add(f"~/{name}")
    assert len(offered) == 5
    assert set(table(ROS, "simulation_interfaces", "Service")) == offered


@pytest.mark.slow
@pytest.mark.parametrize(
    ("node", "tables"),
    [
        (
            "sim_node",
            [
                (PARAMETERS, "Simulation", ""),
                (PARAMETERS, "Scenario", "scenario."),
                (RULES, "Fields", "rules."),
                (DOCS / "faults.md", "Kinds of faults", "scenario."),
            ],
        ),
        ("planner_node", [(PARAMETERS, "Planner", "")]),
        ("mavlink_bridge", [(FLIGHT, "Parameters", "")]),
        ("show", [(ROS, "Table of the steps", "")]),
        ("recorder", [(RECORDING, "Recording", "")]),
        ("foxglove_viewer", [(VIEWERS, "Foxglove", "")]),
        ("cot_gateway", [(VIEWERS, "Where events may go", "")]),
        ("dashboard", [(DASHBOARD, "Parameters", "")]),
    ],
)
def test_the_parameters_are_those_of_the_tables(
    interface: dict[str, Any], node: str, tables: list[tuple[Path, str, str]]
) -> None:
    documented = {
        prefix + name: row.get("At run time") != "yes"
        for page, heading, prefix in tables
        for name, row in table(page, heading, "Field" if prefix else "Parameter").items()
    }
    running = interface[node]["read_only"]
    if node == "sim_node":
        chosen = table(PARAMETERS, "Parameters", "Parameter")
        documented |= dict.fromkeys(chosen, True)
        # vehicle_time sets it.
        del documented["rules.vehicle_timed_actions"]
    assert documented == {k: v for k, v in running.items() if k not in COMMON_PARAMETERS}


@pytest.mark.slow
def test_the_tables_of_parameters_are_what_the_code_makes_of_them() -> None:
    tables = runpy.run_path(str(ROOT / "docs" / "tables.py"))
    texts = {page: (ROOT / page).read_text(encoding="utf-8") for page in tables["PAGES"]}
    places = [name for text in texts.values() for name in re.findall("<!-- table: (.+) -->", text)]
    assert sorted(places) == sorted(tables["TABLES"])
    for page, text in texts.items():
        assert tables["with_tables"](text) == text, f"{page}: run `python docs/tables.py`"


def test_the_refusals_are_those_of_the_code() -> None:
    sources = (
        ROOT / "dsse_ros" / "mission" / "run" / "command_intake.py",
        ROOT / "dsse_ros" / "mission" / "run" / "command_parsers.py",
        ROOT / "dsse_ros" / "mission" / "run" / "metres_parsers.py",
        ROOT / "dsse_ros" / "mission" / "run" / "mission.py",
        ROOT / "dsse_ros" / "mission" / "run" / "mission_space.py",
        ROOT / "dsse_ros" / "ros" / "nodes" / "sim_node.py",
    )
    codes = {
        node.args[0].value
        for path in sources
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "Rejected"
        and isinstance(node.args[0], ast.Constant)
    }
    rows = "".join(re.findall(r"^\|.*", section(ROS, "Refusals"), re.MULTILINE))
    assert set(re.findall(r"`([a-z_]+)`(?!\])", rows)) == codes


def test_the_layouts_are_those_of_the_messages_and_files() -> None:
    dtype = step_report_dtype(5)
    fields = {name: dtype[name].base.name for name in dtype.names or ()}
    documented = table(ROS, "Step report", "Field")
    assert {name: row["Type"] for name, row in documented.items()} == fields
    frame = GridFrame(8, 130.0, 0.0, 0.0, 0.0, 120.0)
    info = AgentsInfo(("drone0",), ("search",), "paper", 0, frame, 100, 13.0, mission=1, run_id=1)
    (shown,) = blocks(ROS, "json")
    assert json.loads(shown).keys() == json.loads(agents_json(info)).keys()
    assert set(COLUMNS) <= set(re.findall(r"`(\w+)`", section(ROS, "Files")))
    assert tuple(table(ROS, "Lockstep", "`missing_action`")) == MISSING_ACTIONS


# What a reader does


@pytest.mark.slow
def test_a_planner_of_ones_own_flies_a_whole_mission(mission: RecordedMission) -> None:
    assert mission.person_found is not None
    assert mission.person_found[-1].all() or mission.truncated[-1].all()
    steps = mission.actions[1:]
    assert len(steps) > 0
    assert (steps != "").all(), "a drone was not commanded"
    assert "search" in steps


@pytest.mark.slow
def test_the_readme_shows_what_a_mission_prints(mission: RecordedMission) -> None:
    (shown,) = blocks(README, "text")
    labels = [line[2:22].strip() for line in summary(mission).splitlines()[1:]]
    shown_labels = [line[2:22].strip() for line in shown.splitlines() if line.startswith("  ")]
    assert shown_labels == [*labels, "picture", "steps"]


PYTHON = {
    f"{page.name}-{number}": block
    for page in PAGES
    for number, block in enumerate(blocks(page, "python"), start=1)
    # It is in the environment for learning only.
    if not re.search("import torch|stable_baselines3", block)
}
# One process, as each would import the same for a second.
RUN_ALL = """
import json, runpy, sys, traceback
for path in sys.argv[1:]:
    try:
        runpy.run_path(path, run_name="__main__")
    except BaseException:
        print(json.dumps([path, traceback.format_exc()]), file=sys.stderr)
"""


@pytest.fixture(scope="module")
def failures(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Which of the blocks of Python have failed, and how."""
    folder = tmp_path_factory.mktemp("blocks")
    for name, block in PYTHON.items():
        (folder / f"{name}.py").write_text(block, encoding="utf-8")
    # With -c Python would find the package in the source tree, and compile it again.
    (folder / "run_all.py").write_text(RUN_ALL, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, folder / "run_all.py", *(folder / f"{name}.py" for name in PYTHON)],
        cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in done.stderr.splitlines() if line.startswith('["/')]
    return {Path(path).stem: trace for path, trace in lines}


@pytest.mark.slow
@pytest.mark.parametrize("name", PYTHON)
def test_the_python_on_a_page_runs(failures: dict[str, str], name: str) -> None:
    assert name not in failures, failures[name]


LOOPS = {
    name: block
    for name, block in PYTHON.items()
    if re.search(r"^while env\.agents:", block, re.MULTILINE)
}
"""Blocks that play a mission in an environment."""


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_on_a_page_plans_for_the_drones_that_are_in_the_search(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("dsse_ros.save_movie", lambda *arguments: None)
    monkeypatch.chdir(ROOT)
    counts = []
    step = SearchEnv.step

    def checked(env: SearchEnv, actions: Any) -> Any:
        assert list(actions) == env.agents
        counts.append(len(env.agents))
        if len(counts) == 2:
            assert env.withdraw(len(env.agents) - 1)
        return step(env, actions)

    monkeypatch.setattr(SearchEnv, "step", checked)
    script = tmp_path / "loop.py"
    script.write_text(LOOPS[name])
    runpy.run_path(str(script), run_name="__main__")
    assert counts[2] == counts[1] - 1


@pytest.mark.slow
def test_the_commands_name_what_exists(interface: dict[str, Any]) -> None:
    text = commands()
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):.*##", makefile, re.MULTILINE))
    # PX4's targets have other names.
    made = re.findall(r"\bmake ([a-z-]+)(?!\w)((?: [A-Z_]+=\S+)*)", text)
    assert {"sim", "test", "sitl-demo"} <= {target for target, _ in made} <= targets
    options = set(table(README, "Quick start", "Option"))
    assert options == set(re.findall(r"\$\(if \$\(([A-Z_]+)\),--[\w-]+(?: '|\))", makefile)) - {
        "SOURCED"
    }
    variables = {name for _, variables in made for name in re.findall(r"\b([A-Z_]+)=", variables)}
    assert variables <= set(re.findall(r"\$\(([A-Z_]+)\)", makefile))

    programs = set(re.findall(r"(?:\.venv/bin/|ros2 run dsse_ros )(\w+)", text))
    assert programs - {"pytest", "python"} <= SCRIPTS
    known = {name for node in interface.values() for name in node["read_only"]}
    detector = (ROOT / "examples" / "detector.py").read_text(encoding="utf-8")
    known |= set(re.findall(r"^    (\w+): ", detector, re.MULTILINE))
    assert set(re.findall(r"-p ([\w.]+):=", text)) <= known | SHORT_NAMES.keys()
    for flags in re.findall(r"\brun_mission( --.*)", text):
        if "--help" not in flags:
            parse(flags.split())


def launch_arguments(*files: str) -> set[str]:
    """Names of the arguments that files declare; launch itself is not there to ask."""
    text = "".join((ROOT / file).read_text(encoding="utf-8") for file in files)
    return set(re.findall(r'\bargument\(\s*"(\w+)"', text))


def test_the_arguments_of_the_launch_files_are_on_the_page_and_exist() -> None:
    of_mission = launch_arguments("dsse_ros/ros/nodes/launching.py")
    of_flight = of_mission | launch_arguments("launch/flight.launch.py")
    listed = section(ROS, "Launch files").partition("explains the arguments:\n\n")[2]
    assert set(re.findall(r"`(\w+)`", listed.partition("\n\n")[0])) == of_flight
    for name, known in (("mission", of_mission), ("flight", of_flight)):
        launches = re.findall(rf"ros2 launch dsse_ros {name}\.launch\.py(.*)", commands())
        assert launches
        for line in launches:
            assert set(re.findall(r"(\w+):=", line.partition("#")[0])) <= known


# The rest


def test_every_profile_has_its_row() -> None:
    assert set(table(RULES, "Search rules", "Profile")) == set(PROFILES)


def test_the_golden_traces_are_as_many_as_stated() -> None:
    stated = " ".join(section(DOCS / "coming_from_dsse.md", "What is the same").split())
    for version, text in (
        ("v1", "{} [recorded episodes]("),
        ("v2", "of {} of 1.1.9"),
    ):
        file = ROOT / "test" / "oracles" / "data" / f"{version}_episodes.json"
        episodes = json.loads(file.read_text())["episodes"]
        assert text.format(len(episodes)) in stated


def test_every_dependency_is_explained() -> None:
    module = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    setup = {
        keyword.arg: keyword.value
        for node in ast.walk(module)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
    }
    extras = ast.literal_eval(setup["extras_require"])
    extras[""] = ast.literal_eval(setup["install_requires"])
    needed = {
        extra: {re.split("[<>=]", requirement)[0] for requirement in requirements}
        for extra, requirements in extras.items() if extra not in FOR_DEVELOPERS
    }  # fmt: skip
    stated: dict[str, set[str]] = {}
    for extra, packages in re.findall(
        r"^\| (?:`(\w+)` )?\| (`.+?`) \|",
        section(DOCS / "install.md", "Dependencies"),
        re.MULTILINE,
    ):
        stated.setdefault(extra, set()).update(re.findall("`([^`]+)`", packages))
    assert stated == needed


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    dead = []
    for link in links:
        target, _, anchor = link.partition("#")
        if "://" in target:
            continue
        path = page.parent / target if target else page
        if not path.exists() or (anchor and anchor not in anchors(path)):
            dead.append(link)
    assert dead == []


def test_the_movie_is_small_and_is_one() -> None:
    path = ROOT / "docs" / "mission.gif"
    with Image.open(path) as movie:
        assert movie.format == "GIF" and movie.n_frames > 10
    assert path.stat().st_size < 1_500_000
