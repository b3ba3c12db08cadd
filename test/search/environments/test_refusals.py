# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whatever is given, it is accepted or refused in one line that says what is allowed."""

from __future__ import annotations

import datetime
import decimal
import fractions
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from gymnasium.error import ResetNeeded
from hypothesis import example, given, settings
from hypothesis import strategies as st
from play import started

from dsse_ros.base.fields import FieldError, specs
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.rules import PROFILES, Rules, profile
from dsse_ros.world.scenario.scenario import Scenario

PAPER = profile("paper")
SCENARIO_FIELDS = list(specs(Scenario))
RULE_FIELDS = list(specs(Rules))

scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.integers(-3, 30)
    | st.floats()
    | st.floats(0, 2)
    | st.text(max_size=8)
    | st.binary(max_size=4)
    | st.complex_numbers()
    | st.fractions()
    | st.sampled_from(
        [
            5e-324,
            1e-200,
            1e-9,
            1.7e308,
            math.nan,
            math.inf,
            10**400,
            fractions.Fraction(10**400),
            decimal.Decimal("NaN"),
            decimal.Decimal(3),
            np.float32(2),
            np.float64("nan"),
            np.int64(3),
            np.uint64(2**64 - 1),
            np.bool_(True),
            np.datetime64("2020-01-01"),
            datetime.date(2020, 1, 1),
            object(),
            int,
            len,
            "a\nb\u2028c",
            "x" * 300,
        ]
    )
)
junk = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text(max_size=3), inner, max_size=2)
        | st.integers(0, 12).map(np.zeros)
        | st.just(np.zeros((2, 2)))
        | st.integers(0, 3).map(range)
    ),
    max_leaves=5,
)

numbers = st.floats(allow_nan=False, allow_infinity=False)
near = st.floats(1e-3, 1e4)
plausible: dict[str, st.SearchStrategy[Any]] = {
    "grid_size": st.integers(1, 30) | st.tuples(st.integers(1, 30), st.integers(1, 30)),
    "zone_size": numbers.map(abs) | near,
    "cell_size": numbers.map(abs) | near,
    "altitude": numbers.map(abs) | near,
    "field_of_view": st.floats(0, 175),
    "drone_speed": numbers.map(abs) | near,
    "num_drones": st.integers(1, 40),
    "drones_positions": st.lists(st.tuples(st.integers(-1, 12), st.integers(-1, 12)), max_size=4),
    "vector": st.tuples(numbers, numbers) | st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    "current_speed": st.floats(0, 100),
    "current_toward": st.floats(-360, 360),
    "person_initial_position": st.tuples(st.integers(-1, 12), st.integers(-1, 12)),
    "person_amount": st.integers(1, 20),
    "sigma": numbers.map(abs) | near,
    "sigma_x": numbers.map(abs) | near,
    "sigma_y": numbers.map(abs) | near,
    "dispersion_inc": numbers.map(abs) | st.floats(0, 3),
    "probability_of_detection": st.floats(0, 1),
    "pre_search_minutes": numbers.map(abs) | st.floats(0, 20),
    "timestep_limit": st.integers(1, 10**9),
}


def refusal(attempt: Any) -> str | None:
    """Run; return the one line of a refusal, or None if there is none."""
    try:
        attempt()
    except FieldError as error:
        assert isinstance(error, ValueError)
        text = str(error)
        assert len(text.splitlines()) == 1, text
        # The longest line lists every field there is.
        assert 10 < len(text) < 1600, text
        return text
    return None


def try_out(scenario: Scenario) -> None:
    """Play a little, if that is cheap."""
    plain = scenario.resolve(PAPER)
    cheap = plain.grid_size.longer <= 30 and (plain.num_drones or 0) <= 100
    if not cheap or plain.person_amount > 100 or plain.pre_search_steps > 2000:
        return
    env = parallel_env(scenario)
    env.reset(seed=0)
    for _ in range(4):
        env.step(dict.fromkeys(env.agents, 4))
        total = float(env.probability.sum(dtype=np.float64))
        assert math.isfinite(total) and abs(total - 1) <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("field", SCENARIO_FIELDS)
@settings(deadline=None, max_examples=40)
@given(value=junk)
@example(value=5e-324)
@example(value=1e-200)
@example(value=1e-9)
def test_any_value_of_a_scenario_s_field_is_accepted_or_refused(field: str, value: Any) -> None:
    message = refusal(lambda: try_out(Scenario(**{field: value})))
    if message is not None and field != "name":
        assert field in message or field in ("altitude", "field_of_view", "current_speed"), message


@pytest.mark.slow
@pytest.mark.parametrize("field", RULE_FIELDS)
@settings(deadline=None, max_examples=25)
@given(value=junk)
def test_any_value_of_a_rule_is_accepted_or_refused(field: str, value: Any) -> None:
    message = refusal(lambda: profile("paper", **{field: value}))
    if message is not None:
        assert field in message
    assert (refusal(lambda: PAPER.override(**{field: value})) is None) == (message is None)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(st.fixed_dictionaries({}, optional=plausible))
@example({"altitude": 1e-9, "zone_size": 1000.0})
@example({"cell_size": 5e-324, "zone_size": 1000.0})
@example({"cell_size": 5e-324, "drone_speed": 1000.0})
@example({"cell_size": 1e-300, "pre_search_minutes": 1.0})
@example({"drone_speed": 5e-324, "current_speed": 1.0, "current_toward": 0.0})
@example({"sigma_x": 1e-170, "sigma_y": 1e300})
@example({"dispersion_inc": 1.7e308})
def test_fields_that_are_sound_alone_are_accepted_or_refused_together(
    fields: dict[str, Any],
) -> None:
    refusal(lambda: try_out(Scenario(**fields)))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"num_drones": 0}, ("num_drones", "0", ">= 1")),
        ({"num_drones": 65}, ("num_drones", "65", "64")),
        ({"num_drones": 2.0}, ("num_drones", "2.0", "integer")),
        ({"num_drones": True}, ("num_drones", "True", "integer")),
        ({"grid_size": 0}, ("grid_size", "0", ">= 1")),
        ({"grid_size": "8"}, ("grid_size", "'8'", "integer")),
        ({"vector": (math.nan, 0)}, ("vector", "nan", "finite")),
        ({"vector": (1,)}, ("vector", "(1,)", "two")),
        ({"sigma": 0}, ("sigma", "0", "number", "cells")),
        ({"sigma": -1.0}, ("sigma", "-1.0", "number")),
        ({"person_initial_position": (9, 9)}, ("person_initial_position", "9, 9", "7")),
        ({"person_initial_position": (1.0, 1)}, ("person_initial_position", "1.0", "integer")),
        ({"person_amount": 0}, ("person_amount", "0", ">= 1")),
        ({"probability_of_detection": 1.1}, ("probability_of_detection", "1.1", "<= 1")),
        ({"timestep_limit": 0}, ("timestep_limit", "0", ">= 1")),
        ({"origin_lat": 91}, ("origin_lat", "91", "<= 90", "deg")),
        ({"drone_speed": 0}, ("drone_speed", "0", "number", "m/s")),
        ({"render_mode": "ascii"}, ("render_mode", "'ascii'", "ansi")),
        ({"rules": "v0"}, ("rules", "'v0'", "paper")),
        ({"num_drone": 2}, ("num_drone", "did you mean num_drones?")),
        ({"gird_size": 2}, ("gird_size", "did you mean grid_size?")),
        ({"colision": 2}, ("colision", "did you mean collision?")),
        ({"zzzz": 2}, ("zzzz", "grid_size", "collision")),
    ],
)
def test_a_refusal_names_field_value_and_what_is_allowed(
    fields: dict[str, Any], message: tuple[str, ...]
) -> None:
    text = refusal(lambda: parallel_env(**fields))
    assert text is not None
    for part in message:
        assert part in text


def test_a_number_too_long_to_print_is_refused_everywhere() -> None:
    env = started()
    too_long: Any = 10**5000
    attempts = [
        *(lambda n=name: Scenario(**{n: too_long}) for name in SCENARIO_FIELDS),
        *(lambda n=name: profile("paper", **{n: too_long}) for name in RULE_FIELDS),
        lambda: Scenario.from_dict({too_long: 1}),
        lambda: parallel_env(too_long),
        lambda: parallel_env(rules=too_long),
        lambda: parallel_env(render_mode=too_long),
        lambda: env.step({"drone0": too_long}),
        lambda: env.reset(seed=-too_long),
        lambda: env.reset(options={"vector": (too_long, 0)}),
    ]
    assert all(refusal(attempt) is not None for attempt in attempts)
    # As much as a seed can be.
    env.reset(seed=too_long)


@settings(deadline=None, max_examples=60)
@given(junk)
@example([])
def test_any_rules_render_mode_or_scenario_is_accepted_or_refused(value: Any) -> None:
    for name in ("rules", "render_mode"):
        message = refusal(lambda name=name: parallel_env(**{name: value}))  # type: ignore[misc]
        assert message is None or name in message
    refusal(lambda: parallel_env(value))


@pytest.mark.parametrize("value", ["", "no/such/place.yaml", ".", "a\0b", "x" * 300])
def test_a_path_that_leads_to_no_file_is_refused(value: str) -> None:
    text = refusal(lambda: Scenario.read(value))
    assert text is not None and "scenario" in text


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(junk)
@example(-1)
@example(5)
@example(256)
@example(True)
@example(np.zeros((2, 2)))
@example(np.array([1, 2]))
@example("left")
def test_any_action_is_obeyed_or_refused_with_nothing_changed(value: Any) -> None:
    env = started(drones_positions=[(3, 3), (5, 5)])
    before = env.world.state_bytes()
    message = refusal(lambda: env.step({"drone0": 0, "drone1": value}))
    if message is None:
        assert env.action_space("drone1").contains(int(value))
        assert env.world.worlds["t"][0] == 1
    else:
        assert "drone1" in message and "search" in message
        assert env.world.state_bytes() == before
        assert env.agents == ["drone0", "drone1"]


@pytest.mark.parametrize("rules", [name for name, of in PROFILES.items() if of.actions])
@pytest.mark.parametrize(
    "actions", [{}, {"drone0": 1}, {"drone1": 1}, {"drone_0": 1}, None, 5, [1, 1], "left"]
)
def test_actions_that_are_not_one_per_live_agent_are_refused_with_nothing_changed(
    rules: str, actions: Any
) -> None:
    env = started(rules=rules, drones_positions=[(3, 3), (5, 5)])
    before = env.world.state_bytes()
    text = refusal(lambda: env.step(actions))
    assert text is not None and "actions" in text
    assert env.world.state_bytes() == before


@settings(deadline=None, max_examples=60)
@given(junk)
@example(-1)
@example(True)
@example(np.zeros((2, 2)))
def test_any_seed_is_taken_or_refused_with_nothing_changed(value: Any) -> None:
    env = started()
    before = env.world.state_bytes()
    message = refusal(lambda: env.reset(seed=value))
    if message is not None:
        assert "seed" in message
        assert env.world.state_bytes() == before
    else:
        assert value is None or value >= 0


@pytest.mark.parametrize(
    "name", ["drones_positions", "vector", "person_initial_position", "person_pod_multipliers"]
)
@settings(deadline=None, max_examples=40)
@given(value=junk)
def test_any_reset_option_is_taken_or_refused_with_nothing_changed(name: str, value: Any) -> None:
    env = started()
    before = env.world.state_bytes()
    message = refusal(lambda: env.reset(options={name: value}))
    if message is not None:
        assert name in message
        assert env.world.state_bytes() == before


@pytest.mark.parametrize("options", [[1], 5, "vector", [("vector", (1, 1))]])
def test_reset_options_that_are_no_mapping_are_refused(options: Any) -> None:
    text = refusal(lambda: started().reset(options=options))
    assert text is not None and "options" in text


HOSTILE = {
    "a list": "- 1\n- 2",
    "a number": "5",
    "a word": "santos",
    "an unknown key": "grid_sise: 5",
    "a key that is no text": "5: 5",
    "a key that is a list": "? [1]\n: 2",
    "a day that does not exist": "origin_lat: 2001-99-99",
    "a day": "origin_lat: 2001-01-01",
    "a key that stands twice": "sigma: 1.0\nsigma: 2.0",
    "a key that stands twice, once in quotes": "sigma: 1.0\n'sigma': 1.0",
    "a key twice further down": "vector: {x: 1, x: 2}",
    "an alias": "sigma_x: &a 2.0\nsigma_y: *a",
    "a merge": "<<: {sigma: 2.0}",
    "a tag that does not fit": "sigma: !!int wide",
    "a time": "grid_size: !!timestamp noon",
    "a number with a gap": "grid_size: 1_0",
    "minutes and seconds": "grid_size: 0:20",
    "yes for true": "grid_size: yes",
    "a number of 5000 digits": "grid_size: " + "9" * 5000,
    "a key of 5000 digits": "9" * 5000 + ": 5",
    "deep nesting": "[" * 1000,
    "a list in itself": "drones_positions: &a [*a]",
    "an object": "grid_size: !!python/object/apply:os.getcwd []",
    "no YAML": "grid_size: [1",
    "a tab": "\tgrid_size: 5",
    "a control character": "name: \x00",
    "two documents": "grid_size: 5\n---\ngrid_size: 6",
    "not a number": "vector: [.nan, 0]",
    "infinity": "sigma: .inf",
    "a text for a number": "sigma: wide",
}


@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE)
def test_a_file_that_makes_no_sense_is_refused_with_its_path(content: str, tmp_path: Path) -> None:
    path = tmp_path / "place.yaml"
    path.write_bytes(content.encode())
    text = refusal(lambda: Scenario.from_yaml(path))
    assert text is not None and str(path) in text


@pytest.mark.parametrize("brackets", ["[", "{a: ", "- ", "? "])
def test_deep_nesting_is_refused_without_being_read_to_its_end(
    brackets: str, tmp_path: Path
) -> None:
    path = tmp_path / "place.yaml"
    path.write_text(brackets * 100_000)
    text = refusal(lambda: Scenario.from_yaml(path))
    assert text is not None and "line 1: levels must be at most 8" in text


def test_aliases_are_refused_and_not_expanded(tmp_path: Path) -> None:
    path = tmp_path / "place.yaml"
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 20)]
    path.write_text("\n".join(lines))
    text = refusal(lambda: Scenario.from_yaml(path))
    assert text is not None and "line 2: value must be written out, got an alias" in text


def test_a_key_that_stands_twice_is_refused_with_both_lines(tmp_path: Path) -> None:
    path = tmp_path / "place.yaml"
    path.write_text("name: Here\nsigma: 1.0\n\nsigma: 2.0\n")
    text = refusal(lambda: Scenario.from_yaml(path))
    assert text is not None and "'sigma' is given twice: line 2 and line 4" in text


def test_an_endless_file_is_refused() -> None:
    text = refusal(lambda: Scenario.from_yaml("/dev/zero"))
    assert text is not None and "bytes" in text


def test_a_path_that_cannot_be_is_refused() -> None:
    text = refusal(lambda: Scenario.from_yaml("no\0where"))
    assert text is not None and "\n" not in text


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "picture.yaml"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    text = refusal(lambda: Scenario.from_yaml(path))
    assert text is not None and str(path) in text


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(
    st.text(max_size=60)
    | st.dictionaries(
        st.sampled_from(SCENARIO_FIELDS),
        st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.dates(),
        max_size=3,
    ).map(yaml.safe_dump)
)
def test_any_file_is_accepted_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.yaml"
    path.write_text(content, encoding="utf-8", errors="surrogatepass")
    refusal(lambda: Scenario.from_yaml(path))


@pytest.mark.parametrize("rules", ["paper", "v2", "sea", "coverage"])
def test_true_is_no_action(rules: str) -> None:
    env = parallel_env(rules=rules, grid_size=6, num_drones=2)
    env.reset(seed=1)
    for value in (True, False, np.True_, 1.0):
        text = refusal(lambda value=value: env.step({"drone0": value, "drone1": 0}))
        assert text is not None and text.startswith("action of drone0 must be one of 0 left, ")


def test_true_is_no_turn_and_no_speed() -> None:
    env = parallel_env(rules="flight", grid_size=6, num_drones=1)
    env.reset(seed=1)
    text = refusal(lambda: env.step({"drone0": [True, False]}))
    assert text is not None and text.startswith("action of drone0 must be two numbers")


@pytest.mark.parametrize("rules", ["paper", "flight"])
def test_before_the_first_reset_there_is_nothing_to_step_to_see_or_to_read(rules: str) -> None:
    env = parallel_env(rules=rules, grid_size=6, num_drones=1, render_mode="ansi")
    for attempt in (lambda: env.step({}), env.render, env.state):
        with pytest.raises(ResetNeeded, match="must be called first"):
            attempt()
    env.reset(seed=1)
    assert env.render() and env.state().any()
