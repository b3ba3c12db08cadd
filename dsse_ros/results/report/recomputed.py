# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The maps and the belief of a recorded mission, computed again from its scenario."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.run.mission import Mission
from dsse_ros.picture.mission_view import MissionView, ending
from dsse_ros.results.report.metrics import effort
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.belief.forecasts import forecast_for as new_forecast
from dsse_ros.search.belief.protocol import TargetBelief, TargetForecast
from dsse_ros.search.environments.coverage_task import poc_of
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.looks import likely_cells, looks_of, waits
from dsse_ros.world.sensors.sensor import SEARCH

LARGEST_BELIEF_GRID = 50
"""On larger grids a belief takes long, so the maps are those that drones observe."""
_TOLERANCE = 1e-6
"""Maps are float32."""

Maps = dict[int, NDArray[np.float32]]


def views(record: RecordedMission, wanted: Collection[int]) -> dict[int, MissionView]:
    """Return the views of a mission for pictures, with the map that drones observed.

    Args:
        wanted: Numbers of recorded steps, 0 to K - 1.

    Raises:
        FieldError: If the probability of a searched cell differs from the record: the record is of
            another scenario, or of other rules.
    """
    if record.covers:
        return _views_of_coverage(record, wanted)
    waited = None
    if record.waited is None and not record.rules.in_metres:
        waited = np.zeros_like(record.searched)
    if waited is not None:
        record = replace(record, waited=waited)
    shown: dict[int, MissionView] = {}
    for k, before, env in _observed(record):
        if before is not None:
            _check(record, k, before)
            if waited is not None:
                waited[k] = _waiting(record, k, before)
        if k in wanted:
            shown[k] = _view(record, k, env.view())
    return shown


def with_waits(record: RecordedMission) -> RecordedMission:
    """Return the record with the drones that waited in each step.

    None do in a coverage task or in metres.
    """
    if record.covers or record.rules.in_metres or record.waited is not None:
        return record
    waited = np.zeros_like(record.searched)
    for k, before, _ in _observed(record):
        if before is not None:
            waited[k] = _waiting(record, k, before)
    return replace(record, waited=waited)


def _waiting(record: RecordedMission, k: int, before: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which drones (N,) waited in the k-th recorded step, by the map before it."""
    looked = record.looked_at
    of_step = looked[slice(*np.searchsorted(looked[:, 0], [k, k + 1]))]
    return waits(record.searched[k], of_step[:, 1], of_step[:, 2:], likely_cells(before))


def _observed(
    record: RecordedMission,
) -> Iterator[tuple[int, NDArray[np.float32] | None, SearchEnv]]:
    """Yield each recorded step, the map before it, and a search after it whose drones did nothing.

    The start of the mission has no map before it.
    """
    env = SearchEnv(record.scenario, record.rules)
    # The map depends on neither drones nor persons: any seed and any actions give the same one.
    # A mission in which nobody can be found goes on to its limit, whatever the drones pass.
    nobody = {"person_pod_multipliers": [0.0] * record.scenario.person_amount}
    env.reset(seed=0, options=nobody if record.rules.in_metres else None)
    hold, step = np.full(len(record.agents), NO_ACTION, np.int8), 0
    for k, recorded in enumerate(record.steps.tolist()):
        before = None
        for _ in range(step, recorded):
            before = env.probability
            env.advance(hold)
        step = recorded
        yield k, before, env


def with_coverage(record: RecordedMission) -> RecordedMission:
    """Return the record of a coverage task with its metrics, as far as they are known."""
    if not record.covers or record.coverage_rate is not None or record.missing_steps:
        return record
    poc = poc_of(record.scenario, record.rules)
    left, total = poc.copy(), np.count_nonzero(poc)
    rate, repeated, pos = np.zeros((3, len(record.steps)))
    visits, found = 0, 0.0
    for k in range(len(record.steps)):
        for col, row in record.cells[k, record.searched[k]].tolist():
            visits += 1
            found += left[row, col] * record.scenario.probability_of_detection
            left[row, col] = 0.0
        covered = total - np.count_nonzero(left)
        rate[k], repeated[k], pos[k] = covered / total, (visits - covered) / total, found
    return replace(record, coverage_rate=rate, repeated_coverage=repeated, pos=pos)


def _views_of_coverage(record: RecordedMission, wanted: Collection[int]) -> dict[int, MissionView]:
    """Return the views of a coverage task, whose map the drones change."""
    env = SearchEnv(record.scenario, record.rules)
    env.reset(seed=0)
    view, left = env.view(), env.probability.copy()
    shown: dict[int, MissionView] = {}
    for k in range(len(record.steps)):
        _check(record, k, left)
        col, row = record.cells[k, record.searched[k]].T
        left[row, col] = 0.0
        if k in wanted:
            rate = None if record.coverage_rate is None else float(record.coverage_rate[k])
            shown[k] = _view(record, k, replace(view, probability=left.copy(), coverage_rate=rate))
    return shown


def _check(record: RecordedMission, k: int, probability: NDArray[np.float32]) -> None:
    if record.probabilities is None:
        return
    for drone in np.flatnonzero(record.searched[k] & (record.actions[k] == SEARCH)).tolist():
        col, row = record.cells[k, drone].tolist()
        recorded, computed = float(record.probabilities[k, drone]), float(probability[row, col])
        if abs(recorded - computed) > _TOLERANCE:
            raise FieldError(
                f"scenario: it does not match the record: in step {record.steps[k]} cell "
                f"({col}, {row}) had probability {recorded:.6g}, not {computed:.6g}"
            )


def _view(record: RecordedMission, k: int, of_map: MissionView) -> MissionView:
    """Return the view of a map with what was recorded up to the k-th recorded step."""
    nobody, nothing = np.zeros((0, 2), np.int64), np.zeros(0, bool)
    return replace(
        of_map,
        tracks=record.tracks(k + 1),
        **_view_in_metres(record, k),
        alive=~record.lost[k],
        persons=nobody if record.persons is None else record.persons[k],
        found=nothing if record.person_found is None else record.person_found[k],
        step=int(record.steps[k]),
        pos=None if record.pos is None else float(record.pos[k]),
        searches=effort(record, k + 1) if record.in_cells is None else None,
        waits=_waits(record, k + 1),
        ending=_ending(record, k) if record.complete and k == len(record.steps) - 1 else "",
    )


def _view_in_metres(record: RecordedMission, k: int) -> dict[str, Any]:
    """Return the further fields of the view of a record in metres."""
    if record.in_cells is None:
        return {}
    headings = None if record.courses is None else record.courses[k, :, 0]
    legs, looked = record.paths.shape[2] - 1, record.looked_on_tracks(k + 1)
    return {"headings": headings, "legs": legs, "looked": looked}


def _waits(record: RecordedMission, num_steps: int) -> NDArray[np.int64] | None:
    """Return in how many of the first recorded steps a drone waited in each cell, (R, C)."""
    if record.waited is None:
        return None
    count = np.zeros(record.grid_size.matrix, np.int64)
    col, row = record.cells[:num_steps][record.waited[:num_steps]].T
    np.add.at(count, (row, col), 1)
    return count


def _ending(record: RecordedMission, k: int) -> str:
    return ending(
        int(record.steps[k]),
        [record.agents[i] for i in np.flatnonzero(record.found[k])],
        persons=record.scenario.person_amount,
        covered=record.coverage_rate is not None and bool(record.coverage_rate[k] == 1.0),
        out_of_time=bool(record.truncated[k].any()),
    )


def forecast_for(record: RecordedMission, known: TargetForecast | None) -> TargetForecast | None:
    """Return the forecast for `follow_belief`; None if no belief can follow the mission.

    Args:
        known: One that was made before; it is returned if it is for this search.
    """
    if record.missing_steps or record.covers or record.grid_size.longer > LARGEST_BELIEF_GRID:
        return None
    if record.rules.in_metres and (record.turns is None or record.seed is None):
        return None
    if known is not None and (known.rules, known.scenario) == (record.rules, record.scenario):
        return known
    return new_forecast(record.scenario, record.rules, drift_samples=DRIFT_SAMPLES)


def follow_belief(
    record: RecordedMission, forecast: TargetForecast, wanted: Collection[int] = ()
) -> tuple[NDArray[np.float64], Maps]:
    """Update a belief with the recorded looks, like `sim_node`.

    The record does not contain which look of an action found a person: if there were several, the
    belief learns nothing from them.

    In metres the mission is flown again: only the paths of vehicles are recorded.

    Args:
        record: The record; it has every step from the start.

    Returns:
        (K,) POS after each step, and the belief (R, C) after each wanted one.

    Raises:
        FieldError: If the record in metres is not of the mission with its seed.
    """
    if record.rules.in_metres:
        return _flown_again(record, wanted)
    # The last one states the POS.
    followed = [forecast.belief()]
    if forecast.of_pos is not forecast:
        followed.append(forecast.of_pos.belief())
    pos = np.zeros(len(record.steps))
    beliefs: Maps = {}
    for k in _updated(record, forecast, followed):
        pos[k] = followed[-1].pos
        if k in wanted:
            beliefs[k] = followed[0].poc().astype(np.float32)
    return pos, beliefs


def pos_alive(record: RecordedMission, forecast: TargetForecast) -> float | None:
    """Return the probability that the searches find the person alive; None without a survival.

    Args:
        record: See `follow_belief`.
        forecast: Of the search.

    Raises:
        FieldError: As `follow_belief`.
    """
    alive = forecast.of_pos_alive if isinstance(forecast, EnsembleForecast) else None
    if alive is None:
        return None
    if record.rules.in_metres:
        with _same_mission():
            *_, last = (mission.pos_alive for mission in _flown_missions(record, belief=True))
        return last
    belief = alive.belief()
    for _ in _updated(record, alive, [belief]):
        pass
    return belief.pos


def object_shares(record: RecordedMission, forecast: TargetForecast) -> NDArray[np.float64] | None:
    """Return the probability of each possible object after each step, (K, O); None for only one.

    Args:
        record: See `follow_belief`.
        forecast: Of the search.

    Raises:
        FieldError: As `follow_belief`.
    """
    if not isinstance(forecast, EnsembleForecast) or forecast.tracks.objects is None:
        return None
    if record.rules.in_metres:
        with _same_mission():
            shares = [list(m.object_shares.values()) for m in _flown_missions(record, belief=True)]
        return np.array(shares)
    belief = forecast.belief()
    steps = _updated(record, forecast, [belief])
    return np.array([list(belief.object_shares.values()) for _ in steps])


def _updated(
    record: RecordedMission, forecast: TargetForecast, followed: Sequence[TargetBelief]
) -> Iterator[int]:
    """Update beliefs with the recorded looks; yield the number of each step when it is done."""
    views, looks = record.viewpoints, looks_of(forecast.scenario, forecast.rules)
    for k in range(len(record.steps)):
        if k:
            failed, finds = [], []
            for drone in np.flatnonzero(views["action"][k] >= 0).tolist():
                col, row, action, _ = views[k, drone].tolist()
                done = looks.done(drone, action, (col, row))
                if not record.found[k, drone]:
                    failed += done
                elif len(done) == 1:
                    finds += done
            for each in followed:
                each.update(failed)
                for look in finds:
                    each.observe_find(look)
                each.advance()
        yield k


def _flown_again(
    record: RecordedMission, wanted: Collection[int]
) -> tuple[NDArray[np.float64], Maps]:
    """See `follow_belief`."""
    pos, beliefs = np.zeros(len(record.steps)), {}
    with _same_mission():
        for k, view in enumerate(mission_views(record, belief=True)):
            pos[k] = view.pos
            if k in wanted:
                beliefs[k] = view.probability
    return pos, beliefs


@contextmanager
def _same_mission() -> Iterator[None]:
    """Raise a `FieldError` if the mission that is flown again is another one."""
    try:
        yield
    except ValueError as error:
        raise FieldError(f"scenario: it does not match the record: {error}") from None


def mission_views(record: RecordedMission, *, belief: bool) -> Iterator[MissionView]:
    """Fly a mission again, and yield its views at the start and after each step.

    Args:
        record: The commands, from the start, and the seed.
        belief: Whether the views show the belief of `Mission` instead of the map.

    Raises:
        ValueError: If the drones' cells differ from the record.
    """
    for mission in _flown_missions(record, belief=belief):
        view = mission.env.view()
        if belief:
            view = replace(view, probability=mission.belief(), pos=mission.pos, belief=True)
        yield view


def _flown_missions(record: RecordedMission, *, belief: bool) -> Iterator[Mission]:
    """Yield a mission at the start and after each step; see `mission_views`."""
    assert record.seed is not None
    env = SearchEnv(record.scenario, record.rules, "ansi")
    mission = Mission(env, record.seed, belief=belief)
    drones = env.world.drones[0]
    for step, cells in enumerate(record.cells):
        if step:
            record.inputs(step).repeat(mission)
        if not np.array_equal(np.stack([drones["x"], drones["y"]], axis=1), cells):
            raise ValueError(f"step {step} is not of the mission with seed {record.seed}")
        yield mission
