# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The published packages from PyPI in separate environments, and programs in C."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

BASELINE = Path(__file__).with_name("baseline.c")
LIMIT = Path(__file__).with_name("limit.c")
COMPILER_FLAGS = ("-O3", "-march=native", "-ffast-math")


@dataclass(frozen=True)
class Published:
    """A published package.

    Attributes:
        version: Version of DSSE.
        sha256: SHA-256 of its wheel.
        pythons: Minor versions of Python 3 that it runs on, the best first.
        requirements: Other packages to install; None for those that the package requires.
    """

    version: str
    sha256: str
    pythons: tuple[int, ...]
    requirements: tuple[str, ...] | None


V1 = Published(
    "0.1.13",
    "af67a7ad43984016b81eb9f255edba11e9e1c7d835cf1d1aa88d20025ea0bb0c",
    (10, 11, 9),
    # The package requires more than it imports; these are the versions of its time.
    ("numpy<1.25", "gymnasium==0.28.1", "pettingzoo==1.22.4", "pygame", "matplotlib==3.7.5"),
)
V2 = Published(
    "1.1.9",
    "431e0a800e89fd8e7a43ecafb306df83217fa685cce2bb377ce64623a0074b2e",
    (12, 11, 10, 13),
    None,
)


class Unavailable(Exception):
    """A baseline is not available here; the text is one line with the reason."""


def install(package: Published, folder: Path) -> Path:
    """Return the Python of an environment with the package, which the first call creates.

    Raises:
        Unavailable: If there is no Python for it, or an installation fails.
    """
    home = folder / f"dsse-{package.version}"
    python, finished = home / "bin" / "python", home / ".made"
    if finished.exists():
        return python
    name = f"DSSE {package.version}"
    base = _interpreter(package)
    if base is None:
        versions = ", ".join(f"3.{minor}" for minor in sorted(package.pythons))
        raise Unavailable(f"{name} is left out: it needs one of Python {versions}")
    print(f"Installing {name} into {home}", flush=True)
    shutil.rmtree(home, ignore_errors=True)
    pip: list[str | Path] = [python, "-m", "pip", "--disable-pip-version-check", "-qq", "install"]
    with tempfile.TemporaryDirectory() as scratch:
        wheel = Path(scratch, "requirement.txt")
        wheel.write_text(f"DSSE=={package.version} --hash=sha256:{package.sha256}\n")
        try:
            _run([base, "-m", "venv", home])
            _run([*pip, "--no-deps", "-r", wheel])
            _run([*pip, *(package.requirements or [f"DSSE=={package.version}"])])
        except Unavailable as error:
            raise Unavailable(f"{name} is left out: {error}") from None
    finished.touch()
    return python


def build(source: Path, folder: Path) -> Path:
    """Return a C program (`BASELINE` or `LIMIT`), compiled for this machine.

    Raises:
        Unavailable: If there is no C compiler.
    """
    compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise Unavailable(f"the C {source.stem} is left out: there is no C compiler")
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / source.stem
    _run([compiler, *COMPILER_FLAGS, source, "-o", program, "-lm", "-lpthread"])
    return program


def versions(python: Path) -> dict[str, str]:
    """Return the version of Python and of the packages in an environment."""
    listed = _run([python, "-m", "pip", "--disable-pip-version-check", "list", "--format=freeze"])
    packages = dict(line.split("==", 1) for line in listed.splitlines() if "==" in line)
    wanted = ("DSSE", "numpy", "numba", "gymnasium", "pettingzoo")
    number = _run([python, "-c", "import platform; print(platform.python_version())"]).strip()
    return {"python": number, **{name: packages[name] for name in wanted if name in packages}}


def _interpreter(package: Published) -> Path | None:
    """Return a Python that the package supports and that can create environments."""
    own = Path(sys.base_prefix, "bin", f"python3.{sys.version_info.minor}")
    for minor in package.pythons:
        found = shutil.which(f"python3.{minor}")
        for path in ([own] if own.name == f"python3.{minor}" else []) + ([found] if found else []):
            try:
                _run([path, "-c", "import ensurepip, venv"], timeout_s=60)
            except Unavailable:
                continue
            return Path(path)
    return None


def _run(command: list[str | Path], timeout_s: float = 900) -> str:
    """Run a program and return what it printed.

    Raises:
        Unavailable: If it fails, with the last line of its standard error.
    """
    try:
        done = subprocess.run(
            [str(part) for part in command],
            capture_output=True,
            text=True,
            timeout=timeout_s,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        raise Unavailable(f"{Path(command[0]).name} took more than {timeout_s:g} s") from None
    except OSError as error:
        raise Unavailable(f"{command[0]}: {error.strerror}") from None
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or ["it failed"]
        raise Unavailable(lines[-1].strip())
    return done.stdout
