# SPDX-License-Identifier: Apache-2.0
"""Pictures of a mission: text, image and window, all drawn from one `MissionView`."""

from __future__ import annotations

import math
import os
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

SHADES = " .:-=+*#%@"
MAX_NAMED_DRONES = 8
LAND = "#d8cba8"
"""Colour of the cells outside the area."""


@dataclass(frozen=True)
class MissionView:
    """What a picture of a mission shows; cells are (col, row), row 0 in the north.

    Attributes:
        probability: (G, G) float32, [row, col].
        tracks: (N, K, 2) cells of each drone, from its start to where it is now.
        alive: (N,) bool, whether the drone is still in flight.
        persons: (P, 2) cells; no rows where the persons are not to be shown.
        found: (P,) bool.
        datum: Supposed cell of the person, or None where it is not known.
        step: Steps done.
        timestep_limit: Steps the drones can do.
        cell_size_m: Side of a cell in metres.
        title: Name of the place.
        pos: Cumulative probability of success of the searches, None where it is not known.
        belief: Whether the probability is a belief, which has learned from the searches.
        area: (G, G) bool [row, col], the cells that are searched; None for all.
    """

    probability: NDArray[np.float32]
    tracks: NDArray[np.integer[Any]]
    alive: NDArray[np.bool_]
    persons: NDArray[np.integer[Any]]
    found: NDArray[np.bool_]
    datum: tuple[int, int] | None
    step: int
    timestep_limit: int
    cell_size_m: float
    title: str = ""
    pos: float | None = None
    belief: bool = False
    area: NDArray[np.bool_] | None = None

    @property
    def headline(self) -> str:
        """One line: place, step, persons found, drones in flight, POS."""
        parts = [f"step {self.step} of {self.timestep_limit}"]
        if len(self.persons):
            parts.append(f"{int(self.found.sum())} of {len(self.persons)} found")
        parts.append(f"{int(self.alive.sum())} of {len(self.alive)} drones in flight")
        if self.pos is not None:
            parts.append(f"POS {self.pos:.1%}")
        return ": ".join(filter(None, [self.title, ", ".join(parts)]))


def to_ansi(view: MissionView) -> str:
    """Return the mission as text: shades of probability, drones 0-9, x down, P person, F found.

    A cell outside the area is a slash.
    """
    top = float(view.probability.max()) or 1.0
    level = np.ceil(np.sqrt(view.probability / top) * (len(SHADES) - 1)).astype(int)
    rows = [[SHADES[i] for i in line] for line in level.tolist()]
    if view.area is not None:
        for row, col in np.argwhere(~view.area).tolist():
            rows[row][col] = "/"

    def put(cell: NDArray[np.integer[Any]], mark: str) -> None:
        col, row = int(cell[0]), int(cell[1])
        if 0 <= row < len(rows) and 0 <= col < len(rows):
            rows[row][col] = mark

    for cell in view.persons[~view.found]:
        put(cell, "P")
    for i, track in enumerate(view.tracks):
        put(track[-1], str(i % 10) if view.alive[i] else "x")
    # Its finder is in its cell.
    for cell in view.persons[view.found]:
        put(cell, "F")
    edge = "+" + "-" * len(rows) + "+"
    body = ["|" + "".join(row) + "|" for row in rows]
    return "\n".join([view.headline, edge, *body, edge]) + "\n"


class Picture:
    """The mission on a matplotlib figure: east to the right, north up, in km.

    What stays the same from one view to the next is kept: the layout alone takes half the time.

    Args:
        figure: It is drawn on from now on.
    """

    def __init__(self, figure: Figure) -> None:
        self._figure = figure
        self._scene: tuple[Any, ...] = ()
        self._margins: tuple[Any, ...] = ()

    def draw(self, view: MissionView) -> None:
        """Draw the mission as it is now."""
        scene = (
            len(view.probability), view.cell_size_m, len(view.tracks), len(view.persons),
            view.datum is None, view.belief, None if view.area is None else view.area.tobytes(),
        )  # fmt: skip
        if scene != self._scene:
            self._scene, self._margins = scene, ()
            self._build(view)
        self._update(view)
        # Whatever can make the texts beside the map wider or narrower.
        top = float(view.probability.max())
        margins = (
            view.alive[:MAX_NAMED_DRONES].tolist(), view.found.any(), view.found.all(), view.title,
            math.floor(math.log10(top)) if top > 0 else None,
        )  # fmt: skip
        self._figure.set_layout_engine("none" if margins == self._margins else "constrained")
        if margins != self._margins:
            self._margins = margins
            self._label(view)

    def _build(self, view: MissionView) -> None:
        from matplotlib import colormaps
        from matplotlib.colors import ListedColormap

        grid, count = len(view.probability), len(view.tracks)
        self._grid, self._km = grid, view.cell_size_m / 1000.0
        side = grid * self._km
        self._figure.clear()
        self._axes = axes = self._figure.add_subplot()
        self._sea = axes.imshow(
            view.probability, cmap="Blues", extent=(0, side, 0, side), interpolation="nearest"
        )
        if view.area is not None:
            outside = np.ma.masked_where(view.area, np.ones(view.area.shape))
            axes.imshow(
                outside, cmap=ListedColormap([LAND]), extent=(0, side, 0, side),
                interpolation="nearest",
            )  # fmt: skip
        bar = self._figure.colorbar(
            self._sea,
            ax=axes,
            label="belief after the searches, per cell (%)" if view.belief else "map, per cell (%)",
            shrink=0.8,
            pad=0.02,
        )
        self._beside = bar.ax
        colours = colormaps["tab10" if count <= 10 else "turbo"]
        self._colours = [colours(i if count <= 10 else i / count) for i in range(count)]
        size = float(np.clip(300 / grid, 4, 11))

        def points(marker: str, scale: float, **style: Any) -> Line2D:
            style = {"linestyle": "none", "markeredgecolor": "black", **style}
            (line,) = axes.plot([], [], marker, markersize=size * scale, **style)
            return line

        self._drones = []
        for colour in self._colours:
            (track,) = axes.plot([], [], color=colour, linewidth=1.2, alpha=0.8)
            start = points("o", 0.45, color=colour, markeredgecolor=colour)
            self._drones.append((track, start, points("^", 1.0, color=colour)))
        self._datum = points("+", 1.3, color="black", label="datum")
        self._persons = {
            False: points("*", 1.6, color="red", label="person", zorder=5),
            True: points("*", 1.6, color="limegreen", label="person found", zorder=5),
        }
        if grid <= 50:
            inner = np.arange(1, grid) * self._km
            axes.hlines(inner, 0, side, color="0.85", linewidth=0.4)
            axes.vlines(inner, 0, side, color="0.85", linewidth=0.4)
        axes.set_xlim(0, side)
        axes.set_ylim(0, side)
        axes.set_xlabel("east (km)")
        axes.set_ylabel("north (km)")

    def _update(self, view: MissionView) -> None:
        percent = 100.0 * view.probability
        self._sea.set_data(percent)
        self._sea.set_clim(0, float(percent.max()))
        for (track, start, now), cells, alive in zip(
            self._drones, view.tracks, view.alive, strict=True
        ):
            x, y = self._place(cells)
            track.set_data(x, y)
            start.set_data(x[:1], y[:1])
            now.set_data(x[-1:], y[-1:])
            now.set_marker("^" if alive else "X")
        if view.datum is not None:
            self._datum.set_data(*self._place([view.datum]))
        for found, points in self._persons.items():
            points.set_data(*self._place(view.persons[view.found == found]))
        self._axes.set_title(view.headline, fontsize=10, parse_math=False)

    def _label(self, view: MissionView) -> None:
        """Write the legend anew."""
        shown = [now for _, _, now in self._drones[:MAX_NAMED_DRONES]]
        for i, now in enumerate(shown):
            now.set_label(f"drone{i}" if view.alive[i] else f"drone{i} (down)")
        if view.datum is not None:
            shown.append(self._datum)
        shown += [self._persons[found] for found in (False, True) if (view.found == found).any()]
        rest = len(self._drones) - MAX_NAMED_DRONES
        # The colour bar has it: Matplotlib 3.6 finds no room for a legend of the figure.
        self._beside.legend(
            handles=shown, loc="upper left", bbox_to_anchor=(4.5, 1.0), fontsize=8, frameon=False,
            title="\n".join(["o start, ^ now", *([f"and {rest} more"] if rest > 0 else [])]),
            title_fontsize=8,
        )  # fmt: skip

    def _place(self, cells: Any) -> tuple[Any, Any]:
        """Return x and y in km of cells (K, 2)."""
        cells = np.asarray(cells, float)
        return (cells[:, 0] + 0.5) * self._km, (self._grid - 1 - cells[:, 1] + 0.5) * self._km


def new_figure() -> Figure:
    """Return an empty figure of the size that `Picture` is made for, without a window."""
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise ModuleNotFoundError("pictures need matplotlib: pip install dsse_ros[viz]") from None
    return Figure(figsize=(8.0, 5.6), dpi=100, layout="constrained")


class Camera:
    """Takes one image after the other."""

    def __init__(self) -> None:
        figure = new_figure()
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self._canvas = FigureCanvasAgg(figure)
        self._picture = Picture(figure)

    def rgb_array(self, view: MissionView) -> NDArray[np.uint8]:
        """Return the mission as an image (H, W, 3) uint8."""
        self._picture.draw(view)
        self._canvas.draw()
        return np.array(np.asarray(self._canvas.buffer_rgba())[..., :3])


def save_picture(view: MissionView, path: str | os.PathLike[str]) -> None:
    """Write the mission as an image file; the ending of the path chooses the format."""
    figure = new_figure()
    Picture(figure).draw(view)
    figure.savefig(path)


class Viewer:
    """A window that shows the mission; without a display it draws and shows nothing.

    Args:
        fps: Pictures per second at most.
    """

    def __init__(self, fps: float) -> None:
        new_figure()
        from matplotlib import pyplot

        self._pyplot = pyplot
        self._figure = pyplot.figure(figsize=(8.0, 5.6), layout="constrained")
        self._picture = Picture(self._figure)
        self._interactive = pyplot.get_backend().lower() != "agg"
        self._period_s = 1.0 / fps
        self._due_s = -math.inf

    def show(self, view: MissionView) -> None:
        """Draw the mission once its turn has come, and let the window handle its events."""
        self._pause(self._due_s - time.monotonic())
        self._due_s = time.monotonic() + self._period_s
        self._picture.draw(view)
        self._figure.canvas.draw()
        if self._interactive:
            self._pause(0.001)

    def _pause(self, seconds: float) -> None:
        if seconds > 0:
            (self._pyplot.pause if self._interactive else time.sleep)(seconds)

    def close(self) -> None:
        """Close the window."""
        self._pyplot.close(self._figure)
