# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners by name: those of this package, and those that other packages register.

A package adds planners with entry points of the group `dsse_ros.planners`. Each maps the name of a
planner to a `PlannerFactory`. In its setup.py, for example:

    entry_points={"dsse_ros.planners": ["my_planner = my_package.my_module:make_my_planner"]}
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from dsse_ros.planners.expanding_square import square_routes
from dsse_ros.planners.greedy import Greedy
from dsse_ros.planners.pattern_routes import PatternRoutes
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.planners.planner import Planner, PlannerFactory, Search
from dsse_ros.planners.random_moves import RandomMoves
from dsse_ros.planners.routes import RouteFollower
from dsse_ros.planners.sector import sector_routes
from dsse_ros.planners.spiral import spiral_routes
from dsse_ros.planners.sweep import sweep_routes
from dsse_ros.scenario.cell_checks import check_cell
from dsse_ros.scenario.fields import FieldError, Spec, shown, specs
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario

GROUP = "dsse_ros.planners"
"""Group of the entry points."""

PLANNERS: Mapping[str, Callable[..., Planner]] = MappingProxyType(
    {
        "sweep": partial(RouteFollower, sweep_routes),
        "creeping_line": partial(RouteFollower, partial(sweep_routes, creeping=True)),
        "expanding_square": partial(RouteFollower, square_routes),
        "sector": partial(RouteFollower, sector_routes),
        "spiral": partial(RouteFollower, spiral_routes),
        "greedy": Greedy,
        "random": RandomMoves,
    }
)
"""Planners that need only the actions and the area; see `make_planner` for their arguments."""

PATTERN_PLANNERS: Mapping[str, str] = MappingProxyType(
    {"sweep": "PS", "creeping_line": "CS", "sector": "VS", "expanding_square": "SS"}
)
"""Planners that can fly a `SearchPattern`: its fields and `datum`, see `PatternRoutes`, are their
options."""

PATTERN_OPTIONS = ("datum", *(name for name in specs(SearchPattern) if name != "pattern"))


class LoadedPlanner(NamedTuple):
    """A planner of this package that is imported on request.

    Attributes:
        factory: Its `PlannerFactory`, as `module:name`.
        task: What it does: "persons" looks for persons, "cells" covers cells, "" does either.
        libraries: Installed by its extra, if it needs one; their versions also affect the results.
    """

    factory: str
    task: str
    libraries: tuple[str, ...] = ()


LOADED_PLANNERS: Mapping[str, LoadedPlanner] = MappingProxyType(
    {
        "belief": LoadedPlanner("dsse_ros.planners.belief:make_belief", "persons"),
        "belief_greedy": LoadedPlanner("dsse_ros.planners.belief:make_belief_greedy", "persons"),
        "forward_backward": LoadedPlanner(
            "dsse_ros.planners.forward_backward:make_forward_backward", "persons"
        ),
        "optimal_effort": LoadedPlanner(
            "dsse_ros.planners.optimal_effort:make_optimal_effort", "persons"
        ),
        "astar": LoadedPlanner("dsse_ros.planners.astar:make_astar", "cells"),
        "onnx": LoadedPlanner("dsse_ros.planners.onnx:make_onnx", "", ("onnxruntime",)),
        "route": LoadedPlanner("dsse_ros.planners.route:make_route", "persons", ("ortools",)),
    }
)
"""Planners that need the rules and the scenario too."""


def _of_task(task: str) -> tuple[str, ...]:
    return tuple(name for name, planner in LOADED_PLANNERS.items() if planner.task == task)


PERSON_PLANNERS = _of_task("persons")
"""Planners that look for persons only."""
COVERAGE_PLANNERS = _of_task("cells")
"""Planners that cover cells only."""


def _pattern_routes(name: str, scenario: ResolvedScenario, given: dict[str, Any]) -> PatternRoutes:
    """Return the routes of a planner with options of a pattern.

    Raises:
        FieldError: If a value is not allowed, or the planner flies no pattern.
    """
    if name not in PATTERN_PLANNERS:
        raise FieldError(
            f"{next(iter(given))} is an option of {', '.join(PATTERN_PLANNERS)}, not of {name}"
        )
    datum = Spec("cell", "", optional=True).check("datum", given.pop("datum", None))
    if datum is not None:
        check_cell("datum", datum, scenario.grid_size)
    values = {"length": None, **given, "pattern": PATTERN_PLANNERS[name]}
    return PatternRoutes(SearchPattern(**values), scenario.cell_size, datum)


def _from_actions(name: str, search: Search, **options: Any) -> Planner:
    rules, make = search.rules, PLANNERS[name]
    given = {option: options.pop(option) for option in PATTERN_OPTIONS if option in options}
    scenario = search.scenario.resolve(rules)
    if given:
        make = partial(RouteFollower, _pattern_routes(name, scenario, given))
    if rules.covers and isinstance(make, partial):
        options["covers"] = True
    if search.scenario.has_slower_drones:
        options["apart"] = True
    return make(rules.actions, area=scenario.area_mask, **options)


def _registered() -> dict[str, list[EntryPoint]]:
    """Return the planners that are loaded on request, by name; several may share a name."""
    found = {name: [EntryPoint(name, p.factory, GROUP)] for name, p in LOADED_PLANNERS.items()}
    for entry in entry_points(group=GROUP):
        if entry.name not in PLANNERS and entry.name not in LOADED_PLANNERS:
            found.setdefault(entry.name, []).append(entry)
    return found


PLANNER_NAMES = (*PLANNERS, *_registered())
"""All installed planners. Other packages cannot replace a planner of this package."""


def load_planner(name: str) -> PlannerFactory:
    """Return the factory of a planner.

    Raises:
        FieldError: If the name is unknown, or the package that registers it is defective.
    """
    if isinstance(name, str) and name in PLANNERS:
        return partial(_from_actions, name)
    entries = _registered().get(name, []) if isinstance(name, str) else []
    if not entries:
        raise FieldError(f"planner must be one of {', '.join(PLANNER_NAMES)}, got {shown(name)}")
    if len(entries) > 1:
        values = ", ".join(entry.value for entry in entries)
        raise FieldError(f"planner: {name!r} is registered more than once: {values}")
    try:
        factory = entries[0].load()
    except Exception as error:  # Third-party code may raise anything.
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise FieldError(f"planner: {name!r} cannot be loaded: {reason}") from error
    if not callable(factory):
        raise FieldError(f"planner: {name!r} cannot be loaded: {entries[0].value} is not a factory")
    made: PlannerFactory = factory
    return made


def planner_for(search: Search, name: str, *, seed: int = 0, **options: Any) -> Planner:
    """Return a planner for missions of an environment, or of any search.

    Args:
        search: An environment, or a `SearchDefinition`. The planner reads nothing hidden from it.
        name: One of `PLANNER_NAMES`.
        seed: Seed of the planner's random draws.
        options: Options of the planner, such as the fields of `BeamOptions` for `belief`, or of
            `SearchPattern` for `PATTERN_PLANNERS`.

    Raises:
        ValueError: If the name is unknown, the planner's package is defective, an action that the
            planner needs is missing, or the planner is for another task.
    """
    factory = load_planner(name)
    check_task(name, search.rules)
    return factory(search, seed=seed, **options)


def read_options(options: Iterable[str]) -> dict[str, Any]:
    """Return options by name, each given as name=value with a value in YAML.

    Raises:
        FieldError: If one has no name or no value.
    """
    values = {}
    for text in options:
        name, _, value = text.partition("=")
        try:
            values[name.strip()] = yaml.safe_load(value)
        except yaml.YAMLError:
            value = ""
        if not (name and value):
            raise FieldError(f"planner_options must be name=value each, got {shown(text)}")
    return values


def planner_with(
    search: Search, name: str, options: Iterable[str], *, seed: int = 0, **others: Any
) -> Planner:
    """Return a planner as `planner_for` does, with options as text.

    Args:
        search: An environment, or any search.
        name: One of `PLANNER_NAMES`.
        options: See `read_options`.
        seed: Seed of the planner's random draws.
        others: Further options.

    Raises:
        ValueError: See `planner_for`; also if an option is unknown or has no value.
    """
    try:
        return planner_for(search, name, seed=seed, **read_options(options), **others)
    except TypeError as error:
        raise FieldError(f"planner_options: {name}: {error}") from None


def check_task(name: str, rules: Rules) -> None:
    """Check that a planner of this package is for the task of the rules.

    Raises:
        FieldError: If it is for another task.
    """
    ours, others = PERSON_PLANNERS, COVERAGE_PLANNERS
    task = "looks for persons"
    if rules.covers:
        ours, others = others, ours
        task = "covers cells and has no persons"
    if name in others:
        raise FieldError(
            f"planner must be one of {', '.join(sorted({*PLANNERS, *ours}))} with rules "
            f"{rules.profile}, whose task {task}, got {shown(name)}"
        )


def make_planner(
    name: str,
    actions: Sequence[str],
    *,
    seed: int = 0,
    area: NDArray[np.bool_] | None = None,
    **options: Any,
) -> Planner:
    """Return a planner that needs only the actions and the area.

    Args:
        name: A key of `PLANNERS`.
        actions: Names of the actions by number, as in the rules.
        seed: Seed of the planner's random draws.
        area: (G, G) bool [row, col], the cells to search; None for the whole grid.
        options: Options of the planner.

    Raises:
        ValueError: If the name is unknown, the planner needs the rules and the scenario too, or an
            action that it needs is missing.
    """
    if isinstance(name, str) and name in PLANNERS:
        return PLANNERS[name](actions, seed=seed, area=area, **options)
    if name in PLANNER_NAMES:
        raise FieldError(f"planner: {name!r} also needs the rules and the scenario")
    raise FieldError(f"planner must be one of {', '.join(PLANNER_NAMES)}, got {shown(name)}")
