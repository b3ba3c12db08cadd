# SPDX-License-Identifier: Apache-2.0
"""Pictures of a mission: text, image and window, all drawn from one `MissionView`."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHADES = " .:-=+*#%@"
MAX_NAMED_DRONES = 8


@dataclass(frozen=True)
class MissionView:
    """What a picture of a mission shows; cells are (col, row), row 0 in the north.

    Attributes:
        probability: (G, G) float32, [row, col].
        tracks: (N, K, 2) cells of each drone, from its start to where it is now.
        alive: (N,) bool, whether the drone is still flying.
        persons: (P, 2) cells; no rows where the persons are not to be shown.
        found: (P,) bool.
        datum: Supposed cell of the person, or None where it is not known.
        step: Steps done.
        timestep_limit: Steps the drones can do.
        cell_size_m: Side of a cell in metres.
        title: Name of the place.
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

    @property
    def headline(self) -> str:
        """One line: place, step, persons found, drones in flight."""
        parts = [f"step {self.step} of {self.timestep_limit}"]
        if len(self.persons):
            parts.append(f"{int(self.found.sum())} of {len(self.persons)} found")
        parts.append(f"{int(self.alive.sum())} of {len(self.alive)} drones in flight")
        return ": ".join(filter(None, [self.title, ", ".join(parts)]))


def to_ansi(view: MissionView) -> str:
    """Return the mission as text: shades of probability, drones 0-9, P person, F found."""
    top = float(view.probability.max()) or 1.0
    level = np.ceil(np.sqrt(view.probability / top) * (len(SHADES) - 1)).astype(int)
    rows = [[SHADES[i] for i in line] for line in level.tolist()]

    def put(cell: NDArray[np.integer[Any]], mark: str) -> None:
        col, row = int(cell[0]), int(cell[1])
        if 0 <= row < len(rows) and 0 <= col < len(rows):
            rows[row][col] = mark

    for cell, found in zip(view.persons, view.found, strict=True):
        put(cell, "F" if found else "P")
    for i, track in enumerate(view.tracks):
        put(track[-1], str(i % 10) if view.alive[i] else "x")
    edge = "+" + "-" * len(rows) + "+"
    body = ["|" + "".join(row) + "|" for row in rows]
    return "\n".join([view.headline, edge, *body, edge]) + "\n"


def draw(view: MissionView, figure: Figure) -> None:
    """Draw the mission on an empty matplotlib figure: east to the right, north up, in km."""
    from matplotlib import colormaps

    grid = len(view.probability)
    km = view.cell_size_m / 1000.0
    axes = figure.add_subplot()
    image = axes.imshow(
        100.0 * view.probability,
        cmap="Blues",
        extent=(0, grid * km, 0, grid * km),
        vmin=0,
        interpolation="nearest",
    )
    figure.colorbar(image, ax=axes, label="probability per cell (%)", shrink=0.8, pad=0.02)

    def place(cells: Any) -> tuple[Any, Any]:
        cells = np.asarray(cells, float)
        return (cells[..., 0] + 0.5) * km, (grid - 1 - cells[..., 1] + 0.5) * km

    count = len(view.tracks)
    colours = colormaps["tab10" if count <= 10 else "turbo"]
    size = float(np.clip(300 / grid, 4, 11))
    for i, track in enumerate(view.tracks):
        colour = colours(i if count <= 10 else i / count)
        named = i < MAX_NAMED_DRONES or None
        x, y = place(track)
        axes.plot(x, y, color=colour, linewidth=1.2, alpha=0.8)
        axes.plot(x[0], y[0], "o", color=colour, markersize=size * 0.45)
        marker = "^" if view.alive[i] else "X"
        name = f"drone{i}" if view.alive[i] else f"drone{i} (down)"
        axes.plot(
            x[-1], y[-1], marker, color=colour, markersize=size, markeredgecolor="black",
            linestyle="none", label=named and name,
        )  # fmt: skip
    if view.datum is not None:
        axes.plot(*place(view.datum), "+", color="black", markersize=size * 1.3, label="datum")
    for found, label, fill in ((False, "person", "red"), (True, "person found", "limegreen")):
        cells = view.persons[view.found == found]
        if len(cells):
            axes.plot(
                *place(cells), "*", color=fill, markersize=size * 1.6, markeredgecolor="black",
                linestyle="none", label=label, zorder=5,
            )  # fmt: skip
    if grid <= 50:
        inner = np.arange(1, grid) * km
        axes.hlines(inner, 0, grid * km, color="0.85", linewidth=0.4)
        axes.vlines(inner, 0, grid * km, color="0.85", linewidth=0.4)
    axes.set_xlim(0, grid * km)
    axes.set_ylim(0, grid * km)
    axes.set_xlabel("east (km)")
    axes.set_ylabel("north (km)")
    axes.set_title(view.headline, fontsize=10)
    more = [f"and {count - MAX_NAMED_DRONES} more"] if count > MAX_NAMED_DRONES else []
    figure.legend(
        loc="outside right upper", fontsize=8, frameon=False,
        title="\n".join(["o start, ^ now", *more]), title_fontsize=8,
    )  # fmt: skip


def new_figure() -> Figure:
    """Return an empty figure of the size that `draw` is made for, without a window."""
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise ModuleNotFoundError("pictures need matplotlib: pip install dsse_ros[viz]") from None
    return Figure(figsize=(8.0, 5.6), dpi=100, layout="constrained")


def to_rgb_array(view: MissionView) -> NDArray[np.uint8]:
    """Return the mission as an image (H, W, 3) uint8."""
    figure = new_figure()
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    draw(view, figure)
    canvas.draw()
    return np.array(np.asarray(canvas.buffer_rgba())[..., :3])


def save_picture(view: MissionView, path: str | os.PathLike[str]) -> None:
    """Write the mission as an image file; the ending of the path chooses the format."""
    figure = new_figure()
    draw(view, figure)
    figure.savefig(path)


class Viewer:
    """A window that shows the mission; without a display it draws and shows nothing."""

    def __init__(self) -> None:
        new_figure()
        from matplotlib import pyplot

        self._pyplot = pyplot
        self._figure = pyplot.figure(figsize=(8.0, 5.6), layout="constrained")
        self._interactive = pyplot.get_backend().lower() != "agg"

    def show(self, view: MissionView) -> None:
        """Draw the mission and let the window handle its events."""
        self._figure.clear()
        draw(view, self._figure)
        self._figure.canvas.draw()
        if self._interactive:
            self._pyplot.pause(0.001)

    def close(self) -> None:
        """Close the window."""
        self._pyplot.close(self._figure)
