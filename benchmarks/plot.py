# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of the speeds and of the comparison of planners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from numpy.typing import NDArray

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

# Name, label, colour, line style.
LINES = (
    ("lazy_one_core", "ours, lazy batch, one core", "tab:blue", ":"),
    ("baseline_lazy", "C baseline, lazy", "tab:gray", ":"),
    ("limit_one_core", "memset of the maps, one core", "tab:green", "-."),
    ("batch_two_cores", "ours, batch, two cores", "tab:blue", "--"),
    ("batch_one_core", "ours, batch, one core", "tab:blue", "-."),
    ("baseline_batch", "C baseline, batch, one core", "tab:gray", "-."),
    ("single_v2", "ours, one world, v2", "tab:orange", "-"),
    ("single_v1", "ours, one world, v1", "tab:blue", "-"),
    ("dsse_1_1_9", "DSSE 1.1.9", "tab:red", "-"),
    ("dsse_0_1_13", "DSSE 0.1.13", "tab:purple", "-"),
)
GRID_SIZE, NUM_DRONES = 40, 5


def save(cells: list[dict[str, Any]], path: Path) -> None:
    """Write steps per second over the grid's size and over the number of drones."""
    figure, panels = plt.subplots(1, 2, figsize=(11, 5), sharey=True, layout="constrained")
    for axes, axis, other, value, title in (
        (panels[0], "grid_size", "num_drones", NUM_DRONES, f"{NUM_DRONES} drones"),
        (panels[1], "num_drones", "grid_size", GRID_SIZE, f"grid {GRID_SIZE} x {GRID_SIZE}"),
    ):
        row = sorted((c for c in cells if c[other] == value), key=lambda cell: cell[axis])
        for name, label, colour, style in LINES:
            points = [(c[axis], c["best"][name]) for c in row if name in c["best"]]
            if points:
                axes.plot(*zip(*points, strict=True), style, color=colour, label=label, marker=".")
        axes.set(xscale="log", yscale="log", xlabel=axis.replace("_", " "), title=title)
        ticks = [cell[axis] for cell in row]
        axes.set_xticks(ticks, [str(tick) for tick in ticks])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("environment steps per second")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center", fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def save_curves(
    cases: Sequence[tuple[str, Mapping[str, NDArray[Any]], Mapping[str, float]]], path: Path
) -> None:
    """Write the share of missions that have found over the steps, a panel for each case.

    Args:
        cases: Of each its title, by planner the share after each step (L + 1,), and by name the
            published shares after the last one.
        path: Of the picture.
    """
    figure, panels = plt.subplots(2, 4, figsize=(15, 6.5), sharey=True, layout="constrained")
    for axes in panels.flat[len(cases) :]:
        axes.axis("off")
    for axes, (title, rows, published) in zip(panels.flat, cases, strict=False):
        limit = 0
        for name, shares in rows.items():
            width = 2.2 if name.startswith("belief") else 1.2
            axes.plot(100 * shares, label=name, linewidth=width)
            limit = len(shares) - 1
        for name, share in published.items():
            axes.plot(limit, 100 * share, "k_", markersize=14, clip_on=False)
            axes.annotate(
                f"published {name}", (limit, 100 * share), (-8, 3), textcoords="offset points",
                ha="right", fontsize=7,
            )  # fmt: skip
        axes.set(xlabel="steps", xlim=(0, limit), ylim=(0, 100))
        axes.set_title(title, fontsize=9)
        axes.grid(alpha=0.3)
    for axes in panels[:, 0]:
        axes.set_ylabel("missions that have found, %")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside right center", fontsize=9)
    figure.savefig(path, dpi=80)
    plt.close(figure)
