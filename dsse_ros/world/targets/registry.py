# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The target models by name: motions, which move step by step, and ensembles of tracks."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, MutableMapping
from typing import Any, TypeAlias

from dsse_ros.base.registry import Registry
from dsse_ros.world.targets.best_cell import BEST_CELL
from dsse_ros.world.targets.constant_drift import CONSTANT_DRIFT
from dsse_ros.world.targets.drawn_cell import DRAWN_CELL
from dsse_ros.world.targets.drifting_map import DRIFTING_MAP
from dsse_ros.world.targets.ensemble import Ensemble
from dsse_ros.world.targets.leeway import LEEWAY
from dsse_ros.world.targets.markov_chain import MARKOV_CHAIN
from dsse_ros.world.targets.motion import PersonMotion
from dsse_ros.world.targets.random_walk import RANDOM_WALK

TargetModel: TypeAlias = PersonMotion | Ensemble

_MOTIONS: Mapping[str, PersonMotion] = {
    "window": BEST_CELL,
    "drift": DRAWN_CELL,
    "random_walk": RANDOM_WALK,
    "markov_chain": MARKOV_CHAIN,
}
_ENSEMBLES: Mapping[str, Ensemble] = {
    "constant_drift": CONSTANT_DRIFT,
    "leeway": LEEWAY,
    "drifting_map": DRIFTING_MAP,
}
OWN_MODELS: Mapping[str, TargetModel] = {**_MOTIONS, **_ENSEMBLES}
"""The models of this package."""

_INSTALLED_MOTIONS = Registry[PersonMotion]("motion", PersonMotion, _MOTIONS)

MOTIONS: dict[str, PersonMotion] = _INSTALLED_MOTIONS.loaded()
"""The motions by name, without the defective ones of other packages: all are compiled into the
search. `constants.motion` is the number of the one in use."""

ENSEMBLES = Registry[Ensemble]("ensemble", Ensemble, _ENSEMBLES)

# A name that only the last one has is a motion that cannot be loaded: it says why.
_MODELS: list[Any] = [ENSEMBLES, MOTIONS, _INSTALLED_MOTIONS]

TARGET_MODELS: MutableMapping[str, TargetModel] = ChainMap(*_MODELS)
"""The choices for `person_motion` of the rules."""


def has_own_drift(name: str) -> bool:
    """Return whether this is a motion in which each person has its own drift."""
    model = TARGET_MODELS[name]
    return isinstance(model, PersonMotion) and model.own_drift


def drifts_with_incident(name: str) -> bool:
    """Return whether this is an ensemble of an incident's tracks."""
    model = TARGET_MODELS[name]
    return isinstance(model, Ensemble) and model.of_incident
