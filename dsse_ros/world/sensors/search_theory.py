# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Search theory by hand: coverage, POD of parallel tracks, total probable error, search radius.

Sources: B. O. Koopman, "Search and Screening" (Operations Evaluation Group, 1946), for the random
search formula and the inverse cube law; COMDTINST M16130.2F (2013) for errors and radius. Lengths
may have any unit, the same for all.
"""

from __future__ import annotations

import math

SEARCH_FACTORS = (1.1, 1.6, 2.0, 2.3, 2.5)
"""Factors on the total probable error for the radius of the first to fifth search."""


def coverage(sweep_width: float, track_length: float, area: float) -> float:
    """Return the swept part of an area; of parallel tracks this is sweep width / track spacing."""
    return sweep_width * track_length / area


def random_search_pod(coverage: float) -> float:
    """Return the POD of tracks at random."""
    return -math.expm1(-coverage)


def inverse_cube_pod(coverage: float) -> float:
    """Return the POD of equally spaced parallel tracks, under the inverse cube law."""
    return math.erf(math.sqrt(math.pi) / 2 * coverage)


def total_probable_error(position_error: float, drift_error: float, search_error: float) -> float:
    """Return the total probable error of a datum.

    Args:
        position_error: X, of the last known position.
        drift_error: De, of the drift since.
        search_error: Y, of the searcher's own navigation.
    """
    return math.hypot(position_error, drift_error, search_error)


def search_radius(total_probable_error: float, search: int = 1) -> float:
    """Return the radius to search around the datum; the square around it has the area 4 R^2.

    Args:
        total_probable_error: E.
        search: Number of the search, 1 to 5.

    Raises:
        ValueError: If the number of the search is not from 1 to 5.
    """
    if search not in range(1, len(SEARCH_FACTORS) + 1):
        raise ValueError(f"search must be from 1 to {len(SEARCH_FACTORS)}, got {search}")
    return total_probable_error * SEARCH_FACTORS[search - 1]
