# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a mission: text, image, file and window."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import image, pyplot
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray
from play import put_person, started, step

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.picture import chart, mission_view, rendering
from dsse_ros.picture.map_axes import fan_out
from dsse_ros.picture.theme import DARK, DRONE_COLOURS, LIGHT, Theme
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv

AT_SEA, FOUND = (240, 228, 66), (50, 205, 50)
FAR: dict[str, Any] = {"vector": (0.0, 0.0), "grid_size": 8}


def field_of(text: str) -> list[str]:
    """The rows between the edges of a text picture."""
    lines = text.splitlines()
    edges = [i for i, line in enumerate(lines) if line.startswith("+-")]
    assert len(edges) == 2
    rows = lines[edges[0] + 1 : edges[1]]
    assert all(row[0] == row[-1] == "|" for row in rows)
    return [row[1:-1] for row in rows]


def rgb(colour: str) -> tuple[int, ...]:
    """Parts of a colour like #d8cba8."""
    return tuple(int(colour[i : i + 2], 16) for i in (1, 3, 5))


def drone_colour(number: int) -> tuple[int, ...]:
    """Colour of a drone among at most six."""
    return rgb(DRONE_COLOURS[number])


def pixels(picture: NDArray[np.uint8], colour: tuple[int, ...]) -> NDArray[np.int64]:
    """Places (n, 2) as (row, column) of the pixels of about this colour, without the legend."""
    sea = picture[:, : picture.shape[1] * 16 // 25]
    distance = np.abs(sea.astype(int) - np.array(colour)).max(axis=2)
    return np.argwhere(distance <= 24)


def picture_of(env: SearchEnv) -> NDArray[np.uint8]:
    picture = env.render()
    assert isinstance(picture, np.ndarray)
    assert picture.dtype == np.uint8
    assert picture.ndim == 3 and picture.shape[2] == 3
    assert min(picture.shape[:2]) >= 200
    assert picture.std() > 5
    return picture


def run(code: str, **environment: str) -> str:
    """Run Python code in a process without a display; warnings are errors there."""
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND")
    kept = {name: value for name, value in os.environ.items() if name not in hidden}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=kept | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_without_a_render_mode_there_is_no_picture() -> None:
    assert started().render() is None


def test_the_text_shows_every_drone_and_person_in_its_cell() -> None:
    env = started(
        drones_positions=[(0, 0), (7, 1), (3, 3)], person_amount=2, render_mode="ansi", **FAR
    )
    put_person(env, (5, 6), 0)
    put_person(env, (3, 3), 1)
    text = env.render()
    assert isinstance(text, str)
    rows = field_of(text)
    assert len(rows) == 8 and all(len(row) == 8 for row in rows)
    assert rows[0][0] == "0" and rows[1][7] == "1" and rows[3][3] == "2"
    assert rows[6][5] == "P"
    step(env, 0, 0, 4)
    text = env.render()
    assert isinstance(text, str)
    rows = field_of(text)
    assert rows[0][0] == "x" and rows[1][6] == "1"
    assert "step 1" in text and "1 of 2" in text


@pytest.mark.slow
def test_the_pictures_show_what_is_not_searched() -> None:
    north = [[-24.04, -46.17], [-24.04, -46.0], [-24.0355, -46.0], [-24.0355, -46.17]]
    env = started(
        area=north, render_mode="ansi", person_initial_position=(4, 7), drones_positions=[(0, 7)]
    )
    text = env.render()
    assert isinstance(text, str)
    mask = env.scenario.area_mask
    assert mask is not None and 0 < mask.sum() < mask.size
    for row, of_mask in zip(field_of(text), mask, strict=True):
        assert [cell == "/" for cell in row] == (~of_mask).tolist()
    env.render_mode = "rgb_array"
    image = env.render()
    assert isinstance(image, np.ndarray)
    land = rgb(LIGHT.land)
    share = (image == land).all(axis=2).sum() / image[..., 0].size
    assert share > 0.05
    plain = started(render_mode="rgb_array", person_initial_position=(4, 7)).render()
    assert isinstance(plain, np.ndarray) and not (plain == land).all(axis=2).any()


def test_the_text_shows_who_was_found_and_where_the_probability_is() -> None:
    env = started(drones_positions=[(0, 0)], person_amount=2, render_mode="ansi", sigma=1, **FAR)
    put_person(env, (0, 0), 0)
    put_person(env, (7, 7), 1)
    step(env, 4)
    for number in range(4):
        step(env, number % 2 + 2 if number else 3)
        put_person(env, (7, 7), 1)
    text = env.render()
    assert isinstance(text, str)
    rows = field_of(text)
    assert rows[0][0] == "F" and rows[7][7] == "P"
    shades = mission_view.SHADES
    assert rows[4][4] == shades[-1]
    assert 0 < shades.index(rows[4][5]) < len(shades) - 1
    assert rows[0][4] == shades[0]


def test_whom_the_find_of_all_persons_ended_is_not_down() -> None:
    env = started(drones_positions=[(0, 0), (3, 3)], render_mode="ansi", sigma=1, **FAR)
    put_person(env, (0, 0), 0)
    step(env, 4, 1)
    assert env.agents == [] and env.view().alive.all()
    text = env.render()
    assert isinstance(text, str)
    assert text.startswith("step 1 of 100 (0 min), person found after 1 step by drone0\n")
    rows = field_of(text)
    assert rows[0][0] == "F" and rows[3][4] == "1"


@pytest.mark.parametrize(
    ("changed", "ends"),
    [
        ({"timestep_limit": 4}, "search over: out of time"),
        ({"battery_move": 60.0}, "search over: all drones lost"),
    ],
)
def test_a_picture_of_a_search_that_is_over_says_how_it_ended(
    changed: dict[str, Any], ends: str
) -> None:
    env = started(render_mode="ansi", **(FAR | changed))
    assert "1 of 1 drones in flight" in env.view().status
    put_person(env, (7, 7), 0)
    while env.agents:
        assert "in flight" in env.view().status
        step(env, env.rules.action_set.search)
    assert env.view().status.endswith(ends)


@pytest.mark.slow
def test_the_image_shows_drones_and_person_where_they_are() -> None:
    env = started(drones_positions=[(0, 0), (1, 6), (6, 1)], render_mode="rgb_array", **FAR)
    put_person(env, (2, 1))
    before = picture_of(env)
    for number in (1, 2):
        assert len(pixels(before, drone_colour(number))) > 20
    assert len(pixels(before, AT_SEA)) > 20
    for _ in range(3):
        step(env, 4, 1, 3)
    put_person(env, (6, 6))
    after = picture_of(env)
    assert before.shape == after.shape
    shifts = {
        name: pixels(after, colour).mean(axis=0) - pixels(before, colour).mean(axis=0)
        for name, colour in {
            "east": drone_colour(1),
            "south": drone_colour(2),
            "both": AT_SEA,
        }.items()
    }
    # Rows of pixels grow downward, as those of the grid do.
    assert shifts["east"][1] > 10 and abs(shifts["east"][0]) < 10
    assert shifts["south"][0] > 10 and abs(shifts["south"][1]) < 10
    assert min(shifts["both"]) > 10


@pytest.mark.slow
def test_the_image_shows_the_track() -> None:
    pictures = []
    for actions in ((1, 1, 3, 3), (3, 3, 1, 1)):
        env = started(drones_positions=[(0, 0), (1, 1)], render_mode="rgb_array", **FAR)
        for action in actions:
            step(env, 4, action)
        assert env.positions.tolist() == [[0, 0], [3, 3]]
        put_person(env, (7, 7))
        pictures.append(picture_of(env))
    assert (pictures[0] != pictures[1]).any(axis=2).sum() > 100


@pytest.mark.slow
def test_the_image_shows_a_person_found_otherwise_than_one_still_at_sea() -> None:
    env = started(drones_positions=[(2, 2)], person_amount=2, render_mode="rgb_array", **FAR)
    put_person(env, (2, 2), 0)
    put_person(env, (6, 6), 1)
    assert len(pixels(picture_of(env), FOUND)) == 0
    step(env, 4)
    picture = picture_of(env)
    assert len(pixels(picture, FOUND)) > 20
    assert len(pixels(picture, AT_SEA)) > 20


@pytest.mark.slow
def test_the_image_follows_the_map() -> None:
    def blue(env: SearchEnv) -> NDArray[np.float64]:
        return pixels(picture_of(env), rgb(LIGHT.sea[-1])).mean(axis=0)

    fields: dict[str, Any] = {"drones_positions": [(0, 0)], "grid_size": 8}
    west = started(person_initial_position=(1, 6), render_mode="rgb_array", **fields)
    east = started(person_initial_position=(6, 6), render_mode="rgb_array", **fields)
    north = started(person_initial_position=(6, 1), render_mode="rgb_array", **fields)
    for env in (west, east, north):
        put_person(env, (0, 0))
    assert blue(east)[1] > blue(west)[1] + 20
    assert blue(east)[0] > blue(north)[0] + 20


@pytest.mark.slow
def test_an_image_shows_nothing_of_those_before_it() -> None:
    """One renderer draws all images of an environment; a new one draws the same at any time."""
    env = started(
        drones_positions=[(0, 0), (1, 6), (6, 1)], person_amount=2, render_mode="rgb_array",
        collision=0.0, **FAR,
    )  # fmt: skip
    put_person(env, (2, 1), 0)
    put_person(env, (5, 5), 1)

    def marks(picture: NDArray[np.uint8]) -> list[Any]:
        colours = [AT_SEA, FOUND, *map(drone_colour, (1, 2))]
        found = [pixels(picture, colour) for colour in colours]
        return [(len(places) > 0, places.mean(axis=0) if len(places) else 0) for places in found]

    picture_of(env)
    for actions in ((1, 1, 3), (1, 1, 3), (3, 1, 3), (4, 0, 1), (4, 0, 1)):
        step(env, *actions)
        kept, new = marks(picture_of(env)), marks(rendering.FigureRenderer().rgb_array(env.view()))
        for (shown, where), (other, there) in zip(kept, new, strict=True):
            assert shown == other
            # The margins may differ by the width of a digit.
            assert np.abs(np.subtract(where, there)).max() < 10
    env.reset(options={"drones_positions": [(7, 7), (0, 7), (7, 0)]})
    assert len(pixels(picture_of(env), FOUND)) == 0


@pytest.mark.slow
def test_an_image_that_was_returned_stays_as_it_is() -> None:
    env = started(render_mode="rgb_array", **FAR)
    picture = picture_of(env)
    before = picture.copy()
    step(env, 1)
    assert (picture_of(env) != picture).any()
    assert (picture == before).all()


def test_a_view_counts_the_searches_of_each_cell() -> None:
    """Those of drones that were still in the search, in steps that did something."""
    env = started(
        drones_positions=[(1, 1), (4, 4)],
        render_mode="ansi",
        timestep_limit=4,
        collision=0.0,
        sigma=3,
        circle=False,
        **FAR,
    )
    put_person(env, (7, 7))
    for actions in ((4, 4), (4, 1), (1, 4)):
        step(env, *actions)
    env.withdraw(1)
    step(env, 4, 4)
    while env.agents:
        step(env, *[4] * len(env.agents))
    searches = env.view().searches
    assert searches is not None and searches.sum() == 4
    assert [searches[1, 1], searches[4, 4], searches[4, 5], searches[1, 2]] == [1, 1, 1, 1]
    # At first all the probability is in one cell.
    waits = env.view().waits
    assert waits is not None and waits.sum() == waits[1, 1] == 1
    env.reset()
    assert env.view().searches is not None and not env.view().searches.any()


@pytest.mark.parametrize("sensor", ["own_cell", "flown_over"])
def test_a_drone_that_searches_where_nobody_can_be_waits(sensor: str) -> None:
    env = started(
        drones_positions=[(0, 0), (4, 4)], render_mode="ansi", collision=0.0, sensor=sensor,
        probability_of_detection=0.5, person_initial_position=(4, 4), **FAR,
    )  # fmt: skip
    put_person(env, (7, 7))
    before = env.probability
    assert before[0, 0] == 0 and before[4, 4] > 0
    step(env, 4, 4)
    step(env, 4, 4)
    view = env.view()
    assert view.searches is not None and view.waits is not None
    assert np.argwhere(view.waits).tolist() == [[0, 0]] and view.waits[0, 0] == 2
    assert np.argwhere(view.searches).tolist() == [[4, 4]] and view.searches[4, 4] == 2
    # Flying over such a cell is not waiting.
    step(env, 1, 4)
    assert env.view().waits is not None and env.view().waits.sum() == 2


@pytest.mark.slow
def test_the_image_shows_where_a_drone_waited_otherwise_than_where_one_searched() -> None:
    env = started(drones_positions=[(0, 0)], render_mode="ansi", **FAR)
    view, zero = env.view(), np.zeros((8, 8), int)
    once = zero.copy()
    once[5, 5] = 1
    images = [
        rendering.FigureRenderer().rgb_array(replace(view, searches=searches, waits=waits))
        for searches, waits in ((zero, zero), (once, zero), (zero, once))
    ]
    plain, searched, waited = (
        image[:, : image.shape[1] * 16 // 25].astype(int) for image in images
    )
    for one, other in itertools.combinations((plain, searched, waited), 2):
        assert (one != other).any(axis=2).sum() > 20


@pytest.mark.slow
def test_the_image_shows_how_often_a_cell_was_searched() -> None:
    env = started(drones_positions=[(0, 0)], render_mode="ansi", **FAR)
    view, pictures = env.view(), []
    for searches in range(5):
        counts = np.zeros((8, 8), int)
        counts[5, 5] = searches
        pictures.append(rendering.FigureRenderer().rgb_array(replace(view, searches=counts)))
    sea = [picture[:, : picture.shape[1] * 16 // 25] for picture in pictures]
    ink = [int((picture != sea[0]).any(axis=2).sum()) for picture in sea]
    assert all(more > less + 20 for less, more in itertools.pairwise(ink))


def test_tracks_through_the_same_cells_do_not_hide_each_other() -> None:
    env = started(drones_positions=[(0, 3), (0, 4)], render_mode="rgb_array", collision=0.0, **FAR)
    put_person(env, (7, 7))
    # One after the other through row 3, then both away to the south.
    step(env, 1, 4)
    for actions in ((1, 2), (1, 1), (1, 1), (3, 1), (3, 1), (3, 4), (3, 4)):
        step(env, *actions)
    picture = rendering.FigureRenderer().rgb_array(replace(env.view(), waits=None))
    first, second = (pixels(picture, drone_colour(number)) for number in (0, 1))
    assert len(first) > 100 and len(second) > 100


def test_drones_keep_colours_that_differ_in_lightness_or_hue_to_the_colour_blind() -> None:
    """Deuteranopes and protanopes see the two axes of CIELAB's lightness and of blue and yellow."""
    linear = ((np.array([rgb(colour) for colour in DRONE_COLOURS]) / 255) ** 2.2).astype(float)
    luminance = linear @ (0.2126, 0.7152, 0.0722)
    seen = np.stack([np.cbrt(luminance), np.cbrt(linear[:, 2])], axis=1)
    apart = np.linalg.norm(seen[:, np.newaxis] - seen[np.newaxis], axis=2)
    assert apart[~np.eye(len(seen), dtype=bool)].min() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lat", "lon", "top", "right"),
    [
        (-24.04, -46.17, ["46°10.0′W", "46°09.5′W", "46°09.0′W"], "24°02.0′S 24°01.5′S 24°01.0′S"),
        (0.0, 179.99, ["179°59.5′E", "180°00.0′W", "179°59.5′W"], "0°00.0′N 0°00.5′N 0°01.0′N"),
    ],
)  # fmt: skip
def test_the_edges_of_a_picture_have_latitude_and_longitude(
    lat: float, lon: float, top: list[str], right: str
) -> None:
    env = started(grid_size=20, origin_lat=lat, origin_lon=lon)
    figure = rendering.new_figure()
    rendering.Picture(figure).draw(env.view())
    east, north = figure.axes[0].child_axes
    assert [label.get_text() for label in east.get_xticklabels()] == top
    assert [label.get_text() for label in north.get_yticklabels()] == right.split()


def test_marks_of_degrees_are_where_they_say() -> None:
    along = np.linspace(0.0, 10.0, 65)
    places, labels = chart.degree_marks(along, 59.9 + 0.02 * along, "NS")
    assert labels == ["59°55′N", "60°00′N", "60°05′N"]
    np.testing.assert_allclose(
        places, [(59 + 55 / 60 - 59.9) / 0.02, 5.0, (60 + 5 / 60 - 59.9) / 0.02]
    )
    assert chart.degree_marks(along, np.cos(along), "NS") == ([], [])


@pytest.mark.parametrize(("most", "length"), [(0.78, 0.5), (1.0, 1.0), (2.2, 2.0), (99.0, 50.0)])
def test_scales_have_round_lengths(most: float, length: float) -> None:
    assert chart.round_length(most) == pytest.approx(length)


def drawn(view: mission_view.MissionView, theme: Theme = LIGHT) -> tuple[Any, Any]:
    """Return the figure of a view without its legend, and the axes of the map."""
    figure = rendering.new_figure(rendering.PLAIN)
    rendering.Picture(figure, rendering.PLAIN, theme).draw(view)
    return figure, figure.axes[0]


def test_probability_is_linear_along_the_bar_of_colours_and_has_the_colours_of_the_map() -> None:
    env = started(sigma=2, circle=False, **FAR)
    step(env, 1)
    figure, axes = drawn(env.view())
    (sea, *_), (bar,) = axes.images, figure.axes[1].images
    top = sea.get_array().max()
    values = bar.get_array()[0]
    np.testing.assert_allclose(np.diff(values), 1 / 255)
    np.testing.assert_allclose(
        sea.cmap(sea.norm(top * values)), bar.cmap(bar.norm(values)), atol=0.02
    )
    labels = [text.get_text() for text in figure.texts[:3]]
    assert labels == [f"{share * top:.2g}" for share in (0, 0.5, 1)]


@pytest.mark.parametrize("start", [(0, 0), (0, 7), (7, 7), (3, 4)])
def test_scale_and_north_are_on_the_map_and_not_where_drones_start(start: tuple[int, int]) -> None:
    env = started(drones_positions=[start], **FAR)
    figure, axes = drawn(env.view())
    figure.draw_without_rendering()
    box = axes.get_window_extent()
    texts = {text.get_text(): text.get_window_extent() for text in axes.texts}
    at = axes.transData.transform([(0.13 * (start[0] + 0.5), 0.13 * (7.5 - start[1]))])[0]
    for name in ("N", "200 m"):
        assert box.contains(texts[name].x0, texts[name].y0)
        assert box.contains(texts[name].x1, texts[name].y1)
        assert not texts[name].padded(10).contains(*at)


@pytest.mark.slow
def test_a_dark_picture_is_dark_and_shows_the_same() -> None:
    env = started(drones_positions=[(0, 0), (1, 6)], render_mode="ansi", **FAR)
    images = []
    for theme in (LIGHT, DARK):
        figure, _ = drawn(env.view(), theme)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        images.append(np.asarray(canvas.buffer_rgba())[..., :3])
    light, dark = images
    assert light.mean() > 180 and dark.mean() < 70
    for number in (0, 1):
        places = [np.argwhere((np.abs(image.astype(int) - drone_colour(number)) < 10).all(axis=2))
                  for image in images]  # fmt: skip
        assert np.abs(places[0].mean(axis=0) - places[1].mean(axis=0)).max() < 2


PLACES = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=12)


@given(PLACES)
def test_drones_at_one_place_are_fanned_out_and_others_stay(cells: list[tuple[int, int]]) -> None:
    places = np.array(cells, float) + 0.5
    fanned = fan_out(places, 0.1, GridExtent(4.0, 4.0))
    for i, j in itertools.combinations(range(len(cells)), 2):
        assert np.hypot(*(fanned[i] - fanned[j])) > 0.099
    alone = [i for i, cell in enumerate(cells) if cells.count(cell) == 1]
    assert (fanned[alone] == places[alone]).all()
    assert (np.abs(fanned - places) < 0.5).all() and (fanned > 0).all() and (fanned < 4).all()


def test_hundreds_of_drones_fit_into_a_picture() -> None:
    picture_of(started(grid_size=20, num_drones=100, render_mode="rgb_array"))


@pytest.mark.parametrize("size", [1, 2])
def test_the_smallest_grids_can_be_drawn(size: int) -> None:
    picture_of(started(grid_size=size, render_mode="rgb_array"))
    assert len(field_of(str(started(grid_size=size, render_mode="ansi").render()))) == size


@pytest.mark.parametrize("render_mode", [None, "ansi"])
def test_a_view_shows_the_drones_where_they_are_now(render_mode: str | None) -> None:
    env = started(drones_positions=[(1, 1), (6, 6)], render_mode=render_mode, **FAR)
    for actions in ((1, 0), (3, 2), (1, 4)):
        step(env, *actions)
        np.testing.assert_array_equal(env.view().tracks[:, -1], env.positions)
    if render_mode:
        assert env.view().tracks.tolist() == [
            [[1, 1], [2, 1], [2, 2], [3, 2]],
            [[6, 6], [5, 6], [5, 5], [5, 5]],
        ]
    view = env.view()
    assert view.step == 3 and view.alive.tolist() == [True, True]
    np.testing.assert_array_equal(view.probability, env.probability)


def test_a_view_is_right_after_the_render_mode_was_switched_off_and_on() -> None:
    env = started(render_mode="ansi", **FAR)
    step(env, 1)
    env.render_mode = None
    step(env, 1)
    assert env.view().tracks[0, -1].tolist() == env.positions[0].tolist()
    env.render_mode = "ansi"
    assert env.view().tracks[0, -1].tolist() == env.positions[0].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", [r"$\foo$", "$^$", "a $5 and $6", "{x}%"])
def test_any_name_can_stand_over_a_picture(name: str) -> None:
    started(name=name, render_mode="rgb_array", **FAR).render()


def test_a_new_mission_begins_a_new_track() -> None:
    env = started(drones_positions=[(1, 1)], render_mode="ansi", **FAR)
    step(env, 1)
    env.reset()
    assert env.view().tracks.tolist() == [[[1, 1]]]


def test_an_old_view_does_not_change() -> None:
    env = started(drones_positions=[(1, 1)], render_mode="ansi", sigma=1, **FAR)
    view = env.view()
    text = rendering.to_ansi(view)
    for _ in range(4):
        step(env, 1)
    assert rendering.to_ansi(view) == text != env.render()


def test_a_picture_can_be_saved(tmp_path: Path) -> None:
    env = started(drones_positions=[(1, 1), (5, 1)], render_mode="ansi", **FAR)
    path = tmp_path / "mission.png"
    rendering.save_picture(env.view(), path)
    picture = (image.imread(path)[..., :3] * 255).astype(np.uint8)
    assert min(picture.shape[:2]) >= 200
    assert len(pixels(picture, drone_colour(1))) > 20


@pytest.mark.slow
def test_a_window_shows_the_present_and_draws_texts_only_when_they_change() -> None:
    env = started(drones_positions=[(1, 1), (3, 6)], render_mode="ansi", **FAR)
    put_person(env, (7, 7))
    window = rendering.Viewer(1e9)
    canvas: Any = pyplot.gcf().canvas
    drawn: list[Any] = []
    canvas.mpl_connect("draw_event", drawn.append)
    for shown in range(1, 9):
        window.show(env.view())
        if shown == 5:
            # As when its size changes.
            canvas.draw()
        expected = rendering.FigureRenderer().rgb_array(env.view())
        np.testing.assert_array_equal(np.asarray(canvas.buffer_rgba())[..., :3], expected)
        step(env, 1 if shown < 5 else 3, 4)
    # The first picture, that with a track and a drone that waits, that with a search, and the one
    # above.
    assert len(drawn) == 4
    window.close()


@pytest.mark.slow
def test_a_window_without_a_display_shows_nothing_and_says_nothing() -> None:
    printed = run(
        "from dsse_ros import parallel_env\n"
        "env = parallel_env(num_drones=2, render_mode='human')\n"
        "env.reset(seed=0)\n"
        "env.step(dict.fromkeys(env.agents, 4))\n"
        "print(env.render())\n"
        "env.close()\n"
        "env.close()\n"
    )
    assert printed == "None\n"


@pytest.mark.slow
def test_a_window_shows_no_more_pictures_a_second_than_render_fps() -> None:
    printed = run(
        "import time\n"
        "from dsse_ros import parallel_env\n"
        "parallel_env(grid_size=4, render_mode='human').reset(seed=0)\n"
        "env = parallel_env(grid_size=4, render_mode='human')\n"
        "env.metadata = {**env.metadata, 'render_fps': 0.5}\n"
        "began = time.monotonic()\n"
        "env.reset(seed=0)\n"
        "env.render()\n"
        "env.render()\n"
        "print(time.monotonic() - began)\n"
    )
    # What must be waited for takes its time on any machine.
    assert float(printed) >= 3.99


@pytest.mark.slow
def test_the_search_needs_no_matplotlib_and_pictures_say_that_they_do() -> None:
    printed = run(
        "import sys\n"
        "class Blocker:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] == 'matplotlib':\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Blocker())\n"
        "from dsse_ros import parallel_env\n"
        "env = parallel_env(render_mode='ansi')\n"
        "env.reset(seed=0)\n"
        "env.step({'drone0': 1})\n"
        "assert '0' in env.render()\n"
        "for mode in ('rgb_array', 'human'):\n"
        "    env = parallel_env(render_mode=mode)\n"
        "    try:\n"
        "        env.reset(seed=0)\n"
        "        env.render()\n"
        "    except ModuleNotFoundError as error:\n"
        "        print(error)\n"
    )
    lines = printed.splitlines()
    assert len(lines) == 2
    for line in lines:
        assert "matplotlib" in line and "pip install" in line


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["matplotlib_inline.backend_inline", "nonesuch"])
def test_the_backend_of_a_notebook_that_is_not_installed_here_keeps_no_picture(
    backend: str,
) -> None:
    printed = run(
        "import os\n"
        f"os.environ['MPLBACKEND'] = 'module://{backend}'\n"
        "from dsse_ros import parallel_env\n"
        "for mode in ('rgb_array', 'human'):\n"
        "    env = parallel_env(render_mode=mode, grid_size=8)\n"
        "    env.reset(seed=1)\n"
        "    print(mode, getattr(env.render(), 'ndim', None))\n"
    )
    assert printed.split() == ["rgb_array", "3", "human", "None"]


@pytest.mark.slow
def test_importing_the_search_imports_no_ros_and_no_matplotlib() -> None:
    printed = run(
        "import sys, dsse_ros.search.environments\n"
        "print([m for m in ('rclpy', 'pymavlink', 'matplotlib', 'tqdm') if m in sys.modules])\n"
    )
    assert printed == "[]\n"


def test_rendering_before_the_first_reset_is_refused() -> None:
    for mode in ("ansi", "rgb_array"):
        with pytest.raises(ResetNeeded):
            parallel_env(render_mode=mode).render()
