# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fields of a scenario for the motion of persons: Markov chains and ensembles."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.base.fields import field
from dsse_ros.world.scenario.transition_probabilities import TransitionProbabilities


@dataclass(frozen=True, kw_only=True)
class EnsembleFields:
    """Number and spread of the particles of a person."""

    particles: int = field(
        "int", "Ensembles: number of particles.", 10_000,
        low=1, high=10**6,
    )  # fmt: skip
    ensemble_seed: int = field(
        "int", "Ensembles: seed of the particles and of the persons' tracks.", 0,
        low=0, high=2**53,
    )  # fmt: skip
    diffusivity: float = field(
        "float", "Ensembles: a person's variance along an axis grows by twice this per second.",
        1.0, low=0, high=1e6, unit="m^2/s",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class MarkovChainFields:
    """The chain."""

    transition_probabilities: TransitionProbabilities | None = field(
        "custom",
        "Steps of a markov_chain from each cell: a .npy or .npz file or, in Python, an array; "
        "empty for person_steps in each cell.",
        None,
        reader=TransitionProbabilities,
    )
