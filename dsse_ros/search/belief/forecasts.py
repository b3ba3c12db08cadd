# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Choice of the forecast of a search: that of a motion, or that of an ensemble."""

from __future__ import annotations

from dsse_ros.search.belief.belief import Forecast
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.belief.protocol import TargetForecast
from dsse_ros.search.step.cell_tracks import Draw
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.targets.ensemble import Ensemble
from dsse_ros.world.targets.registry import TARGET_MODELS


def is_ensemble(rules: Rules) -> bool:
    """Return whether the persons of a search follow an ensemble."""
    return isinstance(TARGET_MODELS[rules.person_motion], Ensemble)


def forecast_for(
    scenario: Scenario,
    rules: Rules,
    *,
    horizon: int = 0,
    drift_samples: int = 256,
    draw: Draw = Draw.BELIEF,
) -> TargetForecast:
    """Return the forecast of a scenario.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search.
        horizon: Number of steps after the present one that are available.
        drift_samples: See `Forecast`; ensembles ignore it.
        draw: What particles are drawn for; forecasts without particles ignore it.
    """
    if is_ensemble(rules):
        return EnsembleForecast(scenario, rules, horizon=horizon, draw=draw)
    return Forecast(scenario, rules, horizon=horizon, drift_samples=drift_samples)
