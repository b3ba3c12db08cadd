# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cells from which drones look, compiled: a vehicle may be in another cell than its drone."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, part
from dsse_ros.base.compiled.records import Int, Int8, dtype_of
from dsse_ros.search.step.entities import Drone, Records


class VehicleViewpoint:
    """From where the vehicle of a drone has looked in a step."""

    x: int  # cell of the vehicle
    y: int
    action: Int8  # it has done the looks of this action; `NO_LOOK` for none
    preset: bool  # known before the step; else the drone looks in its own cell


VIEWPOINTS = dtype_of(VehicleViewpoint)
NO_LOOK = -1


def viewpoints_at(
    actions: NDArray[Any], cols: NDArray[Any], rows: NDArray[Any]
) -> NDArray[np.void]:
    """Return an array of `VIEWPOINTS` from arrays of actions, columns and rows."""
    viewpoints = np.zeros(np.shape(actions), VIEWPOINTS)
    viewpoints["action"], viewpoints["x"], viewpoints["y"] = actions, cols, rows
    return viewpoints


class Viewpoint(NamedTuple):
    """A cell, and the action that looks from there."""

    x: Int
    y: Int
    action: Int


@inlined
def set_viewpoint(viewpoint: VehicleViewpoint, x: int, y: int, action: Int) -> None:
    """Write one of `VIEWPOINTS` that is not preset; without a look it has no cell."""
    looks = action >= 0
    viewpoint.x, viewpoint.y = (x, y) if looks else (0, 0)
    viewpoint.action = action if looks else NO_LOOK
    viewpoint.preset = False


@part
def clear_viewpoints(viewpoints: Records | None) -> None:
    """Write that no drone (N,) has looked."""
    if viewpoints is None:
        return
    for n in range(len(viewpoints)):
        set_viewpoint(viewpoints[n], 0, 0, NO_LOOK)


@inlined
def viewpoint_of(
    viewpoints: Records | None, drone: Drone, action: int, b: int, n: int
) -> Viewpoint:
    """Return from where drone n of world b has looked in the last step.

    Args:
        viewpoints: (B, N) of `VIEWPOINTS`; None if drones look in their own cells.
        drone: The drone.
        action: Its action.
        b: Number of the world.
        n: Number of the drone.
    """
    if viewpoints is None:
        return Viewpoint(drone.x, drone.y, np.int64(action))
    viewpoint = viewpoints[b, n]
    return Viewpoint(viewpoint.x, viewpoint.y, np.int64(viewpoint.action))


@part
def viewpoints_of(viewpoints: Records | None, b: int) -> Records | None:
    """Return the viewpoints of world b; None if drones look in their own cells."""
    if viewpoints is None:
        return None
    return viewpoints[b]
