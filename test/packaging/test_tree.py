# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What holds for every file of the repository."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from tree import ROOT, by_name, files, text

COPYRIGHT = "Copyright 2026 dsse_ros maintainers"
LICENCE = "SPDX-License-Identifier: Apache-2.0"
# A path of somebody's machine; a web address or a longer word before it is none.
MACHINE_PATH = re.compile(r"(?<![\w./~-])/(?:home|root|Users|work)/")
UPWARD_PATH = re.compile(r"(?<![\w./])(?:\.\./)+[\w.-]+")
PACKAGES = ("benchmarks", "dsse_ros", "msg_adapters", "soak")
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


def functions() -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """Yield the functions of the packages with the names of their file and of themselves."""
    for name, path in by_name(files()).items():
        if name.startswith(PACKAGES) and name.endswith(".py"):
            for node in ast.walk(ast.parse(text(path))):
                if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                    yield f"{name}: {node.name}", node


def length_of(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return (node.end_lineno or 0) - node.lineno + 1


def test_a_function_is_short_enough_to_be_one_thought() -> None:
    long = {name for name, node in functions() if length_of(node) > MAX_FUNCTION_LINES}
    assert long == set()


def test_a_function_has_few_parameters() -> None:
    long = set()
    for name, node in functions():
        parameters = node.args
        names = [
            parameter.arg
            for parameter in (*parameters.posonlyargs, *parameters.args, *parameters.kwonlyargs)
        ]
        if len([name for name in names if name not in ("self", "cls")]) > MAX_PARAMETERS:
            long.add(name)
    assert long == {*LONG_SIGNATURES}


def test_flight_has_few_modules() -> None:
    found = [name for name in by_name(files()) if name.startswith("dsse_ros/flight/")]
    modules = [name for name in found if name.endswith(".py") and "__init__" not in name]
    assert len(modules) <= MAX_FLIGHT_MODULES, modules
