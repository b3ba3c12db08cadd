# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rules of the search as data: one frozen value per profile, read by one compiled step.

Sources: the DSSE paper (arXiv 2307.06240), namely its table of rewards and its sections on the
probability matrix and the person's movement, and the behaviour of the packages DSSE 0.1.13
(profile v1) and DSSE 1.1.9 (profile v2, and profile coverage for its CoverageDroneSwarmSearch).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from dsse_ros.base.fields import FieldError, check_all, check_known, field, shown, specs
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.actions import ACTION_VECTORS, DIAGONAL, STRAIGHT, ActionSet
from dsse_ros.world.sensors.registry import SENSORS
from dsse_ros.world.sensors.sensor import SEARCH
from dsse_ros.world.targets.ensemble import Ensemble
from dsse_ros.world.targets.registry import ENSEMBLES, OWN_MODELS, TARGET_MODELS

_PLUS = (*STRAIGHT, SEARCH)
_STAR = (*STRAIGHT, *DIAGONAL, SEARCH)


@dataclass(frozen=True, kw_only=True)
class ActionRules:
    """Actions of the drones and effect of a search."""

    space: str = field(
        "str",
        "Where drones fly: from cell to cell by numbered actions, or freely in metres by a turn "
        "and a speed.",
        "cells",
        choices=("cells", "metres"),
    )
    actions: tuple[str, ...] = field("names", "Names of the actions, by number; none in metres.")
    timed_actions: bool = field(
        "bool",
        "Whether an action takes its time: a move its length over the drone's speed, a search what "
        "its kind needs; otherwise each takes a step.",
        False,
    )
    vehicle_timed_actions: bool = field(
        "bool",
        "Whether an action lasts until the drone's vehicle has done it, at least a step; "
        "vehicle_time of sim_node sets it.",
        False,
    )
    noop_actions: bool = field(
        "bool", "Whether an unknown action number does nothing instead of being refused.", False
    )
    leave_policy: str = field(
        "str",
        "A drone that would leave the grid is terminated in its cell, stays there, or flies on "
        "outside.",
        choices=("terminate", "stay", "fly_on"),
    )
    collisions: bool = field("bool", "Whether drones in the same cell after all moves collide.")
    one_find_per_search: bool = field(
        "bool", "Whether a search looks only for the first person in the cell.", False
    )


@dataclass(frozen=True, kw_only=True)
class RewardRules:
    """Rewards of the drones."""

    move: float = field("float", "Reward of a move.")
    leave_grid: float = field("float", "Reward of a move that would leave the grid.")
    collision: float = field("float", "Reward of each drone that collides.", 0.0)
    search_min_probability: float = field(
        "float",
        "Probability below which a search earns search_below.",
        0.01,
        low=0,
        high=1,
    )
    search_min_inclusive: bool = field(
        "bool", "Whether exactly this probability counts as above.", True
    )
    search_below: float = field("float", "Reward of a search below search_min_probability.")
    search_scale: float = field("float", "Reward of any other search, times the probability.")
    find: float = field("float", "Reward of a find.")
    find_bonus: float = field("float", "Added to `find`, times (1 - t / L).")
    time_out: float = field("float", "Reward of an action after the time limit.")
    time_out_total: bool = field(
        "bool",
        "Whether a time-out sets the drone's total reward to time_out; rewards that a collision "
        "replaced count with their original value.",
        False,
    )


@dataclass(frozen=True, kw_only=True)
class CoverageRules:
    """The task, and the rewards of the coverage task."""

    task: str = field(
        "str",
        "What drones do: find persons, or cover each cell with a probability once, on a fixed map.",
        "find",
        choices=("find", "cover"),
    )
    cover_min_probability: float = field(
        "float", "Cells below this need not be covered.", 1e-10, above=0, high=1
    )
    cover: float = field("float", "Reward of covering a cell.", 0.0)
    cover_scale: float = field(
        "float",
        "Added to `cover`, times the cell's probability, the cells to cover and (1 - (t + 1) / L).",
        0.0,
    )
    cover_all: float = field(
        "float",
        "Reward of each drone once all cells are covered, times the cells per drone.",
        0.0,
    )
    cover_all_bonus: float = field("float", "Added to `cover_all`, times (1 - (t + 1) / L).", 0.0)


@dataclass(frozen=True, kw_only=True)
class TerminationRules:
    """When a search ends, and for whom."""

    time_out_grace: int = field(
        "int", "Time is out when t >= L plus this.", 0, low=-1, high=1000, unit="steps"
    )
    time_out_acts: bool = field("bool", "Whether drones still act after the time limit.", False)
    both_flags: bool = field(
        "bool", "Whether a drone gets both terminated and truncated, not one.", False
    )
    ends_together: bool = field(
        "bool",
        "Whether the first flag ends the search for all; a find then flags every drone except "
        "those that move after it in the same step.",
        False,
    )


@dataclass(frozen=True, kw_only=True)
class SeaRules:
    """Drift of the map, and possible cells."""

    drift_remainder: str = field(
        "str",
        "Remainder of a drift that moved the datum: kept, dropped, or reduced by one cell.",
        "kept",
        choices=("kept", "dropped", "less_one"),
    )
    drift_axes_independent: bool = field(
        "bool",
        "Whether the datum stops at the edge of the grid along one axis, not both.",
    )
    drift_by_speed: bool = field(
        "bool", "Whether the drift per step is v * norm(v) / drone_speed, not v.", False
    )
    reset_sea_steps: int = field(
        "int", "Steps of the map and the persons during reset.", 0, low=0, high=1000, unit="steps"
    )
    circle: bool = field("bool", "Whether a growing circle limits the possible cells.")
    circle_on_previous_datum: bool = field(
        "bool", "Whether the circle is centred on the datum of the previous step.", False
    )


@dataclass(frozen=True, kw_only=True)
class PersonRules:
    """Start and motion of the persons, and what happens after a find."""

    person_motion: str = field(
        "str",
        "A person "
        + "; ".join(f"{model.doc} ({name})" for name, model in OWN_MODELS.items())
        + ".",
        "window",
        choices=TARGET_MODELS.keys(),
    )
    person_steps: tuple[float, ...] = field(
        "floats",
        "Probabilities of the steps of a random_walk, or of a markov_chain without "
        "transition_probabilities, row by row from the north-west. Where steps would leave the "
        "area, the others share their probability, except staying.",
        (0.0, 0.1, 0.0, 0.1, 0.6, 0.1, 0.0, 0.1, 0.0),
        low=0,
        high=1,
    )
    person_first: bool = field("bool", "Whether persons move before the map.", False)
    person_walks_blind: bool = field(
        "bool", "Whether a person in an all-zero window moves by (-1, -1), not stays.", False
    )
    person_scatter: int = field(
        "int",
        "One person starts in the given cell, the others in different cells, at most this many "
        "cells away; 0: all in the same one.",
        0,
        low=0,
        high=2,
        unit="cells",
    )
    found_persons_stay: bool = field("bool", "Whether a found person can be found again.", False)


_IN_METRES: dict[str, tuple[object, ...]] = {
    "actions": ((),),
    "timed_actions": (False,),
    "noop_actions": (False,),
    "collisions": (False,),
    "leave_policy": ("terminate", "stay"),
    "task": ("find",),
    "one_find_per_search": (False,),
}
"""Values that fields can have in metres."""


# A dataclass puts the fields of its last base first.
@dataclass(frozen=True, kw_only=True)
class Rules(PersonRules, SeaRules, TerminationRules, CoverageRules, RewardRules, ActionRules):
    """One set of rules. In the fields, t is the number of steps done before, L the step limit.

    Any field can be overridden by name: `profile("paper", collision=-2000)`.

    Raises:
        FieldError: If a value is not allowed.
    """

    profile: str = field("str", "Name of the profile that these rules are based on.")
    sigma: float = field("float", "Default spread of the Gaussian.", above=0, unit="cells")
    dispersion_inc: float = field(
        "float", "Default growth of the spread per step.", 0.0, low=0, unit="cells"
    )
    grid_size: GridShape = field("grid", "Default columns and rows of the grid.", low=1, high=10000)
    vector: tuple[float, float] = field("vector", "Default drift.", unit="cells per step")
    person_initial_position: tuple[int, int] | None = field(
        "cell", "Default cell of the person; by default the centre of the grid.", None
    )
    timestep_limit: int = field("int", "Default limit L.", 100, low=1, high=10**9, unit="steps")
    sensor: str = field("str", "Default sensor of the drones.", "own_cell", choices=SENSORS.keys())

    def __post_init__(self) -> None:
        check_all(self, Rules)
        for name in self.actions:
            if name not in ACTION_VECTORS:
                check_known("the actions", [name], ACTION_VECTORS)
        if self.in_metres:
            self._check_metres()
        elif SEARCH not in self.actions or len(set(self.actions)) != len(self.actions):
            raise FieldError(
                f"actions must be different names that include search, got "
                f"{shown(list(self.actions))}"
            )

        if len(self.person_steps) != 9 or abs(sum(self.person_steps) - 1.0) > 1e-9:
            raise FieldError(
                f"person_steps must be 9 probabilities that sum to 1, got "
                f"{shown(list(self.person_steps))}"
            )

    def _check_metres(self) -> None:
        """Raise unless the rules fit drones that fly in metres."""
        for name, allowed in _IN_METRES.items():
            if getattr(self, name) not in allowed:
                shown_values = " or ".join(shown(value) for value in allowed)
                raise FieldError(
                    f"{name} must be {shown_values} with space metres, got "
                    f"{shown(getattr(self, name))}"
                )
        if not isinstance(TARGET_MODELS[self.person_motion], Ensemble):
            raise FieldError(
                f"person_motion must be one of {', '.join(ENSEMBLES)} with space metres, got "
                f"{shown(self.person_motion)}"
            )

    @property
    def in_metres(self) -> bool:
        """Whether drones fly in metres."""
        return self.space == "metres"

    @property
    def covers(self) -> bool:
        """Whether the task is to cover cells."""
        return self.task == "cover"

    @property
    def margin(self) -> int:
        """Cells by which a drone can be off the grid: one that flies on outside ends there."""
        return int(self.leave_policy == "fly_on")

    @cached_property
    def action_set(self) -> ActionSet:
        """The actions with their moves."""
        return ActionSet(self.actions)

    def last_step(self, timestep_limit: int) -> int:
        """Return the last step in time, counted from 1; a mission that goes on ends in the next."""
        return timestep_limit + self.time_out_grace

    def last_acting_step(self, timestep_limit: int) -> int:
        """Return the last step in which drones act, counted from 1."""
        return self.last_step(timestep_limit) + self.time_out_acts

    def override(self, **values: Any) -> Rules:
        """Return the rules with these fields replaced.

        Raises:
            FieldError: If a field is unknown or a value is not allowed.
        """
        check_known("the rules", values, specs(Rules))
        return dataclasses.replace(self, **values)


_PAPER = Rules(
    profile="paper",
    actions=_PLUS,
    move=1,
    leave_grid=-100000,
    leave_policy="terminate",
    collisions=True,
    collision=-100000,
    search_min_probability=0.01,
    search_below=-100,
    search_scale=10000,
    find=10000,
    find_bonus=10000,
    time_out=-100000,
    drift_axes_independent=True,
    circle=True,
    sigma=10,
    grid_size=GridShape(8, 8),
    vector=(-0.5, -0.5),
)

_V1 = _PAPER.override(
    profile="v1",
    noop_actions=True,
    leave_policy="fly_on",
    search_min_inclusive=False,
    find=100000,
    find_bonus=100000,
    found_persons_stay=True,
    time_out_grace=1,
    time_out_acts=True,
    time_out_total=True,
    both_flags=True,
    ends_together=True,
    drift_remainder="dropped",
    drift_axes_independent=False,
    reset_sea_steps=1,
    circle_on_previous_datum=True,
    person_walks_blind=True,
    grid_size=GridShape(7, 7),
    person_initial_position=(0, 0),
)

_V2 = Rules(
    profile="v2",
    actions=_STAR,
    move=0,
    leave_grid=0,
    leave_policy="stay",
    collisions=False,
    search_below=0,
    search_scale=0,
    find=1,
    find_bonus=1,
    one_find_per_search=True,
    time_out=0,
    both_flags=True,
    drift_remainder="less_one",
    drift_axes_independent=False,
    drift_by_speed=True,
    reset_sea_steps=1,
    circle=False,
    sigma=0.5,
    dispersion_inc=0.1,
    person_motion="drift",
    person_first=True,
    person_scatter=2,
    grid_size=GridShape(20, 20),
    vector=(1.1, 1),
    person_initial_position=(0, 0),
)

_COVERAGE = _V2.override(
    profile="coverage",
    task="cover",
    move=-0.2,
    leave_grid=-0.2,
    cover=1,
    cover_scale=1,
    cover_all=1,
    cover_all_bonus=1,
    time_out_grace=-1,
    both_flags=False,
    # Ten minutes in steps of 13 s, after which the drones arrive in DSSE 1.1.9.
    reset_sea_steps=46,
    # Without a matrix, persons drift as in the paper, with a growing spread.
    drift_remainder="kept",
    drift_axes_independent=True,
    drift_by_speed=False,
    person_motion="window",
    person_first=False,
    person_scatter=0,
    vector=(0.05, 0.05),
    person_initial_position=None,
)

_SEA = _PAPER.override(
    profile="sea",
    actions=_STAR,
    timed_actions=True,
    sensor="flown_over",
    circle=False,
    person_motion="leeway",
)

_FLIGHT = _SEA.override(
    profile="flight",
    space="metres",
    actions=(),
    timed_actions=False,
    collisions=False,
    leave_policy="stay",
    leave_grid=0,
)

GROUPS: dict[str, type] = {
    "Actions": ActionRules,
    "Rewards": RewardRules,
    "Coverage": CoverageRules,
    "Termination": TerminationRules,
    "Sea": SeaRules,
    "Persons": PersonRules,
}
"""The fields of the rules by topic, without the defaults of the scenario."""

PROFILES: dict[str, Rules] = {
    rules.profile: rules for rules in (_PAPER, _V1, _V2, _COVERAGE, _SEA, _FLIGHT)
}
"""The profiles by name."""

AUTO = "auto"
"""In place of a profile: the usual one of a scenario, see `IncidentFields.rules_of`."""


def profile(name: str, **overrides: Any) -> Rules:
    """Return a profile, with single fields overridden.

    Args:
        name: A key of `PROFILES`.
        overrides: Fields of `Rules`.

    Raises:
        FieldError: If the profile or a field is unknown or a value is not allowed.
    """
    if not isinstance(name, str) or name not in PROFILES:
        known = ", ".join(PROFILES)
        raise FieldError(f"rules must be one of {known}, got {shown(name)}")
    return PROFILES[name].override(**overrides)
