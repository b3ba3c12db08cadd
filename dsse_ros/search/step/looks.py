# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The looks of a swarm as one table: the cells that each action of a drone looks at, with PODs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.world.scenario.actions import ACTION_VECTORS, Cell
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.sensors.registry import SENSORS
from dsse_ros.world.sensors.sensor import MAX_LOOKS, SEARCH, Look


class Looked(NamedTuple):
    """A look that was done, for the update of beliefs.

    Attributes:
        cell: (col, row) of the cell looked at; nobody is found off the grid or outside the area.
        pods: (P,) float64, POD of each person of the scenario if in the cell.
    """

    cell: Cell
    pods: NDArray[np.float64]


class Looks(NamedTuple):
    """The looks of a scenario's drones: L looks for K kinds of drones.

    The looks of action a of drone n are starts[kind[n], a] .. starts[kind[n], a + 1] - 1.

    Attributes:
        kind: (N,) int64, number of each drone's kind.
        starts: (K, A + 1) int64.
        offsets: (L, 2) int64, (dx, dy) from the drone after the action, in cells.
        pods: (L, A P) float64, POD of each person in the cell, for each of the A appearances that
            the object may have, see `ResolvedScenario.seen_as`.
        false_alarms: (K, A) float64, probability of a false alarm if an action's looks find nobody.
    """

    kind: NDArray[np.int64]
    starts: NDArray[np.int64]
    offsets: NDArray[np.int64]
    pods: NDArray[np.float64]
    false_alarms: NDArray[np.float64]

    def numbers(self, drone: int, action: int) -> range:
        """Return the numbers of an action's looks; none for an invalid action number."""
        starts = self.starts[self.kind[drone]]
        return (
            range(*starts[action : action + 2].tolist()) if 0 <= action < len(starts) - 1 else _NO
        )

    def done(self, drone: int, action: int, cell: Cell) -> list[Looked]:
        """Return the looks that an action did.

        Args:
            drone: Number of the drone.
            action: Number of the action.
            cell: Cell of the drone after the action.
        """
        return [
            Looked((cell[0] + int(dx), cell[1] + int(dy)), self.pods[look])
            for look in self.numbers(drone, action)
            for dx, dy in [self.offsets[look]]
        ]

    def at(
        self, actions: NDArray[Any], cells: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return the looks of all drones.

        Args:
            actions: (N,) numbers; a number that is not an action has no looks.
            cells: (N, 2) cells of the drones after the actions.

        Returns:
            (Q,) drones, (Q,) numbers of looks, (Q, 2) cells (col, row), on the grid or off it.
        """
        acts = (actions >= 0) & (actions < self.starts.shape[1] - 1)
        if not acts.any():
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 2), np.int64)
        action = np.where(acts, actions, 0).astype(np.int64)
        begin = self.starts[self.kind, action]
        counts = np.where(acts, self.starts[self.kind, action + 1] - begin, 0)
        drones = np.repeat(np.arange(len(counts)), counts)
        looks = np.arange(len(drones)) + np.repeat(begin - counts.cumsum() + counts, counts)
        return drones, looks, cells[drones] + self.offsets[looks]

    @property
    def several(self) -> bool:
        """Whether an action looks at several cells."""
        return bool((self.counts > 1).any())

    @property
    def counts(self) -> NDArray[np.int64]:
        """(K, A) number of looks of each action."""
        return np.diff(self.starts, axis=1)


_NO = range(0)


NEGLIGIBLE = 1e-6
"""Share of the probability of the most probable cell up to which nobody is expected in a cell."""


def likely_cells(probability: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Return the cells (R, C) in which somebody may be, by a map (R, C)."""
    return np.asarray(probability > NEGLIGIBLE * probability.max())


def waits(
    searching: NDArray[np.bool_],
    drones: NDArray[np.int64],
    cells: NDArray[np.int64],
    likely: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return which drones wait: they search where nobody can be.

    A drone that has nothing to do where it is has no other action than to search.

    Args:
        searching: (N,), which drones search.
        drones: (Q,), the drone of each look at a cell of the grid.
        cells: (Q, 2), the cells (col, row).
        likely: (R, C) [row, col], see `likely_cells`.
    """
    useful = np.bincount(drones[likely[cells[:, 1], cells[:, 0]]], minlength=len(searching))
    return np.asarray(searching & (useful == 0))


def looks_of(scenario: ResolvedScenario, rules: Rules) -> Looks:
    """Return the looks of a scenario's drones.

    Raises:
        FieldError: If a sensor has invalid looks.
    """
    kinds, actions = scenario.kinds, rules.action_set.names
    if len(scenario.seen_as) > 1 and rules.one_find_per_search:
        raise FieldError(
            "one_find_per_search must be false where sensors tell the objects of an incident apart"
        )
    starts = np.zeros((len(kinds), len(actions) + 1), np.int64)
    alarms = np.zeros((len(kinds), len(actions)))
    rows: list[Look] = []
    for k, kind in enumerate(kinds):
        assert kind.sensor is not None
        looks = SENSORS[kind.sensor].looks
        starts[k, 0] = len(rows)
        for a, name in enumerate(actions):
            seen: list[list[Look]] = []
            for seen_as in scenario.seen_as:
                try:
                    of_action = list(looks(seen_as, kind, name, ACTION_VECTORS.get(name, (0, 0))))
                except ValueError as error:
                    raise FieldError(f"sensor: {kind.sensor}: {error}") from None
                _check(kind.sensor, name, of_action, scenario.person_pod_multipliers)
                seen.append(of_action)
            of_action = seen[0] if len(seen) == 1 else _together(seen, scenario.person_amount)
            if len(of_action) > MAX_LOOKS:
                raise FieldError(
                    f"sensor: {kind.sensor} at {name}: looks must be at most {MAX_LOOKS} for all "
                    f"objects together, got {len(of_action)}"
                )
            rows += of_action
            starts[k, a + 1] = len(rows)
            alarms[k, a] = 1.0 - np.prod([1.0 - look.false_alarms for look in of_action])
    return Looks(
        np.array(scenario.kind_of, np.int64),
        starts,
        np.array([(look.dx, look.dy) for look in rows], np.int64).reshape(-1, 2),
        np.array([look.pods for look in rows], float).reshape(
            -1, scenario.person_amount * len(scenario.seen_as)
        ),
        alarms,
    )


def _together(seen: Sequence[Sequence[Look]], person_amount: int) -> list[Look]:
    """Return looks with the PODs of several appearances one after another."""
    nothing = (0.0,) * person_amount
    by_cell = [{(look.dx, look.dy): look for look in looks} for looks in seen]
    cells = dict.fromkeys(cell for looks in by_cell for cell in looks)
    together = []
    for cell in cells:
        looks = [looks.get(cell, Look(*cell, nothing)) for looks in by_cell]
        pods = tuple(pod for look in looks for pod in look.pods)
        together.append(Look(*cell, pods, max(look.false_alarms for look in looks)))
    return together


def moves_look(looks: Looks, rules: Rules) -> bool:
    """Return whether an action other than a search looks at anything."""
    others = np.arange(looks.counts.shape[1]) != rules.action_set.search
    return bool((looks.counts[:, others] > 0).any())


def own_cell_looks(num_drones: int, actions: Sequence[str]) -> Looks:
    """Return the default looks, if only the actions of drones are known: a search sees its cell."""
    starts = np.cumsum([0, *(name == SEARCH for name in actions)])[np.newaxis]
    count = int(starts[0, -1])
    return Looks(
        np.zeros(num_drones, np.int64), starts, np.zeros((count, 2), np.int64), np.ones((count, 1)),
        np.zeros((1, len(actions))),
    )  # fmt: skip


def searches_of(scenario: ResolvedScenario, rules: Rules, cells: Iterable[Cell]) -> list[Looked]:
    """Return the looks of searches in these cells (col, row) by the first drone."""
    looks, search = looks_of(scenario, rules), rules.action_set.search
    return [look for cell in cells for look in looks.done(0, search, cell)]


def _check(sensor: str, action: str, looks: list[Look], multipliers: tuple[float, ...]) -> None:
    """Raise unless the looks of an action are valid.

    Raises:
        FieldError: If there are too many looks, or one is invalid.
    """
    where = f"sensor: {sensor} at {action}"
    if len(looks) > MAX_LOOKS:
        raise FieldError(f"{where}: looks must be at most {MAX_LOOKS}, got {len(looks)}")
    if len({(look.dx, look.dy) for look in looks}) < len(looks):
        raise FieldError(f"{where}: looks must be at different cells, got two at one cell")
    alike = {
        (multiplier, *(look.pods[p] for look in looks))
        for p, multiplier in enumerate(multipliers)
        if all(p < len(look.pods) for look in looks)
    }
    if len(alike) > len(set(multipliers)):
        raise FieldError(f"{where}: persons with the same pod multiplier must have the same POD")
    for look in looks:
        chances = np.array([*look.pods, look.false_alarms], float)
        if len(look.pods) != len(multipliers) or not ((chances >= 0.0) & (chances <= 1.0)).all():
            raise FieldError(
                f"{where}: a look must be dx, dy, the POD of each person ({len(multipliers)}) and "
                f"the rate of false alarms, each from 0 to 1, got {shown(tuple(look))}"
            )
