# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The colours of pictures, charts, reports and the live page, on light and on dark pages."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Theme:
    """The colours of a page.

    Attributes:
        paper: Behind everything.
        ink: Text and axes.
        soft: Strokes, ticks, and what is the same for all drones.
        faint: Lines of a grid.
        accent: The main line of a chart.
        shades: Of cividis, for the least and the most.
        sea: Of probabilities, from none to the most, in equal steps.
        land: Land, and cells that are not searched.
        edge: The edge of those.
        lkp: Last known positions: on light pages the magenta of nautical charts.
        wind: The arrow of the wind.
        current: The arrow of the current.
    """

    paper: str
    ink: str
    soft: str
    faint: str
    accent: str
    shades: tuple[float, float]
    sea: tuple[str, ...]
    land: str
    edge: str
    lkp: str
    wind: str
    current: str


# The light sea has the colours of ColorBrewer's Blues. Neither has the darkest or the brightest
# blues, which are for tracks.
LIGHT = Theme(
    paper="#ffffff", ink="#1b1f24", soft="#595959", faint="#d8dde3", accent="#0072B2",
    shades=(0.85, 0.0),
    sea=("#f7fbff", "#e3eef9", "#d0e1f2", "#b7d4ea", "#94c4df", "#6aaed6", "#4a98c9", "#2e7ebc",
         "#1764ab"),
    land="#d8cba8", edge="#6b5f3f", lkp="#a0007a", wind="#5b2a86", current="#00606b",
)  # fmt: skip
DARK = Theme(
    paper="#171b21", ink="#e6e9ed", soft="#a9b2bd", faint="#3a424d", accent="#56B4E9",
    shades=(0.3, 1.0),
    sea=("#171b21", "#182736", "#19334b", "#1a4061", "#1b4e78", "#1d5c90", "#206ba9", "#257bc3",
         "#2d8bdd"),
    land="#4f4733", edge="#b9a878", lkp="#ff8ade", wind="#d4b3f5", current="#6fdbe6",
)  # fmt: skip

DRONE_COLOURS = ("#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B")
"""Okabe and Ito's palette, with brown in place of what black and white pages or blue maps hide."""


def drone_colour(number: int) -> str:
    """Return the colour of a drone."""
    return DRONE_COLOURS[number % len(DRONE_COLOURS)]
