# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios in every form, what is derived from what, and the scale of the paper."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import CUSTOM_FIELDS, SPECS, ResolvedScenario, Scenario

PAPER = profile("paper")
CONFIG = Path(__file__).resolve().parents[3] / "config"
FIELDS: dict[str, Any] = {
    "name": "Somewhere",
    "origin_lat": -23.5,
    "origin_lon": -45.0,
    "grid_size": 9,
    "cell_size": 100.0,
    "drones_positions": [[0, 0], [1, 0]],
    "vector": [0.5, -0.25],
    "person_initial_position": [4, 5],
    "person_amount": 2,
    "person_pod_multipliers": [1, 0.5],
    "sigma": 2,
    "timestep_limit": 50,
}


def resolved(**fields: Any) -> ResolvedScenario:
    return Scenario(**fields).resolve(PAPER)


def test_yaml_dict_and_keywords_state_the_same(tmp_path: Path) -> None:
    path = tmp_path / "place.yaml"
    path.write_text(yaml.safe_dump(FIELDS))
    expected = Scenario(**FIELDS)
    assert Scenario.from_yaml(path) == Scenario.from_yaml(str(path)) == expected
    assert Scenario.from_dict(FIELDS) == expected
    for source in (path, str(path), FIELDS, expected):
        assert Scenario.read(source) == expected
        assert parallel_env(source).scenario == expected.resolve(PAPER)
    assert parallel_env(**FIELDS).scenario == expected.resolve(PAPER)
    assert Scenario.read(None) == Scenario() == Scenario.read({})


def test_values_arrive_in_one_canonical_form() -> None:
    scenario = Scenario(**FIELDS)
    assert scenario.drones_positions == ((0, 0), (1, 0))
    assert scenario.vector == (0.5, -0.25)
    assert scenario.sigma == 2.0 and type(scenario.sigma) is float
    assert hash(scenario) == hash(Scenario.from_dict(FIELDS))


def test_an_empty_file_states_the_defaults(tmp_path: Path) -> None:
    path = tmp_path / "empty.yaml"
    path.write_text("# nothing\n")
    assert Scenario.from_yaml(path) == Scenario()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0), ("1E+3", 1000.0), ("1.5e-1", 0.15), (".5", 0.5), ("5.", 5.0), ("7", 7.0),
        ("+2", 2.0), ("0x10", 16.0), ("~", None), ("", None), ("!!float 2", 2.0),
    ],
)  # fmt: skip
def test_numbers_are_those_of_yaml_1_2(text: str, value: float | None, tmp_path: Path) -> None:
    path = tmp_path / "place.yaml"
    path.write_text(f"sigma: {text}")
    assert Scenario.from_yaml(path).sigma == value


@pytest.mark.parametrize("text", ["no", "on", "1:30", "2001-01-01", "1_0", "santos", "'7'"])
def test_what_yaml_1_1_made_of_a_name_stays_a_name(text: str, tmp_path: Path) -> None:
    path = tmp_path / "place.yaml"
    path.write_text(f"name: {text}")
    assert Scenario.from_yaml(path).name == text.strip("'")


@given(
    grid=st.tuples(st.integers(1, 10000), st.integers(1, 10000)),
    cell=st.floats(1e-3, 1e3),
    vector=st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
)
def test_the_other_ways_of_stating_a_thing_may_stand_beside_it_if_they_agree(
    grid: tuple[int, int], cell: float, vector: tuple[float, float]
) -> None:
    scenario = resolved(grid_size=grid, cell_size=cell, vector=vector)
    assume(all(SPECS[k].high >= max(np.atleast_1d(v)) for k, v in scenario.other_ways.items()))
    both = {"grid_size": grid, "cell_size": cell, "vector": vector, **scenario.other_ways}
    assert resolved(**both) == scenario


def test_keywords_override_the_scenario_and_none_leaves_it() -> None:
    env = parallel_env(FIELDS, sigma=5.0, timestep_limit=None, person_initial_position=(1, 1))
    assert env.scenario.sigma_x == env.scenario.sigma_y == 5
    assert env.scenario.timestep_limit == 50
    assert env.scenario.person_initial_position == (1, 1)


def test_an_override_of_one_way_of_stating_a_thing_replaces_the_other() -> None:
    assert parallel_env({"zone_size": 1000.0}, grid_size=5).scenario.grid_size == (5, 5)
    assert parallel_env({"grid_size": 5}, zone_size=1000.0).scenario.grid_size == (8, 8)
    current: dict[str, Any] = {"current_speed": 1.0, "current_toward": 90.0}
    assert parallel_env(current, vector=(0.0, 1.0)).scenario.vector == (0, 1)
    assert parallel_env({"vector": (0.0, 1.0)}, **current).scenario.vector == pytest.approx(
        (0.1, 0)
    )
    assert parallel_env({"drones_positions": [(4, 4)]}, num_drones=3).scenario.num_drones == 3
    assert parallel_env({"num_drones": 3}, drones_positions=[(4, 4)]).scenario.num_drones == 1


def test_a_resolved_scenario_leaves_nothing_open_and_resolves_to_itself() -> None:
    scenario = resolved()
    other_ways = {"zone_size", "current_speed", "current_toward"}
    for field in dataclasses.fields(scenario):
        assert (getattr(scenario, field.name) is None) == (
            field.name in other_ways | {*CUSTOM_FIELDS}
        )
    assert scenario.resolve(PAPER) == scenario
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.sigma = 3.0  # type: ignore[misc]


def test_a_resolved_scenario_stays_as_it_is_under_other_rules() -> None:
    scenario = parallel_env(rules="v2").scenario
    assert parallel_env(scenario, rules="paper").scenario == scenario


def test_a_resolved_scenario_is_overridden_like_any_other() -> None:
    scenario = parallel_env(sigma=2.0, num_drones=2, vector=(1.0, 0.0)).scenario
    changed = parallel_env(scenario, sigma=5.0, num_drones=3, timestep_limit=7).scenario
    assert (
        changed
        == parallel_env(sigma=5.0, num_drones=3, vector=(1.0, 0.0), timestep_limit=7).scenario
    )
    moved = parallel_env(scenario, drones_positions=[[3, 3]], grid_size=5).scenario
    assert (moved.drones_positions, moved.grid_size) == (((3, 3),), (5, 5))


@pytest.mark.parametrize(
    ("stated", "changed"),
    [
        ({}, {"altitude": 60.0}),
        ({}, {"field_of_view": 90.0}),
        ({"zone_size": 1000.0}, {"altitude": 60.0}),
        ({"zone_size": 1000.0}, {"cell_size": 100.0}),
        ({"cell_size": 100.0}, {"altitude": 60.0}),
        ({"current_speed": 1.0, "current_toward": 90.0}, {"drone_speed": 5.0}),
        ({}, {"grid_size": 20}),
        ({"num_drones": 3}, {"grid_size": 2}),
        ({}, {"person_amount": 3}),
        ({"sigma": 2.0}, {"sigma_x": 1.0}),
    ],
)
def test_what_was_derived_is_derived_anew_after_an_override(
    stated: dict[str, Any], changed: dict[str, Any]
) -> None:
    expected = resolved(**stated, **changed)
    scenario = parallel_env(stated).scenario
    assert parallel_env(scenario.override(**changed)).scenario == expected
    assert parallel_env(scenario, **changed).scenario == expected
    assert parallel_env(scenario.resolve(PAPER), **changed).scenario == expected


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sigma", -1.0),
        ("sigma_x", "wide"),
        ("grid_size", 0),
        ("num_drones", 0),
        ("vector", (math.nan, 0)),
        ("timestep_limit", -5),
        ("cell_size", 0),
        ("person_initial_position", (99, 0)),
        ("drones_positions", [(99, 0)]),
    ],
)
def test_a_resolved_scenario_is_checked_like_any_other(field: str, value: Any) -> None:
    scenario = parallel_env().scenario
    attempts = (
        lambda: parallel_env(scenario, **{field: value}),
        lambda: scenario.override(**{field: value}).resolve(PAPER),
    )
    for attempt in attempts:
        with pytest.raises(FieldError, match=field):
            attempt()


def test_the_speed_of_drones_is_stated_as_the_airspeed_that_the_wind_acts_on() -> None:
    assert "Airspeed" in SPECS["drone_speed"].doc
    assert "airspeed is drone_speed" in SPECS["wind_speed"].doc
    assert not [name for name, spec in SPECS.items() if "ground speed" in spec.doc.lower()]


def test_the_paper_s_camera_sees_cells_of_130_m_and_a_kilometre_takes_eight() -> None:
    scenario = resolved(zone_size=1000)
    assert scenario.cell_size == 130
    assert scenario.grid_size == (8, 8)
    assert scenario.grid_size.extent(scenario.cell_size) == (1040, 1040)
    assert scenario.step_duration_s == 13
    assert scenario.cell_size**2 == 16900


@pytest.mark.parametrize(
    ("altitude", "cell", "grid"), [(60, 65, 16), (240, 260, 4), (90, 97.5, 11), (30, 32.5, 31)]
)
def test_other_altitudes_see_other_cells(altitude: float, cell: float, grid: int) -> None:
    scenario = resolved(altitude=altitude, zone_size=1000)
    assert scenario.cell_size == cell
    assert scenario.grid_size == (grid, grid)


@settings(deadline=None)
@given(st.floats(5, 5000), st.floats(1, 150), st.floats(100, 30000), st.floats(1, 50))
def test_cells_follow_the_camera_and_just_cover_the_zone(
    altitude: float, view: float, zone: float, speed: float
) -> None:
    footprint = 2 * altitude * math.tan(math.radians(view / 2))
    assume(footprint > 1 and zone / footprint < 9000)
    scenario = resolved(altitude=altitude, field_of_view=view, zone_size=zone, drone_speed=speed)
    cell, grid = scenario.cell_size, scenario.grid_size.rows
    assert cell == pytest.approx(footprint, abs=1e-3)
    assert grid * cell >= zone * (1 - 1e-6)
    assert grid == 1 or (grid - 1) * cell < zone
    assert scenario.step_duration_s == pytest.approx(cell / speed)


@given(st.integers(1, 60), st.sampled_from([130.0, 65.0, 97.5, 0.1, 33.3]))
def test_a_zone_of_whole_cells_has_that_many(count: int, cell: float) -> None:
    assert resolved(zone_size=count * cell, cell_size=cell).grid_size == (count, count)


def test_a_cell_size_given_is_taken_whatever_the_camera_sees() -> None:
    assert resolved(cell_size=50, zone_size=1000).grid_size == (20, 20)


@pytest.mark.parametrize(
    ("toward", "direction"),
    [(0, (0, -1)), (90, (1, 0)), (180, (0, 1)), (270, (-1, 0)), (-90, (-1, 0))],
)
def test_a_current_flows_towards_its_compass_direction(
    toward: float, direction: tuple[int, int]
) -> None:
    scenario = resolved(current_speed=2, current_toward=toward)
    assert scenario.vector == pytest.approx((0.2 * direction[0], 0.2 * direction[1]), abs=1e-12)


@pytest.mark.slow
@settings(deadline=None)
@given(st.floats(0, 5), st.floats(-360, 360), st.floats(1, 40), st.floats(10, 500))
def test_a_current_drifts_its_way_of_one_step(
    speed: float, toward: float, drone_speed: float, cell: float
) -> None:
    scenario = resolved(
        current_speed=speed, current_toward=toward, drone_speed=drone_speed, cell_size=cell
    )
    metres = speed * scenario.step_duration_s
    x, y = scenario.vector
    assert math.hypot(x, y) * cell == pytest.approx(metres, abs=1e-9)
    assert x * cell == pytest.approx(metres * math.sin(math.radians(toward)), abs=1e-9)
    assert -y * cell == pytest.approx(metres * math.cos(math.radians(toward)), abs=1e-9)


def test_pre_search_minutes_are_whole_steps_of_drift() -> None:
    assert resolved().pre_search_steps == 0
    assert resolved(pre_search_minutes=10).pre_search_steps == round(600 / 13) == 46
    assert resolved(pre_search_minutes=10, drone_speed=26).pre_search_steps == 120


def test_dispersion_start_is_another_name_of_sigma() -> None:
    assert Scenario.from_dict({"dispersion_start": 4}) == Scenario(sigma=4)
    assert parallel_env(dispersion_start=4.0).scenario.sigma_x == 4
    assert parallel_env({"dispersion_start": 4}, sigma=5.0).scenario.sigma_x == 5


def test_the_spread_may_differ_along_the_axes() -> None:
    scenario = resolved(sigma=3, sigma_y=1.5)
    assert (scenario.sigma_x, scenario.sigma_y) == (3, 1.5)


def test_the_person_is_in_the_centre_by_default() -> None:
    assert resolved(grid_size=8).person_initial_position == (4, 4)
    assert resolved(grid_size=7).person_initial_position == (3, 3)
    assert resolved(grid_size=1).person_initial_position == (0, 0)
    assert resolved(person_initial_position=(0, 0)).person_initial_position == (0, 0)


def test_every_cell_may_have_a_drone_and_no_more() -> None:
    assert len(resolved(grid_size=4, num_drones=16).drones_positions) == 16
    with pytest.raises(FieldError, match="num_drones must be at most 16, .* got 17"):
        resolved(grid_size=4, num_drones=17)


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"grid_size": 5, "zone_size": 1000}, ("grid_size", "zone_size")),
        (
            {"vector": (1, 1), "current_speed": 1, "current_toward": 0},
            ("vector", "current_speed"),
        ),
        ({"current_speed": 1}, ("current_speed", "current_toward")),
        ({"current_toward": 1}, ("current_speed", "current_toward")),
        ({"num_drones": 3, "drones_positions": [(0, 0)]}, ("drones_positions", "3")),
        ({"drones_positions": [(1, 1), (1, 1)]}, ("drones_positions",)),
        ({"drones_positions": [(8, 0)]}, ("drones_positions", "[8, 0]", "7")),
        ({"person_initial_position": (0, 8)}, ("person_initial_position", "[0, 8]", "7")),
        ({"person_amount": 2, "person_pod_multipliers": [1]}, ("person_pod_multipliers", "2")),
        ({"sigma": 1, "dispersion_start": 2}, ("sigma", "dispersion_start")),
    ],
)
def test_what_contradicts_itself_is_refused_in_one_line(
    fields: dict[str, Any], named: tuple[str, ...]
) -> None:
    attempts = (
        lambda: Scenario.from_dict(fields).resolve(PAPER),
        lambda: parallel_env(fields),
        lambda: parallel_env(**fields),
    )
    for attempt in attempts:
        with pytest.raises(FieldError) as caught:
            attempt()
        assert len(str(caught.value).splitlines()) == 1
        for name in named:
            assert name in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_place_that_comes_with_the_package_can_be_searched(path: Path) -> None:
    env = parallel_env(path)
    env.reset(seed=0)
    while env.agents:
        env.step(dict.fromkeys(env.agents, 4))
    assert env.scenario.name
    assert env.scenario.step_duration_s == 13


def test_the_paper_s_zone_is_one_of_them() -> None:
    assert parallel_env(CONFIG / "paper_zone.yaml").scenario.grid_size == (8, 8)


def test_off_santos_there_is_a_current_of_realistic_size() -> None:
    scenario = parallel_env(CONFIG / "santos.yaml").scenario
    assert (scenario.origin_lat, scenario.origin_lon) == (-24.04, -46.17)
    speed = math.hypot(*scenario.vector) * scenario.cell_size / scenario.step_duration_s
    assert 0.05 < speed < 1.5


@pytest.mark.parametrize("letter", ["\0", "\x01", "\x1b", "\ufffe", "\ud800"])
def test_a_name_that_xml_cannot_have_is_refused(letter: str) -> None:
    with pytest.raises(ValueError, match="name must be a string without control characters"):
        Scenario(name=f"ctrl {letter} char")
