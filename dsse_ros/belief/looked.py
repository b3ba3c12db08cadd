# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was looked at in a step, as a belief learns from it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.actions import Cell


class Looked(NamedTuple):
    """A cell that a drone looked at.

    Attributes:
        cell: Column and row; off the grid nobody is there.
        pods: (n,) float64, the probability of detecting each person of the scenario in the cell.
    """

    cell: Cell
    pods: NDArray[np.float64]
