# SPDX-License-Identifier: Apache-2.0
"""What holds for every file of the repository."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LICENCE = "SPDX-License-Identifier: Apache-2.0"
# A path of somebody's machine; a web address or a longer word before it is none.
MACHINE_PATH = re.compile(r"(?<![\w./~-])/(?:home|root|Users|work)/")
UPWARD_PATH = re.compile(r"(?<![\w./])(?:\.\./)+[\w.-]+")


def files() -> list[Path]:
    """Files under version control, or about to be."""
    command = ["git", "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others"]
    listed = subprocess.run(
        [*command, "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    if listed.returncode:
        pytest.skip("not a git checkout")
    paths = (ROOT / name for name in listed.stdout.split("\0") if name)
    return [path for path in paths if path.is_file()]


def text(path: Path) -> str:
    """Text of a file, or nothing for one that is not text."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return ""


def inside(path: Path) -> bool:
    """Whether the path leads to something in the repository."""
    return path.exists() and ROOT in path.resolve().parents


def is_source(path: Path) -> bool:
    return path.suffix in {".py", ".rviz", ".sh", ".toml", ".xml", ".yaml"} or (
        path.name == "Makefile" or path.parent in {ROOT / "scripts", ROOT / ".ci"}
    )


def test_every_source_file_names_its_licence() -> None:
    sources = [path for path in files() if is_source(path)]
    assert ROOT / "setup.py" in sources
    assert [path for path in sources if LICENCE not in "".join(text(path).splitlines()[:3])] == []


def test_no_file_points_out_of_the_repository() -> None:
    out = []
    for path in files():
        if ROOT / ".ci" in path.parents:
            continue
        found = [match[0] for match in MACHINE_PATH.finditer(text(path))]
        upward = [match[0] for match in UPWARD_PATH.finditer(text(path))]
        found += [name for name in upward if not inside(path.parent / name)]
        out += [f"{path.relative_to(ROOT)}: {name}" for name in found]
    assert out == []


def test_scripts_may_be_executed_and_nothing_else_pretends_to() -> None:
    executable = {path for path in files() if path.stat().st_mode & 0o111}
    scripts = {path for path in files() if text(path).startswith("#!")}
    assert executable == scripts
