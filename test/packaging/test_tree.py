# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What holds for every file of the repository."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tree import ROOT, files, text

COPYRIGHT = "Copyright 2026 dsse_ros maintainers"
LICENCE = "SPDX-License-Identifier: Apache-2.0"
# A path of somebody's machine; a web address or a longer word before it is none.
MACHINE_PATH = re.compile(r"(?<![\w./~-])/(?:home|root|Users|work)/")
UPWARD_PATH = re.compile(r"(?<![\w./])(?:\.\./)+[\w.-]+")


def inside(path: Path) -> bool:
    """Whether the path leads to something in the repository."""
    return path.exists() and ROOT in path.resolve().parents


def is_source(path: Path) -> bool:
    return path.suffix in {".py", ".rviz", ".sh", ".toml", ".xml", ".yaml"} or (
        path.name == "Makefile" or path.parent in {ROOT / "scripts", ROOT / ".ci"}
    )


def test_every_source_file_names_its_copyright_and_its_licence() -> None:
    sources = [path for path in files() if is_source(path)]
    assert ROOT / "setup.py" in sources
    for line in (COPYRIGHT, LICENCE):
        assert [
            source for source in sources if line not in "".join(text(source).splitlines()[:3])
        ] == []


@pytest.mark.slow
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
