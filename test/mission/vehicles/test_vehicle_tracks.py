# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has flown in a step, from its positions and its clock."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.vehicles.vehicle_tracks import (
    LONGEST_GAP_S,
    Position,
    VehicleTrack,
    tilt_deg,
)

STEP_S, PIECES = 13.0, 13


def report(track: VehicleTrack, time_s: float, *, looks: bool = True, boot_s: float = 0.0) -> None:
    """Report where a vehicle is that flies east at 10 m/s."""
    stamp = round(time_s * 1e9)
    track.set_place(stamp, Position(10.0 * time_s, 5.0, looks))
    track.set_time(stamp, boot_s + time_s)


@given(st.floats(0, 1e6), st.floats(0.1, LONGEST_GAP_S - 0.1), st.integers(1, 4))
def test_successive_steps_are_one_track_by_the_clock_of_the_vehicle(
    boot_s: float, period_s: float, steps: int
) -> None:
    track, times = VehicleTrack(STEP_S), np.arange(0.0, STEP_S * steps + period_s, period_s)
    report(track, 0.0, boot_s=boot_s)
    track.begin()
    end, done = None, 0
    for time_s in times[1:].tolist():
        report(track, time_s, boot_s=boot_s)
        if time_s >= STEP_S * (done + 1):
            flown = track.take(PIECES)
            assert flown is not None
            path, looked = flown
            assert (path[:, 1] == 5.0).all()
            assert np.diff(path[:, 0]) == pytest.approx(
                np.full(PIECES, np.ptp(path[:, 0]) / PIECES)
            )
            assert path[-1, 0] == pytest.approx(10.0 * time_s, abs=1e-3)
            assert looked[1:].all() and bool(looked[0]) == (done > 0)
            assert end is None or path[0].tolist() == end
            end, done = path[-1].tolist(), done + 1


def test_a_gap_and_a_place_from_which_it_cannot_look_count_as_not_looked() -> None:
    track = VehicleTrack(STEP_S)
    for time_s in np.arange(0.0, 13.01, 0.5).tolist():
        if not 3.0 < time_s < 6.0:
            report(track, time_s, looks=not 8.9 < time_s < 9.1)
    flown = track.take(PIECES)
    assert flown is not None
    _, looked = flown
    # Pieces of a second each: the gap from 3 to 6 s, and the positions around 9 s.
    assert np.flatnonzero(~looked[1:]).tolist() == [3, 4, 5, 8, 9]


def test_a_vehicle_without_positions_stays_where_it_was_and_does_not_look() -> None:
    track = VehicleTrack(STEP_S)
    assert track.take(PIECES) is None
    for time_s in (0.0, 1.0, 2.0):
        report(track, time_s)
    first, second = (track.take(PIECES, silent_s=silent_s) for silent_s in (11.0, 24.0))
    assert first is not None and second is not None
    assert first[1].tolist() == [False, True, True, *[False] * 11]
    assert second[0].tolist() == [[20.0, 5.0]] * 14 and not second[1].any()
    # It is heard again after two steps: how it came there is not known.
    for time_s in np.arange(30.0, 39.1, 1.0).tolist():
        report(track, time_s)
    third = track.take(PIECES)
    assert third is not None
    assert third[0][0].tolist() == pytest.approx([20.0 + 280.0 * 24 / 28, 5.0])
    assert third[0][-1].tolist() == [390.0, 5.0] and not third[1][:4].any() and third[1][5:].all()


@given(st.lists(st.integers(0, 5), min_size=1, max_size=4), st.floats(0.1, 1.0))
def test_steps_that_are_late_have_what_was_flown_in_each_of_them(
    late: list[int], period_s: float
) -> None:
    """Commands come some steps late, and then those steps are done at once."""
    track, time_s, step = VehicleTrack(STEP_S), 0.0, 0
    report(track, 0.0)
    track.begin()
    for steps in late:
        while time_s < STEP_S * (step + steps + 1):
            time_s += period_s
            report(track, time_s)
        for _ in range(steps + 1):
            flown = track.take(PIECES, time_s - STEP_S * (step + 1))
            assert flown is not None
            np.testing.assert_allclose(
                flown[0][:, 0], 10.0 * np.linspace(STEP_S * step, STEP_S * (step + 1), PIECES + 1)
            )
            assert flown[1][1:].all()
            step += 1


def test_after_a_clock_that_stood_still_the_vehicle_looks_again() -> None:
    track = VehicleTrack(STEP_S)
    for time_s in np.arange(0.0, 13.1, 1.0).tolist():
        report(track, time_s)
    for silent_s in (0.0, 13.0, 26.0, 39.0):
        # The clocks of others have gone on.
        assert track.take(PIECES, silent_s=silent_s) is not None
    for time_s in np.arange(14.0, 26.1, 1.0).tolist():
        report(track, time_s)
    flown = track.take(PIECES)
    assert flown is not None and flown[1][1:].all()
    assert flown[0][[0, -1], 0].tolist() == [130.0, 260.0]


def test_a_vehicle_whose_clock_goes_on_without_positions_does_not_look() -> None:
    track = VehicleTrack(STEP_S)
    for time_s in (0.0, 1.0, 2.0, 3.0):
        report(track, time_s)
    for time_s in (8.0, 13.0):
        track.set_time(round(time_s * 1e9), time_s)
    flown = track.take(PIECES)
    assert flown is not None and flown[1].tolist() == [False, *[True] * 3, *[False] * 10]
    assert flown[0][[0, -1], 0].tolist() == [0.0, 30.0]


def test_a_vehicle_whose_clock_is_slower_than_the_fleets_looks_all_the_time() -> None:
    track, step_s = VehicleTrack(STEP_S), 10.0
    for step in range(3):
        for time_s in np.arange(step_s * step, step_s * (step + 1) + 0.1, 1.0).tolist():
            report(track, time_s)
        flown = track.take(PIECES)
        assert flown is not None and flown[1][1:].all()
        assert flown[0][[0, -1], 0].tolist() == [100.0 * step, 100.0 * (step + 1)]


@pytest.mark.parametrize("jump_s", [-100.0, 1000.0])
def test_another_clock_begins_a_new_track(jump_s: float) -> None:
    track = VehicleTrack(STEP_S)
    for time_s in (0.0, 1.0, 2.0):
        report(track, time_s, boot_s=200.0)
    for time_s in np.arange(3.0, 16.1, 1.0).tolist():
        report(track, time_s, boot_s=200.0 + jump_s)
    flown = track.take(PIECES)
    assert flown is not None
    assert flown[0][0].tolist() == [30.0, 5.0] and flown[1].tolist() == [False, *[True] * 13]


@given(
    st.lists(st.tuples(st.booleans(), st.booleans()), min_size=20, max_size=20),
    st.permutations(range(20)),
)
def test_the_time_of_a_position_is_between_the_clocks_around_it(
    heard: list[tuple[bool, bool]], order: list[int]
) -> None:
    track, expected = VehicleTrack(STEP_S), []
    for stamp in range(20):
        has_place, has_clock = heard[stamp]
        messages = [("place", has_place), ("clock", has_clock)]
        for kind, is_heard in messages if order[stamp] % 2 else reversed(messages):
            if is_heard and kind == "place":
                track.set_place(stamp, Position(float(stamp), 0.0, True))
            elif is_heard:
                track.set_time(stamp, 100.0 + stamp)
    clocks = [stamp for stamp in range(20) if heard[stamp][1]]
    for stamp in range(20):
        if heard[stamp][0] and clocks and clocks[0] <= stamp <= clocks[-1]:
            expected.append((100.0 + stamp, Position(float(stamp), 0.0, True)))
    assert list(track._positions) == expected


def test_the_tilt_is_that_of_the_vertical_axis_whatever_the_heading() -> None:
    def turn(axis: int, degrees: float) -> list[float]:
        half = math.radians(degrees) / 2
        quaternion = [0.0, 0.0, 0.0, math.cos(half)]
        quaternion[axis] = math.sin(half)
        return quaternion

    for axis, degrees, tilt in ((2, 77.0, 0.0), (0, 30.0, 30.0), (1, -50.0, 50.0)):
        x, y, z, w = turn(axis, degrees)
        assert tilt_deg((2 * x, 2 * y, 2 * z, 2 * w)) == pytest.approx(tilt)
    assert tilt_deg((0.0, 0.0, 0.0, 0.0)) == 0.0
    assert math.isnan(tilt_deg((math.nan, 0.0, 0.0, 1.0)))
