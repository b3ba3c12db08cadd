# SPDX-License-Identifier: Apache-2.0
"""What the programs make of their command lines, without ROS."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, NoReturn

from dsse_ros.planners import PLANNERS
from dsse_ros.search import PROFILES, FieldError, Rules, Scenario, profile
from dsse_ros.search.scenario import ResolvedScenario

BAD_INPUT = 2
"""Exit code after an input that is not allowed."""

MAX_SEED = 2**62
_SHIPPED = Path("share") / "dsse_ros" / "config"


class Parser(argparse.ArgumentParser):
    """Says what is wrong on one line, and of each argument what it is by default."""

    def add(self, flag: str, **options: Any) -> None:
        """Add an argument, as `add_argument` does."""
        if options.get("default") is not None:
            options["help"] += " (default: %(default)s)"
        self.add_argument(flag, **options)

    def add_search(self, scenario: str) -> None:
        """Add what says which search it is, for `search_of`; the scenario is that by default."""
        self.add("--scenario", default=scenario, help="YAML file or name")
        self.add("--rules", default="paper", choices=tuple(PROFILES), help="profile")
        self.add("--planner", default="greedy", choices=tuple(PLANNERS), help="planner")
        self.add("--drones", type=int, help="number of drones, by default the scenario's")
        self.add("--seed", type=int, default=0, help="of sea, persons and planner")

    def error(self, message: str) -> NoReturn:
        """Leave the program with that line."""
        sys.exit(fail(self.prog, message))


def fail(name: str, error: object) -> int:
    """Print what is wrong on one line and return the exit code for it."""
    print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
    return BAD_INPUT


def search_of(arguments: argparse.Namespace) -> tuple[Path, ResolvedScenario, Rules]:
    """Return scenario file, scenario and rules of a command line with `Parser.add_search`.

    Raises:
        FieldError: If one of them, or the seed, is not allowed.
    """
    if not 0 <= arguments.seed <= MAX_SEED:
        raise FieldError(f"seed: {arguments.seed} is not allowed; 0 to 2^62")
    rules = profile(arguments.rules)
    path = find_scenario(arguments.scenario)
    scenario = Scenario.from_yaml(path).override(num_drones=arguments.drones)
    return path, scenario.resolve(rules), rules


def find_scenario(name: str) -> Path:
    """Return the absolute path of a scenario: a file, or the name of one that the package ships.

    Raises:
        FieldError: If there is none.
    """
    if Path(name).exists() and not Path(name).is_dir():
        return Path(name).resolve()
    # An environment may never have been told to ament; a source tree has no share.
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    folders = [Path(prefix) / _SHIPPED for prefix in prefixes if prefix]
    folders.append(Path(__file__).resolve().parents[2] / "config")
    for folder in folders:
        path = folder / f"{name.removesuffix('.yaml')}.yaml"
        if path.is_file():
            return path.resolve()
    names = sorted({path.stem for folder in folders for path in folder.glob("*.yaml")})
    raise FieldError(f"scenario: {name!r} is no file and none of those shipped: {', '.join(names)}")


def make_folder(name: str, folder: Path) -> None:
    """Make a folder for results, if it is not there.

    Raises:
        FieldError: If it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise FieldError(f"{name}: {str(folder)!r} is a file; a folder is allowed") from None
    except OSError as error:
        raise FieldError(f"{name}: {str(folder)!r}: {error.strerror}") from None
