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

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.picture.chart import draw_degrees, draw_scale, round_length
from dsse_ros.picture.legend import (
    FOUND,
    PERSON,
    STAR,
    STRIP_ALPHA,
    circle_style,
    datum_style,
    heading_marker,
    legend_entries,
    wait_marker,
)
from dsse_ros.picture.map_axes import (
    MAX_LINED_CELLS,
    MAX_STROKES,
    STROKES,
    draw_cells,
    draw_lines,
    draw_outside,
    fan_out,
    name_axes,
    places_km,
    strips_of_tracks,
)
from dsse_ros.picture.mission_view import MissionView
from dsse_ros.picture.sea_chart import (
    corner_rows,
    draw_corner,
    draw_shore,
    draw_sightings,
    label_sides,
)
from dsse_ros.picture.theme import LIGHT, Theme, drone_colour

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

Rect = tuple[float, float, float, float]


@dataclass(frozen=True)
class PictureLayout:
    """Where a picture has its parts, as shares of the figure.

    Attributes:
        size_in: Width and height of the figure in inches.
        map: Left, bottom, width and height of the map.
        bar: Those of the bar of colours.
        label: Left and middle of the label of the bar.
        panel: Those of the legend; None for a map without title, status and legend.
    """

    size_in: tuple[float, float]
    map: Rect
    bar: Rect
    label: tuple[float, float]
    panel: Rect | None = None

    @property
    def map_pt(self) -> float:
        """Longer side of the map in points."""
        return 72.0 * self.size_in[0] * self.map[2]


WIDE = PictureLayout(
    size_in=(8.0, 6.0), map=(0.08, 0.11, 0.5625, 0.75), bar=(0.715, 0.77, 0.253, 0.026),
    label=(0.715, 0.83), panel=(0.704, 0.11, 0.29, 0.59),
)  # fmt: skip
"""The whole picture: the legend beside the map."""
PLAIN = PictureLayout(
    size_in=(4.8, 5.2), map=(0.12, 0.1, 0.81, 0.7477), bar=(0.12, 0.952, 0.3, 0.022),
    label=(0.46, 0.963),
)  # fmt: skip
"""The map and its colours."""
MAX_NUMBERED_DRONES = 24
_LANES = 8
"""Number of parallel tracks in a cell; further drones share them."""
_AGES = 8
"""Shades of a track."""
_SMALLEST_CELL_PT = 5.0
"""Smallest side of a cell with strokes; smaller cells are shaded."""
_MAX_WAIT_PT = 9.0
"""Largest symbol for waiting."""
_TITLE_TOP, _STATUS_TOP = 0.975, 0.94


def sea_colours(theme: Theme = LIGHT) -> LinearSegmentedColormap:
    """Return the colours of probabilities."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("sea", theme.sea)


class Picture:
    """The mission on a matplotlib figure: east to the right, north up, in km.

    Tracks get stronger towards the present, and have dots at regular intervals of steps. On cells
    they run in parallel, and each stroke through a cell is one search of it. In metres they are
    where the drones flew, in the strips that these saw. Elements that do not change from view to
    view are kept.

    Args:
        figure: The figure to draw on.
        layout: Where it has its parts.
        theme: Its colours.
    """

    def __init__(self, figure: Figure, layout: PictureLayout = WIDE, theme: Theme = LIGHT) -> None:
        self._figure, self._layout, self._theme = figure, layout, theme
        self._scene: tuple[Any, ...] = ()
        self._listed: tuple[Any, ...] = ()

    @property
    def moving(self) -> list[Artist]:
        """Artists that change from view to view, and those above them, from bottom to top."""
        over = [*self._axes.collections, *self._axes.images, *self._axes.texts, *self._axes.lines]
        over = [artist for artist in over if artist.get_clip_on()]
        over.sort(key=lambda artist: artist.get_zorder())
        return [*over, *self._axes.spines.values(), *self._percents, *self._words]

    def draw(self, view: MissionView) -> bool:
        """Draw the present mission; return whether other artists than `moving` have changed."""
        extent = GridShape.of(view.probability).extent(view.cell_size_m)
        scene = (
            view.probability.shape, view.cell_size_m, len(view.tracks), view.belief, view.origin,
            view.timestep_limit, None if view.area is None else view.area.tobytes(),
            corner_rows(view.sea, extent), view.sea.sightings,
            [ring.tobytes() for ring in view.sea.shore], view.tracks[:, 0].tobytes(), view.strips_m,
        )  # fmt: skip
        if scene != self._scene:
            self._scene, self._listed = scene, ()
            self._build(view)
        self._update(view)
        return self._list(view)

    # The scene

    def _build(self, view: MissionView) -> None:
        grid, layout, theme = GridShape.of(view.probability), self._layout, self._theme
        self._grid, self._km = grid, view.cell_size_m / 1000.0
        self._extent = grid.extent(self._km)
        self._side = max(self._extent)
        self._shaded = layout.map_pt / grid.longer < _SMALLEST_CELL_PT
        self._figure.clear()
        self._figure.set_facecolor(theme.paper)
        self._axes = self._figure.add_axes(layout.map, facecolor=theme.paper)
        self._words = []
        if layout.panel is not None:
            self._panel = self._figure.add_axes(layout.panel)
            self._panel.set_axis_off()
            for top, style in ((_TITLE_TOP, {"fontsize": 11, "fontweight": "bold"}),
                               (_STATUS_TOP, {"fontsize": 10})):  # fmt: skip
                text = self._figure.text(0.02, top, "", color=theme.ink, va="top", **style)
                text.set_parse_math(False)
                self._words.append(text)
        self._add_sea(view)
        self._add_searches()
        self._add_tracks(len(view.tracks), view.timestep_limit, on_cells=not view.strips_m)
        self._add_strips(view.strips_m)
        self._add_drones(len(view.tracks))
        self._add_persons()
        self._finish_axes(view)

    def _add_sea(self, view: MissionView) -> None:
        """Add the cells, and what the sea consists of."""
        from matplotlib.colors import PowerNorm

        axes, extent, theme = self._axes, self._extent, self._theme
        # A square root makes small probabilities visible.
        colours, roots = sea_colours(theme), (PowerNorm(0.5, 0, 1) for _ in range(2))
        self._sea = draw_cells(
            axes, view.probability, extent, cmap=colours, norm=next(roots), zorder=0
        )
        self._add_scale_of_colours(colours, next(roots), view)
        if self._grid.longer <= MAX_LINED_CELLS:
            draw_lines(axes, self._grid, extent, theme.faint)
        if view.area is not None:
            self._add_area(view.area)
        draw_shore(axes, view.sea, theme)
        draw_sightings(axes, view.sea, extent, theme)
        draw_corner(axes, corner_rows(view.sea, self._grid.extent(view.cell_size_m)), theme)

    def _add_scale_of_colours(self, colours: Any, norm: Any, view: MissionView) -> None:
        """Add the bar of colours, along which the probability is linear."""
        # Updating a matplotlib colour bar takes longer than drawing everything else.
        theme, (left, bottom, width, _) = self._theme, self._layout.bar
        bar = self._figure.add_axes(self._layout.bar)
        bar.imshow(np.linspace(0, 1, 256)[np.newaxis], cmap=colours, norm=norm, aspect="auto")
        bar.set_xticks([-0.5, 127.5, 255.5], ["", "", ""])
        bar.set_yticks([])
        bar.tick_params(length=3, color=theme.ink)
        for spine in bar.spines.values():
            spine.set_color(theme.ink)
        words: dict[str, Any] = {"fontsize": 9, "color": theme.ink}
        self._percents = [
            self._figure.text(
                left + share * width, bottom - 0.014, "", ha="center", va="top", **words
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
        text = f"probability per cell (%),\n{learned}"
        self._figure.text(*self._layout.label, text, va="center", **words)

    def _add_area(self, area: NDArray[np.bool_]) -> None:
        """Add the cells outside the area, and the edge of the area."""
        from matplotlib.collections import LineCollection

        draw_outside(self._axes, area, self._extent, self._theme.land, zorder=0.7)
        upright, level = np.argwhere(np.diff(area, axis=1)), np.argwhere(np.diff(area, axis=0))
        # Corners (col, row) of the cells, rows from the north.
        ends = [
            (upright[:, ::-1] + (1, 0), upright[:, ::-1] + (1, 1)),
            (level[:, ::-1] + (0, 1), level[:, ::-1] + (1, 1)),
        ]
        edges = np.concatenate([np.stack(pair, axis=1) for pair in ends]).astype(float)
        edges[..., 1] = self._grid.rows - edges[..., 1]
        colour = self._theme.edge
        self._axes.add_collection(
            LineCollection(list(edges * self._km), colors=colour, linewidths=1.0, zorder=0.8),
            autolim=False,
        )

    def _add_lines(self, **style: Any) -> Any:
        from matplotlib.collections import LineCollection

        return self._axes.add_collection(LineCollection([], **style), autolim=False)

    def _add_points(self, zorder: float, size: float, marker: Any, width: float = 0.9) -> Any:
        return self._axes.scatter([], [], s=size**2, marker=marker, linewidths=width, zorder=zorder)

    def _add_searches(self) -> None:
        """Add the strokes or shades of searches, and the symbols of waiting drones."""
        self._strokes = self._add_lines(colors=self._theme.soft, linewidths=0.7, zorder=1)
        self._shade = draw_cells(self._axes, np.zeros((1, 1, 4)), self._extent, zorder=1)
        self._shade.set_visible(False)
        size = min(0.7 * self._layout.map_pt / self._grid.longer, _MAX_WAIT_PT)
        self._waits = self._add_points(3.7, max(size, 4.0), wait_marker(), width=1.6)

    def _add_strips(self, widths_m: tuple[float, ...]) -> None:
        """Add the strips that drones in metres see on their paths."""
        self._widths = [self._layout.map_pt * width / (1000.0 * self._side) for width in widths_m]
        self._strips = self._add_lines(
            colors=self._theme.soft, alpha=STRIP_ALPHA, zorder=0.9, capstyle="butt",
            joinstyle="round",
        )  # fmt: skip

    def _add_tracks(self, count: int, timestep_limit: int, *, on_cells: bool) -> None:
        from matplotlib.colors import to_rgb

        paper = np.array(to_rgb(self._theme.paper))
        colours = np.array([to_rgb(drone_colour(i)) for i in range(count)]).reshape(count, 3)
        age = np.linspace(0.35, 1.0, _AGES)[:, np.newaxis, np.newaxis]
        # Order by age first, so that new parts of any track lie above the old parts of all tracks.
        shades = (paper - age * (paper - colours)).reshape(-1, 3)
        width = 1.8 if count <= _LANES else 1.3
        joined = {"capstyle": "round", "joinstyle": "round"}
        self._casing = self._add_lines(
            colors=self._theme.paper, linewidths=width + 1.2, zorder=2, **joined
        )
        self._lines = self._add_lines(colors=shades, linewidths=width, zorder=2.1, **joined)
        # Vehicle tracks may overlap: upper lines are thinner, so that lower ones stay visible.
        widths = np.linspace(6.0, 1.5, count) if count > 1 else 2.5
        self._flown = self._add_lines(colors=colours, linewidths=widths, zorder=2.5, **joined)
        lanes = min(count, _LANES)
        apart = max(min(0.2, 0.8 / lanes) * self._km, 0.0035 * self._side)
        self._lane = (np.arange(count) % _LANES - (lanes - 1) / 2) * apart * on_cells
        self._every = max(1, round(round_length(max(timestep_limit / 8, 1))))
        self._colours = colours
        self._times = self._add_points(3, 3.6, "o")
        self._starts = self._add_points(3.5, 5.0, "s")

    def _add_drones(self, count: int) -> None:
        self._numbered = count <= MAX_NUMBERED_DRONES
        head = 10.0 if self._numbered else 6.0
        self._apart = (head + 1.5) / self._layout.map_pt * self._side
        self._heads, self._lost = (
            self._add_points(6, head, "o"), self._add_points(6, head + 1, "X")
        )  # fmt: skip
        for heads in (self._heads, self._lost):
            heads.set_edgecolor(self._theme.paper)
        light = self._colours @ (0.2126, 0.7152, 0.0722) > 0.55
        self._numbers = [
            self._axes.text(
                0, 0, str(i), color="black" if light[i] else "white", fontsize=6.5,
                fontweight="bold", ha="center", va="center_baseline", zorder=6.5, clip_on=True,
            )
            for i in range(count if self._numbered else 0)
        ]  # fmt: skip

    def _add_persons(self) -> None:
        """Add the persons, and where they may be."""

        def marks(marker: str, size: float, **style: Any) -> Line2D:
            (line,) = self._axes.plot([], [], marker, markersize=size, linestyle="none", **style)
            return line

        (self._circle,) = self._axes.plot([], [], **circle_style(self._theme))
        self._datum = marks("+", 11, zorder=4, **datum_style(self._theme))
        self._persons = marks("*", 14, markerfacecolor=PERSON, zorder=5, **STAR)
        self._found = marks("*", 12, markerfacecolor="white", zorder=5, **STAR)
        ring = {"markerfacecolor": "none", "zorder": 5}
        self._rings = [
            marks("o", 20, markeredgecolor=colour, markeredgewidth=width, **ring)
            for colour, width in (("black", 4.0), (FOUND, 2.0))
        ]

    def _finish_axes(self, view: MissionView) -> None:
        axes, (width, height), theme = self._axes, self._extent, self._theme
        axes.set_xlim(0, width)
        axes.set_ylim(0, height)
        name_axes(axes, fontsize=9, color=theme.ink)
        axes.tick_params(labelsize=9, colors=theme.ink)
        for spine in axes.spines.values():
            spine.set_color(theme.ink)
        if view.origin is not None:
            draw_degrees(axes, self._extent, view.origin, theme)
        # Drones that start in the south-western corner would hide it.
        side = min(self._side, 2 * min(width, height))
        starts = self._place(view.tracks[:, 0]) / side
        west = not ((starts[:, 0] < 0.47) & (starts[:, 1] < 0.16)).any()
        draw_scale(axes, (0.0 if west else width - 0.46 * side, 0.0), side, theme)

    # A view

    def _update(self, view: MissionView) -> None:
        top = 100.0 * float(view.probability.max())
        self._sea.set_data(100.0 * view.probability)
        self._sea.set_clim(0, top or 1.0)
        for text, share in zip(self._percents, (0, 0.5, 1), strict=True):
            percent = share * top
            text.set_text(f"{percent:.0f}" if percent >= 99.5 else f"{percent:.2g}")
        self._draw_searches(view)
        self._draw_tracks(view)
        self._draw_drones(view)
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
        for text, words in zip(self._words, (view.title, view.status), strict=False):
            text.set_text(words)

    def _draw_searches(self, view: MissionView) -> None:
        if view.waits is not None:
            row, col = np.nonzero(view.waits)
            self._put(
                self._waits, self._place(np.stack([col, row], axis=1)), "none", self._theme.ink
            )
        if view.searches is None:
            return
        if self._shaded:
            from matplotlib.colors import to_rgb

            shade = np.zeros((*view.searches.shape, 4), np.float32)
            shade[..., :3] = to_rgb(self._theme.ink)
            shade[..., 3] = 0.14 * np.minimum(view.searches, MAX_STROKES)
            self._shade.set_data(shade)
            self._shade.set_visible(True)
            return
        row, col = np.nonzero(view.searches)
        counts = np.minimum(view.searches[row, col], MAX_STROKES)
        south_west = np.stack([col, self._grid.rows - 1 - row], axis=1)
        self._strokes.set_segments(
            [
                (corner + stroke) * self._km
                for corner, number in zip(south_west, counts.tolist(), strict=True)
                for stroke in STROKES[number]
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
        lines, widths = strips_of_tracks(places, view.looked, self._widths)
        self._strips.set(segments=lines, linewidths=widths or 1.0)
        self._lines.set_segments(parts)
        self._casing.set_segments(parts)
        self._flown.set_segments([np.asarray(flown) / 1000.0 for flown in view.flown])
        for planned in (self._lines, self._casing, self._times):
            planned.set_visible(not view.flown)
        every = self._every * view.legs
        times = lanes[:, every:last:every]
        colours = np.repeat(self._colours, times.shape[1], axis=0)
        self._put(self._times, times.reshape(-1, 2), self._theme.paper, colours)
        starts = fan_out(places[:, 0], self._apart, self._extent)
        self._put(self._starts, starts, self._theme.paper, self._colours)

    def _draw_drones(self, view: MissionView) -> None:
        now = fan_out(self._place(view.tracks[:, -1]), self._apart, self._extent)
        if view.headings is not None:
            # One for each drone, as every collection takes its markers in turn.
            self._heads.set_paths([heading_marker(turn) for turn in view.headings[view.alive]])
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
        shown = self.shown(view)
        listed = tuple(shown)
        if listed == self._listed:
            return False
        self._listed = listed
        if self._layout.panel is not None:
            entries = self.entries(view)
            self._panel.legend(
                [entries[name][0] for name in shown], [entries[name][1] for name in shown],
                loc="upper left", fontsize=9, frameon=False, borderaxespad=0.0, labelspacing=0.75,
                handlelength=2.2, labelcolor=self._theme.ink,
            )  # fmt: skip
        return True

    def entries(self, view: MissionView) -> dict[str, tuple[Any, str]]:
        """Return the symbols that the picture can have, with their meanings."""
        return legend_entries(
            self._theme, numbered=self._numbered, shaded=self._shaded, every=self._every,
            step_s=view.step_s, in_metres=bool(view.strips_m),
        )  # fmt: skip

    def shown(self, view: MissionView) -> list[str]:
        """Return the names of the entries of the legend that a picture of the view has."""
        there = {
            "drone": bool(view.alive.any()),
            "lost": not view.alive.all(),
            "start": True,
            "flown": bool(view.flown),
            "track": view.tracks.shape[1] > 1 and not view.flown,
            "searched": view.searches is not None and bool(view.searches.any()),
            "strip": bool(view.strips_m) and view.tracks.shape[1] > 1,
            "waited": view.waits is not None and bool(view.waits.any()),
            "datum": view.datum is not None,
            "circle": self._shows_circle(view),
            "lkp": any(label_sides(view.sea, self._grid.extent(view.cell_size_m))),
            "person": bool((~view.found).any()),
            "found": bool(view.found.any()),
            "outside": view.area is not None,
            "land": bool(view.sea.shore),
        }
        return [name for name, present in there.items() if present]

    def _shows_circle(self, view: MissionView) -> bool:
        """Return whether a part of the circle is on the map."""
        if view.circle is None:
            return False
        col, row, radius = view.circle
        far = [
            max(at + 0.5, size - at - 0.5) for at, size in zip((col, row), self._grid, strict=True)
        ]
        return math.hypot(*far) > radius

    def _place(self, cells: Any) -> NDArray[np.float64]:
        """Return x and y in km of cells (K, 2)."""
        return places_km(cells, self._grid.rows, self._km)
