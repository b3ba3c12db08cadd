# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones in metres fly commanded tracks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.mission.run.metres_parsers import parse_track
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.vehicles.track_follower import TOLERANCE_M
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.scenario import scenario_frame
from dsse_ros.world.searchers import registry
from dsse_ros.world.searchers.searcher import Searcher
from msg_adapters.poses import FramedPose

KINDS = {
    "hover": Searcher(doc="turns on the spot", speed=10.0),
    "heavy": Searcher(doc="takes its time", speed=10.0, acceleration=2.0),
    "plane": Searcher(doc="a plane", speed=15.0, min_speed=11.0, turn_radius=60.0),
}
PLACE: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 20, "particles": 100,
    "drones_positions": ((9, 9),), "sigma": 3.0, "probability_of_detection": 0.0,
}  # fmt: skip
places = st.tuples(st.floats(300.0, 2300.0), st.floats(300.0, 2300.0))


@pytest.fixture(autouse=True)
def kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, kind in KINDS.items():
        monkeypatch.setitem(registry.SEARCHERS, name, kind)


def mission(kind: str, wind: float) -> Mission:
    made = Mission(
        parallel_env(**PLACE, searchers=(kind,), wind_speed=wind, wind_toward=70.0), 3, belief=False
    )
    return made


def flown(of: Mission, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the path (K, 2) to the end of a track, all of it within the steps of the mission."""
    of.commands.set_goal(0, points)
    path = []
    while not of.missing:
        assert not of.done
        result = of.advance("abort")
        assert result.flown is not None
        path.append(result.flown.paths[0])
    return np.concatenate(path)


def away(points: NDArray[np.float64], track: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of points from a track."""
    starts, legs = track[:-1], np.diff(track, axis=0)
    squared = np.maximum((legs**2).sum(axis=1), 1e-9)
    share = np.clip(((points[:, None] - starts) * legs).sum(axis=2) / squared, 0.0, 1.0)
    near = starts + share[..., None] * legs
    found: NDArray[np.float64] = np.linalg.norm(points[:, None] - near, axis=2).min(axis=1)
    return found


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(sorted(KINDS)), st.lists(places, min_size=1, max_size=5), st.floats(0, 5))
def test_a_drone_comes_to_the_end_of_its_track(
    kind: str, track: list[tuple[float, float]], wind: float
) -> None:
    points = np.array(track)
    path = flown(mission(kind, wind), points)
    near = max(TOLERANCE_M, KINDS[kind].turn_radius)
    assert away(points[-1:], path)[0] <= near + 1e-6


@settings(max_examples=15, deadline=None)
@given(st.lists(places, min_size=1, max_size=5), st.floats(0, 5))
def test_one_that_turns_on_the_spot_stays_on_its_track(
    track: list[tuple[float, float]], wind: float
) -> None:
    of, points = mission("hover", wind), np.array(track)
    start = of.result.flown.paths[0, -1]  # type: ignore[union-attr]
    path = flown(of, points)
    assert away(path, np.vstack([start, points])).max() <= TOLERANCE_M + 1.0
    # It has passed each of its corners.
    assert away(points, path).max() <= TOLERANCE_M + 1.0


def test_one_point_is_flown_straight_and_no_step_is_lost() -> None:
    of = mission("hover", 0.0)
    path = flown(of, np.array([[1235.0, 235.0]]))
    assert of.result.step == math.ceil((1000.0 - TOLERANCE_M) / 130.0)
    assert np.abs(path[:, 0] - 1235.0).max() < 1e-6


def test_a_track_goes_on_from_a_snapshot() -> None:
    of, other = mission("plane", 3.0), mission("plane", 3.0)
    of.commands.set_goal(0, np.array([[2000.0, 600.0], [600.0, 2000.0]]))
    of.advance("abort")
    other.restore(of.snapshot())
    for _ in range(5):
        assert other.missing == of.missing == []
        ours, theirs = of.advance("abort").flown, other.advance("abort").flown
        assert ours is not None and theirs is not None
        assert ours.paths.tobytes() == theirs.paths.tobytes()


def pose(x: float, y: float, frame: str = "map", z: float = 0.0) -> FramedPose:
    return FramedPose(frame, (x, y, z), (0.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("poses", "code", "reason"),
    [
        ([], "wrong_size", "poses must be 1 to 10000, got 0"),
        ([pose(5, 5, "odom")], "foreign_frame", "header.frame_id must be 'map', got 'odom'"),
        ([pose(5, 5), pose(5, math.nan)], "not_finite", "poses[1]: pose.position.y must be"),
        ([pose(5, 5, z=math.inf)], "not_finite", "pose.position.z must be a finite number"),
        ([pose(5, 5), pose(-1, 5)], "outside_grid", "poses[1]: pose.position must be 0 <= x, y <"),
    ],
)
def test_what_is_no_track_is_refused(poses: list[FramedPose], code: str, reason: str) -> None:
    refused = parse_track(poses, scenario_frame(mission("hover", 0.0).env.scenario))
    assert isinstance(refused, Rejected)
    assert refused.code == code and refused.reason.startswith(reason)


def test_a_track_is_in_metres_from_the_north_west_corner() -> None:
    parsed = parse_track([pose(5, 7)], scenario_frame(mission("hover", 0.0).env.scenario))
    assert isinstance(parsed, Accepted) and parsed.value.tolist() == [[5.0, 2593.0]]
