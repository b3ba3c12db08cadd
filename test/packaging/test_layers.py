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
# What a layer may import of this package, packages or modules, and what it may not import of the
# world.
WORLD = {
    "dsse_ros.belief",
    "dsse_ros.compiled",
    "dsse_ros.defects",
    "dsse_ros.drift",
    "dsse_ros.progress_bar",
    "dsse_ros.scenario",
    "dsse_ros.search",
    "dsse_ros.searchers",
    "dsse_ros.sensors",
    "dsse_ros.step",
    "dsse_ros.targets",
    "dsse_ros.view",
    "dsse_ros.whole_files",
}
"""What simulates a search, and shows it."""
LAYERS: dict[str, tuple[set[str], set[str]]] = {
    "dsse_ros": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.checks": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.defects": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.result": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.extras": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.temporary": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.private_files": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.whole_files": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.progress_bar": (set(), {"ros", "messages", "mavlink"}),
    "dsse_ros.compiled": (
        {"dsse_ros.compiled", "dsse_ros.temporary"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.drift": (
        {"dsse_ros.drift", "dsse_ros.compiled", "dsse_ros.defects", "dsse_ros.extras"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.searchers": (
        {"dsse_ros.searchers", "dsse_ros.sensors"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.sensors": ({"dsse_ros.sensors"}, {"ros", "messages", "mavlink"}),
    "dsse_ros.targets": (
        {"dsse_ros.targets", "dsse_ros.compiled"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.scenario": (
        {
            "dsse_ros.scenario",
            "dsse_ros.compiled",
            "dsse_ros.defects",
            "dsse_ros.drift",
            "dsse_ros.searchers",
            "dsse_ros.sensors",
            "dsse_ros.targets",
            "dsse_ros.extras",
        },
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.mission_items": (
        {"dsse_ros.mission_items", "dsse_ros.scenario", "dsse_ros.checks"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.step": (
        {
            "dsse_ros.step",
            "dsse_ros.scenario",
            "dsse_ros.sensors",
            "dsse_ros.targets",
            "dsse_ros.compiled",
        },
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.belief": (
        {
            "dsse_ros.belief",
            "dsse_ros.step",
            "dsse_ros.scenario",
            "dsse_ros.targets",
            "dsse_ros.compiled",
        },
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.view": (
        {"dsse_ros.view", "dsse_ros.scenario", "dsse_ros.progress_bar", "dsse_ros.extras"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.search": (WORLD | {"dsse_ros.extras"}, {"ros", "messages", "mavlink"}),
    "dsse_ros.conformance": (
        WORLD | {"dsse_ros.conformance", "dsse_ros.planners"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.planners": (
        WORLD | {"dsse_ros.planners", "dsse_ros.extras"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.compat": (
        WORLD
        | {
            "dsse_ros.compat",
        },
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.training": (
        WORLD
        | {
            "dsse_ros.training",
            "dsse_ros.planners",
            "dsse_ros.extras",
        },
        {"ros", "messages", "mavlink"},
    ),
    "msg_adapters": ({"msg_adapters"}, {"effects", "ros", "mavlink"}),
    "dsse_ros.message_types": ({"dsse_ros.scenario.fields"}, {"ros", "mavlink"}),
    "dsse_ros.live": (WORLD | {"dsse_ros.live", "dsse_ros.result"}, {"ros", "messages", "mavlink"}),
    "dsse_ros.mission": (
        WORLD
        | {
            "dsse_ros.live",
            "dsse_ros.mission",
            "dsse_ros.mission_items",
            "dsse_ros.result",
            "dsse_ros.message_types",
            "msg_adapters",
        },
        {"ros", "messages", "mavlink"},
    ),
    # Bags hold messages, which rclpy serialises.
    "dsse_ros.recording": (
        WORLD
        | {
            "dsse_ros.recording",
            "dsse_ros.live",
            "dsse_ros.mission",
            "dsse_ros.message_types",
            "msg_adapters",
        },
        {"mavlink"},
    ),
    "dsse_ros.report": (
        WORLD
        | {
            "dsse_ros.report",
            "dsse_ros.recording",
            "dsse_ros.mission",
            "dsse_ros.mission_items",
            "msg_adapters",
        },
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.campaign": (
        WORLD
        | {
            "dsse_ros.campaign",
            "dsse_ros.report",
            "dsse_ros.mission",
            "dsse_ros.planners",
        },
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.mavlink": (
        {"dsse_ros.mavlink", "dsse_ros.private_files", "dsse_ros.whole_files"},
        {"ros", "messages"},
    ),
    "dsse_ros.autopilots": ({"dsse_ros.autopilots", "dsse_ros.mavlink"}, {"ros", "messages"}),
    "dsse_ros.flight": (
        {
            "dsse_ros.flight",
            "dsse_ros.autopilots",
            "dsse_ros.mavlink",
            "dsse_ros.mission_items",
            "dsse_ros.scenario.geodesy",
            "dsse_ros.checks",
            "dsse_ros.defects",
        },
        {"ros", "messages"},
    ),
    "dsse_ros.bridge": (
        WORLD
        | {
            "dsse_ros.bridge",
            "dsse_ros.autopilots",
            "dsse_ros.flight",
            "dsse_ros.mission",
            "dsse_ros.mission_items",
            "dsse_ros.checks",
            "dsse_ros.defects",
            "dsse_ros.result",
            "msg_adapters",
        },
        {"ros", "messages"},
    ),
    "dsse_ros.dashboard": (
        WORLD
        | {
            "dsse_ros.dashboard",
            "dsse_ros.private_files",
            "msg_adapters",
        },
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.tak": (
        WORLD | {"dsse_ros.tak", "dsse_ros.defects", "dsse_ros.private_files"},
        {"ros", "messages", "mavlink"},
    ),
    "dsse_ros.runtime": (
        WORLD | {"dsse_ros.runtime", "dsse_ros.message_types", "msg_adapters"},
        {"mavlink"},
    ),
    "dsse_ros.nodes": (
        WORLD
        | {
            "dsse_ros.nodes",
            "dsse_ros.autopilots",
            "dsse_ros.runtime",
            "dsse_ros.bridge",
            "dsse_ros.dashboard",
            "dsse_ros.defects",
            "dsse_ros.flight",
            "dsse_ros.live",
            "dsse_ros.mission",
            "dsse_ros.mission_items",
            "dsse_ros.recording",
            "dsse_ros.result",
            "dsse_ros.message_types",
            "dsse_ros.tak",
            "msg_adapters",
            "dsse_ros.planners",
        },
        set(),
    ),
    "dsse_ros.ros_env": (
        WORLD
        | {
            "dsse_ros.runtime",
            "msg_adapters",
        },
        {"mavlink"},
    ),
    "dsse_ros.cli": ({"dsse_ros", "msg_adapters"}, set()),
}
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


def layer_of(module: str) -> str:
    """Layer of a module of ours: its first package, or its second one in `dsse_ros`."""
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] == "dsse_ros" and len(parts) > 1 else parts[0]


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


def is_in(module: str, allowed: set[str]) -> bool:
    """Whether a module, or a name in one, is allowed; the empty package at the top always is."""
    return module == "dsse_ros" or any(f"{module}.".startswith(f"{prefix}.") for prefix in allowed)


def breaches(code: str, module: str, *, package: bool = False) -> list[str]:
    """Imports of a module that its layer does not allow."""
    own_layers, foreign_kinds = LAYERS[layer_of(module)]
    return [
        name
        for name in imports(code, module, package=package)
        if (
            not is_in(name, own_layers)
            if name.split(".")[0] in OURS
            else kind_of(name) in foreign_kinds
        )
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
        ("dsse_ros.search.world", "import rclpy"),
        ("dsse_ros.search.world", "from pymavlink import mavutil"),
        ("dsse_ros.search.world", "from nav_msgs.msg import OccupancyGrid"),
        ("dsse_ros.search.world", "def f():\n    from msg_adapters import poses"),
        ("dsse_ros.search.world", "from ..nodes import sim_node"),
        ("dsse_ros.search.world", "from .. import planners"),
        ("dsse_ros.search.world", "import importlib\nimportlib.import_module('rclpy.node')"),
        ("dsse_ros.planners.sweep", "from dsse_ros.nodes.sim_node import SimNode"),
        ("dsse_ros.planners.sweep", "from msg_adapters.poses import pose"),
        ("dsse_ros.search.drone_slots", "from dsse_ros.training.vec_env import DroneVecEnv"),
        ("dsse_ros.mission.mission", "from rclpy.node import Node"),
        ("dsse_ros.mission.mission", "from dsse_ros.flight import link"),
        ("dsse_ros.mission.mission", "from ..nodes.settings import SimSettings"),
        ("dsse_ros.recording.bag", "from dsse_ros.nodes.recorder import RecorderNode"),
        ("dsse_ros.mission.mission", "from dsse_ros.recording.bag import read_bag"),
        ("dsse_ros.report.bags", "from std_msgs.msg import String"),
        ("dsse_ros.report.metrics", "from dsse_ros.nodes.settings import SimSettings"),
        ("dsse_ros.campaign.engines", "from dsse_ros.cli.start import missing"),
        ("dsse_ros.mavlink.link", "from rclpy.node import Node"),
        ("dsse_ros.mavlink.link", "from dsse_ros.scenario.fields import FieldError"),
        ("dsse_ros.flight.orders", "from ..mission.mission import Mission"),
        ("dsse_ros.flight.orders", "from ..bridge.custody import Custody"),
        ("dsse_ros.bridge.custody", "from rclpy.node import Node"),
        ("dsse_ros.bridge.followed_search", "from std_msgs.msg import String"),
        ("dsse_ros.bridge.settings", "from dsse_ros.nodes.settings import SimSettings"),
        ("dsse_ros.nodes.sim_node", "from dsse_ros.cli.command_line import Parser"),
        ("dsse_ros.dashboard.view", "from rclpy.node import Node"),
        ("dsse_ros.dashboard.view", "from std_msgs.msg import String"),
        ("dsse_ros.dashboard.view", "from dsse_ros.nodes.dashboard import DashboardNode"),
        ("dsse_ros.ros_env", "from dsse_ros.planners import planner_for"),
        ("msg_adapters.poses", "from rclpy.time import Time"),
        ("msg_adapters.poses", "from dsse_ros.scenario.frames import GridFrame"),
        ("msg_adapters.poses", "import logging"),
    ],
)
def test_an_import_from_above_is_seen(module: str, code: str) -> None:
    assert breaches(code, module)


@pytest.mark.parametrize(
    ("module", "code"),
    [
        (
            "dsse_ros.search.world",
            "import numpy as np\nfrom . import kernels\nfrom .rules import Rules",
        ),
        ("dsse_ros.planners.sweep", "from ..search.rules import Rules"),
        ("dsse_ros.report.bags", "from dsse_ros.recording.bag import read_bag"),
        ("dsse_ros.mavlink.link", "from pymavlink import mavutil"),
        ("dsse_ros.flight.upload", "from dsse_ros.mission_items.items import MissionItem"),
        ("dsse_ros.bridge.fence", "from dsse_ros.scenario.frames import GridFrame"),
        ("dsse_ros.bridge.custody", "from dsse_ros.flight.orders import Hold"),
        ("dsse_ros.mission.mission", "from dsse_ros.result import Rejected"),
        ("dsse_ros.recording.bag_replay", "from dsse_ros.mission.mission import Mission"),
        ("dsse_ros.recording.bag", "from rclpy.serialization import serialize_message"),
        ("dsse_ros.nodes.sim_node", "from dsse_ros.mission.mission import Mission"),
        ("dsse_ros.cli.run_mission", "import rclpy\nfrom dsse_ros.runtime.qos import LATCHED"),
        (
            "msg_adapters.poses",
            "from geometry_msgs.msg import Pose\nfrom msg_adapters.stamps import header",
        ),
    ],
)
def test_an_import_from_below_is_allowed(module: str, code: str) -> None:
    assert breaches(code, module) == []
