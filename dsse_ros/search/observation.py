# SPDX-License-Identifier: Apache-2.0
"""What a drone observes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Observation(NamedTuple):
    """The observation of one drone.

    Attributes:
        position: (2,) integers, its cell (x, y).
        probability: (G, G) float32, the probability of cell [y, x].
    """

    position: NDArray[np.integer[Any]]
    probability: NDArray[np.float32]


AgentObservation = tuple[NDArray[np.integer[Any]], NDArray[np.float32]]
"""What an environment hands out for each agent: `Observation(*it)` has names."""
