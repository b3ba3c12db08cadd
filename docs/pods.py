# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draws the POD of each cell after two tracks, by sensor, into docs/pods.png."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.step.looks import looks_of
from dsse_ros.world.scenario.actions import ACTION_VECTORS
from dsse_ros.world.scenario.scenario import scenario_and_rules

mpl.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

SIDE = 20
LEGS = [("right", 14), ("down", 6), ("left", 14)]
SENSORS: dict[str, dict[str, Any]] = {
    "flown_over": {"probability_of_detection": 0.8},
    "sweep_width, inverse_cube": {},
    "sweep_width, random_search": {"detection_law": "random_search"},
    "camera": {"cell_size": 130.0, "altitude": 240.0},
}
"""Fields of a scenario by the sensor that they are for."""


def pods(sensor: str, **fields: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the POD (SIDE, SIDE) of each cell [row, col], and the path (M, 2) of the drone."""
    scenario, rules = scenario_and_rules(rules="v2", grid_size=SIDE, sensor=sensor, **fields)
    looks, missed = looks_of(scenario.resolve(rules), rules), np.ones((SIDE, SIDE))
    path = [(3, 6)]
    for action in (action for action, steps in LEGS for _ in range(steps)):
        dx, dy = ACTION_VECTORS[action]
        path.append((path[-1][0] + dx, path[-1][1] + dy))
        for (col, row), of_persons in looks.done(0, rules.actions.index(action), path[-1]):
            if 0 <= col < SIDE and 0 <= row < SIDE:
                missed[row, col] *= 1.0 - of_persons[0]
    return 1.0 - missed, np.array(path)


def main() -> None:
    """Draw the picture."""
    figure, panels = plt.subplots(1, 4, figsize=(13, 3.6), sharey=True, layout="constrained")
    for axes, (name, fields) in zip(panels, SENSORS.items(), strict=True):
        shown, path = pods(name.split(",")[0], **fields)
        image = axes.imshow(shown, vmin=0, vmax=1, cmap="viridis")
        axes.plot(*path.T, color="tab:red", linewidth=1)
        axes.set(title=name, xlabel="column", xticks=range(0, SIDE, 5), yticks=range(0, SIDE, 5))
    panels[0].set_ylabel("row")
    figure.colorbar(image, ax=panels, label="POD")
    figure.savefig(Path(__file__).with_name("pods.png"), dpi=80)


if __name__ == "__main__":
    main()
