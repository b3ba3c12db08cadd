# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every map of a report shows land and last known positions."""

from __future__ import annotations

import numpy as np
import pytest
from flights import Log, fly
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from dsse_ros.picture.theme import DARK, LIGHT
from dsse_ros.results.report import figures
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import views
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.scenario import scenario_and_rules
from dsse_ros.world.scenario.sea_state import sea_state

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> RecordedMission:
    """The start of a search for a kayak."""
    path = tmp_path_factory.mktemp("kayak") / "mission.csv"
    env = SearchEnv(*scenario_and_rules("config/kayak.yaml", "sea", particles=200))
    fly(env, Log(path, env), steps=3)
    (read,) = read_csv(path)
    return read


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_every_map_has_the_land_and_the_last_known_positions(
    record: RecordedMission, theme: figures.Theme
) -> None:
    maps = {
        "effort": figures.effort_figure(record, theme),
        "tracks": figures.tracks_figure(record, theme),
        **{
            f"map {k}": figures.map_figure(view, theme) for k, view in views(record, {0, 3}).items()
        },
    }
    seen = sea_state(record.scenario, 0).sightings
    assert len(seen) == 2
    for name, figure in maps.items():
        assert figure.get_facecolor()[:3] == pytest.approx(
            np.array([int(theme.paper[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        )
        check_sea(name, figure, [sighting.label for sighting in seen])


def check_sea(name: str, figure: Figure, labels: list[str]) -> None:
    """Check that the land and these positions are on the shown part of a map."""
    axes = figure.axes[0]
    (land,) = [
        collection for collection in axes.collections if isinstance(collection, PolyCollection)
    ]
    assert land.get_paths(), name
    shown = {
        text.get_text(): text.xy for text in axes.texts if text.get_text().startswith("LKP")
    }  # fmt: skip
    assert sorted(shown) == sorted(labels), name
    for x, y in shown.values():
        assert axes.get_xlim()[0] <= x <= axes.get_xlim()[1], name
        assert axes.get_ylim()[0] <= y <= axes.get_ylim()[1], name


def test_a_drone_that_waits_is_shown_as_waiting(record: RecordedMission) -> None:
    from dsse_ros.results.report.metrics import effort, work
    from dsse_ros.results.report.recomputed import with_waits

    known = with_waits(record)
    assert known.waited is not None and known.waited.any()
    done, plain = work(known), work(record)
    assert (done.searching + done.waiting == plain.searching).all()
    assert effort(record).sum() - effort(known).sum() == done.waiting.sum() > 0
    legend = figures.work_figure(known, done, LIGHT).axes[0].get_legend()
    assert legend is not None
    assert "waiting" in [text.get_text() for text in legend.get_texts()]
