# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which forecast and which belief a search has: those of a motion, or those of an ensemble."""

from __future__ import annotations

from typing import TypeAlias

from dsse_ros.belief.belief import Belief, Forecast
from dsse_ros.belief.ensemble_belief import EnsembleBelief, EnsembleForecast
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.targets.ensemble import Ensemble
from dsse_ros.targets.registry import TARGET_MODELS

AnyForecast: TypeAlias = Forecast | EnsembleForecast
AnyBelief: TypeAlias = Belief | EnsembleBelief


def is_ensemble(rules: Rules) -> bool:
    """Return whether the persons of a search follow an ensemble."""
    return isinstance(TARGET_MODELS[rules.person_motion], Ensemble)


def forecast_for(
    scenario: Scenario, rules: Rules, *, horizon: int = 0, drift_samples: int = 256
) -> AnyForecast:
    """Return the forecast of a scenario.

    Args:
        scenario: Resolved or not; it is resolved with the rules.
        rules: The rules of the search.
        horizon: How many steps after the present one can be looked at.
        drift_samples: See `Forecast`; an ensemble has none.
    """
    if is_ensemble(rules):
        return EnsembleForecast(scenario, rules, horizon=horizon)
    return Forecast(scenario, rules, horizon=horizon, drift_samples=drift_samples)


def belief_on(forecast: AnyForecast) -> AnyBelief:
    """Return a belief at the start of a mission.

    Args:
        forecast: Of `forecast_for`.
    """
    if isinstance(forecast, EnsembleForecast):
        return EnsembleBelief(forecast)
    return Belief(forecast)
