# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The action of an agent, checked."""

from __future__ import annotations

import operator
from collections.abc import Mapping

from dsse_ros.scenario.fields import FieldError, shown
from dsse_ros.scenario.rules import Rules
from dsse_ros.search.world import HOLD


def action_of(rules: Rules, agent: str, actions: Mapping[str, int]) -> int:
    """Return an agent's action number; `HOLD` for what the rules count as nothing.

    Raises:
        FieldError: If the action is missing or the rules do not allow it.
    """
    if agent not in actions:
        raise FieldError(f"actions: {agent} is missing; one action per live agent")
    value = actions[agent]
    try:
        # If unknown actions do nothing, any value that equals a number counts, as in DSSE 0.1.13.
        known = range(len(rules.actions))
        return known.index(value if rules.noop_actions else operator.index(value))
    except (TypeError, ValueError):
        if rules.noop_actions:
            return HOLD
    raise FieldError(
        f"action of {agent} must be one of {rules.action_set}, got {shown(value)}"
    ) from None
