# SPDX-License-Identifier: Apache-2.0
"""The rules of the search as data: one frozen value per profile, read by one compiled step.

Sources: the DSSE paper (arXiv 2307.06240), its table of rewards and its sections on the
probability matrix and the person's movement, and the behaviour of the packages DSSE 0.1.13
(profile v1) and DSSE 1.1.9 (profile v2).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from dsse_ros.search.fields import FieldError, check_all, check_known, field, specs

ACTION_VECTORS: dict[str, tuple[int, int]] = {
    "left": (-1, 0),
    "right": (1, 0),
    "up": (0, -1),
    "down": (0, 1),
    "up_left": (-1, -1),
    "up_right": (1, -1),
    "down_left": (-1, 1),
    "down_right": (1, 1),
    "search": (0, 0),
}
"""Step of each action in cells (dx to the east, dy to the south)."""

_PLUS = ("left", "right", "up", "down", "search")
_STAR = ("left", "right", "up", "down", "up_left", "up_right", "down_left", "down_right", "search")


@dataclass(frozen=True, kw_only=True)
class Rules:
    """One set of rules; t is the number of steps done before the present one, L the limit.

    Any field can be overridden by name: `profile("paper", collision=-2000)`.

    Raises:
        FieldError: If a value is not allowed.
    """

    profile: str = field("str", "Name of the profile these rules started from.")
    actions: tuple[str, ...] = field("names", "Legend: the action with number i is actions[i].")

    move: float = field("float", "Reward of any action that no other rule rewards.")
    leave_grid: float = field("float", "Reward of a move that would leave the grid.")
    leave_policy: str = field(
        "str",
        "A drone that would leave the grid keeps its cell, and is terminated or goes on.",
        choices=("terminate", "stay"),
    )
    collisions: bool = field("bool", "Whether drones in one cell after all moved collide.")
    collision: float = field("float", "Reward of each drone that collided.", 0.0)
    search_min_probability: float = field(
        "float", "Searching a cell below this probability is penalised.", 0.01, low=0, high=1
    )
    search_min_inclusive: bool = field(
        "bool", "Whether a cell of exactly the minimum probability counts as above it.", True
    )
    search_below: float = field("float", "Reward of searching a cell below the minimum.")
    search_scale: float = field("float", "Reward of any other search: probability times this.")
    find: float = field("float", "Reward of finding a person.")
    find_bonus: float = field("float", "Added to `find`, times (1 - t / L).")
    one_find_per_search: bool = field(
        "bool", "Whether one search finds one person at most, or all in the cell.", False
    )
    time_out: float = field("float", "Reward of an action after the time limit.")
    time_out_grace: int = field(
        "int", "Out of time is t >= L + this many steps.", 0, low=0, high=1000, unit="steps"
    )

    drift_keeps_remainder: bool = field(
        "bool", "Whether the fraction of a cell left after the datum moved is kept."
    )
    drift_axes_independent: bool = field(
        "bool", "Whether an axis of the datum that would leave the grid stays alone, or both do."
    )
    drift_relation: float = field(
        "float", "Drift per step is v times norm(v) times this; 0 means v itself.", 0.0, low=0
    )
    reset_map_steps: int = field("int", "Map steps that reset does.", 0, low=0, high=1)
    reset_person_steps: int = field("int", "Person steps that reset does.", 0, low=0, high=1)
    circle: bool = field("bool", "Whether only cells inside the growing circle are possible.")
    circle_on_previous_datum: bool = field(
        "bool", "Whether the circle is centred on the datum of the step before.", False
    )
    sigma: float = field("float", "Default spread of the Gaussian.", above=0, unit="cells")
    dispersion_inc: float = field(
        "float", "Default growth of the spread per step.", 0.0, low=0, unit="cells"
    )
    person_first: bool = field("bool", "Whether persons step before the map does.", False)
    person_walks_blind: bool = field(
        "bool", "Whether a person with an all-zero window walks (-1, -1), or stays.", False
    )
    person_scatter: int = field(
        "int",
        "Persons start in different cells within this distance of the given one; 0: all in it.",
        0,
        low=0,
        high=2,
        unit="cells",
    )

    grid_size: int = field("int", "Default number of cells along a side.", low=1, high=10000)
    vector: tuple[float, float] = field("vector", "Default drift.", unit="cells per step")
    person_initial_position: tuple[int, int] | None = field(
        "cell", "Default cell of the person; the centre of the grid if not given.", None
    )
    timestep_limit: int = field("int", "Default limit L.", 100, low=1, high=10**9, unit="steps")

    def __post_init__(self) -> None:
        check_all(self)
        for name in self.actions:
            if name not in ACTION_VECTORS:
                check_known("the actions", [name], ACTION_VECTORS)
        if "search" not in self.actions or len(set(self.actions)) != len(self.actions):
            raise FieldError(
                f"actions: {list(self.actions)!r} is not allowed; different names, search included"
            )

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
    drift_keeps_remainder=True,
    drift_axes_independent=True,
    circle=True,
    sigma=10,
    grid_size=8,
    vector=(-0.5, -0.5),
)

PROFILES: dict[str, Rules] = {"paper": _PAPER}
"""The profiles by name."""


def profile(name: str, **overrides: Any) -> Rules:
    """Return a profile, with single fields overridden.

    Args:
        name: A key of `PROFILES`.
        overrides: Fields of `Rules`.

    Raises:
        FieldError: If the profile or a field is unknown or a value is not allowed.
    """
    if name not in PROFILES:
        known = ", ".join(PROFILES)
        raise FieldError(f"rules: {name!r} is not allowed; one of {known}")
    return PROFILES[name].override(**overrides)
