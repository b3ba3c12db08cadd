# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled step of many beliefs: update with the searches of each world, then motion.

Arrays are those of `belief_kernels` and `search_outcomes`, with a first axis of B worlds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief_kernels import (
    NOTHING_LEFT,
    detectable,
    index_of,
    normalise,
    predict,
    search,
)
from dsse_ros.belief.look_kernels import list_looks
from dsse_ros.belief.search_outcomes import (
    close_classes,
    learn_outcome,
    mean_found,
    open_classes,
    weigh_classes,
)
from dsse_ros.compiled.jit import kernel
from dsse_ros.targets.sea_map import Sea


@kernel
def learn(
    constants, belief, apart, chances, class_of, missing, unfound, pos, numbers, hazard,
    seen, rows, pods, failed, count,
):  # fmt: skip
    """Update a belief with the looks of a step; return the new POS.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        belief: (C K, S S) float64, in and out.
        apart: (K,) of `forecast_step`.
        chances: (S S,) of `forecast_step`.
        class_of: (n,) int64, see `search_outcomes`.
        missing: (n,) float64, in and out.
        unfound: (n,) float64, in and out.
        pos: The POS before the step.
        numbers: (`OF_CLASS`, C) float64 scratch.
        hazard: (n,) float64 scratch.
        seen: (Q, 2) int64, columns and rows of the cells looked at.
        rows: (Q,) int64, the row of `pods` of each look.
        pods: (L, C) float64.
        failed: Number of looks that found nobody; they come first.
        count: Number of looks.
    """
    c, several = constants[0], len(missing) > 1
    if several and count > 0:
        open_classes(class_of, numbers)
    for turn in range(2):
        taken = 0.0
        for q in range(failed if turn == 1 else 0, count if turn == 1 else failed):
            x, y, of_look = seen[q, 0], seen[q, 1], pods[rows[q]]
            if several:
                learn_outcome(
                    c, belief, of_look, class_of, missing, unfound, apart, numbers, hazard, x, y,
                    turn == 1,
                )  # fmt: skip
            elif turn == 1 and c.one_find_per_search:
                pos += (1.0 - pos) * detectable(c, belief, of_look, x, y)
            else:
                taken += search(constants, belief, of_look, x, y)
        if taken > 0.0:
            pos += (1.0 - pos) * min(taken, 1.0)
            if normalise(belief) < NOTHING_LEFT:
                for k in range(len(belief)):
                    for i in range(belief.shape[1]):
                        belief[k, i] = chances[i]
                normalise(belief)
    if several and count > 0:
        close_classes(belief, class_of, missing, numbers, chances)
        pos = mean_found(unfound)
    return pos


class Followed(NamedTuple):
    """Worlds after a step, and the actions of the step.

    Attributes:
        constants: (1,) of `constants.CONSTANTS`.
        area: Of `sea_map.Sea`.
        worlds: (B,) of `kernels.WORLDS`, after the step.
        drones: (B, N) of `kernels.DRONES`, after the step.
        finds: (B, N) of `kernels.Crew`, after the step.
        kinds: (N,) of `kernels.Crew`.
        looks: (K, A + 1) of `kernels.Crew`.
        offsets: (L, 2) of `kernels.Crew`.
        actions: (B, N) int8 of the step.
        live: (B, N) bool, the drones in the search before the step.
        done: (B,) bool, the worlds whose search had ended before the step.
    """

    constants: NDArray[np.void]
    area: NDArray[np.bool_] | None
    worlds: NDArray[np.void]
    drones: NDArray[np.void]
    finds: NDArray[np.uint64]
    kinds: NDArray[np.int64]
    looks: NDArray[np.int64]
    offsets: NDArray[np.int64]
    actions: NDArray[np.int8]
    live: NDArray[np.bool_]
    done: NDArray[np.bool_]


class Tables(NamedTuple):
    """Tables computed once for all missions of a scenario.

    Attributes:
        start: (C K, S S) float64, the belief at a mission's first observation.
        pods: (L, C) float64, POD of each look by detection class.
        class_of: (n,) int64, see `search_outcomes`.
        sea: Of a `Forecast`.
        chances: (R, S S) of `forecast_step`; step s of the sea is at s % R.
        tables: (R, `CHANCES`, S S) of `complete`.
        directions: (R, K) of `forecast_step`.
        apart: (R, K) of `forecast_step`.
        first_step: Steps of the sea before a mission's first observation.
    """

    start: NDArray[np.float64]
    pods: NDArray[np.float64]
    class_of: NDArray[np.int64]
    sea: Sea
    chances: NDArray[np.float64]
    tables: NDArray[np.float64]
    directions: NDArray[np.int64]
    apart: NDArray[np.bool_]
    first_step: int


class Beliefs(NamedTuple):
    """The beliefs of B worlds.

    Attributes:
        beliefs: (B, C K, S S) float64.
        missing: (B, n) float64, see `search_outcomes`.
        unfound: (B, n) float64, see `search_outcomes`.
        pos: (B,) float64, the POS of all searches of the mission.
    """

    beliefs: NDArray[np.float64]
    missing: NDArray[np.float64]
    unfound: NDArray[np.float64]
    pos: NDArray[np.float64]


class Scratch(NamedTuple):
    """Memory of a thread.

    Attributes:
        scratch: Of `predict`.
        numbers: (`OF_CLASS`, C) float64.
        hazard: (n,) float64.
        seen: (Q, 2) int64, of `list_looks`, with room for all looks of a step.
        rows: (Q,) int64, of `list_looks`, of the same length.
    """

    scratch: NDArray[np.float64]
    numbers: NDArray[np.float64]
    hazard: NDArray[np.float64]
    seen: NDArray[np.int64]
    rows: NDArray[np.int64]


# Called like `kernels.step_worlds`, with the fields of the tuples as separate arguments.
@kernel
def follow_worlds(
    constants, area, worlds, drones, finds, kinds, looks, offsets, actions, live, done,
    start, pods, class_of, sea, chances, tables, directions, apart, first_step,
    beliefs, missing, unfound, pos,
    scratch, numbers, hazard, seen, rows,
    first, last,
):  # fmt: skip
    """Update the beliefs of the worlds first..last - 1 after a step.

    The arguments begin with the fields of `Followed`, `Tables`, `Beliefs` and `Scratch`.
    """
    c = constants[0]
    for b in range(first, last):
        if c.auto_reset and done[b]:
            for k in range(len(start)):
                for i in range(start.shape[1]):
                    beliefs[b, k, i] = start[k, i]
            missing[b, :] = 1.0
            unfound[b, :] = 1.0
            pos[b] = 0.0
            continue
        step = worlds[b].t - 1
        slot = (first_step + step) % len(directions)
        if c.time_out_acts or step < c.timestep_limit + c.time_out_grace:
            failed, count = list_looks(
                c, drones[b], finds[b], kinds, looks, offsets, actions[b], live[b], seen, rows
            )
            pos[b] = learn(
                constants, beliefs[b], apart[slot], chances[slot], class_of, missing[b],
                unfound[b], pos[b], numbers, hazard, seen, rows, pods, failed, count,
            )  # fmt: skip
        predict(
            constants, sea, beliefs[b], chances[slot], tables[slot],
            directions[slot], scratch,
        )  # fmt: skip


@kernel
def write_cells(constants, belief, class_of, missing, weights, out):
    """Write the probability of every cell, out (G, G) float64 as [y, x].

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        belief: (C K, S S) float64.
        class_of: (n,) int64, see `search_outcomes`.
        missing: (n,) float64, see `search_outcomes`.
        weights: (C,) float64 scratch.
        out: The probabilities of the missing persons.
    """
    c, drifts = constants[0], len(belief) // len(weights)
    weigh_classes(class_of, missing, weights)
    for y in range(c.grid_size):
        for x in range(c.grid_size):
            out[y, x] = 0.0
    for k in range(len(belief)):
        for y in range(c.grid_size):
            for x in range(c.grid_size):
                out[y, x] += weights[k // drifts] * belief[k, index_of(c, x, y)]


@kernel
def write_beliefs(constants, beliefs, class_of, missing, weights, scratch, maps, first, last):
    """Write the probability of every cell of the worlds first..last - 1, (B, G, G) as [y, x].

    `scratch` is (G, G) float64.
    """
    for b in range(first, last):
        write_cells(constants, beliefs[b], class_of, missing[b], weights, scratch)
        for y in range(len(scratch)):
            for x in range(len(scratch)):
                # Rounding may put a sum of shares above 1.
                maps[b, y, x] = min(scratch[y, x], 1.0)
