# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is trained is what flies: the same belief, view and actions in training and in missions."""

from __future__ import annotations

import csv
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.planners.registry import planner_for
from dsse_ros.search.belief.belief import Forecast
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.looks import looks_of
from dsse_ros.world.scenario.scenario import Scenario

torch = pytest.importorskip("torch")

from dsse_ros.training.export import export  # noqa: E402
from dsse_ros.training.lockstep import (  # noqa: E402
    ACTIONS,
    AWAY,
    LIMIT,
    RULES,
    SEARCH,
    Cases,
    Searches,
    random_cases,
)
from dsse_ros.training.networks import Actor  # noqa: E402
from dsse_ros.training.ppo import Learner, Settings, room_for  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
GRID, DRIFTS = 9, 8


def cases_of(count: int, seed: int, grid: int = GRID) -> Cases:
    """Return random searches."""
    return random_cases(count, grid, torch.Generator().manual_seed(seed))


def fields_of(cases: Cases, number: int, grid: int = GRID) -> dict[str, Any]:
    """Return the fields of the scenario of a search."""
    case = cases.at(slice(number, number + 1))
    starts = [tuple(cell) for cell in case.starts[0].tolist() if cell[0] != AWAY]
    sigma_x, sigma_y = case.sigma[0].tolist()
    return {
        "grid_size": grid, "drones_positions": starts, "timestep_limit": LIMIT,
        "person_initial_position": tuple(case.persons[0].tolist()),
        "vector": tuple(case.vectors[0].tolist()), "sigma_x": sigma_x, "sigma_y": sigma_y,
        "dispersion_inc": case.growth.item(),
    }  # fmt: skip


def drawn(searches: Searches, generator: Any) -> Any:
    """Return allowed actions (B, N), often searches."""
    weights = searches.masks().float()
    weights[..., SEARCH] *= 4
    return torch.multinomial(weights.flatten(0, 1), 1, generator=generator).view(
        searches.there.shape
    )


def test_the_belief_and_the_mean_time_are_those_of_the_exact_filter() -> None:
    cases, generator = cases_of(4, seed=3), torch.Generator().manual_seed(1)
    searches = Searches(cases, GRID, DRIFTS)
    beliefs, looks = [], []
    for number in range(len(cases)):
        scenario = Scenario(**fields_of(cases, number))
        forecast = Forecast(scenario, RULES, drift_samples=DRIFTS)
        beliefs.append(forecast.belief())
        looks.append(looks_of(forecast.scenario, RULES))
    for _ in range(40):
        actions = drawn(searches, generator)
        shares = searches.step(actions)
        found = shares.sum(1)
        for number, belief in enumerate(beliefs):
            before, done = belief.pos, []
            for drone in range(int(searches.there[number].sum())):
                cell = tuple(searches.cells[number, drone].tolist())
                done += looks[number].done(drone, int(actions[number, drone]), cell)
            belief.update(done)
            belief.advance()
            p = (belief.pos - before) / (1 - before)
            assert float(found[number]) == pytest.approx(p, abs=1e-5)
            assert float(searches.missing[number]) == pytest.approx(1 - belief.pos, abs=1e-5)
            np.testing.assert_allclose(searches.belief[number], belief.poc(), atol=1e-5)
    assert (searches.missing < 0.9).any()


# PyTorch's exporter warns of the names of axes, and of what it calls itself.
@pytest.mark.filterwarnings("ignore::UserWarning:torch", "ignore::FutureWarning")
def test_the_exported_model_flies_as_the_policy_does_whatever_the_direction_of_the_drift(
    tmp_path: Path,
) -> None:
    torch.manual_seed(4)
    actor = Actor(len(ACTIONS), 16)
    torch.nn.init.normal_(actor.scores.weight)
    learner = Learner(16, Settings(), torch.device("cpu"))
    learner.actor = actor
    path = tmp_path / "policy.onnx"
    export(actor, path, {"actions": ACTIONS, "rules": "v2", "observe": "belief"}, grid=7, drones=2)
    cases = cases_of(1, seed=6, grid=GRID)
    fields = fields_of(cases, 0)
    for turn in range(4):
        env = parallel_env(rules="v2", **turned(fields, turn))
        planner = planner_for(env, "onnx", model=str(path))
        searches = Searches(cases, GRID, 64)
        observations, infos = env.reset(seed=8)
        while env.agents and searches.t < 30:
            cells = [env_cell(observations[agent][0], turn) for agent in env.agents]
            assert cells == searches.cells[0, searches.there[0]].tolist(), (turn, searches.t)
            searches.step(learner.best(searches))
            observations, _, _, _, infos = env.step(planner(observations, infos))
        assert searches.t > 5


def turned(fields: dict[str, Any], turn: int) -> dict[str, Any]:
    """Return a search after quarter turns to the left."""
    if turn == 0:
        return fields
    x, y = fields["vector"]
    column, row = fields["person_initial_position"]
    starts = [(r, GRID - 1 - c) for c, r in fields["drones_positions"]]
    return turned(
        {
            **fields, "vector": (y, -x), "drones_positions": starts,
            "person_initial_position": (row, GRID - 1 - column),
            "sigma_x": fields["sigma_y"], "sigma_y": fields["sigma_x"],
        },
        turn - 1,
    )  # fmt: skip


def env_cell(position: Any, turn: int) -> list[int]:
    """Return a cell of a turned search where it is before the turns."""
    x, y = (int(axis) for axis in position)
    for _ in range(turn):
        x, y = GRID - 1 - y, x
    return [x, y]


def test_the_policy_learns_to_find_sooner() -> None:
    torch.manual_seed(2)
    cpu = torch.device("cpu")
    learner = Learner(32, Settings(worlds=24, batches=4, rate=2e-3), cpu)
    rollouts, generator = room_for(24, 4, cpu), torch.Generator().manual_seed(5)
    means = []
    for _ in range(12):
        learner.fly(Searches(random_cases(24, 8, generator), 8, 4), rollouts, slice(None))
        means.append(float(rollouts.missing.sum(0).mean()))
        figures = learner.learn(rollouts, left=1.0, shared=0.5)
        assert all(np.isfinite(value) for value in figures.values())
    assert np.mean(means[-3:]) < 0.7 * np.mean(means[:3])


def test_the_example_goes_on_from_its_checkpoint_after_an_interrupt(tmp_path: Path) -> None:
    command = [
        sys.executable, ROOT / "examples/train.py", "--out", tmp_path, "--check-every=0",
        "--worlds=8", "--width=16", "--device=cpu",
    ]  # fmt: skip
    with subprocess.Popen([*command, "--seconds=1e9"]) as first:
        try:
            while not (tmp_path / "best.pt").is_file():
                assert first.poll() is None
                time.sleep(0.5)
            first.send_signal(signal.SIGINT)
            assert first.wait(300) == 0
        finally:
            first.kill()
    done = read(tmp_path / "curve.csv")
    assert (tmp_path / "best.onnx").is_file()
    more = float(done[-1]["seconds"]) + 1
    again = subprocess.run(
        [*command, f"--seconds={more}"], capture_output=True, text=True, timeout=600
    )
    assert again.returncode == 0, again.stderr
    assert f"going on from {tmp_path / 'checkpoint.pt'}" in again.stdout
    curve = read(tmp_path / "curve.csv")
    assert curve[: len(done)] == done and len(curve) > len(done)


def read(curve: Path) -> list[dict[str, str]]:
    with curve.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))
