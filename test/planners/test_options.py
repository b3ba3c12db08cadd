# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every value of an option is either flown or refused in one line, wherever it comes from."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from effort import LITTLE_EFFORT

from dsse_ros.base.fields import FieldError, Spec, specs
from dsse_ros.cli import export_mission
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.options import POS, POS_ALIVE
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import (
    LOADED_PLANNERS,
    OPTIONS,
    PLANNERS,
    check_options,
    make_planner,
    planner_for,
    planner_with,
    read_options,
)
from dsse_ros.results.campaign.config import Campaign
from dsse_ros.ros.nodes.settings import PlannerSettings
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.definition import SearchDefinition

FIELDS: dict[str, Any] = {
    "grid_size": 6, "num_drones": 2, "sigma": 2, "timestep_limit": 4,
    "probability_of_detection": 0.5,
}  # fmt: skip
TASK = {"astar": {"rules": "coverage"}, "onnx": {"rules": "v2"}}
EACH = [(name, option) for name, cls in OPTIONS.items() for option in cls.specs()]
LANES: dict[str, Any] = {"length": 300.0, "width": 200.0, "track_spacing": 100.0}
NEEDED: dict[str, dict[str, Any]] = {
    **LITTLE_EFFORT, "sweep": LANES, "creeping_line": LANES, "sector": {"length": 300.0},
    "expanding_square": {"length": 300.0, "track_spacing": 100.0},
}  # fmt: skip
"""Other options that go with the one under test."""


def env_for(planner: str) -> SearchEnv:
    return parallel_env(**{**FIELDS, **TASK.get(planner, {})})


def installed(planner: str) -> None:
    """Skip the test if the planner needs a package that is not installed."""
    if planner in LOADED_PLANNERS:
        for library in LOADED_PLANNERS[planner].libraries:
            pytest.importorskip(library)


def wrong_values(spec: Spec) -> list[Any]:
    """Return values that the spec does not allow, of each kind of mistake."""
    wrong: list[Any] = [[], {"a": 1}, object()]
    if spec.kind == "bool":
        return [*wrong, "maybe", 1, 0.0]
    if spec.kind == "str":
        return [*wrong, 3, 1.5]
    if spec.kind == "cell":
        return [*wrong, 3, "2, 3", (1, 2, 3), (1.5, 2), (-1, 0), (6, 0)]
    wrong += ["many", True, math.nan, math.inf]
    wrong += [spec.high + 1, -(2**70), 2**70]
    if math.isfinite(spec.low):
        wrong += [spec.low - 1, spec.low - 10**9]
    return [*wrong, 1.5, "3"] if spec.kind == "int" else [*wrong, "3"]


def least_values(spec: Spec) -> list[Any]:
    """Return the values at the lower limit of a spec, and next to it."""
    if spec.kind == "bool":
        return [True, False]
    if spec.kind in ("int", "float"):
        return [value for value in (spec.low, spec.low + 1) if math.isfinite(value)]
    if POS_ALIVE in spec.choices:
        return [POS]  # Nothing is known of survival.
    return {"cell": [(0, 0), (5, 5)], "str": list(spec.choices) or [""]}[spec.kind]


@pytest.mark.parametrize(("planner", "option"), EACH)
def test_a_value_that_is_not_allowed_is_refused_by_the_name_of_its_option(
    planner: str, option: str
) -> None:
    installed(planner)
    env, spec = env_for(planner), OPTIONS[planner].specs()[option]
    for value in wrong_values(spec):
        with pytest.raises(FieldError, match=f"^{option} must ") as caught:
            planner_for(env, planner, **{**NEEDED.get(planner, {}), option: value})
        assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(("planner", "option"), EACH)
def test_the_least_values_that_are_allowed_are_flown(planner: str, option: str) -> None:
    installed(planner)
    env, spec = env_for(planner), OPTIONS[planner].specs()[option]
    for value in least_values(spec):
        fly = planner_for(env, planner, seed=1, **{**NEEDED.get(planner, {}), option: value})
        steps = list(play(env, fly, seed=2))
        assert steps and not env.agents


@pytest.mark.parametrize("planner", OPTIONS)
def test_an_unknown_option_is_refused_by_its_name_and_that_of_the_planner(planner: str) -> None:
    installed(planner)
    with pytest.raises(FieldError, match=f"^'sampels' is not an option of planner {planner}; "):
        planner_for(env_for(planner), planner, sampels=3)


@pytest.mark.parametrize("seed", [-1, 1.0, True, "1", None, [1]])
@pytest.mark.parametrize("planner", ["greedy", "random", "belief"])
def test_a_seed_that_is_none_is_refused(planner: str, seed: Any) -> None:
    with pytest.raises(FieldError, match="^seed must be an integer >= 0, got "):
        planner_for(env_for(planner), planner, seed=seed)
    if planner in PLANNERS:
        with pytest.raises(FieldError, match="^seed must be an integer >= 0, got "):
            make_planner(planner, ("left", "right", "up", "down", "search"), seed=seed)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("budget_ms=1e3", 1000.0), ("budget_ms=.5", 0.5), ("samples=0x40", 64), ("samples=+8", 8),
        ("learn_drift=false", False), ("gamma=1", 1.0), ("horizon=null", None),
    ],
)  # fmt: skip
def test_a_text_is_read_as_a_scenario_file_reads_it(text: str, value: Any) -> None:
    option = text.partition("=")[0]
    planner: Any = planner_with(env_for("belief"), "belief", [text])
    assert getattr(planner._new_tactic.keywords["options"], option) == value


@pytest.mark.parametrize(
    ("texts", "line"),
    [
        (["width=0"], "width must be an integer >= 1 and <= 100000, got 0"),
        (["samples=0"], "samples must be an integer >= 1 and <= 1000000, got 0"),
        (["samples=1e3"], "samples must be an integer >= 1 and <= 1000000, got 1000.0"),
        (["horizon=-2"], "horizon must be an integer >= 1 and <= 1000, got -2"),
        (["learn_drift=maybe"], "learn_drift must be true or false, got 'maybe'"),
        (["learn_drift=yes"], "learn_drift must be true or false, got 'yes'"),
        (["width=4", "width=5"], "planner_options must name each option once, got width twice"),
    ],
)
def test_the_line_is_the_same_wherever_the_value_comes_from(
    texts: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    env = env_for("belief")
    with pytest.raises(FieldError, match=f"^{re.escape(line)}$"):
        planner_with(env, "belief", texts)
    arguments = ["--scenario", "santos", "--planner", "belief", "--out", str(tmp_path)]
    with pytest.raises(SystemExit) as caught:
        sys_exit(export_mission.main([*arguments, "--planner-options", *texts]))
    assert caught.value.code == 2
    assert capsys.readouterr().err.strip() == f"export_mission: {line}"
    if "twice" in line:
        return
    name, _, value = texts[0].partition("=")
    given = {name: {"maybe": "maybe", "yes": "yes", "1e3": 1000.0}.get(value) or int(value)}
    search = SearchDefinition(env.rules, env.scenario)
    ways: list[Callable[[], Any]] = [
        lambda: check_options("belief", given),
        lambda: planner_for(search, "belief", **given),
        lambda: play_missions(1, "belief", options=given, **FIELDS),
    ]
    for way in ways:
        with pytest.raises(FieldError, match=f"^{re.escape(line)}$"):
            way()
    campaign = {
        "planners": [{"planner": "belief", "options": given}], "scenarios": [{"grid_size": 6}],
    }  # fmt: skip
    with pytest.raises(FieldError, match=re.escape(line)):
        Campaign.from_dict(campaign)


def sys_exit(code: int) -> None:
    """Leave with this code, as a program does."""
    raise SystemExit(code)


def test_an_option_that_is_given_twice_is_refused() -> None:
    pytest.importorskip("onnxruntime")
    env = env_for("onnx")
    with pytest.raises(FieldError, match="^planner_options must not have model, which is given"):
        planner_with(env, "onnx", ["model=a.onnx"], model="b.onnx")


@pytest.mark.parametrize(
    ("name", "value"),
    [("count", 0), ("count", 1.5), ("threads", 0), ("threads", "two")],
)
def test_missions_refuse_numbers_that_are_not_allowed(name: str, value: Any) -> None:
    given = {"count": 2, "planner": "greedy", name: value}
    with pytest.raises(FieldError, match=f"^{name} must be an integer >= 1"):
        play_missions(**given, **FIELDS)


def test_the_example_of_the_help_is_allowed() -> None:
    help_text = specs(PlannerSettings)["planner_options"].doc
    stated = re.search(r"such as (\S+) for (\w+)", help_text)
    assert stated is not None
    check_options(stated[2], read_options([stated[1]]))
    with pytest.raises(FieldError, match="planner sweep must have track_spacing, length, width, "):
        check_options("sweep", {"heading": 45})
