# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run a script or module for DSSE: python -m dsse_ros.compat [--dsse VERSION] (FILE | -m NAME)."""

from __future__ import annotations

import argparse
import runpy
import sys
from importlib.util import find_spec
from pathlib import Path

from dsse_ros.compat.aliases import VERSIONS, install_aliases
from dsse_ros.search.environments.compiler import announced_on_stderr


def main() -> None:
    """Install the module names of DSSE in this process and run the script as Python would."""
    parser = argparse.ArgumentParser(
        prog="python -m dsse_ros.compat",
        usage="%(prog)s [-h] [--dsse VERSION] (SCRIPT | -m MODULE) ...",
        description="Run a script written for the package DSSE on dsse_ros.",
    )
    parser.add_argument(
        "--dsse", choices=list(VERSIONS), default="1.1.9", help="version that the script is for"
    )
    parser.add_argument(
        "-m", dest="module", nargs=argparse.REMAINDER, help="run a module, such as pytest"
    )
    parser.add_argument("script", nargs=argparse.REMAINDER, help="a Python file, its arguments")
    arguments = parser.parse_args()
    with announced_on_stderr():
        _run(parser, arguments)


def _run(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Run the script or module."""
    sys.argv = arguments.script if arguments.module is None else arguments.module
    name = sys.argv[0] if sys.argv else ""
    if arguments.module is not None:
        install_aliases(arguments.dsse)
        if not _is_found(name):
            parser.error(f"module must be one that Python finds, got {name!r}")
        runpy.run_module(name, run_name="__main__", alter_sys=True)
        return
    if not Path(name).is_file():
        parser.error(f"script must be a Python file, got {name!r}")
    if not getattr(sys.flags, "safe_path", False):
        sys.path[0] = str(Path(name).resolve().parent)
    install_aliases(arguments.dsse)
    runpy.run_path(name, run_name="__main__")


def _is_found(module: str) -> bool:
    """Return whether Python finds a module; this imports the packages that contain it."""
    if not all(module.split(".")):
        return False
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError as error:
        # Otherwise a package that contains it lacks something else.
        if f"{module}.".startswith(f"{error.name}."):
            return False
        raise


if __name__ == "__main__":
    main()
