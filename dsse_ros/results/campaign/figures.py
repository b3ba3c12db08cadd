# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The figures of a campaign, in the style of the other reports."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from dsse_ros.picture.theme import Theme
from dsse_ros.results.campaign.estimates import of_mean, of_share
from dsse_ros.results.campaign.statistics import Played, restricted_s
from dsse_ros.results.report.figures import OKABE_ITO, STYLES, add_legend, chart

MAX_POINTS = 200
"""Largest number of points of a curve."""


def pos_figure(missions: Sequence[Played], confidence: float, theme: Theme) -> Figure:
    """Return the POS over the mission time, a curve with its band for each planner."""
    figure, axes = chart(theme)
    case = missions[0].case
    steps = np.linspace(0, case.scenario.timestep_limit, MAX_POINTS).round()
    minutes = np.unique(steps) * case.scenario.step_duration_s / 60.0
    for number, played in enumerate(missions):
        found = [
            of_share(played.detection_s / 60.0 <= t * (1 + 1e-12), confidence, played.clusters)
            for t in minutes
        ]
        colour = OKABE_ITO[number % len(OKABE_ITO)]
        style = STYLES[number // len(OKABE_ITO) % len(STYLES)]
        axes.step(
            minutes, [point.value for point in found], style, where="post", color=colour,
            linewidth=1.8, label=played.planner,
        )  # fmt: skip
        axes.fill_between(
            minutes, [point.low for point in found], [point.high for point in found], step="post",
            color=colour, alpha=0.2, linewidth=0.0,
        )  # fmt: skip
    axes.set(xlabel="mission time (min)", ylabel="POS", ylim=(0, 1))
    axes.set_xlim(0, max(float(minutes[-1]), 1e-3))
    _finish(axes, theme)
    return figure


def estimates_figure(
    missions: Sequence[Played], horizon_s: float, confidence: float, theme: Theme
) -> Figure:
    """Return share found against the restricted mean time to detection, with intervals.

    Args:
        horizon_s: Horizon of the restricted times to detection.
    """
    figure, axes = chart(theme)
    for number, played in enumerate(missions):
        share = of_share(played.found, confidence, played.clusters)
        minutes = of_mean(restricted_s(played, horizon_s) / 60.0, confidence, played.clusters)
        reach = [[minutes.value - minutes.low], [minutes.high - minutes.value]]
        axes.errorbar(
            minutes.value, share.value,
            xerr=reach if np.isfinite(reach).all() else None,
            yerr=[[share.value - share.low], [share.high - share.value]],
            fmt="os^DvP*"[number % 7], color=OKABE_ITO[number % len(OKABE_ITO)], capsize=3,
            label=played.planner,
        )  # fmt: skip
    axes.set(xlabel="restricted mean time to detection (min)", ylabel="missions with all found")
    _finish(axes, theme)
    return figure


def _finish(axes: Axes, theme: Theme) -> None:
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(color=theme.faint, linewidth=0.6)
    axes.set_axisbelow(True)
    add_legend(axes, theme, 4)
