# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The one drawing of a mission, on a matplotlib figure.

Drone colours are from Okabe and Ito ("Color Universal Design", 2008), which colour-blind readers
can distinguish, without the two that are hard to see on the blue or white of the sea. Drones also
have numbers, and persons, datum and searches differ in shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.view.chart import draw_chart, round_length
from dsse_ros.view.legend import CIRCLE, DATUM, EDGE, FOUND, LAND, PERSON, STAR, legend_entries
from dsse_ros.view.map_axes import (
    MAX_LINED_CELLS,
    draw_cells,
    draw_lines,
    draw_outside,
    name_axes,
    places_km,
)
from dsse_ros.view.mission_view import MissionView
from dsse_ros.view.palette import drone_colour
from dsse_ros.view.sea_chart import (
    corner_rows,
    draw_corner,
    draw_shore,
    draw_sightings,
    label_sides,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

Rect = tuple[float, float, float, float]


@dataclass(frozen=True)
class Layout:
    """Where a picture has its parts, as shares of the figure or of the panel.

    Attributes:
        size_in: Width and height of the figure in inches.
        map: Left, bottom, width and height of the map.
        panel: Those of the colours and the legend.
        top: Top of the title.
        status: Top of the status.
        bar: The bar of colours in the panel.
        legend: Left and top of the legend in the panel.
        columns: Columns of the legend.
        scale: Left and bottom of scale and north, in sides of the map from its south-west corner.
        wraps: Whether long titles take several lines.
    """

    size_in: tuple[float, float]
    map: Rect
    panel: Rect
    top: float
    status: float
    bar: Rect
    legend: tuple[float, float]
    columns: int
    scale: tuple[float, float]
    wraps: bool


WIDE = Layout(
    size_in=(8.0, 6.0), map=(0.08, 0.11, 0.5625, 0.75), panel=(0.715, 0.11, 0.275, 0.75),
    top=0.975, status=0.94, bar=(0.0, 0.88, 0.92, 0.035), legend=(-0.04, 0.79), columns=1,
    scale=(1.17, 0.0), wraps=False,
)  # fmt: skip
"""The legend beside the map."""
NARROW = Layout(
    size_in=(4.6, 7.8), map=(0.13, 0.4, 0.76, 0.4482), panel=(0.04, 0.0, 0.93, 0.34),
    top=0.985, status=0.955, bar=(0.02, 0.79, 0.45, 0.05), legend=(-0.02, 0.66), columns=2,
    scale=(0.55, -0.33), wraps=True,
)  # fmt: skip
"""The legend below the map, for phones."""
MAX_NUMBERED_DRONES = 24
MAX_STROKES = 4
"""Number of searches of a cell that the picture can show as strokes."""
_LANES = 8
"""Number of parallel tracks in a cell; further drones share them."""
_AGES = 8
"""Shades of a track."""
_SMALLEST_CELL_PT = 5.0
"""Smallest side of a cell with strokes; smaller cells are shaded."""
_MAP_PT = 324.0
"""Side of the map in points."""


def sea_colours() -> LinearSegmentedColormap:
    """Return the colours of probabilities, without the dark blues, which are for the tracks."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("sea", colormaps["Blues"](np.linspace(0, 0.75, 9)))


class Picture:
    """The mission on a matplotlib figure: east to the right, north up, in km.

    Tracks run in parallel, get darker towards the present, and have dots at regular intervals of
    steps. Each stroke through a cell is one search of it. Elements that do not change from view to
    view are kept.

    Args:
        figure: The figure to draw on.
        layout: Where it has its parts.
    """

    def __init__(self, figure: Figure, layout: Layout = WIDE) -> None:
        self._figure, self._layout = figure, layout
        self._scene: tuple[Any, ...] = ()
        self._listed: tuple[Any, ...] = ()

    @property
    def moving(self) -> list[Artist]:
        """Artists that change from view to view, and those above them, from bottom to top."""
        over = [*self._axes.collections, *self._axes.images, *self._axes.texts, *self._axes.lines]
        over = [artist for artist in over if artist.get_clip_on()]
        over.sort(key=lambda artist: artist.get_zorder())
        return [*over, *self._axes.spines.values(), *self._percents, self._title, self._status]

    def draw(self, view: MissionView) -> bool:
        """Draw the present mission; return whether other artists than `moving` have changed."""
        scene = (
            len(view.probability), view.cell_size_m, len(view.tracks), view.belief, view.origin,
            view.timestep_limit, None if view.area is None else view.area.tobytes(),
            corner_rows(view.sea, len(view.probability) * view.cell_size_m), view.sea.sightings,
            [ring.tobytes() for ring in view.sea.shore],
        )  # fmt: skip
        if scene != self._scene:
            self._scene, self._listed = scene, ()
            self._build(view)
        self._update(view)
        return self._list(view)

    def _build(self, view: MissionView) -> None:
        from matplotlib.collections import LineCollection
        from matplotlib.colors import PowerNorm, to_rgb

        grid, count = len(view.probability), len(view.tracks)
        self._grid, self._km = grid, view.cell_size_m / 1000.0
        self._side = side = grid * self._km
        self._shaded = _MAP_PT / grid < _SMALLEST_CELL_PT
        self._figure.clear()
        layout = self._layout
        self._axes = axes = self._figure.add_axes(layout.map)
        self._panel = panel = self._figure.add_axes(layout.panel)
        panel.set_axis_off()
        words: dict[str, Any] = {"va": "top", "wrap": layout.wraps}
        self._title = self._figure.text(
            0.02, layout.top, "", fontsize=11, fontweight="bold", **words
        )
        self._status = self._figure.text(0.02, layout.status, "", fontsize=10, **words)
        for text in (self._title, self._status):
            text.set_parse_math(False)

        # A square root makes small probabilities visible.
        blues = sea_colours()
        norm = PowerNorm(0.5, 0, 1)
        self._sea = draw_cells(axes, view.probability, side, cmap=blues, norm=norm, zorder=0)
        self._add_scale_of_colours(blues, view)
        if grid <= MAX_LINED_CELLS:
            draw_lines(axes, np.arange(1, grid) * self._km, side, "0.88")
        if view.area is not None:
            self._add_area(view.area)
        draw_shore(axes, view.sea)
        draw_sightings(axes, view.sea, side)
        draw_corner(axes, corner_rows(view.sea, 1000.0 * side))

        def lines(**style: Any) -> Any:
            return axes.add_collection(LineCollection([], **style), autolim=False)

        self._strokes = lines(colors="0.35", linewidths=0.7, zorder=1)
        self._shade = draw_cells(axes, np.zeros((1, 1, 4)), side, zorder=1)
        self._shade.set_visible(False)

        colours = np.array([to_rgb(drone_colour(i)) for i in range(count)]).reshape(count, 3)
        age = np.linspace(0.35, 1.0, _AGES)[:, np.newaxis, np.newaxis]
        # Order by age first, so that new parts of any track lie above the old parts of all tracks.
        shades = (1.0 - age * (1.0 - colours)).reshape(-1, 3)
        width = 1.8 if count <= _LANES else 1.3
        joined = {"capstyle": "round", "joinstyle": "round"}
        self._casing = lines(colors="white", linewidths=width + 1.2, zorder=2, **joined)
        self._lines = lines(colors=shades, linewidths=width, zorder=2.1, **joined)
        # Vehicle tracks may overlap: upper lines are thinner, so that lower ones stay visible.
        widths = np.linspace(6.0, 1.5, count) if count > 1 else 2.5
        self._flown = lines(colors=colours, linewidths=widths, zorder=2.5, **joined)
        lanes = min(count, _LANES)
        apart = max(min(0.2, 0.8 / lanes) * self._km, 0.0035 * side)
        self._lane = (np.arange(count) % _LANES - (lanes - 1) / 2) * apart
        self._every = max(1, round(round_length(max(view.timestep_limit / 8, 1))))
        self._colours = colours

        def points(zorder: float, size: float, marker: str) -> Any:
            return axes.scatter([], [], s=size**2, marker=marker, linewidths=0.9, zorder=zorder)

        self._numbered = count <= MAX_NUMBERED_DRONES
        head = 10.0 if self._numbered else 6.0
        self._times = points(3, 3.6, "o")
        self._starts = points(3.5, 5.0, "s")
        self._heads, self._lost = points(6, head, "o"), points(6, head + 1, "X")
        for heads in (self._heads, self._lost):
            heads.set_edgecolor("white")
        light = colours @ (0.2126, 0.7152, 0.0722) > 0.55
        self._numbers = [
            axes.text(
                0,
                0,
                str(i),
                color="black" if light[i] else "white",
                fontsize=6.5,
                fontweight="bold",
                ha="center",
                va="center_baseline",
                zorder=6.5,
                clip_on=True,
            )  # fmt: skip
            for i in range(count if self._numbered else 0)
        ]

        def marks(marker: str, size: float, **style: Any) -> Line2D:
            (line,) = axes.plot([], [], marker, markersize=size, linestyle="none", **style)
            return line

        (self._circle,) = axes.plot([], [], **CIRCLE)
        self._datum = marks("+", 11, zorder=4, **DATUM)
        self._persons = marks("*", 14, markerfacecolor=PERSON, zorder=5, **STAR)
        self._found = marks("*", 12, markerfacecolor="white", zorder=5, **STAR)
        ring = {"markerfacecolor": "none", "zorder": 5}
        self._rings = [
            marks("o", 20, markeredgecolor=colour, markeredgewidth=width, **ring)
            for colour, width in (("black", 4.0), (FOUND, 2.0))
        ]
        axes.set_xlim(0, side)
        axes.set_ylim(0, side)
        name_axes(axes, fontsize=9)
        axes.tick_params(labelsize=9)
        draw_chart(axes, side, view.origin, layout.scale)

    def _add_scale_of_colours(self, colours: Any, view: MissionView) -> None:
        # Updating a matplotlib colour bar takes longer than drawing everything else.
        left, bottom, width, height = self._layout.bar
        bar = self._panel.inset_axes(self._layout.bar)
        bar.imshow(np.linspace(0, 1, 64)[np.newaxis], cmap=colours, aspect="auto")
        bar.set_xticks([-0.5, 31.5, 63.5], ["", "", ""])
        bar.set_yticks([])
        bar.tick_params(length=3)
        # Labels at the left end, the middle (the colours use roots) and the right end.
        self._percents = [
            self._panel.text(
                left + share * width, bottom - 0.4 * height, "", fontsize=9, ha="center", va="top"
            )
            for share in (0.0, 0.5, 1.0)
        ]
        learned = (
            "left to cover"
            if view.coverage_rate is not None
            else "after the searches so far"
            if view.belief
            else "by drift alone, before any search"
        )
        self._panel.text(
            left,
            bottom + 1.4 * height,
            f"probability per cell (%),\n{learned}",
            fontsize=9,
            va="bottom",
        )

    def _add_area(self, area: NDArray[np.bool_]) -> None:
        """Draw the cells outside the area, and the edge of the area."""
        from matplotlib.collections import LineCollection

        draw_outside(self._axes, area, self._side, LAND, zorder=0.7)
        upright, level = np.argwhere(np.diff(area, axis=1)), np.argwhere(np.diff(area, axis=0))
        # Corners (col, row) of the cells, rows from the north.
        ends = [
            (upright[:, ::-1] + (1, 0), upright[:, ::-1] + (1, 1)),
            (level[:, ::-1] + (0, 1), level[:, ::-1] + (1, 1)),
        ]
        edges = np.concatenate([np.stack(pair, axis=1) for pair in ends]).astype(float)
        edges[..., 1] = self._grid - edges[..., 1]
        self._axes.add_collection(
            LineCollection(list(edges * self._km), colors=EDGE, linewidths=1.0, zorder=0.8),
            autolim=False,
        )

    def _update(self, view: MissionView) -> None:
        top = 100.0 * float(view.probability.max())
        self._sea.set_data(100.0 * view.probability)
        self._sea.set_clim(0, top or 1.0)
        for text, share in zip(self._percents, (0, 0.25, 1), strict=True):
            percent = share * top
            text.set_text(f"{percent:.0f}" if percent >= 99.5 else f"{percent:.2g}")
        self._draw_searches(view)
        self._draw_tracks(view)
        place = self._place
        if view.circle is not None:
            col, row, radius = view.circle
            angle = np.linspace(0, 2 * math.pi, 91)
            self._circle.set_data(
                *place(np.stack([col + radius * np.cos(angle), row + radius * np.sin(angle)], 1)).T
            )
        if view.datum is not None:
            self._datum.set_data(*place([view.datum]).T)
        self._persons.set_data(*place(view.persons[~view.found]).T)
        for marks in (self._found, *self._rings):
            marks.set_data(*place(view.persons[view.found]).T)
        self._title.set_text(view.title)
        self._status.set_text(view.status)

    def _draw_searches(self, view: MissionView) -> None:
        if view.searches is None:
            return
        if self._shaded:
            shade = np.zeros((*view.searches.shape, 4), np.float32)
            shade[..., 3] = 0.14 * np.minimum(view.searches, MAX_STROKES)
            self._shade.set_data(shade)
            self._shade.set_visible(True)
            return
        row, col = np.nonzero(view.searches)
        counts = np.minimum(view.searches[row, col], MAX_STROKES)
        south_west = np.stack([col, self._grid - 1 - row], axis=1)
        self._strokes.set_segments(
            [
                (corner + stroke) * self._km
                for corner, number in zip(south_west, counts.tolist(), strict=True)
                for stroke in _STROKES[number]
            ]
        )

    def _draw_tracks(self, view: MissionView) -> None:
        places = np.stack([self._place(track) for track in view.tracks])
        last = places.shape[1] - 1
        lanes = places + self._lane[:, np.newaxis, np.newaxis]
        # A track begins and ends at its drone, in the middle of a cell.
        lanes[:, 0], lanes[:, last] = places[:, 0], places[:, last]
        cuts = np.linspace(0, last, _AGES + 1).round().astype(int)
        parts = [
            track[first : then + 1]
            for first, then in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)
            for track in lanes
        ]
        self._lines.set_segments(parts)
        self._casing.set_segments(parts)
        self._flown.set_segments([np.asarray(flown) / 1000.0 for flown in view.flown])
        for planned in (self._lines, self._casing, self._times):
            planned.set_visible(not view.flown)
        times = lanes[:, self._every : last : self._every]
        colours = np.repeat(self._colours, times.shape[1], axis=0)
        self._put(self._times, times.reshape(-1, 2), "white", edges=colours)
        self._put(self._starts, places[:, 0], "white", edges=self._colours)
        now = places[:, last]
        self._put(self._heads, now[view.alive], self._colours[view.alive])
        self._put(self._lost, now[~view.alive], self._colours[~view.alive])
        for text, (x, y) in zip(self._numbers, now.tolist(), strict=False):
            text.set_position((x, y))

    @staticmethod
    def _put(points: Any, places: NDArray[np.float64], colours: Any, edges: Any = None) -> None:
        points.set_offsets(places)
        points.set_facecolor(colours)
        if edges is not None:
            points.set_edgecolor(edges)

    def _list(self, view: MissionView) -> bool:
        """Write the legend if it has changed; return whether it has."""
        shown = {
            "drone": bool(view.alive.any()),
            "lost": not view.alive.all(),
            "start": True,
            "flown": bool(view.flown),
            "track": view.tracks.shape[1] > 1 and not view.flown,
            "searched": view.searches is not None and bool(view.searches.any()),
            "datum": view.datum is not None,
            "circle": self._shows_circle(view),
            "lkp": any(label_sides(view.sea, 1000.0 * self._side)),
            "person": bool((~view.found).any()),
            "found": bool(view.found.any()),
            "outside": view.area is not None,
            "land": bool(view.sea.shore),
        }
        listed = tuple(shown.values())
        if listed == self._listed:
            return False
        self._listed = listed
        entries = legend_entries(
            numbered=self._numbered, shaded=self._shaded, every=self._every, step_s=view.step_s
        )
        chosen = [entry for name, entry in entries.items() if shown[name]]
        self._panel.legend(
            [handle for handle, _ in chosen], [label for _, label in chosen], loc="upper left",
            bbox_to_anchor=self._layout.legend, fontsize=9, frameon=False, borderaxespad=0.0,
            labelspacing=0.75, handlelength=2.2, ncols=self._layout.columns, columnspacing=0.6,
        )  # fmt: skip
        return True

    def _shows_circle(self, view: MissionView) -> bool:
        """Return whether a part of the circle is on the map."""
        if view.circle is None:
            return False
        col, row, radius = view.circle
        far = [max(at + 0.5, self._grid - at - 0.5) for at in (col, row)]
        return math.hypot(*far) > radius

    def _place(self, cells: Any) -> NDArray[np.float64]:
        """Return x and y in km of cells (K, 2)."""
        return places_km(cells, self._grid, self._km)


def _strokes(count: int) -> NDArray[np.float64]:
    """Return lines (count, 2, 2) across a cell of side 1, from south-west to north-east."""
    shift = (np.arange(count) + 1) * 2 / (count + 1) - 1
    low, high = np.maximum(shift, 0), np.minimum(shift + 1, 1)
    return np.stack([np.stack([low, low - shift], 1), np.stack([high, high - shift], 1)], 1)


_STROKES = [_strokes(count) for count in range(MAX_STROKES + 1)]
