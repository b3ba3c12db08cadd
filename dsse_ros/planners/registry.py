# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners by name: those of this package, and the factories that other packages register.

See `base.registry` and `PlannerFactory`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.registry import Registry
from dsse_ros.planners.expanding_square import square_routes
from dsse_ros.planners.greedy import Greedy
from dsse_ros.planners.mission_watch import MissionWatch
from dsse_ros.planners.options import (
    PATTERNS,
    BeamOptions,
    BeliefOptions,
    OnnxOptions,
    Options,
    PatternOptions,
)
from dsse_ros.planners.pattern_routes import PatternRoutes
from dsse_ros.planners.planner import Planner, PlannerFactory, Search
from dsse_ros.planners.random_moves import RandomMoves
from dsse_ros.planners.route_guidance import RouteLayout, RoutePlanner
from dsse_ros.planners.sector import sector_routes
from dsse_ros.planners.spiral import spiral_routes
from dsse_ros.planners.sweep import sweep_routes
from dsse_ros.search.step.looks import looks_of, moves_look
from dsse_ros.world.scenario.cell_checks import check_cell
from dsse_ros.world.scenario.env_options import check_seed
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.swarm import Swarm
from dsse_ros.world.scenario.yaml_file import parse_yaml

DEFAULT_PLANNER = "belief"
"""The planner of a search for persons, unless another is chosen."""

_ROUTES: Mapping[str, RouteLayout] = MappingProxyType(
    {
        "sweep": sweep_routes,
        "creeping_line": partial(sweep_routes, creeping=True),
        "expanding_square": square_routes,
        "sector": sector_routes,
        "spiral": spiral_routes,
    }
)

PLANNERS: Mapping[str, Callable[..., Planner]] = MappingProxyType(
    {
        **{name: partial(RoutePlanner, layout) for name, layout in _ROUTES.items()},
        "greedy": Greedy,
        "random": RandomMoves,
    }
)
"""Planners that need only the actions and the area: factories of a `Swarm` and a seed."""


class LoadedPlanner(NamedTuple):
    """A planner of this package that is imported on request.

    Attributes:
        factory: Takes a `Search`, its options and the keyword `seed`, as `module:name`.
        options: The class of its options.
        task: What it does: "persons" looks for persons, "cells" covers cells, "" does either.
        libraries: Installed by its extra, if it needs one; their versions also affect the results.
    """

    factory: str
    options: type[Options]
    task: str
    libraries: tuple[str, ...] = ()


LOADED_PLANNERS: Mapping[str, LoadedPlanner] = MappingProxyType(
    {
        "belief": LoadedPlanner("dsse_ros.planners.belief:make_belief", BeamOptions, "persons"),
        "belief_greedy": LoadedPlanner(
            "dsse_ros.planners.belief:make_belief_greedy", BeliefOptions, "persons"
        ),
        "effort_allocation": LoadedPlanner(
            "dsse_ros.planners.effort_allocation:make_effort_allocation", BeliefOptions, "persons"
        ),
        "astar": LoadedPlanner("dsse_ros.planners.astar:make_astar", Options, "cells"),
        "onnx": LoadedPlanner(
            "dsse_ros.planners.onnx:make_onnx", OnnxOptions, "", ("onnxruntime",)
        ),
        "route": LoadedPlanner(
            "dsse_ros.planners.solved_routes:make_route", BeliefOptions, "persons", ("ortools",)
        ),
    }
)
"""Planners that need the rules and the scenario too."""

OPTIONS: Mapping[str, type[Options]] = MappingProxyType(
    {
        **dict.fromkeys(PLANNERS, Options),
        **dict.fromkeys(PATTERNS, PatternOptions),
        **{name: planner.options for name, planner in LOADED_PLANNERS.items()},
    }
)
"""The class of the options of each planner of this package."""


IN_METRES: Mapping[str, str] = MappingProxyType(
    {
        "belief": "dsse_ros.planners.metres_planners:MetresBelief",
        "greedy": "dsse_ros.planners.metres_planners:MetresGreedy",
        **dict.fromkeys(_ROUTES, "dsse_ros.planners.metres_planners:MetresPattern"),
    }
)
"""The planners of this package in a search in metres, as `LoadedPlanner.factory`."""


def _of_task(task: str) -> tuple[str, ...]:
    return tuple(name for name, planner in LOADED_PLANNERS.items() if planner.task == task)


PERSON_PLANNERS = _of_task("persons")
"""Planners that look for persons only."""
COVERAGE_PLANNERS = _of_task("cells")
"""Planners that cover cells only."""


def _by_actions(name: str, search: Search, options: Options, *, seed: int) -> Planner:
    """Return a planner of `PLANNERS` for a search.

    Raises:
        ValueError: If the datum is off the grid, or an action that the planner needs is missing.
    """
    rules, scenario = search.rules, search.scenario.resolve(search.rules)
    swarm = Swarm.of_scenario(scenario, rules)
    watch = MissionWatch(search)
    if name == "random":
        return RandomMoves(swarm, watch, seed=seed)
    if name not in _ROUTES:
        return PLANNERS[name](swarm, seed=seed)
    layout: RouteLayout = _ROUTES[name]
    if isinstance(options, PatternOptions) and options.pattern is not None:
        if options.datum is not None:
            check_cell("datum", options.datum, scenario.grid_size)
        layout = PatternRoutes(options.pattern, scenario.cell_size, options.datum)
    in_passing = moves_look(looks_of(scenario, rules), rules)
    return RoutePlanner(layout, swarm, watch, seed=seed, covers=rules.covers, in_passing=in_passing)


def _entry(factory: str) -> EntryPoint:
    """Return what loads `LoadedPlanner.factory`."""
    return EntryPoint("", factory, "")


_FACTORIES = Registry[Callable[..., Planner]](
    "planner",
    Callable,  # type: ignore[arg-type]
    {
        **{name: partial(_by_actions, name) for name in PLANNERS},
        **{name: _entry(planner.factory) for name, planner in LOADED_PLANNERS.items()},
    },
)

PLANNER_NAMES = tuple(_FACTORIES)
"""All installed planners. Other packages cannot replace a planner of this package."""


def load_planner(name: str) -> PlannerFactory:
    """Return the factory of a planner, which checks the seed and the options that it is given.

    Raises:
        FieldError: If the name is unknown, or the package that registers it is defective.
    """
    factory = _loaded(name)
    return partial(_with_options if name in OPTIONS else _of_package, name, factory)


def _loaded(name: str) -> Callable[..., Planner]:
    """Return the factory of a planner; those of this package take an `Options`."""
    if not isinstance(name, str) or name not in _FACTORIES:
        raise FieldError(f"planner must be one of {', '.join(PLANNER_NAMES)}, got {shown(name)}")
    return _FACTORIES[name]


def _with_options(
    name: str, factory: Callable[..., Planner], search: Search, *, seed: int = 0, **options: Any
) -> Planner:
    """Return a planner of this package.

    Raises:
        FieldError: If the search is in metres and the planner is not.
    """
    checked, seed = OPTIONS[name].checked(name, options), check_seed(seed)
    if search.rules.in_metres:
        check_space(name, search.rules)
        factory = _entry(IN_METRES[name]).load()
        return factory(search, checked, seed=seed, **({"name": name} if name in _ROUTES else {}))
    return factory(search, checked, seed=seed)


def check_space(name: str, rules: Rules) -> None:
    """Check that a planner of this package is for the space of the rules.

    Raises:
        FieldError: If it is not.
    """
    if rules.in_metres and name in OPTIONS and name not in IN_METRES:
        raise FieldError(
            f"planner must be one of {', '.join(sorted(IN_METRES))} with space metres, got "
            f"{shown(name)}"
        )


def _of_package(
    name: str, factory: Callable[..., Planner], search: Search, *, seed: int = 0, **options: Any
) -> Planner:
    """Return a planner of another package, which checks the values of its options itself."""
    _check_names(name, factory, options)
    return factory(search, seed=check_seed(seed), **options)


def _check_names(name: str, factory: Callable[..., Planner], options: Mapping[str, Any]) -> None:
    """Check that the factory of another package has arguments of these names."""
    try:
        inspect.signature(factory).bind(None, seed=0, **options)
    except TypeError as error:
        raise FieldError(f"planner_options: {name}: {error}") from None
    except ValueError:
        # Functions in C may have no signature.
        return


def check_options(name: str, options: Mapping[str, Any]) -> None:
    """Check the options of a planner as far as possible without a search.

    Raises:
        FieldError: If an option is unknown or not allowed, or as `load_planner`.
    """
    factory = _loaded(name)
    if name in OPTIONS:
        OPTIONS[name].checked(name, options)
    else:
        _check_names(name, factory, options)


def planner_for(search: Search, name: str, *, seed: int = 0, **options: Any) -> Planner:
    """Return a planner for missions of an environment, or of any search.

    Args:
        search: An environment, or a `SearchDefinition`. The planner reads nothing hidden from it.
        name: One of `PLANNER_NAMES`.
        seed: Seed of the planner's random draws.
        options: Options of the planner, see `options`.

    Raises:
        ValueError: If the name is unknown, the planner's package is defective, an option is unknown
            or not allowed, an action that the planner needs is missing, or the planner is for
            another task.
    """
    factory = load_planner(name)
    check_task(name, search.rules)
    return factory(search, seed=seed, **options)


def read_options(options: Iterable[str]) -> dict[str, Any]:
    """Return options by name, each given as name=value with a value in YAML, see `parse_yaml`.

    Raises:
        FieldError: If one has no name or no value, or is given twice.
    """
    values: dict[str, Any] = {}
    for text in options:
        name, _, value = text.partition("=")
        name = name.strip()
        if not (name and value):
            raise FieldError(f"planner_options must be name=value each, got {shown(text)}")
        try:
            parsed = parse_yaml(value)
        except FieldError as error:
            raise FieldError(f"planner_options: {name}: {error}") from None
        if name in values:
            raise FieldError(f"planner_options must name each option once, got {name} twice")
        values[name] = parsed
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
        others: Further options, which the text must not have.

    Raises:
        ValueError: See `planner_for` and `read_options`.
    """
    named = read_options(options)
    for other in others:
        if other in named:
            raise FieldError(f"planner_options must not have {other}, which is given already")
    return planner_for(search, name, seed=seed, **named, **others)


def default_planner(rules: Rules) -> str:
    """Return the planner for the task of the rules, unless another is chosen."""
    return COVERAGE_PLANNERS[0] if rules.covers else DEFAULT_PLANNER


def check_task(name: str, rules: Rules) -> None:
    """Check that a planner of this package is for the task and the space of the rules.

    Raises:
        FieldError: If it is for another one.
    """
    check_space(name, rules)
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
) -> Planner:
    """Return a planner that needs only the actions and the area, for drones that can do them all.

    Args:
        name: A key of `PLANNERS`.
        actions: Names of the actions by number, as in the rules.
        seed: Seed of the planner's random draws.
        area: (R, C) bool [row, col], the cells to search; None for the whole grid.

    Raises:
        ValueError: If the name is unknown, the planner needs the rules and the scenario too, the
            seed is not allowed, or an action that the planner needs is missing.
    """
    if isinstance(name, str) and name in PLANNERS:
        return PLANNERS[name](Swarm.alike(actions, area), seed=check_seed(seed))
    if name in PLANNER_NAMES:
        raise FieldError(f"planner: {name!r} also needs the rules and the scenario")
    raise FieldError(f"planner must be one of {', '.join(PLANNER_NAMES)}, got {shown(name)}")
