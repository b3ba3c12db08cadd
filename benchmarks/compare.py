# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make compare`: all planners on the same missions, and how they degrade when they are misled.

Mission m of a case has the same seed with every planner, so the person drifts the same way: the
difference to greedy is a paired one. A mission without a find counts with the time limit.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from math import cos, radians, sin
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import ROOT, incidents, planner_tables, plot
from benchmarks.bench import RESULTS, machine, own_versions
from benchmarks.intervals import LEVEL
from benchmarks.planner_tables import BASELINE
from benchmarks.reference_values import GREEDY, PPO, REINFORCE, SWEEP, Source
from dsse_ros.base.fields import FieldError
from dsse_ros.base.progress_bar import progress, say
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.mission_batches import PlayedMissions
from dsse_ros.planners.planner import Planner, Search
from dsse_ros.planners.registry import load_planner, planner_for
from dsse_ros.results.campaign.estimates import clusters, of_mean, of_share
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario, scenario_and_rules

RESULTS_PAGE = ROOT / "docs" / "results.md"
PAGES = (RESULTS_PAGE, ROOT / "docs" / "drift.md")
CSV = ROOT / "docs" / "planner_results.csv"
SEED = 20_000_000
"""Seed of the first mission; planners are tuned on other seeds."""
PLANNERS = (
    "random", "sweep", "creeping_line", "expanding_square", "spiral", "sector", "greedy",
    "effort_allocation", "route", "belief_greedy", "belief",
)  # fmt: skip
PLANNER_SEEDS = {"belief": 32, "route": 16}
"""Number of shared seeds of slow planners; missions of other planners have their own seeds."""
PARTS = ("cases", "disturbed", "faults", "incidents")


@dataclass(frozen=True)
class Case:
    """A search that planners are compared on.

    Attributes:
        title: For people.
        scenario: The scenario; if `vectors` are drawn, its vector is replaced.
        rules: Profile of the rules.
        published: Published figures.
        vectors: Whether each component of the drift is drawn as `round(U(-.1, .1), 1)`.
        disturbance: The wrong assumption of the planners, a key of `DISTURBANCES`.
    """

    title: str
    scenario: Scenario
    rules: Rules
    published: tuple[Source, ...] = ()
    vectors: bool = False
    disturbance: str = "none"

    def parts(self, count: int) -> Iterator[tuple[Scenario, NDArray[np.int64]]]:
        """Yield the scenarios of `count` missions, each with the numbers of its missions."""
        if not self.vectors:
            yield self.scenario, np.arange(count)
            return
        drawn = np.random.default_rng(SEED).uniform(-0.1, 0.1, (count, 2)).round(1) + 0.0
        for vector in np.unique(drawn, axis=0):
            scenario = self.scenario.override(vector=(float(vector[0]), float(vector[1])))
            yield scenario, np.flatnonzero((drawn == vector).all(axis=1))


def _cases() -> dict[str, Case]:
    v2 = scenario_and_rules(
        rules="v2", grid_size=40, drones_positions=[(20, 0), (20, 39), (0, 20), (39, 20)],
        person_initial_position=(20, 20), dispersion_inc=0.05,
    )  # fmt: skip
    v1 = scenario_and_rules(
        rules="v1", grid_size=20, person_initial_position=(9, 9), sigma=3, timestep_limit=200
    )
    published = dataclasses.replace(GREEDY[0.05][0], name="greedy")
    sweep = dataclasses.replace(SWEEP[0], name="sweep", median_steps=None)
    cases = {
        "v2": Case("v2, grid 40, 4 drones, 100 steps", *v2, (published, PPO)),
        "v1": Case("v1, grid 20, 1 drone, 200 steps", *v1, (sweep, REINFORCE), vectors=True),
    }
    for drones in (1, 2, 4, 8):
        santos = scenario_and_rules(ROOT / "config" / "santos.yaml", num_drones=drones)
        title = f"paper, santos, {drones} drone{'s' * (drones > 1)}, 180 steps"
        cases[f"santos_{drones}"] = Case(title, *santos)
    shore = scenario_and_rules(ROOT / "config" / "santos_shore.yaml")
    title = "paper, santos_shore, 4 drones, POD .8, drift 30 % off"
    cases["shore"] = Case(title, *shore, disturbance="speed")
    return cases


CASES = _cases()


@dataclass(frozen=True)
class Disturbance:
    """A wrong assumption of the planners.

    Attributes:
        title: For people.
        speed: Factor on the drift per step that planners assume.
        turn_deg: Angle by which that drift is turned.
        pod: POD of the world, None for the scenario's.
        known: Whether the planners know it.
        lost_at: Step in which one drone is lost, 0 for never.
    """

    title: str
    speed: float = 1.0
    turn_deg: float = 0.0
    pod: float | None = None
    known: bool = False
    lost_at: int = 0

    def apply(self, scenario: Scenario, rules: Rules) -> tuple[Scenario, Scenario]:
        """Return the scenario of the world, and the one that planners assume."""
        resolved = scenario.resolve(rules)
        lost = (*[0] * (resolved.num_drones - 1), self.lost_at) if self.lost_at else None
        world = scenario.override(probability_of_detection=self.pod, loss_steps=lost)
        x, y = resolved.vector
        # If the drift per step is v times its norm, it grows with the square of v.
        factor = self.speed**0.5 if rules.drift_by_speed else self.speed
        c, s = factor * cos(radians(self.turn_deg)), factor * sin(radians(self.turn_deg))
        misled = self.speed != 1.0 or self.turn_deg != 0.0
        assumed = world if self.known else scenario
        return world, assumed.override(vector=(c * x - s * y, s * x + c * y)) if misled else assumed


DISTURBANCES = {
    "none": Disturbance("nothing"),
    "speed": Disturbance("drift assumed 30 % too fast", speed=1.3),
    "slow": Disturbance("drift assumed 30 % too slow", speed=0.7),
    "direction": Disturbance("drift assumed 30 deg off", turn_deg=30.0),
    "pod": Disturbance("POD .8, assumed 1", pod=0.8),
    "pod_known": Disturbance("POD .8, known", pod=0.8, known=True),
    "lost": Disturbance("one drone lost after step 10", lost_at=11),
}
DISTURBED_CASES = ("v2", "santos_4")

FAULTS: dict[str, tuple[str, dict[str, Any]]] = {
    "none": ("nothing", {}),
    "battery": (
        "batteries of 50 steps, none relieved",
        {"battery_move": 2.0, "battery_reserve": 20.0},
    ),
    "relief": (
        "the same, relieved after 5 steps",
        {"battery_move": 2.0, "battery_reserve": 20.0, "relief_steps": 5},
    ),
    "loss": ("a drone is lost in 2 % of its steps", {"loss_rate": 0.02}),
    "missed": ("20 % of detections missed", {"probability_of_detection": 0.8}),
    "alarms": (
        "10 % false alarms, 2 steps each",
        {"false_alarm_rate": 0.1, "false_alarm_steps": 2},
    ),
    "dropped": ("10 % of commands dropped", {"command_drop_rate": 0.1}),
    "delayed": ("commands one step late", {"command_delay": 1}),
    "stuck": ("stuck in 2 % of the steps, for 5", {"stuck_rate": 0.02, "stuck_steps": 5}),
    "noise": ("positions half a cell off", {"position_noise": 0.5}),
    "wind": ("wind of 5 m/s to the east", {"wind_speed": 5.0, "wind_toward": 90.0}),
}
"""Title and fields of the scenario by fault; planners know them."""
FAULT_CASE = "santos_4"
FAULT_PLANNERS = ("random", "sweep", "greedy", "effort_allocation", "belief_greedy", "belief")
FAULT_MISSIONS = 400
"""Maximum: missions with faults differ from each other, so each has its own planner."""


def fly_with_fault(planner: str, fault: str, count: int) -> PlayedMissions:
    """Play missions of `FAULT_CASE` with a fault."""
    case = CASES[FAULT_CASE]
    scenario = case.scenario.override(**FAULTS[fault][1])
    numbers = SEED + np.arange(min(count, FAULT_MISSIONS))
    return play_missions(len(numbers), planner, scenario, rules=case.rules, seed=numbers.tolist())


def _misled(assumed: SearchDefinition, name: str, _: Search, *, seed: int) -> Planner:
    """Return a planner that assumes another search than the one it is given."""
    return planner_for(assumed, name, seed=seed)


def fly(planner: str, key: str, count: int, disturbance: str) -> PlayedMissions:
    """Play the missions of a case."""
    case, disturbed = CASES[key], DISTURBANCES[disturbance]
    kinds: tuple[Any, ...] = (np.bool_, np.int64, np.int64, np.float64, np.int64, np.int64)
    all_played = PlayedMissions(*(np.zeros(count, kind) for kind in kinds))
    parts = list(case.parts(count))
    shared = PLANNER_SEEDS.get(planner)
    for part_number, (scenario, numbers) in enumerate(parts):
        seeds = None
        if shared is not None:
            each = -(-shared // len(parts))
            seeds = range(part_number * each, (part_number + 1) * each)
        world, assumed = disturbed.apply(scenario, case.rules)
        misled = partial(_misled, SearchDefinition(case.rules, assumed), planner)
        part = play_missions(
            len(numbers), misled, world, rules=case.rules, seed=(SEED + numbers).tolist(),
            planner_seeds=seeds,
        )  # fmt: skip
        for field in dataclasses.fields(PlayedMissions):
            getattr(all_played, field.name)[numbers] = getattr(part, field.name)
    return all_played


def figures(missions: PlayedMissions, beside: PlayedMissions) -> dict[str, Any]:
    """Return the results of missions with 99 % intervals, and the paired difference to others."""
    by, of_pairs = clusters(missions.planner_seeds), clusters(beside.planner_seeds)
    found, steps = of_share(missions.found, LEVEL, by), of_mean(missions.steps, LEVEL, by)
    difference = of_mean(missions.steps - beside.steps, LEVEL, by, of_pairs)
    return {
        "found": found.value,
        "found_interval": (found.low, found.high),
        "steps": steps.value,
        "steps_interval": (steps.low, steps.high),
        "median_steps": float(np.median(missions.steps)),
        "difference": difference.value,
        "difference_interval": (difference.low, difference.high),
        "lost_drones": int(missions.lost.sum()),
        "planner_seeds": len({*missions.planner_seeds.tolist()} - {-1}),
    }


def tables(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables of the pages by name."""
    titles = {key: disturbance.title for key, disturbance in DISTURBANCES.items()}
    titles |= {key: title for key, (title, _) in FAULTS.items()}
    published = {key: case.published for key, case in CASES.items()}
    return planner_tables.tables(results, published, titles)


def write_pages(results: dict[str, Any]) -> None:
    """Write the tables into the pages, and the CSV beside them."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        written = planner_tables.with_tables(text, tables(results), results["missions"])
        page.write_text(written, encoding="utf-8")
    CSV.write_text(planner_tables.as_csv(results), encoding="utf-8")


def save_plot(curves: dict[str, dict[str, NDArray[np.float64]]], path: Path) -> None:
    """Write the shares of the missions that have found over the steps as a picture."""
    plot.save_curves(
        [
            (CASES[key].title, rows, {source.name: source.found for source in CASES[key].published})
            for key, rows in curves.items()
        ],
        path,
    )


def curve(missions: PlayedMissions, limit: int) -> NDArray[np.float64]:
    """Return the share of the missions that have found by each step, (L + 1,).

    Finds after the limit, which the rules of `v1` allow, count at the limit.
    """
    at = np.bincount(np.minimum(missions.steps[missions.found], limit), minlength=limit + 1)
    return np.cumsum(at) / len(missions.found)


def installed(names: Sequence[str]) -> list[str]:
    """Return the planners that can be loaded; print the reason for each of the others."""
    kept = []
    for name in names:
        try:
            load_planner(name)
        except FieldError as error:
            print(f"{name} is left out: {error}", flush=True)
        else:
            kept.append(name)
    return kept


def run_faults(count: int, workers: int) -> dict[str, Any]:
    """Play `FAULT_CASE` with each fault; returns the figures."""
    names = installed(FAULT_PLANNERS)
    done: dict[tuple[str, str], PlayedMissions] = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = {
            pool.submit(fly_with_fault, name, fault, count): (fault, name)
            for name in reversed(names)
            for fault in FAULTS
        }
        for job in progress(as_completed(jobs), "compare, faults", total=len(jobs)):
            (fault, name), missions = jobs[job], job.result()
            done[fault, name] = missions
            say(f"{fault}, {name}: {missions.found.mean():.2%}, {missions.steps.mean():.2f} steps")
    return {
        fault: {name: figures(done[fault, name], done["none", name]) for name in names}
        for fault in FAULTS
    }


def run(
    count: int, workers: int, names: Sequence[str], parts: Sequence[str]
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Play the cases, or the disturbed ones, or both; returns the figures and the curves.

    Args:
        count: Missions of each planner and case.
        workers: Number of processes.
        names: The planners, `BASELINE` among them.
        parts: Of `PARTS`.
    """
    kinds = {(key, case.disturbance) for key, case in CASES.items() if "cases" in parts}
    if "disturbed" in parts:
        kinds |= {(key, disturbance) for key in DISTURBED_CASES for disturbance in DISTURBANCES}
    jobs: dict[Future[PlayedMissions], tuple[str, str, str]] = {}
    done: dict[tuple[str, str, str], PlayedMissions] = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        # The slowest ones come first.
        for name in reversed(names):
            for key, kind in sorted(kinds):
                jobs[pool.submit(fly, name, key, count, kind)] = (key, kind, name)
        for job in progress(as_completed(jobs), "compare", total=len(jobs)):
            key, kind, name = jobs[job]
            done[jobs[job]] = missions = job.result()
            say(
                f"{len(done)}/{len(jobs)} {key}, {kind}, {name}: {missions.found.mean():.2%}, "
                f"{missions.steps.mean():.2f} steps"
            )
    results: dict[str, Any] = {"missions": count}
    curves: dict[str, dict[str, Any]] = {}
    if "cases" in parts:
        results["cases"] = {}
        for key, case in CASES.items():
            limit = case.scenario.resolve(case.rules).timestep_limit
            played = {name: done[key, case.disturbance, name] for name in names}
            results["cases"][key] = {n: figures(played[n], played[BASELINE]) for n in names}
            curves[key] = {name: curve(played[name], limit) for name in names}
    if "disturbed" in parts:
        results["disturbed"] = {
            key: {
                disturbance: {
                    name: figures(done[key, disturbance, name], done[key, "none", name])
                    for name in names
                }
                for disturbance in DISTURBANCES
            }
            for key in DISTURBED_CASES
        }
    return results, curves


def merged(kept: Any, played: Any) -> Any:
    """Return results in which the rows of the planners played replace those that were kept."""
    if not isinstance(kept, dict):
        return played
    both = {key: merged(kept.get(key), value) for key, value in played.items()}
    both = {**kept, **both}
    if both.keys() <= set(PLANNERS):
        return {name: both[name] for name in PLANNERS if name in both}
    return both


def _with(baseline: str, chosen: Sequence[str]) -> list[str]:
    """Return the installed planners among the chosen ones and the baseline, in their order."""
    return installed([name for name in PLANNERS if name in chosen or name == baseline])


def main(argv: list[str] | None = None) -> int:
    """Compare, print the tables, and keep them with the plot."""
    parser = argparse.ArgumentParser(prog="compare", description=__doc__)
    parser.add_argument("--missions", type=int, default=2000, help="of each planner and case")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the results")
    parser.add_argument(
        "--only", choices=PARTS, help="play this part only, and keep the other results"
    )
    parser.add_argument(
        "--planners", choices=PLANNERS, nargs="+", metavar="NAME",
        help="play these only, and keep the rows of the others; not for faults",
    )  # fmt: skip
    arguments = parser.parse_args(argv)
    if arguments.missions < 100:
        parser.error(f"missions must be at least 100, got {arguments.missions}")
    began, workers = time.perf_counter(), os.cpu_count() or 1
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "compare.json"
    chosen, results = arguments.planners or PLANNERS, {}
    parts = PARTS if arguments.only is None else (arguments.only,)
    complete = parts == PARTS and arguments.planners is None
    if not complete:
        results = json.loads(path.read_text(encoding="utf-8"))
    if {"cases", "disturbed"} & {*parts}:
        played, curves = run(arguments.missions, workers, _with(BASELINE, chosen), parts)
        results = merged(results, played)
        if curves and arguments.planners is None:
            save_plot(curves, arguments.out / "compare.png")
    if "faults" in parts and arguments.planners is None:
        results["faults"] = run_faults(arguments.missions, workers)
    if "incidents" in parts:
        flown = incidents.run(_with(incidents.BASELINE, chosen), workers)
        results = merged(results, flown)
    if complete:
        results |= {"seconds": round(time.perf_counter() - began), "machine": machine()}
        results["versions"] = own_versions()
    path.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    for name, table in tables(results).items():
        print(f"\n{name}\n\n{table}")
    if arguments.out == RESULTS:
        write_pages(results)
    print(f"{path} and {path.with_suffix('.png')} in {results['seconds']} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
