# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run a script that was written for DSSE: python -m dsse_ros.compat [--dsse VERSION] SCRIPT ..."""

from __future__ import annotations

import argparse
import runpy
import sys
from pathlib import Path

from dsse_ros.compat.aliases import VERSIONS, install_aliases


def main() -> None:
    """Install the module names of DSSE in this process and run the script as Python would."""
    parser = argparse.ArgumentParser(
        prog="python -m dsse_ros.compat",
        description="Run a script written for the package DSSE on dsse_ros.",
    )
    parser.add_argument(
        "--dsse", choices=list(VERSIONS), default="1.1.9", help="version that the script is for"
    )
    parser.add_argument("script", type=Path)
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="those of the script")
    given = parser.parse_args()
    if not given.script.is_file():
        parser.error(f"script must be a Python file, got {str(given.script)!r}")
    install_aliases(given.dsse)
    sys.argv = [str(given.script), *given.arguments]
    sys.path[0] = str(given.script.resolve().parent)
    runpy.run_path(str(given.script), run_name="__main__")


if __name__ == "__main__":
    main()
