# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Choice of the forecast of a search: that of a motion, or that of an ensemble."""

from __future__ import annotations

from dsse_ros.belief.belief import Forecast
from dsse_ros.belief.ensemble_belief import EnsembleForecast
from dsse_ros.belief.protocol import TargetForecast
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.targets.ensemble import Ensemble
from dsse_ros.targets.registry import TARGET_MODELS


def is_ensemble(rules: Rules) -> bool:
    """Return whether the persons of a search follow an ensemble."""
    return isinstance(TARGET_MODELS[rules.person_motion], Ensemble)


def forecast_for(
    scenario: Scenario,
    rules: Rules,
    *,
    horizon: int = 0,
    drift_samples: int = 256,
    planning: bool = False,
) -> TargetForecast:
    """Return the forecast of a scenario.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search.
        horizon: Number of steps after the present one that are available.
        drift_samples: See `Forecast`; ensembles ignore it.
        planning: See `EnsembleForecast`; other forecasts ignore it.
    """
    if is_ensemble(rules):
        return EnsembleForecast(scenario, rules, horizon=horizon, planning=planning)
    return Forecast(scenario, rules, horizon=horizon, drift_samples=drift_samples)
