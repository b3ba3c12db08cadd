# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The figures of a report, for light and dark pages, as bytes that are the same for the same input.

Made for any colour vision: the colours of lines and bars are those of Okabe and Ito (2008), cells
are shaded by cividis (Nunez, Anderton and Renslow 2018).
"""

from __future__ import annotations

import io
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from dsse_ros.report.metrics import Curves, Work, effort
from dsse_ros.report.record import RecordedMission
from dsse_ros.view.map_axes import (
    MAX_LINED_CELLS,
    draw_cells,
    draw_lines,
    draw_outside,
    name_axes,
    places_km,
)
from dsse_ros.view.palette import DRONE_COLOURS, drone_colour
from dsse_ros.view.rendering import WIDE, Layout, MissionView, Picture, new_figure

BLUE, ORANGE, GREEN = "#0072B2", "#E69F00", "#009E73"
PNG_DPI = 160
OKABE_ITO = (BLUE, ORANGE, GREEN, "#CC79A7", "#D55E00", "#56B4E9", "#999999")
_BESIDE = 0.7
"""Part of a cell over which the tracks of the drones are spread."""
STYLES = ("-", "--", ":", "-.")
MAX_NAMED = 8
"""Drones that a legend names."""
_MARGIN = 3
"""Cells about the tracks."""
_MOST = 0.6
"""Part of the grid from which on all of it is shown."""
MAX_BARS = 40
"""Drones that have a bar of their own; of more, the bars are those of groups."""
_SALT = "dsse_ros"
"""Of the ids in an SVG, which are random without one."""


@dataclass(frozen=True)
class Theme:
    """Colours of a page.

    Attributes:
        paper: Behind the figure.
        ink: Text and axes.
        faint: Grid lines.
        accent: The main line.
        shades: Of cividis, for the least and the most.
    """

    paper: str
    ink: str
    faint: str
    accent: str
    shades: tuple[float, float]


LIGHT = Theme(paper="#ffffff", ink="#1b1f24", faint="#d8dde3", accent=BLUE, shades=(0.85, 0.0))
DARK = Theme(paper="#171b21", ink="#e6e9ed", faint="#3a424d", accent="#56B4E9", shades=(0.3, 1.0))


def png(figure: Figure, dpi: int = PNG_DPI) -> bytes:
    """Return a figure as PNG."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=dpi)
    return out.getvalue()


def svg(figure: Figure) -> bytes:
    """Return a figure as SVG, without a date in it and with ids that stay."""
    out = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": _SALT}):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()


def map_figure(view: MissionView, layout: Layout = WIDE) -> Figure:
    """Return the map of a mission, as `make sim` draws it."""
    figure = new_figure(layout)
    Picture(figure, layout).draw(view)
    return figure


def chart(theme: Theme, width: float = 7.2, height: float = 3.6) -> tuple[Figure, Axes]:
    """Return a figure with empty axes; width and height are in inches."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor=theme.paper)
    axes = figure.add_subplot(facecolor=theme.paper)
    axes.tick_params(colors=theme.ink)
    for side, spine in axes.spines.items():
        spine.set_color(theme.ink if side in ("left", "bottom") else "none")
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set_color(theme.ink)
    return figure, axes


def add_legend(axes: Axes, theme: Theme, columns: int) -> None:
    """Name the lines above the axes."""
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False,
        labelcolor=theme.ink, borderaxespad=0.2, handlelength=1.6,
    )  # fmt: skip


def progress_figure(of: Curves, cells: int, theme: Theme) -> Figure:
    """Return POS and area coverage over time, finds marked.

    Args:
        of: The curves of the mission.
        cells: Cells of the search area.
        theme: Colours.
    """
    figure, axes = chart(theme)
    minutes = of.times_s / 60.0
    marker = "o" if len(minutes) < 2 else ""
    coverage = of.cells_searched / cells
    axes.step(
        minutes, coverage, where="post", color=ORANGE, linestyle="--", marker=marker,
        label="area coverage",
    )  # fmt: skip
    main, name = coverage, "area coverage"
    if of.pos is not None:
        main, name = of.pos, "POS"
        axes.step(
            minutes, of.pos, where="post", color=theme.accent, linewidth=2.2, marker=marker,
            label="POS",
        )  # fmt: skip
    finds = np.flatnonzero(np.diff(of.num_detections, prepend=0))
    if len(finds):
        axes.plot(
            minutes[finds], main[finds], linestyle="none", marker="*", markersize=15,
            color=GREEN, markeredgecolor=theme.ink, label="person found", zorder=5, clip_on=False,
        )  # fmt: skip
    axes.set(xlabel="mission time (min)", ylabel=name if of.pos is None else "share", ylim=(0, 1))
    axes.set_xlim(0, max(float(minutes[-1]), 1e-3) * 1.01)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(color=theme.faint, linewidth=0.6)
    axes.set_axisbelow(True)
    add_legend(axes, theme, 3)
    return figure


def effort_figure(record: RecordedMission, theme: Theme) -> Figure:
    """Return how often each cell was searched, as a map."""
    figure, axes = _map_chart(record, theme)
    count = effort(record)
    image = draw_cells(
        axes, np.ma.masked_where(count == 0, count), _side_km(record),
        vmin=1, vmax=max(int(count.max()), 2),
        cmap=ListedColormap(colormaps["cividis"](np.linspace(*theme.shades, 256))),
    )  # fmt: skip
    _show_part(axes, record)
    bar = figure.colorbar(image, ax=axes, label="searches of the cell", shrink=0.85, pad=0.02)
    bar.ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    bar.ax.tick_params(colors=theme.ink)
    bar.ax.yaxis.label.set_color(theme.ink)
    bar.outline.set_edgecolor(theme.ink)  # type: ignore[operator]
    return figure


def tracks_figure(record: RecordedMission, theme: Theme) -> Figure:
    """Return the tracks beside each other, as a map: o is the start, a triangle the end."""
    figure, axes = _map_chart(record, theme)
    cell_km, drones = record.scenario.cell_size / 1000.0, len(record.agents)
    for i, cells in enumerate(record.cells.swapaxes(0, 1)):
        beside = _BESIDE * ((i + 1) / (drones + 1) - 0.5)
        x, y = places_km(cells + (beside, -beside), record.grid_size, cell_km).T
        colour = drone_colour(i)
        style = STYLES[i // len(DRONE_COLOURS) % len(STYLES)]
        axes.plot(x, y, style, color=colour, linewidth=1.4, label=record.agents[i])
        axes.plot(x[:1], y[:1], "o", color=colour, markersize=4)
        axes.plot(
            x[-1:], y[-1:], "X" if record.lost[-1, i] else "^", color=colour, markersize=7,
            markeredgecolor=theme.ink, markeredgewidth=0.7, zorder=3,
        )  # fmt: skip
    _show_part(axes, record)
    if drones <= MAX_NAMED:
        add_legend(axes, theme, 4)
    return figure


def _side_km(record: RecordedMission) -> float:
    return record.grid_size * record.scenario.cell_size / 1000.0


def _map_chart(record: RecordedMission, theme: Theme) -> tuple[Figure, Axes]:
    """Return axes with the area and the cells, east to the right and north up."""
    figure, axes = chart(theme, 6.0, 5.2)
    side = _side_km(record)
    axes.set_aspect("equal")
    for spine in axes.spines.values():
        spine.set_color(theme.ink)
    if record.area is not None:
        draw_outside(axes, record.area, side, theme.faint)
    if _part(record)[2] <= MAX_LINED_CELLS:
        draw_lines(axes, np.linspace(0, side, record.grid_size + 1), side, theme.faint)
    name_axes(axes)
    return figure, axes


def _show_part(axes: Axes, record: RecordedMission) -> None:
    """Show the part of the grid in which the drones were."""
    west, south, side = (cells * record.scenario.cell_size / 1000.0 for cells in _part(record))
    axes.set(xlim=(west, west + side), ylim=(south, south + side))


def _part(record: RecordedMission) -> tuple[int, int, int]:
    """Return the square that holds all tracks: its corner and side in cells, from the south-west.

    It is the whole grid if it is most of it.
    """
    size = record.grid_size
    low, high = record.cells.min(axis=(0, 1)), record.cells.max(axis=(0, 1))
    side = min(int((high - low).max()) + 1 + 2 * _MARGIN, size)
    if side > _MOST * size:
        return 0, 0, size
    middle = np.array([low[0] + high[0] + 1, 2 * size - low[1] - high[1] - 1]) // 2
    west, south = np.clip(middle - side // 2, 0, size - side).tolist()
    return west, south, side


def work_figure(record: RecordedMission, of: Work, theme: Theme) -> Figure:
    """Return in how many steps each drone searched, flew on and held."""
    count = len(record.agents)
    shown = min(count, MAX_BARS)
    groups = np.array_split(np.arange(count), shown)
    figure, axes = chart(theme, height=1.3 + 0.24 * shown)
    left = np.zeros(shown)
    for name, steps, colour, hatch in (
        ("searching", of.searching, theme.accent, ""),
        ("moving", of.moving, ORANGE, "//"),
        ("holding", of.holding, "#999999", ".."),
    ):
        width = np.array([steps[group].mean() for group in groups])
        axes.barh(
            np.arange(shown), width, left=left, color=colour, hatch=hatch, label=name,
            edgecolor=theme.paper, linewidth=0.0, height=0.75,
        )  # fmt: skip
        left += width
    names = [
        record.agents[group[0]] if len(group) == 1 else f"drone{group[0]}-{group[-1]}"
        for group in groups
    ]
    axes.set_yticks(np.arange(shown), names)
    axes.invert_yaxis()
    axes.set_xlabel("steps" if shown == count else "steps, mean of the group")
    axes.set_xlim(0, max(float(left.max()), 1.0))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(axis="x", color=theme.faint, linewidth=0.6)
    axes.set_axisbelow(True)
    add_legend(axes, theme, 3)
    return figure
