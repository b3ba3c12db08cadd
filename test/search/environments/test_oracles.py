# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Profiles v1 and v2 against what the published packages were seen to do (test/oracles)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.search.environments.world import World
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.targets import person_kernels

DATA = Path(__file__).parents[2] / "oracles" / "data"
CHI_SQUARE_8_DOF = 39.0
"""Exceeded with probability 5e-6; the generators are seeded, so a pass stays a pass."""


def maps_of(version: str) -> list[tuple[dict[str, Any], dict[str, Any], list[int]]]:
    with np.load(DATA / f"{version}_maps.npz") as stored:
        meta = json.loads(str(stored["meta"]))
        arrays = {name: stored[name] for name in stored.files if name != "meta"}
    cases = []
    for i, case in enumerate(meta["cases"]):
        of_case = {k.split("/")[1]: v for k, v in arrays.items() if k.startswith(f"{i:02d}/")}
        cases.append((case, of_case, meta["whole_maps_at"]))
    return cases


def read(name: str, key: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((DATA / name).read_text())[key]
    return found


def world_of(version: str, case: dict[str, Any], **fields: Any) -> World:
    names = (
        "vector", "sigma", "dispersion_inc", "dispersion_start", "person_amount",
        "timestep_limit", "probability_of_detection", "drone_speed",
    )  # fmt: skip
    given = {name: case[name] for name in names if name in case}
    start = case.get("start", case.get("person_initial_position"))
    cell = case.get("grid_cell_size", 130)
    minutes = case.get("pre_search_steps", 0) * cell / case.get("drone_speed", 10) / 60
    scenario = Scenario.from_dict(
        {
            "grid_size": case["grid"],
            "cell_size": cell,
            "person_initial_position": start,
            "pre_search_minutes": minutes,
            **given,
            **fields,
        }
    )
    world = World(scenario, profile(version))
    world.seed(1)
    return world


def idle(world: World) -> None:
    world.step(np.full((1, world.num_drones), NO_ACTION, np.int8))


def probe(p: np.ndarray) -> float:
    row, col = np.indices(p.shape)
    return float((p * (((31 * row + 17 * col) % 101) / 101)).sum())


@pytest.mark.slow
@pytest.mark.parametrize("version, tolerance", [("v1", 1e-7), ("v2", 1e-6)])
def test_maps_are_those_of_the_package(version: str, tolerance: float) -> None:
    for case, stored, whole in maps_of(version):
        world = world_of(version, case)
        world.reset()
        for step in range(60):
            p, state = world.maps[0], world.worlds[0]
            assert (state["datum_x"], state["datum_y"]) == tuple(stored["datum"][step]), (
                case,
                step,
            )
            statistics = stored["statistics"][step]
            q = p.astype(float)
            moments = (q.sum(), q.max(), (q * q).sum())
            assert np.abs(moments - statistics[:3]).max() < 2e-6, (case, step)
            assert abs(probe(q) - statistics[6]) < 2e-6, (case, step)
            assert np.count_nonzero(p) == statistics[8], (case, step)
            if step in whole:
                theirs = stored["maps"][whole.index(step)].astype(np.float32)
                assert np.abs(p - theirs).max() <= tolerance, (case, step)
                assert ((p > 0) == (theirs > 0)).all(), (case, step)
            idle(world)


@pytest.mark.slow
def test_the_datum_of_v2_is_that_of_the_package_in_every_step() -> None:
    with np.load(DATA / "v2_drift.npz") as stored:
        cases, datums = json.loads(str(stored["meta"]))["cases"], stored["datum"]
    assert datums.shape == (300, 101, 2) and len(cases) == 300
    other = []
    for case, theirs in zip(cases, datums.tolist(), strict=True):
        world = world_of("v2", case)
        world.reset()
        ours = []
        for _ in theirs:
            ours.append([int(world.worlds["datum_x"][0]), int(world.worlds["datum_y"][0])])
            idle(world)
        if ours != theirs:
            other.append(case)
    assert other == []


def scripted(version: str, defects: bool = False) -> list[Any]:
    episodes = read(f"{version}_episodes.json", "episodes")
    return [
        pytest.param(episode, id=episode["name"])
        for episode in episodes
        if defects or not episode["name"].startswith("defect_search_off_grid_fails")
    ]


def start(world: World, positions: list[list[int]]) -> None:
    """Put the drones anywhere: the package starts them in one cell, or outside, as well."""
    world.reset()
    for n, (x, y) in enumerate(positions):
        world.drones["x"][0, n], world.drones["y"][0, n] = x, y


def numbers(actions: list[Any]) -> np.ndarray:
    return np.array([[a if a in range(5) else NO_ACTION for a in actions]], np.int8)


@pytest.mark.parametrize("episode", scripted("v1"))
def test_v1_rewards_flags_and_places_are_those_of_the_package(episode: dict[str, Any]) -> None:
    positions = episode["drones_positions"]
    world = world_of("v1", episode, num_drones=len(positions))
    start(world, positions)
    for step in episode["steps"]:
        assert world.worlds["t"][0] == step["t"]
        world.persons["x"], world.persons["y"] = step["person"]
        if "error" in step:
            return
        world.step(numbers(step["actions"]))
        # Searches reward the map's float64 values; their sum runs in another order than ours.
        assert world.rewards[0] == pytest.approx(step["rewards"], rel=1e-13, abs=0), step
        exact = [abs(r) in (1, 100) or abs(r) >= 1e5 for r in step["rewards"]]
        assert (world.rewards[0] == step["rewards"])[exact].all(), step
        assert world.terminated[0].tolist() == step["terminated"], step
        # The package ends nothing. Here a first flag ends all, so everybody has one then.
        truncated, ends = np.array(step["truncated"]), any(step["terminated"] + step["truncated"])
        truncated |= ends & ~np.array(step["terminated"])
        assert world.truncated[0].tolist() == truncated.tolist(), step
        assert bool(world.persons["found"].any()) == step["found"], step
        places = np.stack([world.drones["x"][0], world.drones["y"][0]], axis=1)
        assert places.tolist() == step["positions"], step
        assert world.drones["episode_return"][0] == pytest.approx(
            step["running_sums"], rel=1e-12
        ), step


@pytest.mark.parametrize("episode", scripted("v2"))
def test_v2_rewards_flags_and_places_are_those_of_the_package(episode: dict[str, Any]) -> None:
    options = episode["options"]
    positions = options["drones_positions"]
    world = world_of("v2", episode, num_drones=len(positions))
    world.place(person_pod_multipliers=options.get("person_pod_multipliers"))
    start(world, positions)
    for step in episode["steps"]:
        if "error" in step or not step["rewards"]:
            return
        for i, cell in enumerate(step["persons"]):
            if cell is not None:
                world.persons["x"][0, i], world.persons["y"][0, i] = cell
        world.step(np.array([step["actions"]], np.int8))
        assert world.rewards[0].tolist() == step["rewards"], step
        assert world.terminated[0].tolist() == step["terminated"], step
        assert world.truncated[0].tolist() == step["truncated"], step
        assert bool(world.persons["found"].all()) == any(step["found"]), step
        places = np.stack([world.drones["x"][0], world.drones["y"][0]], axis=1)
        assert places.tolist() == step["positions"], step


def chi_square(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Return the two-sample statistic; cells that neither reached do not count."""
    ours, theirs = ours.ravel().astype(float), theirs.ravel().astype(float)
    reached = ours + theirs > 0
    k = np.sqrt(theirs.sum() / ours.sum())
    terms = (k * ours - theirs / k) ** 2 / np.where(reached, ours + theirs, 1)
    return float(terms[reached].sum())


def single_moves(version: str) -> list[Any]:
    situations = read(f"{version}_person.json", "situations")
    return [pytest.param(s, id=s["name"]) for s in situations if "person" in s]


@pytest.mark.slow
@pytest.mark.parametrize(
    "version, situation",
    [
        pytest.param(version, param.values[0], id=f"{version}-{param.id}")
        for version in ("v1", "v2")
        for param in single_moves(version)
    ],
)
def test_a_person_moves_as_often_where_as_in_the_package(
    version: str, situation: dict[str, Any]
) -> None:
    world = world_of(version, situation)
    world.reset()
    for _ in range(situation["map_index"]):
        idle(world)
    assert np.abs(world.maps[0] - np.array(situation["map"])).max() < 1e-6
    person = world.persons[0, 0]
    counts = np.zeros((3, 3), int)
    x, y = situation["person"]
    for _ in range(situation["draws"]):
        person["x"], person["y"], person["found"] = x, y, False
        if version == "v2":
            person["remainder_x"], person["remainder_y"] = situation["accumulator"]
            person["drift_x"], person["drift_y"] = situation["increment"]
        sea = world.batch.sea._replace(gauss=world.gauss[0], tails=world.tails[0])
        person_kernels.persons_step(world.constants[0], world.worlds[0], sea, world.persons[0])
        counts[person["y"] - y + 1, person["x"] - x + 1] += 1
    if version == "v2":
        after = (person["remainder_x"], person["remainder_y"])
        assert after == pytest.approx(situation["accumulator_after"], abs=1e-12)
    theirs = np.array(situation["counts"])
    assert ((counts > 0) <= (theirs > 0)).all() or counts[theirs == 0].sum() < 20
    assert chi_square(counts, theirs) < CHI_SQUARE_8_DOF


@pytest.mark.slow
@pytest.mark.parametrize("version", ["v1", "v2"])
def test_a_person_left_to_itself_drifts_where_the_package_drifts(version: str) -> None:
    runs = next(s for s in read(f"{version}_person.json", "situations") if s["name"] == "free_runs")
    world = world_of(version, runs)
    theirs = np.array(runs["counts"])
    ours = np.zeros_like(theirs)
    for _ in range(runs["draws"]):
        world.reset()
        for _ in range(runs["calls"]):
            idle(world)
        ours[world.persons["y"][0, 0], world.persons["x"][0, 0]] += 1
    # Rare cells go together, so that the statistic is chi-square.
    rare = ours + theirs < 20
    pooled = [np.append(a[~rare], a[rare].sum()) for a in (ours, theirs)]
    cells = len(pooled[0])
    assert chi_square(*pooled) < cells + 5 * np.sqrt(2 * cells)


def test_v2_persons_start_around_the_given_cell_as_in_the_package() -> None:
    places = next(s for s in read("v2_person.json", "situations") if s["name"] == "places")
    theirs = np.array(places["counts"])
    world = world_of("v2", {"vector": (0, 0), **places})
    ours = np.zeros_like(theirs)
    for _ in range(places["resets"]):
        world.reset()
        cells = {(int(p["y"]), int(p["x"])) for p in world.persons[0]}
        assert len(cells) == places["person_amount"]
        for cell in cells:
            ours[cell] += 1
    assert ((ours > 0) == (theirs > 0)).all()
    assert chi_square(ours, theirs) < theirs.astype(bool).sum() + 5 * np.sqrt(30)


def test_v2_persons_drift_by_vectors_like_the_packages() -> None:
    drifts = next(s for s in read("v2_person.json", "situations") if s["name"] == "drift_vectors")
    case = {"grid": 12, "start": (6, 6), "vector": drifts["vector"]}
    world = world_of("v2", case, person_amount=25)
    seen = []
    for _ in range(800):
        world.reset()
        increments = world.persons["drift_x"][0] + 1j * world.persons["drift_y"][0]
        # An increment is d |d| / speed.
        seen.append(increments * np.sqrt(10.0 / np.abs(increments)))
    ratio = np.concatenate(seen) / complex(*drifts["vector"])
    counts, *_ = np.histogram2d(
        np.angle(ratio), np.abs(ratio), bins=(24, 12), range=((-np.pi, np.pi), (0, 1.2))
    )
    theirs = np.array(drifts["counts"])
    assert [ratio.real.mean(), ratio.imag.mean()] == pytest.approx(drifts["mean"], abs=0.01)
    assert ((counts > 0) == (theirs > 0)).all()
    cells = np.count_nonzero(theirs)
    assert chi_square(counts, theirs) < cells + 5 * np.sqrt(2 * cells)
