# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How programs begin: quiet on Ctrl-C, clear where something is missing."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rig import ENVIRONMENT, TIMEOUT_S, free_domain

from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import specs
from dsse_ros.cli import node_help, run_mission, start
from dsse_ros.ros.nodes.settings import (
    SHORT_NAMES,
    SIM_PARAMETERS,
    PlannerSettings,
    RecorderSettings,
    ShowSettings,
    ViewerSettings,
)
from dsse_ros.screens.dashboard.settings import DashboardSettings
from dsse_ros.screens.tak.settings import CotSettings
from dsse_ros.search.environments.compiler import COMPILING, progress
from dsse_ros.vehicles.fleet.settings import BridgeSettings

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = sorted(path.name for path in (ROOT / "scripts").iterdir())
WITHOUT_ROS = ("backtrack", "campaign", "export_gis", "export_mission", "plan_search", "report")
OF_ROS = [name for name in PROGRAMS if name not in WITHOUT_ROS]


def launch(
    program: str,
    folder: Path | None,
    before: str = "",
    *arguments: str,
    output: Any = subprocess.PIPE,
) -> subprocess.Popen[str]:
    """Start a program as its executable does.

    Args:
        program: Its name.
        folder: For an empty cache of compiled code; None for the cache of all tests.
        before: Python to run first.
        arguments: The program's.
        output: Where its output goes.
    """
    cache = {} if folder is None else {"NUMBA_CACHE_DIR": str(folder / "cache")}
    code = f"{before}\nfrom dsse_ros.cli.start import {program}\nimport sys\n"
    return subprocess.Popen(
        [sys.executable, "-c", code + f"sys.exit({program}())", *arguments],
        env=os.environ | ENVIRONMENT | cache | {"ROS_DOMAIN_ID": str(free_domain())},
        cwd=ROOT, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
        text=True,
    )  # fmt: skip


def loaded(name: str) -> Callable[[int, Path], bool]:
    return lambda pid, folder: name in Path(f"/proc/{pid}/maps").read_text()


def compiling(pid: int, folder: Path) -> bool:
    """Whether some of the functions are compiled and most are not."""
    return any((folder / "cache").rglob("*.nbc"))


WITHOUT_BELIEF = ("--ros-args", "-p", "compute_pos:=never")
"""A belief is more of the same to compile."""

MOMENTS: dict[str, tuple[str, Callable[[int, Path], bool]]] = {
    "sim_node importing": ("sim_node", loaded("numpy")),
    "sim_node importing numba": ("sim_node", loaded("llvmlite")),
    "sim_node importing ROS": ("sim_node", loaded("rclpy")),
    "sim_node compiling": ("sim_node", compiling),
    "planner_node importing": ("planner_node", loaded("rclpy")),
    "run_mission importing": ("run_mission", loaded("rclpy")),
}


@pytest.mark.parametrize("name", MOMENTS)
@pytest.mark.parametrize("times", [1, 3])
def test_ctrl_c_before_a_program_is_at_work_ends_it_at_once_and_quietly(
    name: str, times: int, tmp_path: Path
) -> None:
    program, moment = MOMENTS[name]
    child = launch(program, tmp_path)
    try:
        deadline = time.monotonic() + TIMEOUT_S
        while not moment(child.pid, tmp_path):
            assert child.poll() is None and time.monotonic() < deadline
            time.sleep(0.005)
        for _ in range(times):
            child.send_signal(signal.SIGINT)
        output, _ = child.communicate(timeout=TIMEOUT_S)
    finally:
        child.kill()
    assert child.returncode == (130 if program == "run_mission" else 0)
    # One that is interrupted a little later may have logged this, and nothing else.
    lines = output.splitlines()
    assert all(map(progress, lines)), output
    assert lines or moment is not compiling


def test_a_node_says_that_it_compiles_where_it_does_and_nowhere_else(tmp_path: Path) -> None:
    for cold in (True, False):
        log = tmp_path / f"{cold}.log"
        seen = False
        with log.open("wb") as output:
            child = launch("sim_node", tmp_path, "", *WITHOUT_BELIEF, output=output)
            try:
                while "mission 1" not in log.read_text():
                    assert child.poll() is None, log.read_text()
                    if cold and compiling(child.pid, tmp_path):
                        seen = seen or bool(run_mission.working(log))
                    time.sleep(0.005)
                assert not run_mission.working(log)
            finally:
                child.kill()
                child.wait()
        assert seen == cold
        lines = log.read_text().splitlines()
        assert sum(COMPILING in line for line in lines) == cold
        assert all("topics and services appear" in line for line in lines if progress(line))
        # A counter that moves.
        counts = [
            int(found[1]) for found in map(re.compile(r": (\d+) functions").search, lines) if found
        ]
        assert counts == sorted(counts) and len(set(counts)) >= 2 * cold


def test_ctrl_c_in_a_terminal_ends_a_mission_that_still_compiles(tmp_path: Path) -> None:
    options = ("--scenario", "config/santos.yaml", "--out", str(tmp_path / "out"))
    child = launch("run_mission", tmp_path, "import os\nos.setsid()", *options)
    try:
        while not compiling(child.pid, tmp_path):
            assert child.poll() is None, child.communicate()
            time.sleep(0.005)
        # As a terminal does it: to all of the group, and twice, as people do it.
        for _ in range(2):
            os.killpg(child.pid, signal.SIGINT)
        output, _ = child.communicate(timeout=TIMEOUT_S)
    finally:
        child.kill()
    assert child.returncode == 130
    logs = [path.read_text() for path in (tmp_path / "out").glob("*.log")]
    assert all("Traceback" not in text for text in [output, *logs])


def test_a_node_that_ends_while_it_is_made_leaves_no_shared_memory(tmp_path: Path) -> None:
    def of(pid: int | str) -> set[str]:
        try:
            maps = Path(f"/proc/{pid}/maps").read_text()
        except OSError:  # It has ended, or is somebody else's.
            return set()
        return {part for part in maps.split() if part.startswith("/dev/shm/fast")}

    child = launch("sim_node", tmp_path)
    try:
        while not compiling(child.pid, tmp_path):
            assert child.poll() is None, child.communicate()
            time.sleep(0.005)
        files = of(child.pid)
        child.send_signal(signal.SIGINT)
        child.communicate(timeout=TIMEOUT_S)
        assert child.returncode == 0
    finally:
        child.kill()
    assert files
    # A participant looks into the files of those that it meets, too.
    others = {name for path in Path("/proc").glob("[0-9]*") for name in of(path.name)}
    # Ports are for all who come later.
    left = [name for name in files - others if "port" not in name and Path(name).exists()]
    assert left == []


@pytest.mark.parametrize("program", OF_ROS)
def test_without_ros_2_a_program_says_so_on_one_line(program: str, tmp_path: Path) -> None:
    child = launch(program, tmp_path, "import sys\nsys.modules['rclpy'] = None")
    output, _ = child.communicate(timeout=TIMEOUT_S)
    (line,) = output.splitlines()
    assert line.startswith(f"{program}: ROS 2 not found")
    assert "source a ROS 2" in line and "make sim" in line
    assert child.returncode == start.MISSING


@pytest.mark.parametrize(
    ("module", "says"),
    [
        ("std_msgs.msg", "ROS 2 not found"),
        ("numba", "numba not found: "),
        ("yaml", "yaml not found: "),
        ("tqdm", "tqdm not found: "),
        ("matplotlib", "matplotlib not found: "),
    ],
)
def test_whatever_else_is_missing_is_named_on_one_line(
    module: str, says: str, tmp_path: Path
) -> None:
    child = launch("run_mission", tmp_path, f"import sys\nsys.modules[{module!r}] = None")
    output, _ = child.communicate(timeout=TIMEOUT_S)
    (line,) = output.splitlines()
    assert line.startswith(f"run_mission: {says}")
    # A name on PyPI could be anybody's.
    assert "install" not in line or pip_install("viz") in line
    assert child.returncode == start.MISSING


def test_the_page_names_the_extra_that_it_needs(tmp_path: Path) -> None:
    child = launch("dashboard", tmp_path, "import sys\nsys.modules['nicegui'] = None")
    output, _ = child.communicate(timeout=TIMEOUT_S)
    (line,) = output.splitlines()
    assert line.startswith("dashboard: nicegui not found: ")
    assert pip_install("dashboard") in line and "make sim VIEW=1" in line
    assert child.returncode == start.MISSING


@pytest.mark.parametrize("module", ["lz4", "mcap", "zstandard"])
def test_the_recorder_names_the_extra_that_it_needs(module: str) -> None:
    text = start.missing(ModuleNotFoundError(f"No module named {module!r}", name=module))
    assert text is not None and text.startswith(f"{module} not found: ")
    assert pip_install("record") in text and "make sim" in text


def test_a_ros_2_of_another_python_is_reported_on_one_line(tmp_path: Path) -> None:
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text(
        "raise ImportError('The C extension is\\nnot there', name='rclpy')"
    )
    child = launch("sim_node", tmp_path, f"import sys\nsys.path.insert(0, {str(tmp_path)!r})")
    output, _ = child.communicate(timeout=TIMEOUT_S)
    (line,) = output.splitlines()
    assert "The C extension is not there" in line and sys.version.split()[0] in line
    assert child.returncode == start.MISSING


def test_a_defect_of_the_package_itself_is_not_taken_for_something_missing() -> None:
    assert (
        start.missing(ImportError("cannot import name 'x'", name="dsse_ros.ros.runtime.qos"))
        is None
    )
    with pytest.raises(ModuleNotFoundError):
        start.start("cli.no_such_program")


def test_what_to_install_is_named_by_the_folder_it_was_installed_from() -> None:
    assert pip_install("viz") == f"{sys.executable} -m pip install '{ROOT}[viz]'"


@pytest.mark.parametrize("metadata", ["", "direct_url.json", "{", '{"url": "https://x/y"}'])
def test_other_metadata_of_the_package_do_not_hide_where_it_was_installed_from(
    metadata: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = tmp_path / "dsse_ros.egg-info"
    left.mkdir()
    (left / "PKG-INFO").write_text("Metadata-Version: 2.1\nName: dsse_ros\nVersion: 0.0.1\n")
    if metadata:
        (left / "direct_url.json").write_text(metadata)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert pip_install("viz") == f"{sys.executable} -m pip install '{ROOT}[viz]'"


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_executable_begins_here(program: str) -> None:
    assert callable(getattr(start, program))
    text = (ROOT / "scripts" / program).read_text()
    assert f"from dsse_ros.cli.start import {program}" in text


@pytest.mark.parametrize("program", sorted(set(PROGRAMS) & set(node_help._NODES)))
@pytest.mark.parametrize("flag", ["--help", "-h"])
def test_a_node_explains_its_arguments_without_ros_2(
    program: str, flag: str, tmp_path: Path
) -> None:
    child = launch(program, tmp_path, "import sys\nsys.modules['rclpy'] = None", flag)
    output, _ = child.communicate(timeout=TIMEOUT_S)
    assert child.returncode == 0
    usage, _, does, _, _, example, _, parameters, more = output.splitlines()
    assert usage.startswith("usage: ") and does.endswith(".")
    assert " --ros-args -p " in example
    for line, page in ((parameters, "parameters.md"), (more, node_help._NODES[program][2])):
        assert line.endswith(f"docs/{page}") and (ROOT / "docs" / page).is_file()


def test_every_node_has_help() -> None:
    nodes = {name for name in PROGRAMS if getattr(start, name).args[0].startswith("ros.nodes.")}
    assert nodes == set(node_help._NODES)


def test_the_parameters_of_the_examples_in_the_help_are_accepted() -> None:
    settings = {
        "sim_node": {*SIM_PARAMETERS, *SHORT_NAMES},
        "planner_node": specs(PlannerSettings),
        "mavlink_bridge": specs(BridgeSettings),
        "show": specs(ShowSettings),
        "recorder": specs(RecorderSettings),
        "foxglove_viewer": specs(ViewerSettings),
        "cot_gateway": specs(CotSettings),
        "dashboard": specs(DashboardSettings),
    }
    for name, (_, example, _) in node_help._NODES.items():
        assert set(re.findall(r"-p (\w+):=", example)) <= set(settings[name])


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_middleware_that_is_not_installed_is_refused_by_those_that_would_use_it(
    program: str, tmp_path: Path
) -> None:
    before = "import os\nos.environ['RMW_IMPLEMENTATION'] = 'rmw_nonesuch_cpp'"
    module = getattr(start, program).args[0]
    communicates = module.startswith("ros.nodes.") or program == "run_mission"
    arguments = () if communicates else ("--help",)
    child = launch(program, tmp_path, before, *arguments)
    output, _ = child.communicate(timeout=TIMEOUT_S)
    if communicates:
        (line,) = output.splitlines()
        assert child.returncode == 2
        assert line.startswith(
            f"{program}: RMW_IMPLEMENTATION must be an installed middleware, got"
        )
    else:
        assert child.returncode == 0 and output.startswith(f"usage: {program}")


@pytest.mark.parametrize("program", ["campaign", "report", "run_mission"])
def test_the_backend_of_a_notebook_that_starts_a_program_is_ignored(
    program: str, tmp_path: Path
) -> None:
    before = "import os\nos.environ['MPLBACKEND'] = 'module://nonesuch.backend_inline'"
    output, _ = launch(program, tmp_path, before, "--help").communicate(timeout=TIMEOUT_S)
    assert output.startswith(f"usage: {program}")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_a_terminal_that_lacks_letters_shows_others(encoding: str, tmp_path: Path) -> None:
    scenario = tmp_path / "named.yaml"
    scenario.write_text("name: São Sebastião 海\ngrid_size: 6\n", encoding="utf-8")
    before = f"import os, sys\nsys.stdout.reconfigure(encoding={encoding!r}, errors='strict')"
    child = launch(
        "export_gis", None, before, "--scenario", str(scenario), "--planner", "sweep",
        "--out", str(tmp_path / "out"),
    )  # fmt: skip
    output, _ = child.communicate(timeout=TIMEOUT_S)
    assert child.returncode == 0, output


def test_a_search_without_a_journal_needs_no_extra(tmp_path: Path) -> None:
    without = "import sys\nfor name in ('mcap', 'lz4', 'zstandard'): sys.modules[name] = None"
    for parameter, code in (("nonesuch:=1", 2), ("journal:=j.mcap", start.MISSING)):
        live = ("-p", "truth:=none", "-p", parameter)
        child = launch("sim_node", tmp_path, without, "--ros-args", *live)
        output, _ = child.communicate(timeout=TIMEOUT_S)
        # The one who keeps a journal hears it before anything is compiled.
        (line,) = output.splitlines()
        assert child.returncode == code
        assert ("mcap not found" in line) == (code == start.MISSING)


def test_nodes_end_with_the_program_that_started_them_however_it_ends(tmp_path: Path) -> None:
    code = (
        "import pathlib, time\n"
        "from dsse_ros.cli.node_process import process\n"
        f"with process('show', {{}}, pathlib.Path({str(tmp_path / 'log')!r})) as node:\n"
        "    print(node.pid, flush=True)\n"
        "    time.sleep(600)\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True,
        env=os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(free_domain())},
    )  # fmt: skip
    assert parent.stdout is not None
    node = Path("/proc", parent.stdout.readline().strip())
    deadline = time.monotonic() + TIMEOUT_S
    while b"waiting for" not in (tmp_path / "log").read_bytes():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    parent.kill()
    parent.communicate()
    while node.exists() and "State:\tZ" not in (node / "status").read_text():
        assert time.monotonic() < deadline
        time.sleep(0.05)
