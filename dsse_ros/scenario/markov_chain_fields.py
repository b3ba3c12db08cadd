# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The field of a scenario for persons who follow a Markov chain."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.scenario.fields import field
from dsse_ros.scenario.transition_probabilities import TransitionProbabilities


@dataclass(frozen=True, kw_only=True)
class MarkovChainFields:
    """The chain."""

    transition_probabilities: TransitionProbabilities | None = field(
        "given",
        "Steps of a markov_chain from each cell: a .npy or .npz file or, in Python, an array; "
        "empty for person_steps in each cell.",
        None,
        reader=TransitionProbabilities,
    )
