# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission as a movie: GIF, or MP4 with the ffmpeg of imageio-ffmpeg."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import FieldError
from dsse_ros.base.progress_bar import progress
from dsse_ros.base.whole_files import whole_file
from dsse_ros.picture.legend import FOUND, PERSON
from dsse_ros.picture.mission_view import MissionView
from dsse_ros.picture.picture import sea_colours
from dsse_ros.picture.rendering import FigureRenderer
from dsse_ros.picture.theme import DRONE_COLOURS, LIGHT

if TYPE_CHECKING:
    from PIL.Image import Image

FPS = 5
_LAST_S = 2.0
"""Additional time for which the movie shows the end of the mission."""
_SUFFIXES = (".gif", ".mp4")


def check_movie(path: str | os.PathLike[str]) -> None:
    """Check that a movie can be written to a file with this name.

    Raises:
        FieldError: If not; one line gives the reason.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _SUFFIXES:
        raise FieldError(f"movie must end in .gif or .mp4, got {os.fspath(path)!r}")
    if suffix == ".mp4":
        try:
            import imageio_ffmpeg

            imageio_ffmpeg.get_ffmpeg_exe()
        except ModuleNotFoundError:
            raise FieldError(f"movie: MP4 needs imageio-ffmpeg: {pip_install('movie')}") from None
        except RuntimeError as error:
            raise FieldError(f"movie: {' '.join(str(error).split())}") from None


def save_movie(
    views: Iterable[MissionView],
    path: str | os.PathLike[str],
    *,
    fps: int = FPS,
    total: int | None = None,
) -> None:
    """Write a mission as a movie from its first view to its last, shown for two more seconds.

    Args:
        views: One for each frame.
        path: The file, .gif or .mp4.
        fps: Frames per second.
        total: Number of views, for the progress bar, if `views` has no length.

    Raises:
        FieldError: If the file's name is not allowed, an extra is missing, or there is no view.
        OSError: If the file cannot be written.
    """
    check_movie(path)
    frames = map(FigureRenderer().rgb_array, progress(views, "movie", total=total))
    try:
        first = next(frames)
    except StopIteration:
        raise FieldError("movie must have at least one view, got none") from None
    write = _write_gif if Path(path).suffix.lower() == ".gif" else _write_mp4
    with whole_file(Path(path)) as part:
        write(first, frames, part, fps)


def _write_gif(
    first: NDArray[np.uint8], rest: Iterator[NDArray[np.uint8]], path: Any, fps: int
) -> None:
    from PIL import Image

    palette = _palette()
    image, *images = (
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in chain([first], rest)
    )
    frame_ms = round(1000 / fps)
    # Consecutive equal frames are written once, with their total duration.
    image.save(
        path, format="GIF", save_all=True, append_images=images, loop=0,
        duration=[*[frame_ms] * len(images), frame_ms + round(1000 * _LAST_S)], optimize=False,
    )  # fmt: skip


def _palette() -> Image:
    """Return the colours of all pictures; one palette for all frames keeps the file small."""
    from matplotlib.colors import to_rgb
    from PIL import Image

    white = np.ones(3)
    sea = [np.array(colour[:3]) for colour in sea_colours()(np.linspace(0, 1, 56))]
    marks = [np.array(to_rgb(colour)) for colour in (*DRONE_COLOURS, PERSON, FOUND, LIGHT.land)]
    shades = [
        white + share * (mark - white) for mark in marks for share in np.linspace(0.15, 1, 14)
    ]
    greys = [grey * white for grey in np.linspace(0, 1, 40)]
    colours = np.round(255 * np.array([*sea, *shades, *greys])).astype(np.uint8)
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.tobytes())
    return palette


def _write_mp4(
    first: NDArray[np.uint8], rest: Iterator[NDArray[np.uint8]], path: Any, fps: int
) -> None:
    import imageio_ffmpeg

    # Raise a one-line OSError for an unwritable path; ffmpeg's own message is longer.
    Path(path).open("wb").close()
    height, width = first.shape[:2]
    writer = imageio_ffmpeg.write_frames(
        os.fspath(path), (width, height), fps=fps, macro_block_size=2, quality=7,
        ffmpeg_log_level="error",
    )  # fmt: skip
    writer.send(None)
    try:
        for frame in chain([first], rest):
            writer.send(last := np.ascontiguousarray(frame))
        for _ in range(round(_LAST_S * fps)):
            writer.send(last)
    finally:
        writer.close()
