# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every parameter of every node, with all kinds of invalid values."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import math
import os
import subprocess
import sys
import threading
from typing import Any

from dsse_ros.base.fields import Spec, specs
from soak.rigs import ENVIRONMENT, Sim, domain
from soak.row import Figures, Row, Run, zero

NODES = (
    "sim_node", "planner_node", "mavlink_bridge", "show", "recorder", "foxglove_viewer",
    "cot_gateway", "dashboard",
)  # fmt: skip
HUGE = 2**62 + 1
VALUES: dict[str, Any] = {
    ".nan": math.nan,
    ".inf": math.inf,
    "-.inf": -math.inf,
    "-1": -1,
    "-1.5": -1.5,
    "0": 0,
    "0.0": 0.0,
    "1e308": 1e308,
    str(HUGE): HUGE,
    "true": True,
    "text": "text",
    "[.nan]": [math.nan],
    "[true, false]": [True, False],
    "[text]": ["text"],
}
"""The given value, as YAML and as a Python value."""
GIVE_UP_S = 20.0


def allowed(spec: Spec, value: Any) -> bool | None:
    """Return whether a field allows this value, None if that depends on other fields."""
    if isinstance(value, list):
        items = {"vector": float, "cell": int, "cells": int, "floats": float, "ints": int}
        kind = items.get(spec.kind)
        if kind is None:
            return None if spec.kind == "names" and isinstance(value[0], str) else False
        return False
    match spec.kind:
        case "bool":
            return isinstance(value, bool)
        case "str":
            if not isinstance(value, str):
                return False
            return value in spec.choices if spec.choices else None
        case "int" | "float":
            if isinstance(value, bool | str) or (spec.kind == "int" and isinstance(value, float)):
                return False
            if isinstance(value, float) and not math.isfinite(value):
                return False
            return None if spec.low <= value <= spec.high and value > spec.above else False
        case "area":
            return None
    return False


def specs_of(node: str) -> dict[str, Spec]:
    """Return the fields that are parameters of a node."""
    if node == "sim_node":
        from dsse_ros.ros.nodes.settings import SIM_PARAMETERS

        return dict(SIM_PARAMETERS)
    names = {
        "planner_node": "PlannerSettings",
        "show": "ShowSettings",
        "recorder": "RecorderSettings",
        "foxglove_viewer": "ViewerSettings",
    }
    if node == "mavlink_bridge":
        from dsse_ros.vehicles.fleet.settings import BridgeSettings

        return specs(BridgeSettings)
    if node == "dashboard":
        from dsse_ros.screens.dashboard.settings import DashboardSettings

        return specs(DashboardSettings)
    if node == "cot_gateway":
        from dsse_ros.screens.tak.settings import CotSettings

        return specs(CotSettings)
    return specs(getattr(importlib.import_module("dsse_ros.ros.nodes.settings"), names[node]))


def of_start(node: str) -> list[tuple[str, str]]:
    """Return the names and YAML values that a node must refuse at its start."""
    return [
        (name, text)
        for name, spec in specs_of(node).items()
        for text, value in VALUES.items()
        if allowed(spec, value) is False
    ]


def parameters(run: Run) -> Figures:
    """Give each node every value at its start, and the simulation also at run time."""
    refused = at_run_time = 0
    wrong: list[str] = []
    with domain(run.folder) as rig:
        for node in run.each(NODES, "nodes"):
            cases = of_start(node)[:: run.size(1, 23)]
            answers = start_all(node, cases, rig.domain)
            for (name, text), (code, errors) in zip(cases, answers, strict=True):
                lines = errors.splitlines()
                if code == 2 and len(lines) == 1 and name.rpartition(".")[2] in lines[0]:
                    refused += 1
                else:
                    wrong.append(f"{node} {name}:={text}: {code} {errors[-300:]}")
        sim = rig.sim({"grid_size": 9, "num_drones": 2, "seed": 3})
        for name, spec in run.each(specs_of("sim_node").items(), "run time"):
            found, count = change(sim, name, spec)
            wrong += found
            at_run_time += count
        sim.fly(4, 4)
    return {
        "refused_at_start": refused,
        "refused_at_run_time": at_run_time,
        "wrong": len(wrong),
        "failures": wrong[:20],
    }


def change(sim: Sim, name: str, spec: Spec) -> tuple[list[str], int]:
    """Try every value at run time; return the failures and the number of refusals."""
    before = sim.get(name)
    bad = [value for value in VALUES.values() if value != HUGE and allowed(spec, value) is False]
    results = try_all(sim, name, bad)
    wrong = [
        f"{name} = {value!r} at run time: {result.reason!r}"
        for value, result in zip(bad, results, strict=True)
        if result.successful or not result.reason
    ]
    if sim.get(name) != before:
        wrong.append(f"{name} was {before} before it was refused")
    return wrong, len(bad)


def try_all(sim: Sim, name: str, values: list[Any]) -> list[Any]:
    """Return the verdicts on values of a parameter, one after the other."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    messages = [Parameter(name, value=value).to_parameter_msg() for value in values]
    return list(sim.call(SetParameters, "set_parameters", parameters=messages).results)


def start_all(
    node: str, cases: list[tuple[str, str]], ros_domain: int
) -> list[tuple[int | None, str]]:
    """Return exit code and error of a node for each case, None where it has started.

    One process tries the cases in turn; a new process continues after a node that has started.
    """
    variables = {"ROS_DOMAIN_ID": str(ros_domain), "PYTHONPATH": os.pathsep.join(sys.path)}
    answers: list[tuple[int | None, str]] = []
    while len(answers) < len(cases):
        done = subprocess.run(
            [sys.executable, "-m", "soak.parameters", node],
            input=json.dumps(cases[len(answers) :]),
            env=os.environ | ENVIRONMENT | variables,
            capture_output=True,
            text=True,
        )
        found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
        answers += [(code, errors) for code, errors in found]
        if len(answers) < len(cases):
            answers.append((None, f"it has started, or ended: {done.stderr[-300:]}"))
    return answers


def _starts(node: str, cases: list[tuple[str, str]], out: Any) -> None:
    """Print exit code and error of a node for each case, until one has started."""
    main = importlib.import_module(f"dsse_ros.ros.nodes.{node}").main
    for name, text in cases:
        watch = threading.Timer(GIVE_UP_S, os._exit, (9,))
        watch.daemon = True
        watch.start()
        errors = io.StringIO()
        with contextlib.redirect_stderr(errors):
            code = main(["--ros-args", "-p", f"{name}:={text}"])
        watch.cancel()
        print(json.dumps([code, errors.getvalue()]), file=out, flush=True)


ROWS = (
    Row(
        "parameters",
        "Each parameter with NaN, inf, -1, 0, huge values and wrong types, at start and at run "
        "time: refused with its reason, and the old value stays",
        parameters,
        "{refused_at_start} refused at the start, {refused_at_run_time} at run time, {wrong} wrong",
        zero("wrong"),
    ),
)

if __name__ == "__main__":
    _starts(sys.argv[1], json.load(sys.stdin), sys.stdout)
