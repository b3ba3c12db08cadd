# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner of whoever chooses none."""

from __future__ import annotations

from dsse_ros.planners.registry import check_task, default_planner
from dsse_ros.ros.nodes.settings import PlannerSettings
from dsse_ros.world.scenario.rules import PROFILES, profile


def test_the_default_is_belief_and_every_profile_has_one_that_does_its_task() -> None:
    assert PlannerSettings().planner == "belief"
    for name in PROFILES:
        rules = profile(name)
        check_task(default_planner(rules), rules)
        assert rules.covers or default_planner(rules) == "belief"
