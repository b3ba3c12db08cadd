# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Dependencies point one way: what lies below knows nothing of what lies above it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OURS = ("dsse_ros", "msg_adapters")
WINGS: tuple[dict[str, set[str]], ...] = (
    {"base": {"ros", "mavlink"}},
    {"world": {"ros", "messages", "mavlink"}},
    {"picture": {"ros", "messages", "mavlink"}},
    {"search": {"ros", "messages", "mavlink"}},
    {"vehicles": {"ros", "messages"}, "planners": {"ros", "messages", "mavlink"}},
    {
        "compat": {"ros", "messages", "mavlink"},
        "conformance": {"ros", "messages", "mavlink"},
        "mission": {"mavlink"},
        "training": {"ros", "messages", "mavlink"},
    },
    {
        "results": {"ros", "messages", "mavlink"},
        "screens": {"ros", "messages", "mavlink"},
    },
    {"ros": set()},
    {"cli": set()},
)
"""The floors of the house from below, each with its wings and what these may not import from
outside. A wing imports only wings of the floors below it."""
FLOORS = {wing: floor for floor, wings in enumerate(WINGS) for wing in wings}
FOREIGN = {wing: kinds for wings in WINGS for wing, kinds in wings.items()}
ADAPTERS = "msg_adapters"
"""It imports nothing of `dsse_ros`."""
ADAPTED = {"vehicles", "mission", "results", "screens", "ros", "cli"}
"""Wings that import the adapters; the search and its planners know no topics."""
ROOMS = {
    ("mission.live", "messages"),
    ("mission.run", "ros"),
    ("mission.files", "ros"),
    ("mission.vehicles", "ros"),
    ("ros.ros_env", "mavlink"),
    ("ros.runtime", "mavlink"),
}
"""Rooms with what only they may not import of their wing's."""
KINDS = {
    "ros": {"ament_index_python", "launch", "launch_ros", "rclpy", "tf2_ros"},
    "mavlink": {"pymavlink"},
    "effects": {"logging", "socket", "threading", "time"},
}


def kind_of(module: str) -> str:
    """Kind of a module from outside, or an empty string."""
    top = module.split(".")[0]
    if top.endswith(("_msgs", "_srvs", "_interfaces")):
        return "messages"
    return next((kind for kind, names in KINDS.items() if top in names), "")


def wing_of(module: str) -> str:
    """Wing of a module of ours: its package in `dsse_ros`, empty for `dsse_ros` itself."""
    top, _, rest = module.partition(".")
    return rest.partition(".")[0] if top == "dsse_ros" else top


def imports(code: str, module: str, *, package: bool = False) -> Iterator[str]:
    """Absolute names that a module imports, inside functions and by `import_module` too."""
    for node in ast.walk(ast.parse(code)):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=name, names=names, level=level):
                parents = module.split(".")[: -level + package or None] if level else []
                base = ".".join([*parents, *filter(None, [name])])
                yield from (f"{base}.{alias.name}" for alias in names)
            case ast.Call(
                func=ast.Attribute(attr="import_module")
                | ast.Name(id="import_module" | "__import__"),
                args=[ast.Constant(value=str(name)), *_],
            ):
                yield name


def may_import(wing: str, name: str) -> bool:
    """Whether a wing may import a name of ours."""
    other = wing_of(name)
    # The package itself names its public names for type checkers.
    if wing in {other, ""} or other not in {*FLOORS, ADAPTERS}:
        return True
    if wing == ADAPTERS:
        return False
    if other == ADAPTERS:
        return wing in ADAPTED
    return FLOORS[other] < FLOORS[wing]


def breaches(code: str, module: str, *, package: bool = False) -> list[str]:
    """Imports of a module that its wing does not allow."""
    wing = wing_of(module)
    foreign = FOREIGN.get(wing, {"ros", "messages", "mavlink"}) | {
        kind for room, kind in ROOMS if f"{module}.".startswith(f"dsse_ros.{room}.")
    }
    if wing == ADAPTERS:
        foreign = {"effects", "ros", "mavlink"}
    return [
        name
        for name in imports(code, module, package=package)
        if (not may_import(wing, name) if name.split(".")[0] in OURS else kind_of(name) in foreign)
    ]


def modules() -> dict[str, Path]:
    """Modules by name."""
    named = {}
    for file in sorted(file for top in OURS for file in (ROOT / top).rglob("*.py")):
        path = file.relative_to(ROOT).with_suffix("")
        named[".".join(path.parent.parts if path.name == "__init__" else path.parts)] = file
    return named


@pytest.mark.parametrize(("module", "file"), modules().items())
def test_a_module_imports_only_from_below(module: str, file: Path) -> None:
    assert breaches(file.read_text(), module, package=file.name == "__init__.py") == []


@pytest.mark.parametrize(
    ("module", "code"),
    [
        ("dsse_ros.search.environments.world", "import rclpy"),
        ("dsse_ros.search.environments.world", "from nav_msgs.msg import OccupancyGrid"),
        ("dsse_ros.search.environments.world", "def f():\n    from msg_adapters import poses"),
        ("dsse_ros.search.environments.world", "from ...ros.nodes import sim_node"),
        ("dsse_ros.search.environments.world", "from ... import planners"),
        ("dsse_ros.search.step.looks", "import importlib\nimportlib.import_module('rclpy.node')"),
        ("dsse_ros.mission.run.mission", "from rclpy.node import Node"),
        ("dsse_ros.vehicles.fleet.custody", "from dsse_ros.planners.sweep import sweep_routes"),
        ("dsse_ros.ros.ros_env", "from dsse_ros.cli.start import missing"),
        ("dsse_ros.ros.runtime.qos", "import pymavlink"),
        ("msg_adapters.poses", "from dsse_ros.world.scenario.frames import GridFrame"),
        ("msg_adapters.poses", "import logging"),
    ],
)
def test_an_import_from_above_is_seen(module: str, code: str) -> None:
    assert breaches(code, module)


@pytest.mark.parametrize(
    ("module", "code"),
    [
        ("dsse_ros.search.environments.world", "import numpy as np\nfrom . import kernels"),
        ("dsse_ros.planners.sweep", "from ..search.step.looks import looks_of"),
        ("dsse_ros.vehicles.mavlink.link", "from pymavlink import mavutil"),
        ("dsse_ros.mission.recording.bag", "from rclpy.serialization import serialize_message"),
        ("dsse_ros.cli.run_mission", "import rclpy\nfrom dsse_ros.ros.runtime.qos import LATCHED"),
        ("msg_adapters.poses", "from geometry_msgs.msg import Pose"),
    ],
)
def test_an_import_from_below_is_allowed(module: str, code: str) -> None:
    assert breaches(code, module) == []
