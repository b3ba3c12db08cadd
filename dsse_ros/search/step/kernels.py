# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled steps of B worlds at once; `recipe` has the step of one world.

`world_state` has their arguments.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import expanded, inlined, kernel, part
from dsse_ros.base.compiled.streaming import ALIGNMENT, LANES
from dsse_ros.search.step.coverage_kernels import CoverageTask, coverage_of, write_left
from dsse_ros.search.step.ensemble_kernels import SeaEnsemble, ensemble_of, write_present
from dsse_ros.search.step.entities import Actions, Area, Entities, Map, Maps, Records
from dsse_ros.search.step.masks import mask_moves
from dsse_ros.search.step.metres_kernels import metres_of
from dsse_ros.search.step.recipe import start_world, step_world
from dsse_ros.search.step.viewpoints import viewpoints_of
from dsse_ros.search.step.world_state import (
    Batch,
    Extensions,
    Report,
    Scratch,
    WorldState,
)
from dsse_ros.world.targets.sea_map import Sea, disperse, write_map

STREAMED_BYTES = 1 << 25
"""Larger maps are written past the caches, because they would not fit."""


@part
def is_streamed(maps: Maps | None) -> bool:
    """Return whether maps (B, R, C) are large and aligned enough to be written past the caches."""
    if maps is None:
        return False
    large = maps.size * maps.itemsize > STREAMED_BYTES
    return large and maps.shape[2] % LANES == 0 and maps.ctypes.data % ALIGNMENT == 0


@inlined
def sea_of(sea: Sea, b: int) -> Sea:
    """Return the sea of world b."""
    table = min(b, len(sea.gauss) - 1)
    return Sea(
        gauss=sea.gauss[table], tails=sea.tails[table], area=sea.area, runs=sea.runs, data=sea.data
    )


@inlined
def entities_of(entities: Entities, b: int) -> Entities:
    """Return the drones and persons of world b."""
    return Entities(
        start_cells=entities.start_cells[b],
        drones=entities.drones[b],
        finds=entities.finds[b],
        persons=entities.persons[b],
        kinds=entities.kinds,
        look_starts=entities.look_starts,
        look_offsets=entities.look_offsets,
        look_pods=entities.look_pods,
    )


@inlined
def extensions_of(extensions: Extensions, b: int) -> Extensions:
    """Return the extensions of world b."""
    return Extensions(
        coverage=coverage_of(extensions.coverage, b),
        ensemble=ensemble_of(extensions.ensemble, b),
        metres=metres_of(extensions.metres, b),
        viewpoints=viewpoints_of(extensions.viewpoints, b),
    )


@expanded
def state_of(batch: Batch, b: int) -> WorldState:
    """Return world b."""
    return WorldState(
        constants=batch.constants[0],
        world=batch.worlds[b],
        sea=sea_of(batch.sea, b),
        entities=entities_of(batch.entities, b),
        extensions=extensions_of(batch.extensions, b),
    )


@part
def map_of(maps: Maps | None, b: int) -> Map | None:
    """Return the map of world b; None without maps, and (0, 0) if none are written."""
    if maps is None:
        return None
    return maps[b]


@inlined
def write_observed(
    state: WorldState,
    scratch: Scratch,
    stream: bool,
    out: Map | None,
    coverage: CoverageTask | None,
    ensemble: SeaEnsemble | None,
) -> None:
    """Write the observed map of a world, or its probability left to cover, to `out` of `map_of`."""
    if out is None:
        return
    if len(out) == 0:
        return
    if ensemble is not None:
        write_present(state.world, ensemble, out)
    elif coverage is None:
        write_map(state.constants, state.world, state.sea, scratch, stream, out)
    else:
        write_left(coverage, out)


@kernel
def step_worlds(
    batch: Batch, scratch: Scratch, actions: Actions, maps: Maps | None, first: int, last: int
) -> None:
    """Advance the worlds first..last - 1 by one step and write their maps.

    Args:
        batch: The worlds.
        scratch: Of the thread.
        actions: (B, N) int8; a number that is not an action does nothing.
        maps: (B, R, C) float32 out as [y, x], C-contiguous; (B, 0, 0) or None to write none.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    stream = is_streamed(maps)
    for b in range(first, last):
        state = state_of(batch, b)
        extensions = state.extensions
        if state.constants.auto_reset and state.world.done:
            start_world(state, scratch)
        else:
            step_world(
                state,
                scratch,
                actions[b],
                extensions.coverage,
                extensions.metres,
                extensions.viewpoints,
            )
        write_observed(
            state, scratch, stream, map_of(maps, b), extensions.coverage, extensions.ensemble
        )


@kernel
def reset_worlds(
    batch: Batch,
    scratch: Scratch,
    maps: Maps | None,
    which: NDArray[np.bool_],
    first: int,
    last: int,
) -> None:
    """Reset those of the worlds first..last - 1 with which[b], (B,) bool; see `step_worlds`."""
    stream = is_streamed(maps)
    for b in range(first, last):
        if which[b]:
            state = state_of(batch, b)
            start_world(state, scratch)
            write_observed(
                state,
                scratch,
                stream,
                map_of(maps, b),
                state.extensions.coverage,
                state.extensions.ensemble,
            )


@kernel
def refresh_worlds(batch: Batch, scratch: Scratch, maps: Maps) -> None:
    """Write the tables and the maps that the state requires, see `step_worlds`."""
    constants, worlds = batch.constants[0], batch.worlds
    stream = is_streamed(maps)
    for b in range(len(batch.sea.gauss)):
        disperse(constants, worlds[b], sea_of(batch.sea, b))
    for b in range(len(worlds)):
        state = state_of(batch, b)
        write_observed(
            state, scratch, stream, maps[b], state.extensions.coverage, state.extensions.ensemble
        )


@kernel
def report_worlds(
    constants: Records, area: Area, drones: Records, report: Report, first: int, last: int
) -> None:
    """Write the report of the drones of the worlds first..last - 1.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        area: Of `Sea`.
        drones: (B, N) of `DRONES`.
        report: Out.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    for b in range(first, last):
        of_world, cells, masks = drones[b], report.positions[b], report.action_masks[b]
        rewards, terminated = report.rewards[b], report.terminated[b]
        truncated = report.truncated[b]
        masks[:] = 1
        for n in range(len(of_world)):
            drone = of_world[n]
            x, y = drone.x, drone.y
            cells[n, 0], cells[n, 1] = x, y
            rewards[n] = drone.reward
            terminated[n], truncated[n] = drone.terminated, drone.truncated
            mask_moves(constants[0], area, x, y, masks[n])
