# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The published names of DSSE 1.1.9 over this package's search; those of 0.1.13 are in `v1`.

Change the import, or run a script unchanged: `python -m dsse_ros.compat script.py`.
docs/coming_from_dsse.md lists the differences. The sources are the documentation and the behaviour
of the package DSSE 1.1.9.
"""

from dsse_ros.compat.constants import Actions, Reward
from dsse_ros.compat.coverage import CoverageDroneSwarmSearch
from dsse_ros.compat.search import DroneSwarmSearch

__all__ = ["Actions", "CoverageDroneSwarmSearch", "DroneSwarmSearch", "Reward"]
