# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The metrics of the search literature, computed from a recorded mission."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsse_ros.results.report.record import RecordedMission
from dsse_ros.world.scenario.incident import GridSummary

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Curves:
    """The course of a mission, after each of its K recorded steps.

    Attributes:
        times_s: (K,) mission time since the start.
        pos: (K,) cumulative probability of success; None if not known.
        num_searches: (K,) searches so far.
        cells_searched: (K,) different cells searched so far.
        path_length_m: (K,) distance that all drones have flown so far.
        num_in_flight: (K,) drones in the search after the step.
        num_detections: (K,) finds so far.
        num_collisions: (K,) pairs of drones in the same cell after a step, so far.
        separation_m: (K,) least distance of two drones in the search; NaN with fewer than two.
    """

    times_s: Floats
    pos: Floats | None
    num_searches: Ints
    cells_searched: Ints
    path_length_m: Floats
    num_in_flight: Ints
    num_detections: Ints
    num_collisions: Ints
    separation_m: Floats


def path_lengths(record: RecordedMission) -> Floats:
    """Return how far each drone has flown after each step, (K, N) in metres."""
    if record.in_cells is not None:
        legs = np.diff(record.paths, axis=2)
        of_steps: Floats = np.hypot(legs[..., 0], legs[..., 1]).sum(axis=2)
    else:
        legs = np.diff(record.cells, axis=0, prepend=record.cells[:1]).astype(float)
        of_steps = record.scenario.cell_size * np.hypot(legs[..., 0], legs[..., 1])
    return of_steps.cumsum(axis=0)


def effort(record: RecordedMission, num_steps: int | None = None) -> Ints:
    """Return how often each cell was searched in the first recorded steps, (R, C) [row, col].

    A drone that waited has not searched, if it is known which did.
    """
    count = np.zeros(record.grid_size.matrix, np.int64)
    looked = record.looked_at
    if record.waited is not None:
        looked = looked[~record.waited[looked[:, 0], looked[:, 1]]]
    if num_steps is not None:
        looked = looked[looked[:, 0] < num_steps]
    np.add.at(count, (looked[:, 3], looked[:, 2]), 1)
    return count


def cumulative_pod(record: RecordedMission, num_steps: int) -> Floats:
    """Return the POD of all looks at each cell in the first recorded steps, (R, C) [row, col].

    A person who stayed in the cell was found with this probability; of several persons it is the
    mean.
    """
    first = record.looked_at[:, 0] < num_steps
    _, _, col, row = record.looked_at[first].T
    missed = np.ones((*record.grid_size.matrix, record.pods_of_looks.shape[1]))
    np.multiply.at(missed, (row, col), 1.0 - record.pods_of_looks[first])
    pod: Floats = (1.0 - missed).mean(axis=2)
    return pod


def num_cells(record: RecordedMission) -> int:
    """Return the number of cells of the search area."""
    return record.grid_size.cells if record.area is None else int(record.area.sum())


def _first_searches(record: RecordedMission) -> Ints:
    """Return how many cells were searched for the first time in each step, (K,)."""
    step, cells = record.looked_at[:, 0], record.looked_at[:, 2:]
    first = np.zeros(len(record.steps), np.int64)
    if len(cells):
        _, at = np.unique(cells, axis=0, return_index=True)
        np.add.at(first, step[at], 1)
    return first


def _close_approaches(record: RecordedMission) -> tuple[Ints, Floats]:
    """Return the pairs of drones in one cell, (K,), and the least distance of two, (K,) in metres.

    Only drones that were in the search before the step count.
    """
    pairs = np.zeros(len(record.steps), np.int64)
    nearest_m = np.full(len(record.steps), np.nan)
    for k, (cells, here) in enumerate(zip(record.places, record.in_flight, strict=True)):
        cells = cells[here].astype(float)
        if len(cells) < 2:
            continue
        away = np.hypot(*(cells[:, None] - cells).transpose(2, 0, 1))
        away = away[np.triu_indices(len(cells), 1)]
        nearest_m[k] = record.scenario.cell_size * away.min()
        pairs[k] = (away == 0).sum() if record.steps[k] else 0
    return pairs, nearest_m


def curves(record: RecordedMission) -> Curves:
    """Return the course of a mission."""
    pairs, nearest_m = _close_approaches(record)
    out = record.terminated | record.truncated
    return Curves(
        times_s=record.times_s,
        pos=record.pos,
        num_searches=np.bincount(record.looked_at[:, 0], minlength=len(record.steps)).cumsum(),
        cells_searched=_first_searches(record).cumsum(),
        path_length_m=path_lengths(record).sum(axis=1),
        num_in_flight=(~out).sum(axis=1),
        num_detections=record.found.sum(axis=1).cumsum(),
        num_collisions=pairs.cumsum(),
        separation_m=nearest_m,
    )


def _horizon(record: RecordedMission) -> int:
    """Return the number of steps in a mission's time limit."""
    return record.rules.last_acting_step(record.scenario.timestep_limit)


def _expected_time(record: RecordedMission, progress: Curves) -> tuple[float | None, float | None]:
    """Return the lower and upper bounds of E[min(T, H)], in seconds; None without a POS.

    T is the time until the searches detect, H the horizon. The expectation is the sum of
    P(T > t) = 1 - POS over the steps up to H, each with the POS of the steps before it. Searches
    after the first find depended on it, and searches after the record are unknown. The lower bound
    assumes that the next step would have detected for certain, the upper bound that no later step
    would have.
    """
    if progress.pos is None or record.covers:
        return None, None
    finds = np.flatnonzero(record.found.any(axis=1))
    acted = record.acted.any(axis=1)
    end = int(finds[0]) if len(finds) else int(np.flatnonzero(acted).max(initial=0))
    missed, steps = 1.0 - progress.pos[: end + 1], record.steps[: end + 1]
    # Between recorded steps, and before the first one, the POS has grown at unknown steps.
    gaps = np.diff(steps, prepend=0)
    earlier = np.concatenate([[1.0], missed[:-1]])
    low = float((earlier * np.minimum(gaps, 1) + missed * np.maximum(gaps - 1, 0)).sum())
    left = float(missed[-1]) * max(_horizon(record) - int(steps[-1]), 0)
    high = float((earlier * gaps).sum()) + left
    # No drone was left to search.
    low += left if record.complete and not len(finds) else 0.0
    step_s = record.scenario.step_duration_s
    return low * step_s, high * step_s


def _first_detection(record: RecordedMission, progress: Curves) -> float | None:
    finds = np.flatnonzero(progress.num_detections)
    return float(progress.times_s[finds[0]]) if len(finds) else None


def _last(values: Floats | None) -> float | None:
    return None if values is None else float(values[-1])


def _of_incident(record: RecordedMission, value: Callable[[GridSummary], float]) -> float | None:
    incident = record.scenario.incident
    return (
        None if incident is None or incident.grid_summary is None else value(incident.grid_summary)
    )


def _share_found(record: RecordedMission, progress: Curves) -> float | None:
    if record.covers:
        return None
    if not record.scenario.has_persons:
        return None
    if record.person_found is not None and record.person_found.shape[1]:
        return float(record.person_found.any(axis=0).mean())
    # One person is found, or not.
    return float(progress.num_detections[-1] > 0) if record.scenario.person_amount == 1 else None


def _redundancy(record: RecordedMission, progress: Curves) -> float | None:
    searches = int(progress.num_searches[-1])
    return 1.0 - float(progress.cells_searched[-1]) / searches if searches else None


def _separation(record: RecordedMission, progress: Curves) -> float | None:
    known = progress.separation_m[~np.isnan(progress.separation_m)]
    return float(known.min()) if len(known) else None


@dataclass(frozen=True)
class Metric:
    """One number of a mission.

    Attributes:
        name: Name in files.
        label: Label in reports.
        unit: `share` (0 to 1), `s`, `m`, or "" for a count or a sum.
        meaning: Its definition.
        value: Computes it; None if unknown, or if there is nothing to measure.
    """

    name: str
    label: str
    unit: str
    meaning: str
    value: Callable[[RecordedMission, Curves], float | None]


METRICS = (
    Metric(
        "pos", "Probability of success (POS)", "share",
        "Probability, before their outcomes are known, that the searches find the person: the sum "
        "of POC times POD, with the POC that remains after earlier searches; with several persons "
        "the expected share of finds.",
        lambda record, progress: _last(progress.pos),
    ),
    Metric(
        "pos_alive", "POS alive", "share",
        "Incident with a survival curve: probability, before their outcomes are known, that the "
        "searches find the person alive. A planning aid: no reason to end a search.",
        lambda record, progress: record.pos_alive,
    ),
    Metric(
        "poc_outside", "POC outside", "share",
        "Incident: share of the particles that leave the grid before the time limit.",
        lambda record, progress: _of_incident(record, lambda summary: 1.0 - summary.inside),
    ),
    Metric(
        "stranded", "Stranded", "share",
        "Incident: share of the particles that lie ashore at the time limit.",
        lambda record, progress: _of_incident(record, lambda summary: summary.stranded),
    ),
    Metric(
        "expected_time_at_least", "Expected time to detection, at least", "s",
        "Mean time until searches like these detect any one person, or the time limit if they do "
        "not (a restricted mean): the sum of 1 - POS over the steps up to the limit, times the "
        "duration of a step. Searches after the first find, or the end of the record, are "
        "unknown: here, the next step is certain to detect.",
        lambda record, progress: _expected_time(record, progress)[0],
    ),
    Metric(
        "expected_time_at_most", "Expected time to detection, at most", "s",
        "The same without further searches. In a complete mission without a "
        "find, both bounds are equal.",
        lambda record, progress: _expected_time(record, progress)[1],
    ),
    Metric(
        "time_to_detection", "Time to detection", "s",
        "Mission time of the first find.",
        _first_detection,
    ),
    Metric(
        "share_found", "Persons found", "share",
        "Share of all persons; unknown for several persons in a bag.",
        _share_found,
    ),
    Metric(
        "coverage", "Area coverage", "share",
        "Share of the cells of the search area that were searched; in metres, flown over.",
        lambda record, progress: float(progress.cells_searched[-1]) / num_cells(record),
    ),
    Metric(
        "coverage_rate", "Coverage rate", "share",
        "Coverage task: share of the cells to cover that were covered.",
        lambda record, progress: _last(record.coverage_rate),
    ),
    Metric(
        "repeated_coverage", "Repeated coverage", "share",
        "Coverage task: visits of cells that were covered before or had no probability, per cell "
        "to cover.",
        lambda record, progress: _last(record.repeated_coverage),
    ),
    Metric(
        "coverage_factor", "Coverage factor C", "",
        "Search effort divided by search area, C = Z / A: the mean number of searches per cell.",
        lambda record, progress: float(progress.num_searches[-1]) / num_cells(record),
    ),
    Metric(
        "redundancy", "Redundancy", "share",
        "Share of the searches in cells searched before; not wasted if persons move or detection "
        "is uncertain.",
        _redundancy,
    ),
    Metric(
        "searches", "Searches", "",
        "Number of searches; a cell counts each time.",
        lambda record, progress: float(progress.num_searches[-1]),
    ),
    Metric(
        "path_length", "Path length, all drones", "m",
        "Sum of the distances between the centres of the cells flown through; in metres along "
        "the paths.",
        lambda record, progress: float(progress.path_length_m[-1]),
    ),
    Metric(
        "longest_path", "Path length, longest", "m",
        "Path of the drone that flew farthest.",
        lambda record, progress: float(path_lengths(record)[-1].max()),
    ),
    Metric(
        "collisions", "Collisions", "",
        "Pairs of drones in the search that share a cell after a step, summed over the steps, even "
        "if the rules have no collisions.",
        lambda record, progress: float(progress.num_collisions[-1]),
    ),
    Metric(
        "separation", "Least separation", "m",
        "Least distance between the cells of two drones in the search, at the start or after any "
        "step.",
        _separation,
    ),
    Metric(
        "drones_lost", "Drones lost", "",
        "Drones out of the search before it ended: collided, off the grid, or with a lost vehicle.",
        lambda record, progress: float(record.lost[-1].sum()),
    ),
    Metric(
        "duration", "Duration", "s",
        "Mission time of the last step in which a drone acted.",
        lambda record, progress: float(progress.times_s[record.acted.any(axis=1)].max(initial=0.0)),
    ),
    Metric(
        "episode_return", "Return", "",
        "Sum of the rewards of all drones.",
        lambda record, progress: float(record.rewards.sum()),
    ),
)  # fmt: skip


def metrics(record: RecordedMission) -> dict[str, float | None]:
    """Return every metric of a mission by its name."""
    progress = curves(record)
    return {metric.name: metric.value(record, progress) for metric in METRICS}


@dataclass(frozen=True)
class Work:
    """Work of each of the N drones.

    Attributes:
        searching: (N,) steps in which it searched, apart from those in which it waited.
        waiting: (N,) steps in which it searched where nobody could be; 0 if that is unknown.
        moving: (N,) steps in which it flew to another cell.
        holding: (N,) steps in which it did neither.
        cells: (N,) different cells that it looked at.
        path_length_m: (N,).
        detections: (N,) finds.
        returns: (N,) sum of its rewards.
        lost_at: (N,) step in which it was lost; -1 if it was not.
    """

    searching: Ints
    waiting: Ints
    moving: Ints
    holding: Ints
    cells: Ints
    path_length_m: Floats
    detections: Ints
    returns: Floats
    lost_at: Ints


def work(record: RecordedMission) -> Work:
    """Return what each drone did."""
    moved = np.diff(record.cells, axis=0, prepend=record.cells[:1]).any(axis=2) & record.acted
    if record.rules.in_metres:
        # They search while they move.
        moved &= ~record.searched
    searching, moving = record.searched.sum(axis=0), moved.sum(axis=0)
    waiting = np.zeros_like(searching) if record.waited is None else record.waited.sum(axis=0)
    lost = record.lost
    return Work(
        searching=searching - waiting,
        waiting=waiting,
        moving=moving,
        holding=record.acted.sum(axis=0) - searching - moving,
        cells=np.array(
            [
                len(np.unique(record.looked_at[record.looked_at[:, 1] == i, 2:], axis=0))
                for i in range(len(record.agents))
            ]
        ),
        path_length_m=path_lengths(record)[-1],
        detections=record.found.sum(axis=0),
        returns=record.rewards.sum(axis=0),
        lost_at=np.where(lost[-1], record.steps[np.argmax(lost, axis=0)], -1),
    )
