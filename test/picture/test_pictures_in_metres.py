# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of drones in metres: where they are, where they point, what they flew and saw."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsse_ros.picture.picture import WIDE
from dsse_ros.picture.theme import DRONE_COLOURS
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.searchers import registry
from dsse_ros.world.searchers.searcher import Searcher

PLANE = Searcher(doc="a plane", speed=15.0, min_speed=11.0, turn_radius=90.0)
FIELDS: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 20, "particles": 200,
    "drones_positions": ((5, 14), (14, 5)), "sigma": 3.0, "probability_of_detection": 0.0,
    "render_mode": "rgb_array",
}  # fmt: skip
SIDE_M = 2600.0


@pytest.fixture
def env(monkeypatch: pytest.MonkeyPatch) -> SearchEnv:
    monkeypatch.setitem(registry.SEARCHERS, "plane", PLANE)
    env = parallel_env(**FIELDS, searchers=("plane",))
    return env


def flown(env: SearchEnv, *turns: tuple[float, float]) -> NDArray[np.float64]:
    """Fly turns at cruise; returns the paths (N, K, 2) as (col, row)."""
    _, infos = env.reset(seed=1)
    paths = [np.stack([info["path"] for info in infos.values()])[:, -1:]]
    for joint in turns:
        *_, infos = env.step({f"drone{i}": np.array([turn, 1.0]) for i, turn in enumerate(joint)})
        paths.append(np.stack([info["path"] for info in infos.values()])[:, 1:])
    return np.concatenate(paths, axis=1) / 130.0 - 0.5


def pixels(picture: NDArray[np.uint8], places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return row and column (M, 2) of the pixels at places (col, row)."""
    left, bottom, width, height = WIDE.map
    shares = (places + 0.5) * 130.0 / SIDE_M
    x = (left + shares[:, 0] * width) * picture.shape[1]
    y = (1.0 - bottom - (1.0 - shares[:, 1]) * height) * picture.shape[0]
    return np.stack([y, x], axis=1).astype(np.int64)


def is_near(picture: NDArray[np.uint8], at: NDArray[np.int64], colour: str, far: int = 1) -> bool:
    """Return whether a pixel within so many pixels has about this colour."""
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    row, col = at.tolist()
    part = picture[row - far : row + far + 1, col - far : col + far + 1].astype(int)
    return bool((np.abs(part - wanted).max(axis=2) <= 60).any())


def test_a_view_has_the_paths_and_the_headings(env: SearchEnv) -> None:
    paths = flown(env, (0.6, -0.6), (0.0, 0.3), (-1.0, 0.0))
    view = env.view()
    assert view.tracks == pytest.approx(paths) and view.tracks.dtype == np.float64
    assert view.legs > 1 and view.tracks.shape[1] == 1 + 3 * view.legs
    assert view.headings is not None and view.flown == ()
    # The last legs of the first drone point where it points.
    east, south = np.diff(view.tracks[1, -2:], axis=0)[0]
    assert math.cos(math.atan2(east, -south) - view.headings[1]) == pytest.approx(1.0, abs=1e-6)
    assert all(width > 0 for width in view.strips_m)


def test_the_picture_shows_each_path_where_it_was_flown(env: SearchEnv) -> None:
    paths = flown(env, (0.5, -0.5), (0.5, -0.5), (0.5, 0.0), (0.0, 0.0))
    picture = env.render()
    assert isinstance(picture, np.ndarray)
    for i, path in enumerate(paths):
        # The newest part, whose colour is the strongest, without the drone itself.
        middle = (path[-5:-2] + path[-4:-1]) / 2
        for at in pixels(picture, middle):
            assert is_near(picture, at, DRONE_COLOURS[i], far=2)


def test_the_nose_of_a_drone_points_to_its_heading(env: SearchEnv) -> None:
    for turn in (0.0, 0.5, -0.5):
        flown(env, (turn, turn), (turn, turn))
        picture, view = env.render(), env.view()
        assert isinstance(picture, np.ndarray) and view.headings is not None
        for i, heading in enumerate(view.headings.tolist()):
            (at,) = pixels(picture, view.tracks[i, -1:])
            ahead = np.array([-math.cos(heading), math.sin(heading)])
            # The nose is 0.9 of a diameter of 10 points long, the rest of the head half of one.
            nose, back = (at + share * ahead * 13.9 for share in (0.72, -0.72))
            assert is_near(picture, nose.astype(int), DRONE_COLOURS[i], far=1)
            across = at + 0.72 * ahead[::-1] * (1, -1) * 13.9
            assert not is_near(picture, across.astype(int), DRONE_COLOURS[i], far=0)
            assert back.shape == (2,)


def test_the_strip_that_a_drone_saw_is_as_wide_as_it_is_in_metres(env: SearchEnv) -> None:
    flown(env, (0.0, 0.0), (0.0, 0.0))
    with_strip, view = env.render(), env.view()
    assert isinstance(with_strip, np.ndarray)
    env.reset(seed=1)
    before = env.render()
    assert isinstance(before, np.ndarray) and view.headings is not None
    start, end = view.tracks[1, 0], view.tracks[1, 2]
    middle, heading = (start + end) / 2, view.headings[1]
    right = np.array([math.cos(heading), math.sin(heading)])
    half = view.strips_m[1] / 130.0 / 2

    def changed(share: float) -> bool:
        places = np.stack([middle + side * share * half * right for side in (-1, 1)])
        at = pixels(with_strip, places)
        return all((with_strip[y, x].astype(int) - before[y, x]).any() for y, x in at.tolist())

    assert changed(0.8) and not changed(1.3)


def test_the_text_shows_drones_in_metres_in_their_cells() -> None:
    env = parallel_env(**FIELDS | {"render_mode": "ansi"})
    env.reset(seed=1)
    env.step({agent: np.array([0.0, 1.0]) for agent in env.agents})
    text = env.render()
    assert isinstance(text, str) and text.count("0") >= 1 and "step 1 of" in text
