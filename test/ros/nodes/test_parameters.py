# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters: what describes them, and what happens to those that change."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import OccupancyGrid
from rcl_interfaces.msg import ParameterType
from rig import LATCHED, Rig, Sim
from rig import occupancy as cells_of

from dsse_ros.base.fields import FieldError, Spec, specs
from dsse_ros.ros.nodes.settings import (
    RUN_TIME_SETTINGS,
    SIM_PARAMETERS,
    PlannerSettings,
    SimSettings,
    without_effect,
)
from dsse_ros.ros.runtime.parameters import descriptor, from_ros, to_ros
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

ROOT = Path(__file__).resolve().parents[3]
of_any_field = pytest.mark.parametrize("name", sorted(SIM_PARAMETERS))

numbers = st.floats(-1e5, 1e5)
cell = st.tuples(st.integers(0, 99), st.integers(0, 99))
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "int": st.integers(-(2**62), 2**62),
    "float": numbers,
    "str": st.text(st.characters(exclude_categories=["Cc", "Cs"]), max_size=20),
    "vector": st.tuples(numbers, numbers),
    "floats": st.lists(numbers, max_size=5).map(tuple),
    "cell": cell,
    "cells": st.lists(cell, min_size=1, max_size=5).map(tuple),
    "names": st.lists(st.text(max_size=5), max_size=5).map(tuple),
}


@given(st.data(), st.sampled_from(sorted(VALUES)))
def test_a_value_survives_the_way_through_a_parameter(data: st.DataObject, kind: Any) -> None:
    spec = Spec(kind, "Any.")
    value = data.draw(VALUES[kind])
    assert spec.check("field", from_ros(spec, to_ros(spec, value))) == value


@of_any_field
def test_the_range_of_a_descriptor_is_what_the_field_allows(name: str) -> None:
    spec = SIM_PARAMETERS[name]
    described = descriptor(name, spec, read_only=True)
    ranges = [*described.integer_range, *described.floating_point_range]
    largest = {"int": 2**62, "float": sys.float_info.max}.get(spec.kind)
    bounds = (spec.low, spec.above, spec.high)
    if largest is None or not any(map(math.isfinite, bounds)):
        assert ranges == []
        if largest is not None:
            assert {spec.check(name, largest), spec.check(name, -largest)} == {largest, -largest}
        return
    (limits,) = ranges
    assert len(described.integer_range) == (spec.kind == "int")

    def allowed(value: Any) -> bool:
        try:
            return bool(spec.check(name, value) == value)
        except FieldError:
            return False

    def beyond(value: Any, towards: float) -> Any:
        if spec.kind == "int":
            return value + int(math.copysign(1, towards))
        return math.nextafter(value, towards)

    # The range of ROS includes its ends; it cannot express "greater than 0".
    first = limits.from_value
    if first == spec.above:
        assert not allowed(first)
        first = beyond(first, math.inf)
    assert allowed(first) and allowed(limits.to_value)
    for end, open_end, towards in (
        (limits.from_value, max(spec.low, spec.above) == -math.inf, -math.inf),
        (limits.to_value, spec.high == math.inf, math.inf),
    ):
        if open_end:
            assert end == math.copysign(largest, towards)
        else:
            assert not allowed(beyond(end, towards))


@pytest.fixture(scope="module")
def node(rig: Rig) -> Sim:
    return rig.sim(
        {
            "num_drones": 2,
            "seed": 3,
            "sigma": 2.0,
            "vector": [0.0, 0.0],
            "drones_positions": [0, 0, 1, 0],
            "grid_size": 9,
        }
    )


@pytest.fixture
def sim(node: Sim) -> Iterator[Sim]:
    yield node


def test_every_field_is_a_parameter_with_a_sentence_and_a_type(sim: Sim) -> None:
    described = sim.parameters()
    assert set(described) >= set(SIM_PARAMETERS)
    of_rclpy = {"use_sim_time", "start_type_description_service"}
    assert set(described) - set(SIM_PARAMETERS) - of_rclpy == set()
    for name, spec in SIM_PARAMETERS.items():
        made = described[name]
        assert made.type != ParameterType.PARAMETER_NOT_SET, name
        assert made.description.strip().endswith("."), name
        assert made.additional_constraints, name
        if spec.unit:
            assert f"Unit: {spec.unit}." in made.description
        assert made.read_only == (name not in RUN_TIME_SETTINGS), name


def test_the_planner_describes_its_parameters_too() -> None:
    for name, spec in specs(PlannerSettings).items():
        assert descriptor(name, spec, read_only=True).description.endswith(".")


def test_the_values_are_those_in_force(sim: Sim) -> None:
    names = ["num_drones", "grid_size", "drones_positions", "vector", "cell_size", "sigma_x"]
    count, grid, positions, vector, cell_size, sigma_x = sim.get(*map("scenario.{}".format, names))
    assert (count, list(grid)) == (2, [9, 9])
    assert list(positions) == [0, 0, 1, 0]
    assert list(vector) == [0.0, 0.0]
    assert (cell_size, sigma_x) == (130.0, 2.0)


def test_all_values_can_be_asked_for_at_once(sim: Sim) -> None:
    names = sorted(SIM_PARAMETERS)
    values = dict(zip(names, sim.get(*names), strict=True))
    assert None not in values.values()
    assert values["scenario.zone_size"] == [9 * 130.0, 9 * 130.0]
    assert values["scenario.current_speed"] == 0.0
    for name, spec in SIM_PARAMETERS.items():
        spec.check(name, from_ros(spec, values[name]))


def test_a_node_started_with_all_values_of_another_is_its_twin(rig: Rig, sim: Sim) -> None:
    names = sorted(SIM_PARAMETERS)
    values = dict(zip(names, sim.get(*names), strict=True))
    plain = {
        k: v if isinstance(v, str | bool | int | float) else list(v) for k, v in values.items()
    }
    twin = rig.sim({k: v for k, v in plain.items() if v != []}, namespace="/twin")
    assert dict(zip(names, twin.get(*names), strict=True)) == values
    assert twin.cells == sim.cells


def test_what_no_current_can_be_is_unset_and_spoils_no_answer(rig: Rig) -> None:
    # 9000 m/s: cells per step may be more than any current makes.
    sim = rig.sim({"vector": [9.0, 0.0], "drone_speed": 1000.0}, namespace="/fast")
    assert sim.get("scenario.num_drones", "scenario.current_speed", "scenario.current_toward") == [
        1,
        None,
        90.0,
    ]
    assert set(sim.parameters()) >= set(SIM_PARAMETERS)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("step_mode", "sometimes"),
        ("missing_action", ""),
        ("grid_scaling", "sqrt"),
        ("command_timeout", -1.0),
        ("command_timeout", float("nan")),
        ("command_timeout", float("inf")),
        ("real_time_factor", 0.0),
        ("seed", -2),
        ("odom_rate", 0.0),
        ("auto_reset", 1),
        ("step_rate", "fast"),
    ],
)
def test_a_refused_change_names_its_reason_and_the_old_value_stays(
    sim: Sim, name: str, value: Any
) -> None:
    before = sim.get(name)
    (result,) = sim.try_set(**{name: value})
    assert not result.successful
    assert name in result.reason or "type" in result.reason
    assert sim.get(name) == before


def test_of_changes_that_belong_together_all_are_refused_if_one_is(sim: Sim) -> None:
    before = sim.get("seed", "missing_action")
    result = sim.try_set_together(seed=9, missing_action="panic")
    assert not result.successful and "missing_action" in result.reason
    assert sim.get("seed", "missing_action") == before
    assert sim.try_set_together(seed=9, missing_action="hold").successful
    assert sim.get("seed", "missing_action") == [9, "hold"]


@pytest.mark.parametrize(
    ("name", "value"),
    [("scenario.num_drones", 3), ("scenario.vector", [1.0, 1.0]), ("rules.profile", "paper"),
     ("rules.collision", -5.0), ("scenario.file", "santos"),
     ("map_frame", "sea"), ("record_file", "x.csv"), ("scenario.origin_lat", 3.0)],
)  # fmt: skip
def test_what_cannot_change_at_run_time_is_read_only(sim: Sim, name: str, value: Any) -> None:
    before = sim.get(name)
    (result,) = sim.try_set(**{name: value})
    assert not result.successful and "read-only" in result.reason
    assert sim.get(name) == before


def test_a_setting_without_effect_in_this_mode_is_named_and_no_other_is(sim: Sim) -> None:
    assert without_effect(SimSettings(odom_rate=20.0)) == [
        "odom_rate has no effect with step_mode lockstep, only with realtime"
    ]
    assert without_effect(SimSettings(odom_rate=20.0, step_mode="realtime")) == []
    assert without_effect(SimSettings(command_timeout=2.0)) == without_effect(SimSettings()) == []
    assert without_effect(SimSettings(step_rate=2.0, vehicle_time="followed")) == [
        "step_rate has no effect with vehicle_time followed"
    ]
    before = sim.process.output.count("odom_rate has no effect")
    sim.set(odom_rate=20.0)
    sim.rig.until(
        lambda: sim.process.output.count("odom_rate has no effect") == before + 1, "a warning"
    )
    sim.set(odom_rate=10.0)


def test_an_unknown_parameter_is_refused(sim: Sim) -> None:
    (result,) = sim.try_set(num_dornes=3)
    assert not result.successful and result.reason


def test_a_change_counts_from_then_on(sim: Sim) -> None:
    for name in sorted(RUN_TIME_SETTINGS - {"step_mode"}):
        sim.set(**{name: sim.get(name)[0]})
    # The probability spreads: at first all of it is in one cell, however it is scaled.
    for _ in range(4):
        sim.fly(4, 4)
    with sim.rig.listening(OccupancyGrid, "probability_grid", LATCHED) as grids:
        sim.rig.until(lambda: grids)
        assert cells_of(grids.last).max() == 100
        sim.set(grid_scaling="linear")
        sim.rig.until(lambda: len(grids) == 2)
        assert 0 < cells_of(grids.last).max() < 100
        sim.fly(4, 4)
        sim.rig.until(lambda: len(grids) == 3)
        assert 0 < cells_of(grids.last).max() < 100


SHARED = """
/**:
  ros__parameters:
    scenario.file: {scenario}
    planner: sweep
    resend_period: 0.2
    speed: 5.0
    nobody: [1, 2]
    controller: {{gain: 1.0}}
    qos_overrides: {{/b/joint_action: {{publisher: {{depth: 20}}}}}}
planner_node:
  ros__parameters:
    seed: 3
"""


def test_one_file_for_all_nodes_stops_none_of_them(rig: Rig) -> None:
    file = rig.folder / "shared.yaml"
    file.write_text(SHARED.format(scenario="santos"))
    planner = rig.start("planner_node", {}, "--params-file", str(file), "-r", "__ns:=/b")
    sim = rig.sim({"step_rate": 0.0}, "--params-file", str(file), namespace="/b")
    rig.until(lambda: not sim.flying, "the end of the mission")
    count, grid = sim.get("scenario.num_drones", "scenario.grid_size")
    assert (count, list(grid)) == (4, [20, 20])
    left = "no parameters of {}, left to other nodes: "
    for process, name, own in (
        (sim.process, "sim_node", "sigma"),
        (planner, "planner_node", "seed"),
    ):
        (line,) = (line for line in process.output.splitlines() if left.format(name) in line)
        assert "nobody" in line and "controller.gain" in line and "speed" in line
        assert own not in line


@pytest.mark.parametrize("name", ["paper_zone", "sitl", "santos.yaml"])
def test_a_scenario_of_the_package_is_known_by_its_name(rig: Rig, name: str) -> None:
    stem = name.removesuffix(".yaml")
    sim = rig.sim({"scenario": name}, namespace=f"/{stem}")
    of_file = Scenario.from_yaml(ROOT / "config" / f"{stem}.yaml").resolve(profile("paper"))
    grid, count = sim.get("scenario.grid_size", "scenario.num_drones")
    assert (tuple(grid), count) == (of_file.grid_size, of_file.num_drones)
