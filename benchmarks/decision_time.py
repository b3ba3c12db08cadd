# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `ForwardBackward` gains over `belief` if a decision may take 50 ms of CPU time.

With one person, a plan is open-loop: the mean time to a find is the sum over the steps of the
probability that the belief leaves for later. So a mission of each seed is computed, not drawn.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.bench import RESULTS, machine, own_versions, rounded
from benchmarks.compare import CASES
from benchmarks.intervals import quantile
from benchmarks.paths.forward_backward import ForwardBackward, ForwardBackwardOptions
from dsse_ros.planners.beam_search import BeamSearch, steps_planned
from dsse_ros.planners.belief import DRIFT_SAMPLES
from dsse_ros.planners.options import BeamOptions
from dsse_ros.planners.planner import DecisionPoint
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.step.looks import looks_of

BUDGET_MS = 50.0
CHOSEN = ("v2", "santos_8", "santos_4")
"""Cases: on the others no gain was measured."""
NEGLIGIBLE = 1e-6
"""A mission ends when it is this probable that the person has not been found."""


def mean_steps(key: str, options: BeamOptions, seed: int, most: int | None = None) -> float:
    """Return the mean time to a find in steps, of which a mission without a find has the limit.

    Args:
        key: Of `CASES`.
        options: Of the planner, which is `ForwardBackward` if they are its options.
        seed: Seed of the planner.
        most: Steps played; None for the limit of the scenario.
    """
    case = CASES[key]
    scenario, rules = case.scenario.resolve(case.rules), case.rules
    horizon = steps_planned(rules, options.horizon)
    forecast = forecast_for(scenario, rules, horizon=horizon, drift_samples=DRIFT_SAMPLES)
    if isinstance(options, ForwardBackwardOptions):
        tactic: BeamSearch = ForwardBackward(forecast, options, seed=seed)
    else:
        tactic = BeamSearch(forecast, options, seed=seed)
    # The exact filter judges the plans; that of the planner has fewer angles of the persons' drift.
    belief, exact = forecast.belief(), forecast_for(scenario, rules).belief()
    looks, actions = looks_of(scenario, rules), rules.action_set
    present = list(scenario.drones_positions)
    agents = list(range(len(present)))
    mean = 0.0
    for _ in range(most or scenario.timestep_limit):
        mean += 1.0 - exact.pos
        if exact.pos > 1.0 - NEGLIGIBLE:
            break
        cells = tactic(DecisionPoint(belief, agents, present))
        joint = [actions.action(a, b) for a, b in zip(present, cells, strict=True)]
        done = [look for n in agents for look in looks.done(n, joint[n], cells[n])]
        for each in (belief, exact):
            each.update(done)
            each.advance()
        present = cells
    return mean


def run(key: str, seeds: int) -> dict[str, Any]:
    """Return the mean times of a case with both planners, and the gain with its 99 % interval."""
    plain, improved = BeamOptions(), ForwardBackwardOptions(budget_ms=BUDGET_MS)
    # The deadlines of planners are of wall time, which others on the machine would take from them.
    with mock.patch("time.monotonic", time.process_time):
        for options in (plain, improved):
            # The first decisions load the compiled functions.
            mean_steps(key, options, 0, most=2)
        times = {
            name: np.array([mean_steps(key, options, seed) for seed in range(seeds)])
            for name, options in (("belief", plain), ("improved", improved))
        }
    before, after = times.values()
    error = math.sqrt((before.var(ddof=1) + after.var(ddof=1)) / seeds)
    gain, reach = float(before.mean() - after.mean()), quantile() * error
    return {
        "title": CASES[key].title,
        "seeds": seeds,
        **{name: float(steps.mean()) for name, steps in times.items()},
        "gain": gain,
        "interval": [gain - reach, gain + reach],
    }


def table(rows: list[dict[str, Any]]) -> str:
    """Return the gains as a table in Markdown."""
    lines = [
        f"| Case | `belief` | `ForwardBackward`, {BUDGET_MS:g} ms | Steps gained | Seeds |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        reach = row["interval"][1] - row["gain"]
        lines.append(
            f"| {row['title']} | {row['belief']:.2f} | {row['improved']:.2f} | "
            f"{row['gain']:.3f} ± {reach:.3f} | {row['seeds']} |"
        )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure, print the table, and keep it."""
    parser = argparse.ArgumentParser(prog="decision_time", description=__doc__)
    parser.add_argument("--seeds", type=int, default=120, help="of each planner and case")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the results")
    options = parser.parse_args(arguments)
    if options.seeds < 2:
        parser.error(f"seeds must be at least 2, got {options.seeds}")
    rows = rounded([run(key, options.seeds) for key in CHOSEN])
    options.out.mkdir(parents=True, exist_ok=True)
    result = {"machine": machine(), "versions": own_versions(), "rows": rows}
    path = options.out / "decision_time.json"
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(f"{table(rows)}\n\n{path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
