# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The colours of the drones in pictures, movies, reports and on the live page."""

from __future__ import annotations

DRONE_COLOURS = ("#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B")
"""Okabe and Ito's palette, with brown in place of what black and white pages or blue maps hide."""


def drone_colour(number: int) -> str:
    """Return the colour of a drone."""
    return DRONE_COLOURS[number % len(DRONE_COLOURS)]
