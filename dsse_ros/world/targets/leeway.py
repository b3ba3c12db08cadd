# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ensemble of an incident: objects that drift with wind and current."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsse_ros.world.targets import constant_drift
from dsse_ros.world.targets.ensemble import Ensemble, TracksBySteps, WeightedTracks, requested


def tracks(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> WeightedTracks:
    """Return tracks of equal weight; see `targets.ensemble.TracksOf`.

    They are those of the scenario's incident. Without one there is only the drift of the datum, and
    the tracks are those of `constant_drift`.
    """
    drawn = by_steps(scenario, steps, rng, count)
    positions = np.array(list(drawn.positions))
    dies_s = None if drawn.dies_s is None else drawn.dies_s()
    return WeightedTracks(positions, drawn.weights, drawn.objects, dies_s)


def by_steps(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> TracksBySteps:
    """Return these tracks, one step after the other."""
    if scenario.incident is None:
        return TracksBySteps(*constant_drift.tracks(scenario, steps, rng, count)[:3])
    times_s = scenario.step_duration_s * np.arange(steps + 1, dtype=np.float64)
    positions, objects, dies_s = scenario.incident_positions(times_s, rng, count)
    number = count if scenario.incident.model_tracks is None else LEEWAY.count(scenario)
    return TracksBySteps(positions, np.full(number, 1.0 / number), objects, dies_s)


def count(scenario: Any) -> int:
    """Return the number of tracks: the scenario's, or that of the tracks of another model."""
    model_tracks = None if scenario.incident is None else scenario.incident.model_tracks
    return requested(scenario) if model_tracks is None else int(model_tracks.lats_deg.shape[1])


LEEWAY = Ensemble(
    "drifts with wind and current like the object of the incident", tracks, count,
    of_incident=True, by_steps=by_steps,
)  # fmt: skip
