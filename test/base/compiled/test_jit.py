# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was compiled is not used again once the code that it was compiled from has changed."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import dsse_ros
from dsse_ros.base.compiled import jit

PACKAGE = Path(dsse_ros.__file__).parent
RUN_DRIFT = """
import numpy as np
from dsse_ros.search.belief.drift_estimate import misfits
from dsse_ros.search.step.constants import CONSTANTS
from dsse_ros.search.step.entities import WORLDS
constants = np.zeros(1, CONSTANTS)
constants["columns"] = constants["rows"] = 10
out = np.zeros(1, np.int64)
misfits(constants, np.zeros(1, WORLDS), None, np.array([[1, 2]]), np.array([[1.0, 2.0]]), out)
print(out)
"""
RUN_FAULTS = """
import numpy as np
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.search.step.fault_kernels import start_conditions
world = World(Scenario(num_drones=1, battery_move=1.0), profile("paper"), 1)
start_conditions(world.batch, world.faults.arrays, np.ones(1, np.bool_), 0, 1)
print(world.faults.arrays.conditions["battery"][0])
"""
TWICE = """
from dsse_ros.base.compiled.jit import compiled

@compiled()
def twice(values):
    return values.sum() + values.sum()
"""
RUN_TWICE = """
import sys, time
import numpy as np
from numba.core.caching import IndexDataCacheFile
from twice import twice

def pause_before(method, seconds):
    write = getattr(IndexDataCacheFile, method)
    setattr(IndexDataCacheFile, method, lambda *args: (time.sleep(seconds), write(*args)))

before_index, before_data = (0.5, 1.5) if sys.argv[1] == "int8" else (1, 0)
pause_before("_save_index", before_index)
pause_before("_save_data", before_data)
values = np.ones(3, sys.argv[1])
print(values.dtype, twice(values))
"""
"""The one writes its index last, the other its code, if nothing prevents them."""
DRIFTS = [
    f"    world.remainder_x += world.drift_{first}\n    world.remainder_y += world.drift_{second}\n"
    for first, second in ("xy", "yx")
]


@pytest.mark.slow
def test_processes_that_compile_at_once_do_not_mix_up_their_code(tmp_path: Path) -> None:
    (tmp_path / "twice.py").write_text(TWICE)

    def run(kind: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", RUN_TWICE, kind]
        return subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)

    for process in [run("int8"), run("float64")]:
        process.communicate(timeout=120)
    outputs = [run(kind).communicate(timeout=120)[0] for kind in ("int8", "float64")]
    assert outputs == ["int8 6\n", "float64 6.0\n"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "versions",
    [
        pytest.param([("Pair", "low", "high"), ("Pair", "high", "low")], id="other order"),
        pytest.param([("Pair", "low", "high"), ("Couple", "low", "high")], id="other name"),
    ],
)
def test_a_named_tuple_that_changes_has_what_uses_it_compiled_anew(
    tmp_path: Path, versions: list[tuple[str, str, str]]
) -> None:
    (tmp_path / "lower.py").write_text(
        "from dsse_ros.base.compiled.jit import compiled\n"
        "@compiled()\ndef lower(pair):\n    return pair.low\n"
    )
    for name, first, second in versions:
        (tmp_path / "pair.py").write_text(
            "from typing import NamedTuple\n"
            f"class {name}(NamedTuple):\n    {first}: float\n    {second}: float\n"
        )
        run = f"from lower import lower; import pair; print(lower(pair.{name}(low=1.0, high=2.0)))"
        done = subprocess.run(
            [sys.executable, "-B", "-c", run],
            cwd=tmp_path, check=True, capture_output=True, text=True,
        )  # fmt: skip
        assert done.stdout == "1.0\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("run", "module", "change", "results"),
    [
        pytest.param(RUN_DRIFT, "world/targets/sea_map.py", DRIFTS, ["[0]", "[2]"], id="function"),
        pytest.param(
            RUN_FAULTS, "world/scenario/battery_fields.py", ["FULL = 100.0\n", "FULL = 90.0\n"],
            ["[100.]", "[90.]"], id="constant",
        ),
    ],
)  # fmt: skip
def test_a_change_of_what_a_function_uses_has_it_compiled_anew(
    tmp_path: Path, run: str, module: str, change: list[str], results: list[str]
) -> None:
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "dsse_ros", ignore=ignore)
    used = tmp_path / "dsse_ros" / module
    text = used.read_text()
    assert text.count(change[0]) == 1
    for line, result in zip(change, results, strict=True):
        used.write_text(text.replace(change[0], line))
        # The folder that it runs in comes first on its path.
        done = subprocess.run(
            [sys.executable, "-c", run], cwd=tmp_path, check=True, capture_output=True, text=True
        )
        assert done.stdout.strip() == result


def imported_by(file: Path) -> set[Path]:
    """Return the modules of the package from which a module takes names, by its syntax tree."""
    found = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        assert not isinstance(node, ast.Import) or "dsse_ros" not in node.names[0].name
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "dsse_ros":
            place = PACKAGE.joinpath(*(node.module or "").split(".")[1:])
            for alias in node.names:
                files = (
                    place / f"{alias.name}.py",
                    place / "__init__.py",
                    place.with_suffix(".py"),
                )
                found.add(next(file for file in files if file.is_file()))
    return found


@pytest.fixture(autouse=True)
def neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let programs find the modules of their working directory."""
    monkeypatch.delenv("PYTHONSAFEPATH")


def test_a_compiled_function_depends_on_all_that_its_module_imports() -> None:
    compiled = [
        path
        for path in PACKAGE.rglob("*.py")
        if "from dsse_ros.base.compiled.jit " in path.read_text() and path.name != "jit.py"
    ]
    assert len(compiled) > 20
    for path in compiled:
        reached, new = {path}, {path}
        while new := set().union(*map(imported_by, new)) - reached:
            reached |= new
        assert jit.modules_of(path) == reached


def test_what_cannot_be_interpreted_is_compiled_where_numba_is_switched_off() -> None:
    code = (
        "from numba import njit\n"
        "from dsse_ros.search.step.kernels import refresh_worlds\n"
        "print(hasattr(njit(lambda: 0), 'py_func'), hasattr(refresh_worlds, 'py_func'))\n"
    )
    env = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=env, capture_output=True, text=True)
    assert done.stdout == "False True\n", done.stderr
