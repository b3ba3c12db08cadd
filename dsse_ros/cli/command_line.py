# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parses the command lines of the programs, without ROS."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from dsse_ros.base.fields import FieldError, Spec, check_known, shown
from dsse_ros.mission.files.scenario_files import find_scenario
from dsse_ros.planners.registry import (
    COVERAGE_PLANNERS,
    DEFAULT_PLANNER,
    PLANNER_NAMES,
    check_options,
    check_task,
    default_planner,
    read_options,
)
from dsse_ros.ros.nodes.settings import (
    FULL_NAMES,
    PROFILE,
    SCENARIO_FILE,
    SHORT_NAMES,
    SIM_PARAMETERS,
)
from dsse_ros.ros.runtime.exit_codes import fail
from dsse_ros.ros.runtime.ros_arguments import (
    from_ros,
    known_parameters,
    split_ros_arguments,
    typed_names,
    without_prefix,
)
from dsse_ros.search.step.cell_tracks import check_memory
from dsse_ros.world.scenario.limits import MAX_SEED
from dsse_ros.world.scenario.place_checks import LAT, LON, place_of
from dsse_ros.world.scenario.positions import EXAMPLES
from dsse_ros.world.scenario.rules import AUTO, PROFILES, Rules, profile
from dsse_ros.world.scenario.scenario import ResolvedScenario, Scenario

DEFAULT_SCENARIO = "santos"
SEED = Spec("int", "Random seed.", low=0, high=MAX_SEED)
SIM_NODE, PLANNER_NODE, DASHBOARD = "sim_node", "planner_node", "dashboard"
_OF_SEARCH = {
    SCENARIO_FILE: ("scenario", SIM_PARAMETERS[SCENARIO_FILE]),
    PROFILE: ("rules", SIM_PARAMETERS[PROFILE]),
    "planner": ("planner", Spec("str", "", choices=PLANNER_NAMES)),
    "model": ("model", Spec("str", "")),
    "planner_options": ("planner_options", Spec("names", "")),
    "scenario.num_drones": ("num_drones", SIM_PARAMETERS["scenario.num_drones"]),
    "seed": ("seed", SEED),
}
"""Parameters of the nodes that are options of a program: name and values of the option."""
_FIELDS = {name: spec for name, spec in SIM_PARAMETERS.items() if "." in name}


class Parser(argparse.ArgumentParser):
    """Parser with one-line errors, which shows the default of each argument."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        # For argparse, `-24.0,-46.4` would be an option, as it is no number.
        self._negative_number_matcher = re.compile(r"-\.?\d")
        self.register("type", int, integer)

    def add(self, flag: str, **options: Any) -> None:
        """Add an argument, as `add_argument` does."""
        if options.get("default") is not None:
            options["help"] += " (default: %(default)s)"
        self.add_argument(flag, **options)

    def add_search(self, scenario: str | None) -> None:
        """Add the arguments for `search_of`, with this scenario as the default.

        With None, a program can see whether a scenario was given.
        """
        self.add("--scenario", default=scenario, help="YAML file or name")
        usual = "profile; auto is sea with an incident, else paper"
        self.add("--rules", default=AUTO, choices=(AUTO, *PROFILES), help=usual)
        usual = f"planner (default: {DEFAULT_PLANNER}, for coverage {COVERAGE_PLANNERS[0]})"
        self.add("--planner", choices=PLANNER_NAMES, help=usual)
        self.add("--model", help="ONNX file of the planner onnx, by default that of this package")
        options = "options of the planner, such as horizon=10 for belief"
        self.add("--planner-options", nargs="+", default=(), metavar="NAME=VALUE", help=options)
        self.add("--num-drones", type=int, help="number of drones, by default the scenario's")
        seeded = "random seed of the map, the persons and the planner"
        self.add("--seed", type=int, default=0, help=seeded)

    def parse_with_ros(
        self,
        argv: Sequence[str] | None,
        options: Mapping[str, tuple[str, Spec]],
        others: Collection[str] = (),
    ) -> argparse.Namespace:
        """Return the arguments; parameters after --ros-args take the place of their defaults.

        Fields of the search that are not options are in `fields`, what follows --ros-args in
        `ros`.

        Args:
            argv: Command line without the program's name, by default the process's own.
            options: As `_OF_SEARCH`, of the program itself.
            others: Parameters that the program has no use for itself.
        """
        own, ros = split_ros_arguments(sys.argv[1:] if argv is None else argv)
        options = {**_OF_SEARCH, **options}
        known = [*options, *_FIELDS, *SHORT_NAMES, *others]
        fields, defaults = {}, {}
        try:
            overridden = _overrides(ros) if ros else {}
            what = f"the parameters of {self.prog}"
            overridden = known_parameters(what, overridden, known, typed_names(ros), FULL_NAMES)
            for short_or_full, value in overridden.items():
                name = SHORT_NAMES.get(short_or_full, short_or_full)
                if name in options:
                    option, spec = options[name]
                    defaults[option] = spec.check(name, value)
                elif name in _FIELDS:
                    fields[name] = _FIELDS[name].check(name, from_ros(_FIELDS[name], value))
        except FieldError as error:
            self.error(str(error))
        self.set_defaults(fields=fields, ros=ros, **defaults)
        return self.parse_args(own)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the arguments; refuse an unknown one with the nearest option."""
        arguments, unknown = self.parse_known_args(args, namespace)
        if unknown:
            names = [name.partition("=")[0] for name in unknown if name.startswith("--")]
            try:
                check_known(f"the options of {self.prog}", names, self._option_string_actions)
            except FieldError as error:
                self.error(str(error))
            self.error(f"{shown(unknown[0])} is not an argument of {self.prog}")
        return arguments

    def error(self, message: str) -> NoReturn:
        """Leave the program with that line."""
        sys.exit(fail(self.prog, message))


def integer(text: str) -> int:
    """Return a whole number; none that begins with 0, which ROS would take for an octal one.

    Raises:
        ValueError: If the text is no such number.
    """
    if re.match(r"\s*[-+]?0\d", text):
        raise ValueError
    return int(text)


def _overrides(ros: Sequence[str]) -> dict[str, Any]:
    """Return the parameters that ROS arguments give to the nodes of a search."""
    # Without ROS arguments the programs run without ROS.
    from dsse_ros.ros.runtime.run_node import overrides_of

    return overrides_of((PLANNER_NODE, SIM_NODE), ros, others=(DASHBOARD,))


def search_of(arguments: argparse.Namespace) -> tuple[Path, ResolvedScenario, Rules]:
    """Return scenario file, scenario and rules of a command line with `Parser.add_search`.

    A planner that was not chosen becomes that of the rules.

    Raises:
        FieldError: If one of them, or the seed, is not allowed.
    """
    SEED.check("seed", arguments.seed)
    of_scenario = without_prefix("scenario.", arguments.fields)
    path = find_scenario(arguments.scenario or DEFAULT_SCENARIO)
    scenario = Scenario.from_yaml(path).override(**of_scenario, num_drones=arguments.num_drones)
    rules = profile(
        scenario.rules_of(arguments.rules), **without_prefix("rules.", arguments.fields)
    )
    if "planner" in arguments:
        arguments.planner = arguments.planner or default_planner(rules)
        check_task(arguments.planner, rules)
        check_options(arguments.planner, options_of(arguments))
    resolved = scenario.resolve(rules)
    # Before any node starts.
    check_memory(resolved, rules)
    return path, resolved, rules


def options_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the options of the planner of a command line with `Parser.add_search`.

    Raises:
        FieldError: If one has no value or is given twice, or the planner has no model.
    """
    options = read_options(arguments.planner_options)
    if not arguments.model:
        return options
    if arguments.planner != "onnx" or "model" in options:
        raise FieldError(
            f"model must be given once, and only with planner onnx, got {arguments.model!r} with "
            f"{arguments.planner}"
        )
    return {**options, "model": arguments.model}


def place(name: str, text: str) -> tuple[float, float]:
    """Return latitude and longitude of an option LAT,LON, see `positions.position`.

    Raises:
        FieldError: If the value is not LAT,LON.
    """
    try:
        return place_of(name, text)
    except ValueError:
        raise FieldError(
            f"{name} must be LAT,LON up to {LAT.high:g} and {LON.high:g} degrees, or such as "
            f"{EXAMPLES}, got {text!r}"
        ) from None


def make_folder(name: str, folder: Path) -> None:
    """Create a folder for results if it does not exist.

    Raises:
        FieldError: If it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise FieldError(f"{name}: {str(folder)!r} must be a folder, got a file") from None
    except OSError as error:
        raise FieldError(f"{name}: {str(folder)!r}: {error.strerror}") from None
