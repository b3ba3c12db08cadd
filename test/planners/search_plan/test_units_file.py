# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A file of units is read as it is stated, or refused in a line."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.search_plan.units_file import UnitFields, read_units
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import ResolvedScenario, Scenario
from dsse_ros.world.sensors.sweep_width import sweep_width_m

BASE = (-24.0, -46.33)
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def kayak() -> ResolvedScenario:
    return Scenario.from_yaml(ROOT / "config" / "kayak.yaml").resolve(profile("flight"))


def test_the_example_has_four_units(kayak: ResolvedScenario) -> None:
    units = [
        fields.unit(kayak, BASE) for fields in read_units(ROOT / "examples" / "kayak_units.yaml")
    ]
    assert [unit.name for unit in units] == ["drone0", "drone1", "lifeboat", "helicopter"]
    assert [unit.returns for unit in units] == [True, True, False, True]
    assert units[3].patterns == ("PS",)
    assert units[3].on_scene_s == 1200.0
    assert units[2].lateral.sweep_width_m == 370.0


def test_a_platform_has_its_own_sweep_width(kayak: ResolvedScenario) -> None:
    stated = kayak.override(search_object="raft_4_person").resolve(profile("flight"))
    fields = UnitFields(
        name="boat", speed=10, sensor="sweep_width", platform="boat", altitude=4.2672
    )
    wanted = sweep_width_m(
        "raft_4_person", "boat", altitude_m=4.2672, visibility_m=stated.visibility, speed_mps=10,
    )  # fmt: skip
    assert fields.unit(stated, BASE).lateral.sweep_width_m == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "content must be a mapping with units, got []"),
        ("units: []", "units must be a list of 1 to 20 units, got []"),
        ("unit: [{name: a, speed: 1}]", "did you mean units?"),
        ("units: [{name: a}]", "units[0].speed must be given"),
        ("units: [{name: a, speed: 0}]", "units[0].speed must be a finite number >= 0.1"),
        ("units: [{name: a, sped: 10}]", "'sped' is not a field of units[0]; did you mean speed?"),
        (
            "units: [{name: a, speed: 10, patterns: [SS]}]",
            "patterns must be among PS, CS, got 'SS'",
        ),
        (
            "units: [{name: a, speed: 10, sensor: camera, sweep_width: 100}]",
            "sensor must not be given with sweep_width, got 'camera'",
        ),
        (
            "units: [{name: a, speed: 1}, {name: a, speed: 2}]",
            "name must be different for each unit",
        ),
        ("units: [3]", "units[0] must be a mapping, got 3"),
    ],
)
def test_bad_units_are_refused_in_a_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "units.yaml"
    path.write_text(text)
    with pytest.raises(FieldError) as refused:
        read_units(path)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"ready": "2026-01-17T13:00Z"}, "ready must be from 2026-01-17T14:"),
        ({"ready": "noon"}, "ready must be a time like"),
        ({"base": [-46.3, -24.0]}, "base must be at most 500 km from the search"),
        ({"base": [95.0, 0.0]}, "base: latitude must be a finite number >= -85 and <= 85"),
        ({"sensor": "own_cell"}, "sensor must see in passing, got 'own_cell'"),
        (
            {"sensor": "sweep_width", "altitude": 9000},
            "sensor: sweep_width: altitude must be from 0",
        ),
    ],
)
def test_what_does_not_fit_the_search_is_refused(
    kayak: ResolvedScenario, fields: dict[str, object], message: str
) -> None:
    with pytest.raises(FieldError, match=message.replace("(", r"\(")):
        UnitFields(name="a", speed=10, **fields).unit(kayak, BASE)  # type: ignore[arg-type]


def test_a_unit_without_limits_searches_until_the_time_limit(kayak: ResolvedScenario) -> None:
    unit = UnitFields(name="a", speed=10).unit(kayak, BASE)
    assert unit.until_s == pytest.approx(180 * 13.0)
    assert unit.endurance_s == unit.on_scene_s == math.inf
    assert not unit.returns
