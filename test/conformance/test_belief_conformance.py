# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The beliefs keep what planners rely on, and what one does not keep is named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import pytest

from dsse_ros.conformance.belief import belief_test
from dsse_ros.search.belief.belief import Belief
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.step.looks import Looked
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.targets.registry import TARGET_MODELS

SCENARIO = Scenario(grid_size=11, timestep_limit=40, pre_search_minutes=1.0, vector=(0.3, 0.2))
WEST = [[-24.05, -46.18], [-24.05, -46.1622], [-24.02, -46.1622], [-24.02, -46.18]]
"""The grid's six western columns: persons drift out of them."""


@pytest.mark.parametrize("area", [None, WEST], ids=["grid", "area"])
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
@pytest.mark.parametrize("model", TARGET_MODELS)
def test_the_beliefs_of_the_package_keep_their_promises(rules: str, model: str, area: Any) -> None:
    chosen = profile(rules).override(person_motion=model)
    scenario = SCENARIO.override(area=area)
    belief_test(forecast_for(scenario, chosen, horizon=4, drift_samples=8).belief())


class _Forgetful(Belief):
    def update(self, looks: Sequence[Looked]) -> None:
        super().update(looks[:1])


class _Shared(Belief):
    def copy(self) -> Belief:
        return self


class _Sure(Belief):
    def poc(self) -> Any:
        return super().poc() * 1.001


class _Late(Belief):
    def outlook(self, horizon: int, gamma: float) -> Any:
        return super().outlook(horizon, 0.99)


class _Fixed(Belief):
    def reset(self) -> None:
        if not hasattr(self, "_begun"):
            self._begun = True
            super().reset()
        self.step, self.pos = 0, 0.0


BAD: dict[str, tuple[Callable[[Any], Belief], str]] = {
    "forgets a look": (_Forgetful, "outlook: |off Bayes' rule"),
    "shares its copies": (_Shared, "outlook|update|copy"),
    "sums to more": (_Sure, "sum to 1.001"),
    "expects too little": (_Late, "outlook: "),
    "does not start again": (_Fixed, "reset"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_belief_that_breaks_a_promise_is_found_out(name: str) -> None:
    make, why = BAD[name]
    forecast: Any = forecast_for(SCENARIO, profile("paper"), horizon=4)
    with pytest.raises(AssertionError, match=why) as error:
        belief_test(make(forecast))
    assert "\n" not in str(error.value)
