# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Leeway speed and divergence as search manuals tabulate them: a second source of the classes.

Source: "U.S. Coast Guard Addendum to the United States National Search and Rescue Supplement",
COMDTINST M16130.2F (2013), in the public domain, as extracted in marine-leeway-data (PDDL-1.0). The
two rows with offsets in cm/s are of Table 8-1 in CG-D-08-99.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

KNOT_CMPS = 185200 / 3600


class PublishedSpeed(NamedTuple):
    """Speed = slope x wind + offset, at an angle to either side of downwind."""

    slope_pct: float
    offset_kt: float
    divergence_deg: float

    def at(self, wind_mps: float) -> float:
        """Speed in cm/s."""
        return self.slope_pct * wind_mps + self.offset_kt * KNOT_CMPS


PUBLISHED_SPEEDS: Mapping[str, PublishedSpeed] = {
    key: PublishedSpeed(*values)
    for key, values in {
        "PIW-1": (1.1, 0.07, 30),
        "PIW-2": (0.5, 0.07, 18),
        "PIW-3": (1.2, 0.0, 18),
        "PIW-4": (1.4, 0.1, 30),
        "PIW-5": (0.7, 0.08, 30),
        "PIW-6": (1.5, 0.08, 30),
        "LIFE-RAFT-NB-1": (4.2, 0.03, 28),
        "LIFE-RAFT-NB-2": (5.7, 0.21, 24),
        "LIFE-RAFT-NB-3": (4.4, -0.2, 28),
        "LIFE-RAFT-NB-4": (3.7, 0.11, 24),
        "LIFE-RAFT-NB-5": (3.0, 0.0, 28),
        "LIFE-RAFT-SB-6": (2.9, 0.0, 22),
        "LIFE-RAFT-SB-7": (3.2, -0.02, 22),
        "LIFE-RAFT-SB-8": (2.5, 0.01, 22),
        "LIFE-RAFT-SB-9": (1.7, -0.1, 8),
        "LIFE-RAFT-DB-10": (3.0, 0.02, 13),
        "LIFE-RAFT-DB-12": (3.8, -2.1 / KNOT_CMPS, 15),
        "LIFE-RAFT-DB-15": (1.8, 1.4 / KNOT_CMPS, 12),
        "USCG-RESCUE": (2.5, -0.04, 7),
        "AVIATION-1": (3.7, 0.11, 24),
        "AVIATION-2": (2.8, -0.01, 15),
        "LIFE-CAPSULE": (3.8, -0.08, 22),
        "PERSON-POWERED-VESSEL-1": (1.1, 0.24, 15),
        "PERSON-POWERED-VESSEL-2": (2.0, 0.0, 15),
        "PERSON-POWERED-VESSEL-3": (2.3, 0.1, 12),
        "SKIFF-1": (3.4, 0.04, 22),
        "SKIFF-2": (3.0, 0.08, 15),
        "SKIFF-3": (1.7, 0.0, 15),
        "SPORT-BOAT": (6.9, -0.08, 19),
        "SPORT-FISHER": (6.0, -0.09, 22),
        "FISHING-VESSEL-1": (3.7, 0.02, 48),
        "FISHING-VESSEL-2": (4.0, 0.0, 48),
        "FISHING-VESSEL-3": (4.2, 0.0, 48),
        "FISHING-VESSEL-4": (3.7, 0.0, 48),
        "FISHING-VESSEL-5": (2.7, 0.1, 48),
        "FISHING-VESSEL-6": (4.0, 0.01, 33),
        "COASTAL-FREIGHTER": (2.8, 0.0, 48),
        "SAILBOAT-7": (4.0, 0.0, 48),
        "FV-DEBRIS": (2.0, 0.0, 10),
        "BAIT-BOX-1": (1.3, 0.27, 31),
        "BAIT-BOX-2": (2.6, 0.18, 15),
        "BAIT-BOX-3": (1.6, 0.16, 33),
    }.items()
}
