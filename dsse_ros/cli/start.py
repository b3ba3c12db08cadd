# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Entry point of every program: quiet on Ctrl-C, with clear errors for missing dependencies.

It imports nothing before the program is chosen, so that it can report a failed import on one line.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import sys
from functools import partial

from dsse_ros.base.defects import reason_of
from dsse_ros.base.extras import pip_install
from dsse_ros.base.temporary import use_without_home
from dsse_ros.cli.node_help import is_wanted, node_help
from dsse_ros.ros.runtime import standard_streams
from dsse_ros.ros.runtime.exit_codes import FAILED, MISSING, fail
from dsse_ros.ros.runtime.interrupts import leave_on_signals

_DASHBOARD = ("dashboard", "make sim VIEW=1")
_RECORD = ("record", "make sim")
_OF_EXTRAS = {
    "PIL": _DASHBOARD,
    "fastapi": _DASHBOARD,
    "foxglove": ("viewer", ""),
    "gpxpy": ("gis", ""),
    "lz4": _RECORD,
    "mcap": _RECORD,
    "nicegui": _DASHBOARD,
    "pyarrow": ("campaign", "make campaign"),
    "pytak": ("tak", ""),
    "rasterio": ("gis", ""),
    "ray": ("ray", ""),
    "scipy": ("campaign", "make campaign"),
    "uvicorn": _DASHBOARD,
    "zstandard": _RECORD,
}
"""Of modules that `viz` does not bring: the extra that does, and the target, if one does too."""
_ROS = ("rclpy", "rpyutils", "ament_index_python")

_MIDDLEWARE = "RMW_IMPLEMENTATION"
_MISSION = "cli.run_mission"


def start(module: str) -> int:
    """Run a program, a module of `dsse_ros` with a `main`; returns its exit code.

    Until the program handles signals itself, Ctrl-C ends the process at once, even while something
    is compiled: a node with code 0 as later, others with 130.
    """
    # Before anything is opened.
    standard_streams.guard()
    is_node = module.startswith("ros.nodes.")
    leave_on_signals(code=0 if is_node else None)
    name = module.rpartition(".")[2]
    try:
        code = _run(name, module, is_node=is_node)
    except SystemExit as leaving:
        # As argparse ends a program after its help.
        code = int(leaving.code or 0)
    except ImportError as error:
        return not_found(name, error)
    if reason := standard_streams.lost():
        fail(name, reason)
        return code or FAILED
    return code


def _run(name: str, module: str, *, is_node: bool) -> int:
    """Run a program; returns its exit code.

    Raises:
        ImportError: If something is not installed.
    """
    use_without_home(os.environ)
    # Programs draw to files; a notebook that starts one leaves its own backend here.
    os.environ.pop("MPLBACKEND", None)
    if wrong := _missing_middleware():
        if is_node or module == _MISSION:
            return fail(name, wrong)
        # The others communicate with nobody.
        del os.environ[_MIDDLEWARE]
    if is_node and is_wanted(sys.argv[1:]):
        print(node_help(name, sys.argv[0]))
        return 0
    program = importlib.import_module(f"dsse_ros.{module}")
    if is_node:
        # Nodes log what they compile.
        code: int = program.main()
        return code
    from dsse_ros.search.environments.compiler import announced_on_stderr

    with announced_on_stderr():
        code = program.main()
    return code


def _missing_middleware() -> str:
    """Return what is wrong with the ROS middleware of the environment; empty if nothing is.

    Otherwise rclpy ends the process as soon as it is imported.
    """
    wanted = os.environ.get(_MIDDLEWARE)
    if not wanted:
        return ""
    try:
        ctypes.CDLL(f"lib{wanted}.so")
    except OSError:
        return (
            f"{_MIDDLEWARE} must be an installed middleware, got {wanted!r}: unset it, as ROS 2 "
            "from wheels has rmw_fastrtps_cpp only, or install it"
        )
    return ""


def not_found(program: str, error: ImportError) -> int:
    """Say on one line what is not installed; returns the exit code.

    Raises:
        ImportError: If the package itself is broken.
    """
    text = missing(error)
    if text is None:
        raise error
    print(f"{program}: {text}", file=sys.stderr)
    return MISSING


def missing(error: ImportError) -> str | None:
    """Return what is not installed, on one line; None where the package itself is broken."""
    name = (error.name or "").partition(".")[0]
    reason = reason_of(error)
    if name in ("dsse_ros", "msg_adapters"):
        return None
    if not isinstance(error, ModuleNotFoundError):
        # Such as a ROS 2 that was made for another Python.
        return f"an import has failed in Python {sys.version.partition(' ')[0]}: {reason}"
    if name in _ROS or name.endswith(("_msgs", "_srvs", "_interfaces")):
        return f"ROS 2 not found ({reason}): source a ROS 2, or use `make sim`, which provides one"
    extra, target = _OF_EXTRAS.get(name, ("viz", "make sim"))
    use = f", or use `{target}`, which provides it" if target else ""
    return f"{name} not found: {pip_install(extra)}{use}"


# The executables of `ros2 run dsse_ros`, by name.
sim_node = partial(start, "ros.nodes.sim_node")
planner_node = partial(start, "ros.nodes.planner_node")
mavlink_bridge = partial(start, "ros.nodes.mavlink_bridge")
show = partial(start, "ros.nodes.show")
recorder = partial(start, "ros.nodes.recorder")
foxglove_viewer = partial(start, "ros.nodes.foxglove_viewer")
cot_gateway = partial(start, "ros.nodes.cot_gateway")
dashboard = partial(start, "ros.nodes.dashboard")
run_mission = partial(start, _MISSION)
export_mission = partial(start, "cli.export_mission")
export_gis = partial(start, "cli.export_gis")
report = partial(start, "cli.report")
replay = partial(start, "cli.replay")
campaign = partial(start, "cli.campaign")
backtrack = partial(start, "cli.backtrack")
plan_search = partial(start, "cli.plan_search")
