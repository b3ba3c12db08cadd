# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a script sets on an environment acts as on DSSE 1.1.9, or is refused (test/oracles)."""

from __future__ import annotations

import gzip
import json
import re
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.compat import CoverageDroneSwarmSearch, DroneSwarmSearch

ORACLES = Path(__file__).parent.parent / "oracles"
sys.path.append(str(ORACLES))
from oracle_attributes import (  # noqa: E402
    COVERAGE,
    JOINT,
    MATRIX,
    SEARCH,
    STARTS,
    TASKS,
    attributes,
    play,
    scripts,
)

RECORDED: list[dict[str, Any]] = json.loads(
    gzip.decompress((ORACLES / "data" / "v2_attributes.json.gz").read_bytes())
)["scripts"]
EPISODES = RECORDED[2:]

READ_ONLY = r"AttributeError: property '\w+' of '\w+' object has no setter"
REFUSED: dict[str, tuple[set[str], str]] = {
    # Inner state of the package, of which there is another one here.
    "env.pygame_renderer =": ({"made", "reset", "flying"}, READ_ONLY),
    "env.probability_matrix =": ({"made", "reset", "flying"}, READ_ONLY),
    "env.probability_matrix.spacement": ({"reset", "flying"}, READ_ONLY),
    "env.probability_matrix.amplitude": ({"reset", "flying"}, READ_ONLY),
    "env.probability_matrix.map": ({"reset", "flying"}, READ_ONLY),
    "env.probability_matrix.probability_map": ({"made", "reset", "flying"}, READ_ONLY),
    "env.probability_matrix.original_map": ({"made", "reset", "flying"}, READ_ONLY),
    "env.probability_matrix.get_matrix()[": (
        {"made", "reset", "flying"}, "ValueError: assignment destination is read-only",
    ),
    "env.seen_states =": ({"made", "reset", "flying"}, READ_ONLY),
    "env.not_seen_states =": ({"made", "reset", "flying"}, READ_ONLY),
    "env.not_seen_states.clear": ({"made", "reset", "flying"}, "AttributeError: .*'clear'"),
    "env.all_states =": ({"made", "reset", "flying"}, READ_ONLY),
    "for person in env.persons_set: person.index": ({"made", "reset", "flying"}, READ_ONLY),
    "for person in env.persons_set: person.grid_size": ({"made", "reset", "flying"}, READ_ONLY),
    # What would leave nothing to search for, or another grid, in the midst of a mission.
    "env.persons_set.clear": ({"reset", "flying"}, "FieldError: persons_set must have one"),
    "env.grid_size = 7": ({"reset", "flying"}, "FieldError: grid_size must be 5 until the next re"),
    "env.disaster_position = (3, 1); env.pre_render_steps": (
        {"made", "reset", "flying"}, "FieldError: disaster_position must be person_initial_positio",
    ),
}  # fmt: skip
"""Statements by their beginning: the stages at which they are refused, and how."""
INNER = {
    "pygame_renderer", "map", "angle_range", "initial_position",
    "max_num_agents", "num_agents", "unwrapped",
}  # fmt: skip
"""Attributes that are missing here, or PettingZoo's own and read-only."""


def refusal_of(episode: dict[str, Any]) -> str:
    for start, (stages, error) in REFUSED.items():
        if episode["code"].startswith(start) and episode["stage"] in stages:
            return error
    return ""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Callable[..., Any]]:
    path = tmp_path_factory.mktemp("coverage") / "matrix.npy"
    np.save(path, np.array(MATRIX))
    coverage = partial(CoverageDroneSwarmSearch, prob_matrix_path=str(path))
    return {"search": DroneSwarmSearch, "coverage": coverage}


def different(episode: dict[str, Any], here: dict[str, Any], number: int) -> list[str]:
    """Return what differs in the outcome of a call."""
    names, there = [], episode["calls"][number]
    # Persons who drift do so at random, but where the script has ended their drift.
    drift = episode["arguments"].get("vector", [0.0, 0.0]) != [0.0, 0.0]
    still = episode["subject"] == "persons who drift" and episode["stage"] == "reset"
    compared = not drift or (still and number <= len(JOINT["search"]))
    for name in here.keys() | there.keys():
        if name == "persons" and not compared:
            continue
        if name == "sums" and any(there.get("terminated", ())):
            # The package adds the reward of the last find to the last drone, if at all.
            continue
        ours, theirs = here.get(name), there.get(name)
        same = ours == theirs
        if name in ("rewards", "map") and ours is not None and theirs is not None:
            same = ours == pytest.approx(theirs, abs=2e-6)
        if name == "infos" and ours:
            same = all(one == pytest.approx(other) for one, other in zip(ours, theirs, strict=True))
        if not same:
            names.append(f"{name}: {ours} here, {theirs} on the package")
    return names


def test_every_script_was_recorded() -> None:
    keys = ("subject", "task", "stage", "code")
    assert [[e[k] for k in keys] for e in EPISODES] == [[s[k] for k in keys] for s in scripts()]


@pytest.mark.slow
@pytest.mark.parametrize("subject", TASKS)
def test_what_a_script_sets_acts_as_on_the_package_or_is_refused_in_a_line(
    subject: str, made: dict[str, Callable[..., Any]]
) -> None:
    failed = []
    for episode in EPISODES:
        if episode["subject"] != subject:
            continue
        calls, theirs = play(episode, made[episode["task"]]), episode["calls"]
        where, refused = f"{episode['stage']}: {episode['code']}", refusal_of(episode)
        errors = [f"{call['error']}: {call['line']}" for call in calls if "error" in call]
        if refused:
            if not any(re.match(refused, error) and "\n" not in error for error in errors):
                failed.append(f"{where}: not refused, {errors}")
            continue
        if any("error" in call for call in theirs):
            # Where the package fails later, it is refused at once.
            if not errors:
                failed.append(f"{where}: no error here")
            continue
        if errors or len(calls) != len(theirs):
            failed.append(f"{where}: {len(calls)} calls and {errors}, {len(theirs)} there")
            continue
        for number, here in enumerate(calls):
            names = different(episode, here, number)
            if names:
                failed.append(f"{where}: call {number}: {names}")
                break
    assert not failed, "\n".join(failed)


@pytest.mark.parametrize("task", ["search", "coverage"])
def test_every_public_attribute_of_the_package_is_set_by_a_script(
    task: str, made: dict[str, Callable[..., Any]]
) -> None:
    there = next(record["attributes"] for record in RECORDED[:2] if record["task"] == task)
    env = made[task](**{"search": SEARCH, "coverage": COVERAGE}[task])
    env.reset(options={"drones_positions": STARTS[task]})
    here = attributes(env)
    codes = " ".join(episode["code"] for episode in EPISODES if episode["task"] == task)
    for part, listed in there.items():
        names = {*listed} - INNER
        if task == "coverage" and part == "probability_matrix":
            # The others are those of the ocean model, which does not run with a matrix.
            names &= {"original_map", "probability_map"}
        assert names <= {*here[part]}, f"{part}: {names - {*here[part]}}"
        unset = {name for name in names if not re.search(rf"\b{name}\b", codes)}
        assert not unset, f"{part}: {unset}"
