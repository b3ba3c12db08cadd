# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What planners receive about the search."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.agents import (
    AgentsInfo,
    agents_from_json,
    agents_json,
    area_rows,
)
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

KAYAK = Path(__file__).resolve().parents[3] / "config" / "kayak.yaml"
CHARACTERS = st.characters(exclude_categories=["Cs"], exclude_characters="\0")
TEXTS = st.text(CHARACTERS, min_size=1, max_size=8)
NAMES = st.lists(TEXTS, min_size=1, max_size=5, unique=True).map(tuple)
NUMBERS = st.floats(-1e5, 1e5)
INFOS = st.builds(
    AgentsInfo,
    agents=st.integers(1, 5).map(lambda n: tuple(f"drone{i}" for i in range(n))),
    actions=NAMES,
    rules=TEXTS,
    seed=st.none() | st.integers(),
    frame=st.builds(
        GridFrame,
        grid_size=st.builds(GridShape, st.integers(1, 10_000), st.integers(1, 10_000)),
        cell_size_m=st.floats(0.001, 1e6),
        origin_lat_deg=st.floats(-90, 90),
        origin_lon_deg=st.floats(-180, 180),
        origin_alt_m=NUMBERS,
        alt_m=NUMBERS,
        map_frame=TEXTS,
        frame_prefix=TEXTS | st.just(""),
    ),
    timestep_limit=st.integers(1, 10**9),
    step_duration_s=NUMBERS,
    mission=st.integers(0, 2**32 - 1),
    run_id=st.integers(1, 2**32 - 1),
    decision_time_s=st.none() | st.floats(1e-6, 1e6),
)
INFO = AgentsInfo(
    agents=("drone0", "drone1"),
    actions=("left", "right", "up", "down", "search"),
    rules="paper",
    seed=None,
    frame=GridFrame(8, 130.0, -24.04, -46.17, 0.0, 120.0),
    timestep_limit=100,
    step_duration_s=13.0,
    mission=1,
    run_id=4_000_000_000,
)


def changed(path, value):
    document = json.loads(agents_json(INFO))
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return json.dumps(document)


@given(INFOS)
def test_the_information_comes_back(info):
    assert agents_from_json(agents_json(info)) == info


@given(INFOS)
def test_the_same_information_gives_the_same_ascii_text(info):
    text = agents_json(info)
    assert text.isascii()
    assert text == agents_json(agents_from_json(text))
    keys = list(json.loads(text))
    assert keys == sorted(keys)


def test_an_area_comes_back_as_its_mask_and_as_its_polygons():
    square = [[-24.035, -46.165], [-24.035, -46.15], [-24.02, -46.15], [-24.02, -46.165]]
    rules = profile("paper")
    stated = Scenario(
        area=square, grid_size=8, cell_size=200, person_initial_position=(4, 4), num_drones=2
    )
    scenario = stated.resolve(rules)
    mask = scenario.area_mask
    area = area_rows(mask)
    info = dataclasses.replace(INFO, area=area, definition=SearchDefinition(rules, scenario))
    heard = agents_from_json(agents_json(info))
    assert heard == info
    np.testing.assert_array_equal(heard.area_mask, mask)
    np.testing.assert_array_equal(heard.definition.scenario.area_mask, mask)
    assert INFO.area_mask is None and area_rows(None) is None


@pytest.mark.parametrize(
    ("field", "values", "rules"),
    [
        ("probability_matrix", np.arange(64.0).reshape(8, 8), profile("coverage")),
        (
            "transition_probabilities",
            np.eye(9)[np.arange(64).reshape(8, 8) % 9],
            profile("paper", person_motion="markov_chain"),
        ),
    ],
)
def test_an_array_comes_back_from_its_file_by_path_and_digest(field, values, rules, tmp_path):
    path = tmp_path / "array.npy"
    np.save(path, values)
    scenario = Scenario(**{field: path}, num_drones=2).resolve(rules)
    message = agents_json(dataclasses.replace(INFO, definition=SearchDefinition(rules, scenario)))
    heard = agents_from_json(message).definition.scenario
    assert heard == scenario
    np.testing.assert_array_equal(getattr(heard, field).values, values)
    sent = json.loads(message)["definition"]["scenario"][field]
    assert sent["path"] == str(path) and len(sent["sha256"]) == 64

    np.save(path, values[::-1])
    with pytest.raises(ValueError, match=rf"^agents.definition: .* '{path}' with the SHA-256"):
        agents_from_json(message)
    path.unlink()
    with pytest.raises(ValueError, match=rf"^agents.definition: .* '{path}': No such file"):
        agents_from_json(message)


def test_an_incident_comes_back_with_its_grid():
    rules = profile("sea")
    scenario = Scenario.from_yaml(KAYAK).resolve(rules)
    info = dataclasses.replace(
        INFO, agents=tuple(f"drone{i}" for i in range(4)), 
        frame=dataclasses.replace(INFO.frame, grid_size=scenario.grid_size),
        definition=SearchDefinition(rules, scenario),
    )  # fmt: skip
    message = agents_json(info)
    heard = agents_from_json(message).definition.scenario
    assert heard == scenario
    sea = json.loads(message)["sea"]
    assert sea["wind"] == pytest.approx({"speed_mps": 6.0, "from_deg": 140.0}, abs=1e-4)
    assert sea["current"] == pytest.approx({"speed_mps": 0.2, "toward_deg": 30.0}, abs=1e-4)
    assert sea["stranded"] == scenario.incident.grid_summary.stranded
    assert sea["poc_outside"] == 1.0 - scenario.incident.grid_summary.inside


def test_a_message_names_no_file_of_an_incident():
    seen = {"lat": 0.0, "lon": 0.0, "time": "2026-01-17"}
    incident = {"object": "PIW-1", "seen": [seen], "search_start": "2026-01-17"}
    message = json.loads(agents_json(INFO))
    for files in ({"wind": {"file": "wind.csv"}}, {"shore": "land.json"}, {"tracks": "drift.nc"}):
        message["definition"] = {"rules": {}, "scenario": {"incident": {**incident, **files}}}
        with pytest.raises(ValueError, match="incident.* an object without files or null"):
            agents_from_json(json.dumps(message))


def test_a_message_names_no_file_to_be_read(tmp_path):
    rules = profile("paper")
    definition = SearchDefinition(rules, Scenario(num_drones=2).resolve(rules))
    document = json.loads(agents_json(dataclasses.replace(INFO, definition=definition)))
    for name, wanted in (
        ("area", "a GeoJSON object"),
        ("probability_matrix", "an object with path"),
        ("transition_probabilities", "an object with path"),
    ):
        message = json.loads(json.dumps(document))
        message["definition"]["scenario"][name] = str(tmp_path / "file")
        with pytest.raises(ValueError, match=rf"^agents.*scenario.{name} must be {wanted}"):
            agents_from_json(json.dumps(message))


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        (
            {"num_drones": 10**8, "drones_positions": None},
            "num_drones must be 2, .* got 100000000",
        ),
        ({"num_drones": 3, "drones_positions": None}, "num_drones must be 2, .* got 3"),
        ({"grid_size": 10_000}, "grid_size must be 8 x 8, .* got 10000 x 10000"),
        ({"grid_size": None, "zone_size": 1e6}, "grid_size must be 8 x 8, .* got 7693 x 7693"),
    ],
)
def test_a_definition_of_another_search_takes_no_memory(fields, line, little_memory):
    rules = profile("paper")
    definition = SearchDefinition(rules, Scenario(num_drones=2).resolve(rules))
    document = json.loads(agents_json(dataclasses.replace(INFO, definition=definition)))
    document["definition"]["scenario"] |= fields
    message = json.dumps(document)
    with little_memory(), pytest.raises(ValueError, match=f"^agents.definition: {line}"):
        agents_from_json(message)


def test_no_grid_is_larger_than_that_of_a_scenario():
    with pytest.raises(ValueError, match=r"^agents.grid_size .* from 1 to 10000, got \[8, 10001\]"):
        agents_from_json(changed(["grid_size"], [8, 10_001]))


def test_the_grid_of_the_information_is_the_simulators():
    assert INFO.frame == GridFrame(8, 130.0, -24.04, -46.17, 0.0, 120.0, "map")


def test_keys_of_later_versions_are_ignored():
    assert agents_from_json(changed(["battery_wh"], 80)) == INFO


REQUIRED = json.loads(agents_json(INFO)).keys() - {"commanded", "speeds_mps"}


@pytest.mark.parametrize("field", sorted(REQUIRED))
def test_a_missing_key_is_named(field):
    document = json.loads(agents_json(INFO))
    del document[field]
    with pytest.raises(ValueError, match=f"^agents.{field}: missing$"):
        agents_from_json(json.dumps(document))


def test_who_does_not_report_whether_drones_were_commanded_does_not_wait_for_that():
    document = json.loads(agents_json(INFO))
    del document["commanded"]
    assert agents_from_json(json.dumps(document)).commanded


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["agents"], []),
        (["agents"], "drone0"),
        (["agents"], ["drone0", "drone0"]),
        (["actions"], [1, 2]),
        (["actions"], [[], []]),
        (["rules"], ""),
        (["decision_time_s"], 0),
        (["decision_time_s"], "1 s"),
        (["speeds_mps"], [10.0]),
        (["speeds_mps"], [10.0, -1]),
        (["speeds_mps"], [10.0, "fast"]),
        (["seed"], 1.5),
        (["seed"], True),
        (["grid_size"], 8),
        (["grid_size"], [8, 0]),
        (["grid_size"], ["8", 8]),
        (["grid_size"], [8, True]),
        (["cell_size_m"], True),
        (["cell_size_m"], 1e301),
        (["timestep_limit"], -1),
        (["mission"], None),
        (["mission"], 2**32),
        (["frame_prefix"], None),
        (["run_id"], 0),
        (["run_id"], 2**32),
        (["origin", "lat_deg"], "south"),
        (["origin"], []),
        (["area"], ["1" * 8]),
        (["area"], ["1" * 8] * 7 + ["1" * 7]),
        (["area"], ["1" * 8] * 7 + ["1" * 7 + "x"]),
        (["area"], [1] * 8),
        (["area"], "1" * 8),
    ],
)
def test_a_value_of_the_wrong_kind_is_refused_by_its_key(path, value):
    with pytest.raises(ValueError, match=f"^agents.{'.'.join(path)} must be .*, got ") as error:
        agents_from_json(changed(path, value))
    assert len(str(error.value)) < 200


@pytest.mark.parametrize(("path", "value"), [(["cell_size_m"], 0), (["origin", "lat_deg"], 91)])
def test_a_grid_that_cannot_be_is_refused(path, value):
    with pytest.raises(ValueError, match=f"^agents: .*{path[-1]} must be "):
        agents_from_json(changed(path, value))


@pytest.mark.parametrize(
    "text",
    ["", "{", "null", "[]", "NaN", '{"agents": NaN}', "[" * 100_000, "1" * 10_000],
    ids=lambda text: text[:20],
)
def test_text_that_is_no_such_document_is_refused_in_one_line(text):
    with pytest.raises(ValueError, match="^agents(: | must be an object)") as error:
        agents_from_json(text)
    assert len(str(error.value)) < 200 and str(error.value).isprintable()


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=3,
)


@pytest.mark.slow
@given(
    st.text()
    | JSON.map(json.dumps)
    | st.fixed_dictionaries(
        {field.name: JSON for field in dataclasses.fields(AgentsInfo)},
    ).map(json.dumps)
)
def test_hostile_text_is_refused_in_one_line(text):
    with pytest.raises(ValueError, match="^agents") as error:
        agents_from_json(text)
    assert str(error.value).isprintable()


@pytest.mark.slow
@given(st.sampled_from([field.name for field in dataclasses.fields(AgentsInfo)]), JSON)
def test_one_hostile_value_is_taken_or_refused_in_one_line(field, value):
    try:
        info = agents_from_json(changed([field], value))
    except ValueError as error:
        assert str(error).startswith("agents") and str(error).isprintable()
    else:
        assert (
            math.isfinite(info.frame.cell_size_m) and min(info.frame.grid_size) >= 1 and info.agents
        )
