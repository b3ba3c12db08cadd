# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `make` says before it has set anything up."""

from __future__ import annotations

import ast
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in (
        "dsse_ros", "msg_adapters", "config", "launch", "resource", "rviz", "scripts", "viewers",
    ):  # fmt: skip
        (tmp_path / name).mkdir()
    locks = ("requirements.lock", "requirements-jazzy.lock", "requirements-kilted.lock")
    for name in ("Makefile", "package.xml", "pyproject.toml", "setup.py", *locks):
        shutil.copy(ROOT / name, tmp_path)
    return tmp_path


def make(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    env = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
    return subprocess.run(
        ["make", *arguments], cwd=folder, env=env, capture_output=True, text=True, timeout=180
    )


def test_make_alone_lists_every_target_with_a_line(folder: Path) -> None:
    phony = next(
        line.split()[1:]
        for line in (folder / "Makefile").read_text().splitlines()
        if line.startswith(".PHONY:")
    )
    listed = make(folder).stdout.splitlines()
    assert {"sim", "test"} < set(phony)
    assert [line.split()[:2] for line in listed] == [["make", target] for target in phony]
    assert all(len(line.split()) > 2 for line in listed)


def test_an_unknown_distribution_gets_one_clear_line(folder: Path) -> None:
    done = make(folder, "sim", "DISTRO=nonesuch")
    assert done.returncode != 0
    assert len(done.stderr.splitlines()) == 1
    assert "DISTRO=nonesuch: choose jazzy or kilted" in done.stderr


def test_a_python_that_is_too_old_or_missing_gets_a_clear_line(folder: Path) -> None:
    done = make(folder, "sim", "PYTHON=nonesuch")
    assert done.returncode != 0
    assert done.stderr.startswith("nonesuch is not Python 3.10 or later")
    assert not (folder / ".venv").exists()


def test_the_mission_gets_the_options_that_are_given_and_no_other(folder: Path) -> None:
    planned = make(folder, "--dry-run", "sim", "PLANNER=greedy", "SEED=0").stdout.split()
    options = planned[planned.index(".venv/bin/run_mission") + 1 :]
    assert options == ["--planner", "'greedy'", "--seed", "'0'"]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("sim", "DRONE=3"), "DRONE is not an option of make sim; did you mean NUM_DRONES?"),
        (("sim", "seed=3"), "seed is not an option of make sim; did you mean SEED?"),
        (("compare", "MISSION=5"), "did you mean MISSIONS?"),
        (("test", "PLANNER=sweep"), "PLANNER is not an option of make test; known are DISTRO "),
    ],
)
def test_an_option_that_a_target_does_not_have_is_refused_with_the_nearest(
    folder: Path, given: tuple[str, ...], says: str
) -> None:
    done = make(folder, *given)
    assert done.returncode != 0
    (line,) = done.stderr.splitlines()
    assert says in line
    assert not (folder / ".venv").exists()


def test_every_option_of_a_recipe_is_in_the_help_of_its_target(folder: Path) -> None:
    for target in ("sim", "sitl-demo"):
        (line,) = (line for line in make(folder).stdout.splitlines() if f"make {target} " in line)
        options = {name: "7" for name in re.findall("([A-Z_]+)=", line)}
        planned = make(folder, "--dry-run", target, *(f"{name}=7" for name in options)).stdout
        assert planned.splitlines()[-1].count("7") >= len(options.keys() - {"VIEW"})


@pytest.mark.parametrize(
    ("options", "extras"),
    [
        ((), ""),
        (("PLANNER=belief", "MOVIE=out/m.gif"), ""),
        (("VIEW=1",), ",dashboard"),
        (("MOVIE=out/m.mp4",), ",movie"),
        (("PLANNER=onnx", "RULES=v2"), ",onnx"),
        (("PLANNER=route",), ",routes"),
        (("VIEW=1", "MOVIE=m.mp4", "PLANNER=onnx"), ",dashboard,movie,onnx"),
    ],
)
def test_a_mission_installs_the_extras_that_it_uses_and_no_other(
    folder: Path, options: tuple[str, ...], extras: str
) -> None:
    planned = make(folder, "--dry-run", "sim", *options).stdout
    assert f"'.[viz,area,record{extras}]'" in planned
    # Those of an earlier one stay, so it is installed once.
    (venv := folder / ".venv").mkdir()
    for stamp in re.findall(r"touch (\.venv/\S+)", planned):
        (folder / stamp).touch()
    assert "install" not in make(folder, "--dry-run", "sim", *options).stdout
    assert ("install" in make(folder, "--dry-run", "sim").stdout) == bool(extras)
    assert venv.is_dir()


def replaced_by_an_older_file(module: Path) -> None:
    times = module.stat()
    module.write_text("a = 2")
    os.utime(module, ns=(0, times.st_mtime_ns - 10**12))


@pytest.mark.parametrize(
    "change",
    [
        replaced_by_an_older_file,
        Path.unlink,
        lambda module: module.rename(module.with_name("moved.py")),
    ],
)
def test_what_is_installed_is_what_the_sources_are_whenever_they_were_written(
    folder: Path, change: Callable[[Path], object]
) -> None:
    module = folder / "dsse_ros" / "module.py"
    module.write_text("a = 1")
    (folder / ".venv").mkdir()
    for stamp in re.findall(r"touch (\.venv/\S+)", make(folder, "--dry-run", ".venv/.test").stdout):
        (folder / stamp).touch()
    assert "pip" not in make(folder, "--dry-run", ".venv/.test").stdout
    change(module)
    (folder / ".venv" / ".test").touch()
    assert "pip" in make(folder, "--dry-run", ".venv/.test").stdout


@pytest.mark.parametrize(("distro", "version"), [("jazzy", "7.1.6"), ("kilted", "9.1.2")])
def test_a_distribution_comes_with_its_own_wheels(folder: Path, distro: str, version: str) -> None:
    planned = make(folder, "--dry-run", "test", f"DISTRO={distro}").stdout
    assert f"--require-hashes --requirement requirements-{distro}.lock" in planned
    assert f"ros-rclpy=={version}" in pinned(f"requirements-{distro}.lock")
    asked = re.findall(r"'ros-[^']+'", (ROOT / "Makefile").read_text())
    assert sum(f"=={version}'" in command for command in asked) == 1


def pinned(name: str) -> list[str]:
    """Packages of a lock, each with its version; every one has hashes."""
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    starts = [i for i, line in enumerate(lines) if line and not line.startswith((" ", "#"))]
    assert all(lines[i + 1].lstrip().startswith("--hash=sha256:") for i in starts)
    return [re.sub(r"\[.*?\]", "", lines[i]).split()[0] for i in starts]


def test_what_the_tests_need_is_pinned_as_setup_py_admits_it(folder: Path) -> None:
    planned = make(folder, "--dry-run", "test").stdout
    (extras,) = re.findall(r"^OF_TESTS := (.+)$", (folder / "Makefile").read_text(), re.MULTILINE)
    assert "--require-hashes --requirement requirements.lock" in planned
    setup = {
        keyword.arg: keyword.value
        for node in ast.walk(ast.parse((ROOT / "setup.py").read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        for keyword in node.keywords
    }
    of_extras = ast.literal_eval(setup["extras_require"])
    needed = [
        *ast.literal_eval(setup["install_requires"]),
        *(of_extra for extra in extras.split(",") for of_extra in of_extras[extra]),
    ]
    versions: dict[str, set[str]] = {}
    for requirement in pinned("requirements.lock"):
        name, _, version = requirement.partition("==")
        versions.setdefault(name, set()).add(version)
    for requirement in map(Requirement, needed):
        found = versions.get(canonicalize_name(requirement.name), set())
        assert found and all(requirement.specifier.contains(version) for version in found), (
            requirement
        )


def test_both_distributions_are_tested_with_the_same_libraries() -> None:
    of_tests = {requirement.partition("==")[0] for requirement in pinned("requirements.lock")}
    for distro in ("jazzy", "kilted"):
        common = {
            requirement for requirement in pinned(f"requirements-{distro}.lock")
            if requirement.partition("==")[0] in of_tests
        }  # fmt: skip
        assert common <= set(pinned("requirements.lock"))


def test_no_lock_names_a_place_to_download_from() -> None:
    for name in ROOT.glob("requirements*.lock"):
        assert "//" not in name.read_text(encoding="utf-8")


def test_the_folder_may_have_any_name(folder: Path) -> None:
    named = folder.rename(folder.with_name("it's 100 % $HOME"))
    for target in ("sim", "campaign", "docs", "test-oldest"):
        planned = make(named, "--dry-run", target).stdout
        # Neither the shell nor the configuration of the build has the name to misread.
        assert named.name not in planned and "$PWD" not in planned


def test_a_sourced_ros_2_keeps_its_own_packages(folder: Path) -> None:
    sourced = ("--dry-run", "test", "SOURCED=jazzy")
    planned = make(folder, *sourced).stdout
    assert "--system-site-packages" in planned and ".lock" not in planned


def test_the_workflow_runs_what_ci_runs_for_each_distribution_and_for_a_sourced_one() -> None:
    text = (ROOT / ".github/workflows/test.yaml").read_text(encoding="utf-8")
    jobs = yaml.safe_load(text)["jobs"]
    run = {name: [step.get("run", "") for step in job["steps"]] for name, job in jobs.items()}
    assert jobs["wheels"]["strategy"]["matrix"]["distro"] == ["jazzy", "kilted"]
    assert run["wheels"][-1] == "make test" and run["oldest"][-1] == "make test-oldest"
    assert jobs["sourced"]["container"] == "ros:jazzy"
    assert run["sourced"][-1].endswith("setup.bash && make test")
    # A tag can be moved, a commit cannot.
    uses = re.findall(r"uses: \S+@(\S+)", text)
    assert uses and all(re.fullmatch("[0-9a-f]{40}", use) for use in uses)


def test_the_oldest_versions_have_an_environment_of_their_own(folder: Path) -> None:
    planned = make(folder, "--dry-run", "test-oldest").stdout
    assert "--constraint .venv-oldest/oldest.txt '.[viz,area,test]'" in planned
    assert ".venv-oldest/bin/pytest" in planned and ".venv/bin/pytest" not in planned


def test_a_check_lints_and_runs_folders_of_tests_without_what_is_slow(folder: Path) -> None:
    planned = make(folder, "--dry-run", "check").stdout.splitlines()
    lint = make(folder, "--dry-run", "lint").stdout.splitlines()
    assert planned[: len(lint)] == lint
    command = shlex.split(planned[-1])
    assert command[command.index("-m") + 1] == "not slow"
    folders = {ROOT / part for part in command if part.startswith("test/")}
    # The others start nodes, or are of the benchmarks or the soak.
    others = ("benchmarks", "cli", "oracles", "ros", "soak")
    assert {ROOT / "test" / name for name in others} == {
        path for path in (ROOT / "test").iterdir() if path.is_dir() and path.name != "__pycache__"
    } - folders


def test_the_hooks_before_a_commit_are_what_lint_does(folder: Path) -> None:
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    hooks = [hook["entry"] for repository in config["repos"] for hook in repository["hooks"]]
    planned = make(folder, "--dry-run", "lint").stdout.splitlines()
    assert hooks == planned[-len(hooks) :]
    assert [line for line in planned if "/ruff" in line or "/mypy" in line] == hooks


def test_ci_runs_the_oldest_versions_too() -> None:
    lines = (ROOT / ".ci" / "run").read_text().splitlines()
    assert 'make test-oldest >"$log" 2>&1 &' in lines
    # Neither's failure is lost.
    assert "make test || status=$?" in lines and "wait $! || status=$?" in lines
