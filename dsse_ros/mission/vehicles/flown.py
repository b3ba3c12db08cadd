# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What drones flew in a step in metres, and how they move in it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.environments.metres_drones import MetresDrones
from dsse_ros.search.step.metres_paths import Wind
from dsse_ros.world.scenario.frames import GridFrame, flip_y


@dataclass(frozen=True)
class Flown:
    """What N drones flew in the last step; positions are as in `step.metres_paths`.

    Attributes:
        actions: (N, 2) float64, turns and speeds.
        flights: (N,) of `metres_paths.MOTION_STATES`, the states after it.
        paths: (N, K + 1, 2) float64, positions at equal times of the step.
        looked: (N, K + 1) bool, whether they looked right before it and on each piece.
        places: (N, 2) float64 (col, row) after it; fractions lie between cells.
    """

    actions: NDArray[np.float64]
    flights: NDArray[np.void]
    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]
    places: NDArray[np.float64]

    @classmethod
    def of_flights(cls, flights: MetresDrones) -> Flown:
        """Return a copy of the last step of a batch of one."""
        return cls(
            flights.actions[0].copy(),
            flights.states[0].copy(),
            flights.paths[0].copy(),
            flights.looked[0].copy(),
            flights.in_cells()[0],
        )


class Motion(NamedTuple):
    """How a drone moves, in the map frame.

    Attributes:
        position: x, y, z, m.
        velocity: Over the ground, (east, north), m/s.
        yaw: Where it points, radians from east to north.
    """

    position: tuple[float, float, float]
    velocity: tuple[float, float]
    yaw: float


def yaw_of_heading(heading: float) -> float:
    """Return a heading, radians clockwise from north, as a yaw, radians from east to north."""
    return math.remainder(math.pi / 2 - heading, 2 * math.pi)


def motions(frame: GridFrame, flown: Flown, wind: Wind, share: float) -> list[Motion]:
    """Return how N drones move during a step.

    Args:
        frame: Frame of the grid.
        flown: The step.
        wind: The wind, and the time of a step.
        share: Share of the step that has passed; at 1 they move on as at its end.
    """
    pieces = flown.paths.shape[1] - 1
    piece = min(int(share * pieces), pieces - 1)
    here = flown.paths[:, piece]
    way = flown.paths[:, piece + 1] - here
    places = here + (share * pieces - piece) * way
    velocities = way * pieces / wind.step_s
    drift = np.array([wind.east, wind.south])
    if share >= 1.0:
        headings, speeds = flown.flights["heading"], flown.flights["speed"]
        air = speeds[:, None] * np.stack([np.sin(headings), -np.cos(headings)], axis=1)
        velocities = air + drift
    else:
        air = velocities - drift
        stands = np.hypot(*air.T) == 0.0
        headings = np.where(stands, flown.flights["heading"], np.arctan2(air[:, 0], -air[:, 1]))
    return [
        Motion(
            (x, flip_y(frame.extent.height, y), altitude), (east, -south), yaw_of_heading(heading)
        )
        for (x, y), (east, south), heading, altitude in zip(
            places.tolist(),
            velocities.tolist(),
            headings.tolist(),
            frame.altitudes_m(len(places)),
            strict=True,
        )
    ]
