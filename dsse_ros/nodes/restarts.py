# SPDX-License-Identifier: Apache-2.0
"""How a listener tells a simulation that was restarted from the one before.

Stamps grow from mission to mission of a simulation, but a new one begins with 0 again: if it is
killed before its first step, its report and the first of its successor have stamp and step alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.agents import AgentsInfo


def may_be_restarted(before: AgentsInfo, info: AgentsInfo, stamp_ns: int) -> bool:
    """Return whether a report with this stamp may be of the search before as well as of the new."""
    return stamp_ns == 0 and (before.mission, before.seed) != (info.mission, info.seed)


def same_cells(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Return whether the drones are in the same cells in both reports."""
    return all(np.array_equal(one[key], other[key]) for key in ("col", "row"))
