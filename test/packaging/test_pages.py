# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the pages promise a newcomer: messages as printed, commands that work, files that exist."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

import pytest

from dsse_ros.planners.registry import PLANNER_NAMES

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [README, *(ROOT / f"{name}.md" for name in ("CONTRIBUTING", "SECURITY")), *DOCS]
TROUBLESHOOTING = ROOT / "docs" / "troubleshooting.md"
NEED_ROS_2 = {"security.md", "cpp_planner.md"}
"""Pages on tools of a full ROS 2."""


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def literals(source: str) -> list[str]:
    """Return the texts in a source, with a line break for each value that is filled in."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.JoinedStr):
            parts = [
                value.value if isinstance(value, ast.Constant) else "\n" for value in node.values
            ]
            found.append("".join(map(str, parts)))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.append(node.value)
    return found


@functools.cache
def printed() -> list[str]:
    """Return the texts that the programs, and `make`, can print."""
    sources = [path for package in ("dsse_ros", "msg_adapters") for path in
               (ROOT / package).rglob("*.py")]  # fmt: skip
    return [
        text(ROOT / "Makefile"),
        *(literal for path in sources for literal in literals(text(path))),
    ]


def quoted() -> list[str]:
    """Return the messages in the first columns of the page's tables."""
    rows = re.findall(r"^\| ([^|]+) \|", text(TROUBLESHOOTING), re.MULTILINE)
    return [message for row in rows for message in re.findall(r"^`([^`]+)`", row)]


def is_printed(part: str, pieces: int = 3) -> bool:
    """Return whether a text consists of a few texts of the programs, split between words."""
    if not part:
        return True
    words = part.split(" ")
    for count in range(len(words), 0, -1):
        if any(" ".join(words[:count]) in line for line in printed()):
            return pieces > 0 and is_printed(" ".join(words[count:]), pieces - 1)
    return False


@pytest.mark.slow
@pytest.mark.parametrize("message", quoted())
def test_a_message_on_the_page_is_one_that_a_program_prints(message: str) -> None:
    for part in message.split("..."):
        assert is_printed(part.strip(" :,;()'"))


def test_a_message_that_no_program_prints_is_found() -> None:
    assert not is_printed("waiting for Godot")
    assert not is_printed("waiting for a simulation: something on")
    assert "a \n must be a c" in literals('raise ValueError(f"a {b!r} must " "be a c")')


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_program_that_ros2_runs_is_also_shown_as_make_installs_it(page: Path) -> None:
    if page.name in NEED_ROS_2:
        return
    content = text(page)
    programs = set(re.findall(r"ros2 run dsse_ros (\w+)", content))
    assert programs <= set(re.findall(r"\.venv/bin/(\w+)", content))


def test_every_planner_has_its_row() -> None:
    rows = re.findall(r"^\| `(\w+)` \|", text(ROOT / "docs/planners.md").split("##")[0], re.M)
    assert sorted(rows) == sorted(PLANNER_NAMES)


def test_each_file_that_the_page_on_the_architecture_names_exists() -> None:
    names = re.findall(r"`([\w/]+/\w+\.py)`", text(ROOT / "docs" / "architecture.md"))
    assert len(names) > 20
    assert [name for name in names if not (ROOT / name).is_file()] == []
