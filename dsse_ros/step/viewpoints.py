# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""From where drones look whose vehicles may be elsewhere, compiled: one look a step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import inlined, part

VIEWPOINTS = np.dtype(
    [
        ("x", "i8"),  # cell of the vehicle
        ("y", "i8"),
        ("action", "i1"),  # the action whose looks it has done, `NO_LOOK` for none
        ("preset", "?"),  # known before the step; else the drone looks in its own cell
    ],
    align=True,
)
"""From where a drone has looked in a step."""
NO_LOOK = -1


def viewpoints_at(
    actions: NDArray[Any], cols: NDArray[Any], rows: NDArray[Any]
) -> NDArray[np.void]:
    """Return an array of `VIEWPOINTS` from arrays of actions, columns and rows."""
    viewpoints = np.zeros(np.shape(actions), VIEWPOINTS)
    viewpoints["action"], viewpoints["x"], viewpoints["y"] = actions, cols, rows
    return viewpoints


class Viewpoint(NamedTuple):
    """A cell, and the number of the action whose looks are done there."""

    x: np.int64
    y: np.int64
    action: np.int64


@inlined
def set_viewpoint(viewpoint, x, y, action):
    """Write one of `VIEWPOINTS` that is not preset; without a look it has no cell."""
    looks = action >= 0
    viewpoint.x, viewpoint.y = (x, y) if looks else (0, 0)
    viewpoint.action = action if looks else NO_LOOK
    viewpoint.preset = False


@part
def clear_viewpoints(viewpoints):
    """Write that no drone (N,) has looked."""
    if viewpoints is None:
        return
    for n in range(len(viewpoints)):
        set_viewpoint(viewpoints[n], 0, 0, NO_LOOK)


@inlined
def viewpoint_of(viewpoints, drone, action, b, n):
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
def viewpoints_of(viewpoints, b):
    """Return the viewpoints of world b; None if drones look in their own cells."""
    if viewpoints is None:
        return None
    return viewpoints[b]
