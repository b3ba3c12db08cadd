# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drawing of a mission as an image, to a file or in a window, all with one `Picture`."""

from __future__ import annotations

import math
import os
import time
from collections.abc import MutableMapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.extras import pip_install
from dsse_ros.base.whole_files import whole_file
from dsse_ros.picture.mission_view import MissionView, to_ansi
from dsse_ros.picture.picture import PLAIN, WIDE, Picture, PictureLayout

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "PLAIN", "WIDE", "FigureRenderer", "MissionView", "Picture", "PictureLayout", "Viewer",
    "new_figure", "save_picture", "to_ansi",
]  # fmt: skip


def new_figure(layout: PictureLayout = WIDE) -> Figure:
    """Return an empty figure of the size for `Picture`, without a window."""
    _forget_missing_backend(os.environ)
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise ModuleNotFoundError(f"pictures need matplotlib: {pip_install('viz')}") from None
    return Figure(figsize=layout.size_in, dpi=100)


def _forget_missing_backend(environ: MutableMapping[str, str]) -> None:
    """Remove a backend that is not installed here, such as that of a notebook with another Python.

    Matplotlib could not be imported with it.
    """
    scheme, _, module = environ.get("MPLBACKEND", "").partition("module://")
    if not scheme and module and find_spec(module.partition(".")[0]) is None:
        del environ["MPLBACKEND"]


class _KeptCanvas:
    """A figure that redraws only moving artists: static texts take most of the time."""

    def __init__(self, figure: Figure) -> None:
        self._figure = figure
        self._canvas: Any = figure.canvas
        self._picture = Picture(figure)
        self._background: Any = None
        self._canvas.mpl_connect("draw_event", self._keep)

    def draw(self, view: MissionView) -> None:
        """Draw the mission."""
        static_changed = self._picture.draw(view)
        if not self._canvas.supports_blit:
            self._canvas.draw()
        elif static_changed:
            for artist in self._picture.moving:
                artist.set_animated(True)
            self._canvas.draw()
        else:
            self._canvas.restore_region(self._background)
            self._draw_moving()
            self._canvas.blit(self._figure.bbox)

    def _keep(self, _event: Any) -> None:
        """Keep what was drawn, without the moving artists; a resized window is drawn again too."""
        if self._canvas.supports_blit and not self._canvas.is_saving():
            self._background = self._canvas.copy_from_bbox(self._figure.bbox)
            self._draw_moving()

    def _draw_moving(self) -> None:
        for artist in self._picture.moving:
            self._figure.draw_artist(artist)


class FigureRenderer:
    """Renders views of a mission as images."""

    def __init__(self) -> None:
        figure = new_figure()
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self._canvas = FigureCanvasAgg(figure)
        self._kept = _KeptCanvas(figure)

    def rgb_array(self, view: MissionView) -> NDArray[np.uint8]:
        """Return the mission as an image (H, W, 3) uint8."""
        self._kept.draw(view)
        return np.array(np.asarray(self._canvas.buffer_rgba())[..., :3])


def save_picture(view: MissionView, path: str | os.PathLike[str]) -> None:
    """Write the mission as an image file; the path's suffix sets the format."""
    figure = new_figure()
    Picture(figure).draw(view)
    with whole_file(Path(path)) as part:
        figure.savefig(part)


class Viewer:
    """A window that shows the mission; without a display it draws and shows nothing.

    Args:
        fps: Maximum number of pictures per second.
    """

    def __init__(self, fps: float) -> None:
        new_figure()
        from matplotlib import pyplot

        self._pyplot = pyplot
        self._figure = pyplot.figure(figsize=WIDE.size_in)
        self._canvas = _KeptCanvas(self._figure)
        self._interactive = pyplot.get_backend().lower() != "agg"
        self._period_s = 1.0 / fps
        self._due_s = -math.inf

    def show(self, view: MissionView) -> None:
        """Wait for the next frame's time, draw the mission, and handle window events."""
        self._pause(self._due_s - time.monotonic())
        self._due_s = time.monotonic() + self._period_s
        self._canvas.draw(view)
        if self._interactive:
            self._pause(0.001)

    def _pause(self, seconds: float) -> None:
        if seconds > 0:
            (self._pyplot.pause if self._interactive else time.sleep)(seconds)

    def close(self) -> None:
        """Close the window."""
        self._pyplot.close(self._figure)
