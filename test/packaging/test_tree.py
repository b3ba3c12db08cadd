# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What holds for every file of the repository."""

from __future__ import annotations

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from tree import ROOT, by_name, files, text

COPYRIGHT = "Copyright 2026 dsse_ros maintainers"
LICENCE = "SPDX-License-Identifier: Apache-2.0"
# A path of somebody's machine; a web address or a longer word before it is none.
MACHINE_PATH = re.compile(r"(?<![\w./~-])/(?:home|root|Users|work)/")
UPWARD_PATH = re.compile(r"(?<![\w./])(?:\.\./)+[\w.-]+")
PACKAGES = ("benchmarks", "dsse_ros", "msg_adapters", "soak")
LIBRARY = ("dsse_ros", "msg_adapters")
NO_NAMES = frozenset({"given", "made", "of", "one", "whole"})
PUBLISHED_TWICE = {"DroneSwarmSearch", "ProbabilityMatrix"}
"""Classes of two versions of DSSE, and of DSSE and the scenario."""
MAX_LINES = 500
MAX_FUNCTION_LINES = 60
MAX_PARAMETERS = 8
LONG_SIGNATURES = {
    "dsse_ros/compat/coverage.py: __init__": "the signature of DSSE",
    "dsse_ros/compat/search.py: __init__": "the signature of DSSE",
    "dsse_ros/compat/v1.py: __init__": "the signature of DSSE",
}
"""Functions with more parameters, and why."""
MAX_FLIGHT_MODULES = 14
MAX_OWN_LINES = {"dsse_ros/nodes/sim_node.py": 452}


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


def lines(path: Path) -> int:
    """Lines of a file but for that of its copyright."""
    return len(path.read_text(encoding="utf-8").splitlines()) - 1


def test_a_module_is_short_enough_to_be_read_at_once() -> None:
    long = {
        name: lines(path)
        for name, path in by_name(files()).items()
        if name.startswith(PACKAGES) and name.endswith(".py")
        if lines(path) > MAX_OWN_LINES.get(name, MAX_LINES)
    }
    assert long == {}


class Source(NamedTuple):
    """What the syntax trees of the packages have.

    Attributes:
        lengths: File and name of each function, and its lines.
        parameters: The same with its parameters.
        no_names: Files with the names that say nothing.
        classes: How many modules of the library have a public class of each name.
    """

    lengths: list[tuple[str, int]]
    parameters: list[tuple[str, int]]
    no_names: list[str]
    classes: Counter[str]


@cache
def source() -> Source:
    """Read all files once; the trees themselves take too much memory to be kept."""
    found = Source([], [], [], Counter())
    for file, path in by_name(files()).items():
        if not (file.startswith(PACKAGES) and file.endswith(".py")):
            continue
        tree = ast.parse(text(path))
        if file.startswith(LIBRARY):
            classes = [node.name for node in tree.body if isinstance(node, ast.ClassDef)]
            found.classes.update(name for name in classes if not name.startswith("_"))
        for node in ast.walk(tree):
            found.no_names.extend(f"{file}: {name}" for name in NO_NAMES & names_of(node))
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                name, arguments = f"{file}: {node.name}", node.args
                found.lengths.append((name, (node.end_lineno or 0) - node.lineno + 1))
                own = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
                count = sum(argument.arg not in ("self", "cls") for argument in own)
                found.parameters.append((name, count))
    return found


def names_of(node: ast.AST) -> set[str]:
    """Return the names that a node gives."""
    match node:
        case ast.Name(id=str(name), ctx=ast.Store()) | ast.arg(arg=str(name)):
            return {name}
        case ast.FunctionDef(name=str(name)) | ast.MatchAs(name=str(name)):
            return {name}
    return set()


def test_a_function_is_short_enough_to_be_one_thought() -> None:
    assert [name for name, lines in source().lengths if lines > MAX_FUNCTION_LINES] == []


def test_a_function_has_few_parameters() -> None:
    many = {name for name, count in source().parameters if count > MAX_PARAMETERS}
    assert many == {*LONG_SIGNATURES}


def test_a_name_says_what_it_names() -> None:
    assert source().no_names == []


def test_public_classes_of_two_modules_have_two_names() -> None:
    twice = {name for name, count in source().classes.items() if count > 1}
    assert twice == PUBLISHED_TWICE


def test_flight_has_few_modules() -> None:
    found = [name for name in by_name(files()) if name.startswith("dsse_ros/flight/")]
    modules = [name for name in found if name.endswith(".py") and "__init__" not in name]
    assert len(modules) <= MAX_FLIGHT_MODULES, modules
