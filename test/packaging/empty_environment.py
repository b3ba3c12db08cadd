# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An environment with nothing but what pip would install for some requirements.

A download would take minutes, so that the files are links to those of the environment that runs
this: of the required packages, theirs in turn, and pip.

`python empty_environment.py FOLDER REQUIREMENT...` makes one. `bring_compiled` saves the minute in
which Numba compiles the search.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

OURS = "dsse-ros"
PIP = """#!/bin/sh
exec "$(dirname "$0")/python3" -m pip --disable-pip-version-check "$@"
"""


def required(requirements: Iterable[str]) -> set[str]:
    """Return the names of all distributions that pip would install, except of this package."""
    found: set[tuple[str, str]] = set()
    left = [(Requirement(text), {""}) for text in requirements]
    while left:
        requirement, of = left.pop()
        if requirement.marker and not any(
            requirement.marker.evaluate({"extra": extra}) for extra in of
        ):
            continue
        name = canonicalize_name(requirement.name)
        extras = {"", *requirement.extras}
        new = {(name, extra) for extra in extras} - found
        if new:
            found |= new
            left += [(Requirement(text), extras) for text in metadata.requires(name) or []]
    return {name for name, _ in found} - {OURS}


def link(source: Path, target: Path) -> None:
    """Make a file a link to another, or a copy on another file system."""
    target.unlink(missing_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def make(folder: Path, requirements: Iterable[str]) -> None:
    """Make an environment that has these requirements."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    of_tests = Path(sys.prefix)
    parents: set[Path] = set()
    for name in {*required(requirements), "pip"}:
        distribution = metadata.distribution(name)
        for path in distribution.files or ():
            source = Path(os.path.normpath(distribution.locate_file(path)))
            # A program names the Python of the environment that it was installed into.
            if source.parent == of_tests / "bin" or not source.is_file():
                continue
            target = folder / source.relative_to(of_tests)
            if target.parent not in parents:
                parents.add(target.parent)
                target.parent.mkdir(parents=True, exist_ok=True)
                # What Python has compiled of it.
                compiled = source.parent / "__pycache__"
                if compiled.is_dir() and source.suffix == ".py":
                    (target.parent / compiled.name).mkdir(exist_ok=True)
                    for file in compiled.glob("*.pyc"):
                        link(file, target.parent / compiled.name / file.name)
            link(source, target)
    program = folder / "bin" / "pip"
    program.write_text(PIP)
    program.chmod(0o755)


def bring_compiled(folder: Path) -> None:
    """Link what Numba has compiled of this package to each copy of it below a folder.

    Numba takes it if the sources are the same.
    """
    ours = Path(sysconfig.get_path("purelib")) / "dsse_ros"
    for copy in {file.parent for file in folder.rglob("dsse_ros/__init__.py")}:
        for source in ours.rglob("*.py"):
            file = copy / source.relative_to(ours)
            if not file.is_file() or file.read_bytes() != source.read_bytes():
                continue
            for compiled in (source.parent / "__pycache__").glob(f"{source.stem}.*.nb?"):
                target = file.parent / "__pycache__"
                target.mkdir(exist_ok=True)
                link(compiled, target / compiled.name)


if __name__ == "__main__":
    make(Path(sys.argv[1]), sys.argv[2:])
