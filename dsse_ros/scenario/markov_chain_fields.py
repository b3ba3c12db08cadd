# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The field of a scenario for persons who follow a Markov chain."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.scenario.fields import FieldError, field
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.transition_probabilities import NAME, TransitionProbabilities

MOTION = "markov_chain"


@dataclass(frozen=True, kw_only=True)
class MarkovChainFields:
    """The chain."""

    transition_probabilities: TransitionProbabilities | None = field(
        "transitions",
        "Steps of a markov_chain from each cell: a .npy or .npz file or, in Python, an array; "
        "empty for person_steps in each cell.",
        None,
    )

    def check_transitions(self, rules: Rules, grid_size: int) -> None:
        """Raise unless the chain, if any, fits the rules and the grid.

        Raises:
            FieldError: If it does not.
        """
        if self.transition_probabilities is None:
            return
        if rules.person_motion != MOTION:
            raise FieldError(
                f"{NAME} must come with person_motion {MOTION}, got {rules.person_motion}"
            )
        self.transition_probabilities.check_side(grid_size)
