# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A campaign has each mission once, whatever plays it and however often it is killed."""

from __future__ import annotations

import csv
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.cli import campaign as program
from dsse_ros.planners.play import play as steps_of_play
from dsse_ros.planners.registry import planner_for
from dsse_ros.results.campaign.chunks import Results, job, play
from dsse_ros.results.campaign.config import Campaign
from dsse_ros.results.campaign.engines import WorkerError, local, on_ray
from dsse_ros.search.environments.factories import parallel_env

WAIT_S = 180.0


class Deadly(dict[str, Any]):
    """Ends the process that it is sent to."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os._exit, (9,)


SMALL: dict[str, Any] = {
    "planners": ["greedy", {"planner": "random", "planner_seeds": 5}],
    "scenarios": [
        {"name": "a", "grid_size": 8, "num_drones": 3, "sigma": 2, "timestep_limit": 25},
        {"name": "b", "rules": "v2", "grid_size": 9, "num_drones": 2, "timestep_limit": 20},
    ],
    "seed": 40,
    "missions": 23,
    "chunk": 7,
}


def write(folder: Path, values: dict[str, Any], name: str = "small.yaml") -> Path:
    path = folder / name
    # JSON is YAML.
    path.write_text(json.dumps(values))
    return path


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def alone(campaign: Campaign) -> Iterator[tuple[Any, ...]]:
    """Play each mission of a campaign by itself."""
    for case in campaign.cases:
        env = parallel_env(case.scenario, rules=case.rules)
        for entry in campaign.planners:
            for m in range(campaign.settings.missions):
                seed = campaign.settings.seed + m
                dealt = entry.planner_seeds
                planner = planner_for(env, entry.planner, seed=m % dealt if dealt else seed)
                yield (entry.name, case.name, seed, *flown(env, planner, seed))


def flown(env: Any, planner: Any, seed: int) -> tuple[bool, int, float, int]:
    """Play a mission; returns found, steps, path length in metres and collisions."""
    observations, infos = env.reset(seed=seed)
    limit, steps, far, met = env.scenario.timestep_limit, 0, 0.0, 0
    while env.agents and steps < limit:
        live = [env.possible_agents.index(agent) for agent in env.agents]
        before: NDArray[Any] = env.positions[live].copy()
        observations, _, _, _, infos = env.step(planner(observations, infos))
        observations = {agent: observations[agent] for agent in env.agents}
        after = env.positions[live]
        far += float(np.hypot(*(after - before).T).sum())
        met += sum((a == b).all() for i, a in enumerate(after) for b in after[:i])
        steps += 1
    found = bool(env.world.worlds["num_missing"][0] == 0) and not env.agents
    return found, steps if found else limit, far * env.scenario.cell_size, met


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a campaign that two processes have played."""
    folder = tmp_path_factory.mktemp("campaign")
    path = write(folder, {**SMALL, "workers": 2})
    assert program.main([str(path), "--out", str(folder / "out")]) == 0
    return folder / "out"


@pytest.mark.slow
def test_missions_are_what_single_ones_are(finished: Path) -> None:
    table = pq.read_table(finished / "missions.parquet").to_pylist()
    expected = list(alone(Campaign.from_dict(SMALL)))
    assert len(table) == len(expected) == 2 * 2 * 23
    for row, (planner, scenario, seed, found, steps, far, met) in zip(table, expected, strict=True):
        assert (row["planner"], row["scenario"], row["seed"]) == (planner, scenario, seed)
        assert (row["found"], row["steps"], row["collisions"]) == (found, steps, met)
        assert row["path_length_m"] == pytest.approx(far)


def test_the_csv_has_what_the_parquet_has(finished: Path) -> None:
    with (finished / "missions.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    table = pq.read_table(finished / "missions.parquet").to_pylist()
    assert [(r["planner"], int(r["seed"]), float(r["path_length_m"])) for r in rows] == [
        (r["planner"], r["seed"], r["path_length_m"]) for r in table
    ]


@pytest.mark.slow
def test_the_results_do_not_depend_on_the_number_of_workers_or_on_the_chunks(
    finished: Path, tmp_path: Path
) -> None:
    path = write(tmp_path, {**SMALL, "workers": 1, "chunk": 100})
    assert program.main([str(path), "--out", str(tmp_path / "out")]) == 0
    one, two = contents(tmp_path / "out"), contents(finished)
    of_results = [name for name in two if "chunks" not in name and name != "campaign.json"]
    assert {"missions.csv", "summary.csv", "pairs.csv", "report.html"} < set(of_results)
    assert [name for name in of_results if one[name] != two[name]] == []


def test_a_finished_campaign_is_not_played_again(finished: Path) -> None:
    before = contents(finished)
    # An engine that is not there would be refused.
    campaign = Campaign.from_dict({**SMALL, "engine": "ray", "address": "127.0.0.1:1"})
    with Results(finished, campaign) as results:
        program.play(campaign, results)
        results.collect()
    assert contents(finished) == before


def test_another_campaign_in_the_folder_is_refused(
    finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(finished.parent, {**SMALL, "missions": 24}, "other.yaml")
    assert program.main([str(path), "--out", str(finished)]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "belongs to a campaign with different missions;" in line


def test_two_campaigns_do_not_use_a_folder_at_once(tmp_path: Path) -> None:
    campaign = Campaign.from_dict(SMALL)
    with Results(tmp_path, campaign), pytest.raises(FieldError, match="is in use by another"):
        Results(tmp_path, campaign)
    Results(tmp_path, campaign).__exit__()


def test_what_a_kill_has_left_of_a_chunk_is_no_chunk(tmp_path: Path) -> None:
    campaign = Campaign.from_dict(SMALL)
    chunks = campaign.chunks()
    with Results(tmp_path, campaign) as results:
        results.keep(chunks[1], play(job(campaign, chunks[1])))
    (tmp_path / "chunks" / "0000000.parquet.part").write_bytes(b"PAR1")
    with Results(tmp_path, campaign) as results:
        assert results.missing(chunks) == [chunks[0], *chunks[2:]]
    assert not list(tmp_path.rglob("*.part"))


def test_a_damaged_chunk_is_named(tmp_path: Path) -> None:
    campaign = Campaign.from_dict(SMALL)
    with Results(tmp_path, campaign) as results:
        (tmp_path / "chunks" / "0000000.parquet").write_bytes(b"nothing")
        with pytest.raises(FieldError, match="0000000.parquet' is damaged; delete it"):
            results.collect()


@pytest.mark.slow
def test_a_planner_that_fails_is_named_with_the_seeds_of_its_missions() -> None:
    campaign = Campaign.from_dict(SMALL)
    chunk, entry, case, seed = job(campaign, campaign.chunks()[1])
    broken = (chunk, replace(entry, options={"nonsense": 3}), case, seed)
    with pytest.raises(WorkerError, match="'greedy' has failed in 'a', .* 47 to 53: .*nonsense"):
        list(local([broken], campaign.settings))


@pytest.mark.slow
def test_workers_that_are_killed_at_work_and_idle_cost_no_chunk() -> None:
    campaign = Campaign.from_dict({**SMALL, "workers": 2})
    jobs = [job(campaign, chunk) for chunk in campaign.chunks()]
    played = {}
    for number, ((chunk, *_), columns) in enumerate(local(jobs, campaign.settings)):
        played[chunk.number] = columns
        if number in (1, 4):
            for worker in multiprocessing.active_children():
                worker.kill()
    assert not multiprocessing.active_children()
    assert sorted(played) == list(range(len(jobs)))
    for of in jobs:
        expected = play(of)
        for name, values in played[of[0].number].items():
            np.testing.assert_array_equal(values, expected[name])


@pytest.mark.slow
def test_a_chunk_that_kills_its_workers_is_named() -> None:
    campaign = Campaign.from_dict(SMALL)
    chunk, entry, case, seed = job(campaign, campaign.chunks()[0])
    deadly = (chunk, replace(entry, options=Deadly()), case, seed)
    with pytest.raises(WorkerError, match="'greedy' .* 40 to 46: 5 workers have died"):
        list(local([deadly], campaign.settings))


def test_a_cluster_that_is_not_there_gets_one_clear_line() -> None:
    pytest.importorskip("ray")
    campaign = Campaign.from_dict({**SMALL, "engine": "ray", "address": "127.0.0.1:1"})
    jobs = [job(campaign, chunk) for chunk in campaign.chunks()]
    with pytest.raises(FieldError, match="address: no Ray cluster at '127.0.0.1:1'"):
        list(on_ray(jobs, campaign.settings))


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[[], subprocess.Popen[bytes]]]:
    """Start a campaign of 40 chunks as a process in `tmp_path`; it is killed at the end."""
    values = {**SMALL, "scenarios": SMALL["scenarios"][:1], "missions": 200, "chunk": 10}
    values["workers"] = 2
    write(tmp_path, values)
    processes = []

    def start() -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dsse_ros.cli.campaign", "small.yaml", "--out", "out"]
        with (tmp_path / "log").open("wb") as log:
            processes.append(subprocess.Popen(command, cwd=tmp_path, stdout=log, stderr=log))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.wait()


def wait_for(what: Callable[[], Any], process: subprocess.Popen[bytes]) -> Any:
    deadline = time.monotonic() + WAIT_S
    while not (result := what()):
        assert process.poll() is None, "it has ended before"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return result


def children(process: subprocess.Popen[bytes]) -> list[int]:
    """Return the workers of a campaign."""
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    found = [int(pid) for pid in listed]
    return [p for p in found if b"spawn_main" in Path(f"/proc/{p}/cmdline").read_bytes()]


@pytest.mark.slow
def test_killed_workers_and_campaigns_lose_and_repeat_nothing(
    tmp_path: Path, started: Callable[[], subprocess.Popen[bytes]]
) -> None:
    def chunks() -> dict[str, int]:
        return {p.name: p.stat().st_mtime_ns for p in tmp_path.glob("out/chunks/[!.]*.parquet")}

    first = started()
    wait_for(lambda: len(chunks()) > 2, first)
    workers = wait_for(lambda: children(first), first)
    first.kill()
    first.wait()
    kept = chunks()
    # Nothing is left to play on, nor to hold the folder.
    deadline = time.monotonic() + WAIT_S
    while any(Path(f"/proc/{pid}").exists() for pid in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    second = started()
    os.kill(wait_for(lambda: children(second), second)[0], signal.SIGKILL)
    assert second.wait(WAIT_S) == 0, (tmp_path / "log").read_text()
    assert {name: chunks()[name] for name in kept} == kept
    rows = pq.read_table(tmp_path / "out" / "missions.parquet").to_pylist()
    seen = [(row["scenario"], row["planner"], row["seed"]) for row in rows]
    assert seen == [(s, p, m) for s in "a" for p in ("greedy", "random") for m in range(40, 240)]


def test_a_page_and_its_numbers_agree(finished: Path) -> None:
    page = (finished / "report.html").read_text(encoding="utf-8")
    table = pq.read_table(finished / "missions.parquet").to_pylist()
    found = [r["found"] for r in table if (r["scenario"], r["planner"]) == ("a", "greedy")]
    with (finished / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    (stated,) = (
        float(row["value"])
        for row in rows
        if (row["scenario"], row["planner"], row["measure"]) == ("a", "greedy", "found")
    )
    assert stated == pytest.approx(sum(found) / len(found))
    assert f"{stated:.1%}" in page
    assert "http:" not in page.replace("http://www.w3.org", "") and "<script" not in page


def test_missions_in_metres_are_played_too() -> None:
    fields: dict[str, Any] = {
        "rules": "flight", "person_motion": "constant_drift", "grid_size": 14, "particles": 300,
        "num_drones": 2, "sigma": 2.0, "timestep_limit": 15,
    }  # fmt: skip
    campaign = Campaign.from_dict(
        {"planners": ["greedy"], "scenarios": [{"name": "m", **fields}], "seed": 30, "missions": 3}
    )
    (chunk,) = campaign.chunks()
    columns, env = play(job(campaign, chunk)), parallel_env(**fields)
    for m in range(3):
        steps = list(steps_of_play(env, planner_for(env, "greedy", seed=30 + m), seed=30 + m))
        found = bool(env.world.worlds["num_missing"][0] == 0)
        assert columns["found"][m] == found
        assert columns["steps"][m] == (len(steps) if found else 15)
