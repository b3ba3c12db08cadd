# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The figures of a report, for light and dark pages, as bytes that are the same for the same input.

Made for any colour vision: the colours of lines and bars are those of Okabe and Ito (2008), cells
are shaded by cividis (Nunez, Anderton and Renslow 2018).
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.picture.map_axes import (
    MAX_LINED_CELLS,
    draw_cells,
    draw_lines,
    draw_outside,
    name_axes,
    places_km,
)
from dsse_ros.picture.rendering import PLAIN, MissionView, Picture, new_figure
from dsse_ros.picture.sea_chart import corner_rows, draw_corner, draw_shore, draw_sightings
from dsse_ros.picture.theme import DRONE_COLOURS, Theme, drone_colour
from dsse_ros.results.report.metrics import Curves, Work, effort
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.world.scenario.sea_state import sea_state

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


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=PNG_DPI)
    return out.getvalue()


def svg(figure: Figure) -> bytes:
    """Return a figure as SVG, without a date in it and with ids that stay."""
    out = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": _SALT}):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()


def map_figure(view: MissionView, theme: Theme) -> Figure:
    """Return the map of a mission, as `make sim` draws it, without its legend."""
    figure = new_figure(PLAIN)
    Picture(figure, PLAIN, theme).draw(view)
    return figure


class Symbol(NamedTuple):
    """A symbol of maps.

    Attributes:
        handle: For a legend of matplotlib.
        label: Its meaning.
    """

    handle: Any
    label: str

    def icon(self) -> bytes:
        """Return the symbol as SVG."""
        figure = Figure(figsize=(0.42, 0.3))
        figure.patch.set_alpha(0.0)
        figure.legend(
            [self.handle], [""], loc="center", frameon=False, borderpad=0.0, borderaxespad=0.0,
            handletextpad=0.0, handlelength=2.2,
        )  # fmt: skip
        return svg(figure)


def symbols(views: Iterable[MissionView], theme: Theme) -> list[Symbol]:
    """Return the symbols that the maps have, in the order of the legend."""
    shown: set[str] = set()
    entries: dict[str, tuple[Any, str]] = {}
    for view in views:
        picture = Picture(new_figure(PLAIN), PLAIN, theme)
        picture.draw(view)
        shown.update(picture.shown(view))
        entries = picture.entries(view)
    return [
        Symbol(handle, label.replace("\n", " "))
        for name, (handle, label) in entries.items()
        if name in shown
    ]


def legend_figure(entries: Sequence[Symbol], theme: Theme) -> Figure:
    """Return the legend of the maps."""
    rows = -(-len(entries) // 2)
    figure = Figure(figsize=(7.2, 0.3 * rows + 0.2), facecolor=theme.paper)
    figure.legend(
        [entry.handle for entry in entries], [entry.label for entry in entries],
        loc="center", ncols=2, frameon=False, labelcolor=theme.ink, fontsize=9, handlelength=2.2,
    )  # fmt: skip
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


def progress_figure(progress: Curves, cells: int, theme: Theme) -> Figure:
    """Return POS and area coverage over time, finds marked."""
    figure, axes = chart(theme, 5.4, 3.0)
    minutes = progress.times_s / 60.0
    marker = "o" if len(minutes) < 2 else ""
    coverage = progress.cells_searched / cells
    axes.step(
        minutes, coverage, where="post", color=ORANGE, linestyle="--", marker=marker,
        label="area coverage",
    )  # fmt: skip
    main, name = coverage, "area coverage"
    if progress.pos is not None:
        main, name = progress.pos, "POS"
        axes.step(
            minutes, progress.pos, where="post", color=theme.accent, linewidth=2.2, marker=marker,
            label="POS",
        )  # fmt: skip
    finds = np.flatnonzero(np.diff(progress.num_detections, prepend=0))
    if len(finds):
        axes.plot(
            minutes[finds], main[finds], linestyle="none", marker="*", markersize=15,
            color=GREEN, markeredgecolor=theme.ink, label="person found", zorder=5, clip_on=False,
        )  # fmt: skip
    axes.set(
        xlabel="mission time (min)", ylabel=name if progress.pos is None else "share", ylim=(0, 1)
    )
    axes.set_xlim(0, max(float(minutes[-1]), 1e-3) * 1.01)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(color=theme.faint, linewidth=0.6)
    axes.set_axisbelow(True)
    add_legend(axes, theme, 3)
    return figure


def objects_figure(record: RecordedMission, theme: Theme) -> Figure:
    """Return how likely each possible object of an incident is over time."""
    figure, axes = chart(theme, 5.4, 3.0)
    assert record.object_shares is not None
    minutes = record.times_s / 60.0
    names = record.object_names
    shades = colormaps["cividis"](np.linspace(*theme.shades, len(names)))
    axes.stackplot(
        minutes, record.object_shares.T, labels=names, colors=shades, step="post",
        edgecolor=theme.ink, linewidth=0.4,
    )  # fmt: skip
    axes.set(xlabel="mission time (min)", ylabel="probability", ylim=(0, 1))
    axes.set_xlim(0, max(float(minutes[-1]), 1e-3) * 1.01)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    add_legend(axes, theme, 2)
    return figure


def effort_figure(record: RecordedMission, theme: Theme) -> Figure:
    """Return how often each cell was searched, as a map."""
    figure, axes = _map_chart(record, theme)
    count = effort(record)
    image = draw_cells(
        axes, np.ma.masked_where(count == 0, count), _extent_km(record),
        vmin=1, vmax=max(int(count.max()), 2),
        cmap=ListedColormap(colormaps["cividis"](np.linspace(*theme.shades, 256))),
    )  # fmt: skip
    bar = figure.colorbar(image, ax=axes, label="searches of the cell", shrink=0.85, pad=0.02)
    bar.ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    bar.ax.tick_params(colors=theme.ink)
    bar.ax.yaxis.label.set_color(theme.ink)
    bar.outline.set_edgecolor(theme.ink)  # type: ignore[operator]
    return figure


def tracks_figure(record: RecordedMission, theme: Theme) -> Figure:
    """Return the tracks, on cells beside each other: o is the start, a triangle the end."""
    figure, axes = _map_chart(record, theme)
    cell_km, drones = record.scenario.cell_size / 1000.0, len(record.agents)
    for i, cells in enumerate(record.tracks(len(record.steps))):
        on_cells = record.in_cells is None
        beside = _BESIDE * ((i + 1) / (drones + 1) - 0.5) * on_cells
        x, y = places_km(cells + (beside, -beside), record.grid_size.rows, cell_km).T
        colour = drone_colour(i)
        style = STYLES[i // len(DRONE_COLOURS) % len(STYLES)]
        axes.plot(x, y, style, color=colour, linewidth=1.4, label=record.agents[i])
        axes.plot(x[:1], y[:1], "o", color=colour, markersize=4)
        axes.plot(
            x[-1:], y[-1:], "X" if record.lost[-1, i] else "^", color=colour, markersize=7,
            markeredgecolor=theme.ink, markeredgewidth=0.7, zorder=3,
        )  # fmt: skip
    if drones <= MAX_NAMED:
        add_legend(axes, theme, 4)
    return figure


def _extent_km(record: RecordedMission) -> GridExtent:
    return GridExtent(*(m / 1000.0 for m in record.grid_size.extent(record.scenario.cell_size)))


def _map_chart(record: RecordedMission, theme: Theme) -> tuple[Figure, Axes]:
    """Return axes with the sea and the cells, east to the right and north up.

    They show the part of the grid with the tracks and the last known positions.
    """
    figure, axes = chart(theme, 5.4, 4.7)
    extent, sea, part = _extent_km(record), sea_state(record.scenario, 0), _part(record)
    west, south, width, height = (cells * record.scenario.cell_size / 1000.0 for cells in part)
    axes.set_aspect("equal")
    for spine in axes.spines.values():
        spine.set_color(theme.ink)
    if record.area is not None:
        draw_outside(axes, record.area, extent, theme.land)
    if max(part[2:]) <= MAX_LINED_CELLS:
        draw_lines(axes, record.grid_size, extent, theme.faint)
    draw_shore(axes, sea, theme)
    draw_sightings(axes, sea, GridExtent(width, height), theme, (west, south))
    # Those that are off the map; wind and current change.
    whole = record.grid_size.extent(record.scenario.cell_size)
    draw_corner(axes, [row for row in corner_rows(sea, whole) if row.kind == "lkp"], theme)
    name_axes(axes)
    axes.set(xlim=(west, west + width), ylim=(south, south + height), autoscale_on=False)
    return figure, axes


def _part(record: RecordedMission) -> tuple[int, int, int, int]:
    """Return the square that holds all tracks and the last known positions on the grid.

    It ends at the edges of the grid, and is the whole grid if it is most of it.

    Returns:
        Its corner, width and height in cells, from the south-west.
    """
    grid, cell_m = record.grid_size, record.scenario.cell_size
    seen = [
        (seen.x_m // cell_m, grid.rows - 1 - seen.y_m // cell_m)
        for seen in sea_state(record.scenario, 0).sightings
        if grid.holds(int(seen.x_m // cell_m), int(seen.y_m // cell_m))
    ]
    places = np.concatenate([record.cells.reshape(-1, 2), np.array(seen, int).reshape(-1, 2)])
    low, high = places.min(axis=0), places.max(axis=0)
    side = min(int((high - low).max()) + 1 + 2 * _MARGIN, grid.longer)
    if side > _MOST * grid.longer:
        return 0, 0, *grid
    middle = np.array([low[0] + high[0] + 1, 2 * grid.rows - low[1] - high[1] - 1]) // 2
    shown = np.minimum(side, grid)
    west, south = np.clip(middle - shown // 2, 0, np.array(grid) - shown).tolist()
    width, height = shown.tolist()
    return west, south, width, height


def work_figure(record: RecordedMission, done: Work, theme: Theme) -> Figure:
    """Return in how many steps each drone searched, flew on, waited and held."""
    count = len(record.agents)
    shown = min(count, MAX_BARS)
    groups = np.array_split(np.arange(count), shown)
    figure, axes = chart(theme, 5.4, 1.3 + 0.24 * shown)
    left = np.zeros(shown)
    for name, steps, colour, hatch in (
        ("searching", done.searching, theme.accent, ""),
        ("moving", done.moving, ORANGE, "//"),
        ("waiting", done.waiting, "#999999", ".."),
        ("holding", done.holding, "#CC79A7", "xx"),
    ):
        if not steps.any():
            continue
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
    if left.any():
        add_legend(axes, theme, 4)
    return figure
