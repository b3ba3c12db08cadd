# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compare the POS of beliefs with what thousands of missions find.

The plan of a combination is open-loop: all its missions do the same searches, whatever they find.
Only then is the mean POS the share of persons that they find, see docs/belief.md. There are two
comparisons, each after every search:

* The share of persons found with the mean POS, until the first mission ends. A mission that has
  ended does not search any more. With one person this comparison goes on to the time limit: a
  mission that has ended would have the POS of those that go on.
* The finds of all missions with the sum of the hazards, to the time limit. The hazard of a search
  is the number of persons that the belief expects it to find, given how the searches before it
  ended. If the belief is exact, the difference is a martingale, whenever missions end.

Differences are in standard errors (z-scores). An exact belief exceeds 3 in 0.27 % of single
comparisons. Those of one combination are strongly correlated, as they count almost the same finds.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES, WorldBeliefs
from dsse_ros.search.step.looks import searches_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_and_rules
from soak.row import Figures, Goal, Row, Run

SEED = 50_000_000
"""Seed of the first mission of the first combination; each mission has its own seed."""
SIGMAS = 3.0
BATCH = 200
"""Missions in memory at a time; with four persons of different PODs they take 0.3 GB."""
SMALLEST_VARIANCE = 10.0
"""Least variance of a number of finds: below, the number is far from normally distributed."""
SHOWN = (1, 5, 20, 50)
"""Steps whose POS and share are reported, besides the last one."""

NEVER_FOUND = (0.9, 0.5, 0.3, 0.0)
"""No search detects the last person: no mission ends, and all 100 steps can be compared."""
MULTIPLIERS: tuple[tuple[float, ...], ...] = (
    (1.0,),
    (0.3,),
    (1.0, 1.0),
    (0.5, 0.5),
    (0.9, 0.2),
    (1.0, 1.0, 1.0, 1.0),
    (0.5, 0.5, 0.5, 0.5),
    (0.2, 0.9, 0.5, 0.5),
    NEVER_FOUND,
)
"""One per person. The POD of `v2` is 1 by default, so they equal the PODs."""


@dataclass(frozen=True)
class Combination:
    """A search of `v2` with other persons than by default.

    Attributes:
        multipliers: POD multiplier of each person.
        one_find: Whether a search finds one person only.
    """

    multipliers: tuple[float, ...]
    one_find: bool

    def __str__(self) -> str:
        pods = " ".join(f"{multiplier:g}" for multiplier in self.multipliers)
        return f"{pods}, {'one find' if self.one_find else 'all finds'}"

    def definition(self) -> tuple[ResolvedScenario, Rules]:
        """Return the scenario and the rules."""
        scenario, rules = scenario_and_rules(
            rules="v2",
            person_amount=len(self.multipliers),
            person_pod_multipliers=self.multipliers,
            one_find_per_search=self.one_find,
        )
        return scenario.resolve(rules), rules


COMBINATIONS = [Combination(pods, one_find) for pods in MULTIPLIERS for one_find in (True, False)]
QUICK = [Combination(pods, True) for pods in ((0.3,), (0.9, 0.2))]


@dataclass
class Played:
    """The results of M missions with n persons in T steps.

    Attributes:
        persons: n.
        searched: (T,) bool, whether the step of the plan is a search.
        missions: M.
        going: (T, M) bool, missions that had not ended before the step.
        found: (T, M) persons found after the step.
        pos: (T, M) POS after the step.
        spread: (T, M) variance of the number of persons found, by the belief.
        hazard: (T, M) finds that the belief expected in the step.
        variance: (T, M) variance of these finds, by the belief.
    """

    persons: int
    searched: NDArray[np.bool_]
    missions: int
    going: NDArray[np.bool_] = field(init=False)
    found: NDArray[np.float64] = field(init=False)
    pos: NDArray[np.float64] = field(init=False)
    spread: NDArray[np.float64] = field(init=False)
    hazard: NDArray[np.float64] = field(init=False)
    variance: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        shape = len(self.searched), self.missions
        self.going = np.zeros(shape, bool)
        self.found, self.pos, self.spread, self.hazard, self.variance = np.zeros((5, *shape))


@dataclass(frozen=True)
class Comparison:
    """Numbers of finds after some steps, and the expected numbers.

    Attributes:
        steps: (K,) int64, from 1.
        counted: (K,) persons found in all missions.
        expected: (K,) expected number of these, by the beliefs.
        z: (K,) their difference in standard errors.
    """

    steps: NDArray[np.int64]
    counted: NDArray[np.float64]
    expected: NDArray[np.float64]
    z: NDArray[np.float64]

    @property
    def largest(self) -> float:
        """The z-score that is farthest from 0."""
        return float(self.z[np.abs(self.z).argmax()])


def pos(run: Run) -> Figures:
    """Compare the beliefs of all combinations with what their missions find."""
    combinations, missions = run.size((COMBINATIONS, 2000), (QUICK, 200))
    numbered = list(enumerate(combinations))
    of_each = {
        str(combination): figures_of(play(combination, missions, SEED + number * missions))
        for number, combination in run.each(numbered, "combinations")
    }
    return {"missions": missions, **summary(of_each), "combinations": of_each}


def play(combination: Combination, missions: int, seed: int) -> Played:
    """Play missions to their ends, each with its belief.

    Args:
        combination: Persons and rules.
        missions: Number of missions.
        seed: Mission m has seed + m.
    """
    scenario, rules = combination.definition()
    actions = plan(scenario, rules)
    played = Played(scenario.person_amount, actions == rules.action_set.search, missions)
    for first in range(0, missions, BATCH):
        batch = slice(first, min(first + BATCH, missions))
        world = World(scenario, rules, batch.stop - first, write_maps=False)
        world.seed(seed + first)
        world.reset()
        follow(world, actions, played, batch)
        world.close()
    return played


def plan(scenario: ResolvedScenario, rules: Rules) -> NDArray[np.int8]:
    """Return the actions of the only drone, as if all searches failed.

    The drone flies to the most probable cell of the belief and searches it.
    """
    belief = Belief(Forecast(scenario, rules, drift_samples=DRIFT_SAMPLES))
    (cell,) = scenario.drones_positions
    actions = []
    for _ in range(scenario.timestep_limit):
        row, col = divmod(int(belief.poc().argmax()), scenario.grid_size.columns)
        end = rules.action_set.towards(cell, (col, row))
        actions.append(rules.action_set.action(cell, end))
        if end == cell:
            belief.update(searches_of(scenario, rules, [cell]))
        cell = end
        belief.advance()
    return np.array(actions, np.int8)


def follow(world: World, actions: NDArray[np.int8], played: Played, batch: slice) -> None:
    """Do the steps of a plan in a batch of the missions, and record their results."""
    # The hazard is that of one search. Several searches in a step would depend on each other.
    assert world.num_drones == 1
    beliefs = WorldBeliefs(world)
    found = np.zeros(world.persons.shape, bool)
    for t, action in enumerate(actions):
        going = ~world.worlds["done"]
        unfound, missing = unfound_of(beliefs), beliefs.missing.copy()
        beliefs.step(np.full(world.drones.shape, action, np.int8))
        found |= world.persons["found"]
        after = unfound_of(beliefs)
        # A person who has certainly been found adds nothing.
        left = np.divide(after, unfound, out=np.ones_like(after), where=unfound > 0.0)
        finds = missing * (1.0 - left) * going[:, None]
        hazard = finds.sum(axis=1)
        of_persons = (finds * (1.0 - finds)).sum(axis=1)
        one_find = world.rules.one_find_per_search
        played.going[t, batch] = going
        played.hazard[t, batch] = hazard
        played.variance[t, batch] = hazard * (1.0 - hazard) if one_find else of_persons
        played.found[t, batch] = found.sum(axis=1)
        played.pos[t, batch] = beliefs.pos
        played.spread[t, batch] = (after * (1.0 - after)).sum(axis=1)
        if world.worlds["done"].all():
            for of_step in (played.found, played.pos, played.spread):
                of_step[t + 1 :, batch] = of_step[t, batch]
            break


def unfound_of(beliefs: WorldBeliefs) -> NDArray[np.float64]:
    """Return the probability that the searches so far have not found each person, (B, n)."""
    if beliefs.unfound.shape[1] == 1:
        return 1.0 - beliefs.pos[:, None]
    return beliefs.unfound.copy()


def of_shares(played: Played) -> Comparison:
    """Compare the share of persons found with the mean POS, see the module.

    The standard error is the larger of those of the missions and of an exact belief.
    That of the missions alone is too small if almost all of them have the same result.
    """
    missions, going = played.missions, played.going
    if played.persons == 1:
        until = int(going.any(axis=1).sum())
        # Missions without a find have done all searches.
        of_plan = played.pos.max(axis=1)
        expected, spread = missions * of_plan, missions * of_plan * (1.0 - of_plan)
    else:
        until = int(going.all(axis=1).sum())
        expected = played.persons * played.pos.sum(axis=1)
        spread = played.spread.sum(axis=1)
    spread = np.maximum(spread, missions * played.found.var(axis=1))
    return compared(played, played.found.sum(axis=1), expected, spread, until)


def of_hazards(played: Played) -> Comparison:
    """Compare the finds with the summed hazards, see the module."""
    hazards, variance = (
        of_step.sum(axis=1).cumsum() for of_step in (played.hazard, played.variance)
    )
    until = int(played.going.any(axis=1).sum())
    return compared(played, played.found.sum(axis=1), hazards, variance, until)


def compared(
    played: Played,
    counted: NDArray[np.float64],
    expected: NDArray[np.float64],
    variance: NDArray[np.float64],
    until: int,
) -> Comparison:
    """Compare numbers of finds after each search of the first `until` steps."""
    chosen = np.flatnonzero(played.searched[:until])
    error = np.sqrt(np.maximum(variance, SMALLEST_VARIANCE))
    z = (counted - expected) / error
    return Comparison(chosen + 1, counted[chosen], expected[chosen], z[chosen])


def figures_of(played: Played) -> Figures:
    """Return the z-scores of a combination, and its shares at some steps."""
    shares, hazards = of_shares(played), of_hazards(played)
    persons = played.missions * played.persons
    last = int(shares.steps[-1])
    shown = [int(np.searchsorted(shares.steps, step, "right")) - 1 for step in (*SHOWN, last)]
    return {
        "searches_compared": len(shares.steps),
        "last_step_compared": last,
        "share_z": shares.largest,
        "shares_beyond": beyond(shares),
        "step_pos_share_z": [
            [int(shares.steps[k]), shares.expected[k] / persons, shares.counted[k] / persons,
             float(shares.z[k])]
            for k in sorted(set(shown))
        ],
        "searches": len(hazards.steps),
        "finds": int(hazards.counted[-1]),
        "hazards": float(hazards.expected[-1]),
        "hazard_z": hazards.largest,
        "hazard_z_at_end": float(hazards.z[-1]),
        "hazards_beyond": beyond(hazards),
    }  # fmt: skip


def beyond(comparison: Comparison) -> int:
    """Return how many z-scores are beyond three standard errors."""
    return int((np.abs(comparison.z) > SIGMAS).sum())


def summary(of_each: dict[str, Figures]) -> Figures:
    """Return the figures of all combinations together."""

    def largest(name: str) -> float:
        # A NaN remains NaN and meets no goal.
        return float(np.max([abs(figures[name]) for figures in of_each.values()]))

    def total(names: Iterable[str]) -> int:
        return sum(figures[name] for figures in of_each.values() for name in names)

    return {
        "number": len(of_each),
        "comparisons": total(("searches_compared", "searches")),
        "beyond": total(("shares_beyond", "hazards_beyond")),
        "share_z": largest("share_z"),
        "hazard_z": largest("hazard_z"),
    }


ROWS = (
    Row(
        "pos",
        "2000 missions of v2 with 1, 2 and 4 persons, one find per search and all, equal and "
        "unequal PODs: the mean POS is within three standard errors of the share found, after "
        "each search until the first mission ends, and so are the finds of the hazards to the end",
        pos,
        "{number} combinations of {missions} missions: POS within {share_z:.2f} standard errors "
        "of the share, finds within {hazard_z:.2f} of the hazards; {beyond} of {comparisons} "
        "comparisons beyond 3",
        (Goal("share_z", most=SIGMAS), Goal("hazard_z", most=SIGMAS)),
    ),
)
