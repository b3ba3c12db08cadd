# SPDX-License-Identifier: Apache-2.0
"""What `make` says before it has set anything up."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in (
        "dsse_ros", "msg_adapters", "config", "launch", "resource", "rviz", "scripts", "viewers",
    ):  # fmt: skip
        (tmp_path / name).mkdir()
    for name in ("Makefile", "package.xml", "pyproject.toml", "setup.py"):
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


@pytest.mark.parametrize(("distro", "version"), [("jazzy", "7.1.6"), ("kilted", "9.1.2")])
def test_a_distribution_comes_with_its_own_wheels(folder: Path, distro: str, version: str) -> None:
    planned = make(folder, "--dry-run", "test", f"DISTRO={distro}").stdout
    assert f"ros-rclpy[fastrtps]=={version}" in planned


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
    others = ("benchmarks", "cli", "nodes", "oracles", "ros_env", "soak")
    assert {ROOT / "test" / name for name in others} == {
        path for path in (ROOT / "test").iterdir() if path.is_dir() and path.name != "__pycache__"
    } - folders


def test_all_tests_end_with_a_list_of_the_slowest(folder: Path) -> None:
    assert " --durations=" in make(folder, "--dry-run", "test").stdout.splitlines()[-1]


def test_the_hooks_before_a_commit_are_what_lint_does(folder: Path) -> None:
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    hooks = [hook["entry"] for repository in config["repos"] for hook in repository["hooks"]]
    planned = make(folder, "--dry-run", "lint").stdout.splitlines()
    assert hooks == planned[-len(hooks) :]
    assert [line for line in planned if "/ruff" in line or "/mypy" in line] == hooks


def test_ci_runs_the_oldest_versions_too() -> None:
    assert "make test-oldest ||" in (ROOT / ".ci" / "run").read_text()
