# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Movies of a mission."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image
from play import started, step

from dsse_ros.base import progress_bar
from dsse_ros.base.fields import FieldError
from dsse_ros.picture import movie
from dsse_ros.picture.mission_view import MissionView
from dsse_ros.picture.rendering import FigureRenderer


@pytest.fixture(scope="module")
def views() -> list[MissionView]:
    """The start of a mission and three steps."""
    env = started(drones_positions=[(1, 1), (5, 5)], grid_size=8, render_mode="ansi")
    seen = [env.view()]
    for actions in ((1, 4), (3, 4), (4, 0)):
        step(env, *actions)
        seen.append(env.view())
    return seen


@pytest.mark.slow
def test_a_gif_shows_every_view_in_order_and_the_end_for_longer(
    views: list[MissionView], tmp_path: Path
) -> None:
    path = tmp_path / "mission.gif"
    movie.save_movie(iter(views), path, fps=5)
    renderer = FigureRenderer()
    with Image.open(path) as gif:
        assert gif.n_frames == len(views) and gif.info["loop"] == 0
        durations = []
        for number, view in enumerate(views):
            gif.seek(number)
            durations.append(gif.info["duration"])
            off = np.asarray(gif.convert("RGB")).astype(int) - renderer.rgb_array(view)
            # With colours of a palette.
            assert np.abs(off).mean() < 3
    assert durations == [200, 200, 200, 2200]


@pytest.mark.slow
def test_an_mp4_shows_every_view(views: list[MissionView], tmp_path: Path) -> None:
    path = tmp_path / "mission.mp4"
    movie.save_movie(views, path, fps=5)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == len(views) + 10 and seconds == pytest.approx(frames / 5, abs=0.21)
    reader = imageio_ffmpeg.read_frames(str(path))
    width, height = next(reader)["size"]
    renderer = FigureRenderer()
    for view in views:
        frame = np.frombuffer(next(reader), np.uint8).reshape(height, width, 3)
        assert np.abs(frame.astype(int) - renderer.rgb_array(view)).mean() < 6
    reader.close()


@pytest.mark.parametrize("name", ["mission.avi", "mission", ".gif"])
def test_other_names_are_refused(views: list[MissionView], tmp_path: Path, name: str) -> None:
    with pytest.raises(FieldError, match=r"^movie must end in \.gif or \.mp4, got "):
        movie.save_movie(views, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_movie_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="^movie must have"):
        movie.save_movie([], tmp_path / "mission.gif")


def test_without_its_extra_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(FieldError, match=r"pip install '/.*\[movie\]'"):
        movie.check_movie("mission.mp4")
    movie.check_movie("mission.gif")


def test_progress_is_quiet_where_there_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(sys, "stderr", screen)
    assert list(progress_bar.progress(range(3), "job")) == [0, 1, 2]
    assert screen.getvalue() == ""


def test_progress_on_a_terminal_shows_the_job_and_how_much_is_done(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys, "stderr", screen)
    assert list(progress_bar.progress(iter("abc"), "job", total=3)) == list("abc")
    assert "job" in screen.getvalue() and "/3" in screen.getvalue()


def test_progress_without_tqdm_passes_everything_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tqdm", None)
    assert list(progress_bar.progress(range(3), "job")) == [0, 1, 2]
