# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was compiled is not used again once the code that it was compiled from has changed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import dsse_ros
from dsse_ros.compiled import jit

PACKAGE = Path(dsse_ros.__file__).parent
OF_SEARCH = ("belief", "compiled", "scenario", "search", "step", "targets")
RUN = """
import numpy as np
from dsse_ros.belief.drift_estimate import misfits
from dsse_ros.step.constants import CONSTANTS
from dsse_ros.step.kernels import WORLDS
constants = np.zeros(1, CONSTANTS)
constants["grid_size"] = 10
out = np.zeros(1, np.int64)
misfits(constants, np.zeros(1, WORLDS), None, np.array([[1, 2]]), np.array([[1.0, 2.0]]), out)
print(out)
"""
TWICE = """
from dsse_ros.compiled.jit import compiled

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
BEFORE, AFTER = (
    f"    w.remainder_x += w.drift_{first}\n    w.remainder_y += w.drift_{second}\n"
    for first, second in ("xy", "yx")
)


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
def test_a_change_of_a_function_that_is_called_has_its_callers_compiled_anew(
    tmp_path: Path,
) -> None:
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "dsse_ros", ignore=ignore)

    def run() -> str:
        # The folder that it runs in comes first on its path.
        done = subprocess.run(
            [sys.executable, "-c", RUN], cwd=tmp_path, check=True, capture_output=True, text=True
        )
        return done.stdout.strip()

    called = tmp_path / "dsse_ros" / "targets" / "sea_map.py"
    text = called.read_text()
    assert text.count(BEFORE) == 1
    assert run() == "[0]"
    called.write_text(text.replace(BEFORE, AFTER))
    assert run() == "[2]"


def test_every_compiled_module_of_the_search_is_one_that_the_cache_depends_on() -> None:
    compiled = {
        path
        for folder in OF_SEARCH
        for path in (PACKAGE / folder).glob("*.py")
        if "from dsse_ros.compiled.jit " in path.read_text()
    }
    assert compiled < set(jit.MODULES)
    assert len(compiled) > 10
