# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Look and meaning of the symbols in a picture of a mission."""

from __future__ import annotations

from typing import Any

PERSON = "#F0E442"
"""Colour of a person at sea."""
FOUND = "limegreen"
"""Colour of the ring around a person found."""
LAND = "#d8cba8"
"""Colour of the cells outside the area."""
EDGE = "#6b5f3f"
"""Colour of the edge of the area."""
SHORE: dict[str, Any] = {"facecolor": LAND + "a0", "edgecolor": EDGE, "linewidth": 1.2}
CIRCLE: dict[str, Any] = {"color": "0.15", "linewidth": 1.0, "linestyle": (0, (4, 3))}
DATUM: dict[str, Any] = {"color": "black", "markeredgewidth": 1.8}
LKP_COLOUR = "#a0007a"
"""Colour of last known positions: the magenta of charts."""
LKP: dict[str, Any] = {
    "marker": "o", "markersize": 9, "markerfacecolor": "white", "markeredgecolor": LKP_COLOUR,
    "markeredgewidth": 1.6, "linestyle": "none", "zorder": 4.5,
}  # fmt: skip
"""With the dot, the fix of a chart."""
LKP_DOT: dict[str, Any] = {
    "marker": ".", "markersize": 5, "color": LKP_COLOUR, "linestyle": "none", "zorder": 4.5,
}  # fmt: skip
LKP_CIRCLE: dict[str, Any] = {"color": LKP_COLOUR, "linewidth": 1.2, "zorder": 1.5}
STAR: dict[str, Any] = {"markeredgecolor": "black"}


def legend_entries(
    *, numbered: bool, shaded: bool, every: int, step_s: float | None
) -> dict[str, tuple[Any, str]]:
    """Return the symbols and their meanings by name, in the order of the legend.

    Args:
        numbered: Whether drones have numbers.
        shaded: Whether shades show the searches.
        every: Steps between two dots of a track.
        step_s: Time of one step in seconds, None if unknown.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def symbol(marker: str, size: float, **style: Any) -> Line2D:
        return Line2D([], [], linestyle="none", **{"marker": marker, "markersize": size, **style})

    def line(**style: Any) -> Line2D:
        return Line2D([], [], **{"color": "0.35", "linewidth": 1.8, **style})

    minutes = "" if step_s is None else f" ({every * step_s / 60:.2g} min)"
    steps = "step" if every == 1 else f"{every} steps"
    dots = {"marker": "o", "markersize": 4, "markeredgecolor": "0.35", "markerfacecolor": "white"}
    drone = {"color": "0.35", "markeredgecolor": "white"}
    ring = {"markerfacecolor": "none"}
    found = (
        symbol("*", 9, **STAR | {"markerfacecolor": "white"}),
        symbol("o", 15, markeredgecolor="black", markeredgewidth=3.4, **ring),
        symbol("o", 15, markeredgecolor=FOUND, markeredgewidth=1.7, **ring),
    )
    return {
        "drone": (symbol("o", 10, **drone), "drone with its number" if numbered else "drone"),
        "lost": (symbol("X", 10, **drone), "drone that is lost"),
        "start": (symbol("s", 5, color="white", markeredgecolor="0.35"), "start of a drone"),
        "flown": (line(linewidth=2.2), "flown by its vehicle"),
        "track": (line(**dots), f"track, darker is newer;\ndot every {steps}{minutes}"),
        "searched": (
            Patch(facecolor="0.7", label="")
            if shaded
            else Patch(facecolor="white", edgecolor="0.35", linewidth=0.7, hatch="///"),
            "searched, darker is\nmore often" if shaded else "searched: a stroke\nfor each time",
        ),
        "datum": (symbol("+", 10, **DATUM), "datum: where drift alone\nputs the person"),
        "circle": (line(**CIRCLE), "circle of the map"),
        "lkp": (
            (Line2D([], [], **LKP), Line2D([], [], **LKP_DOT)),
            "last known position (LKP)\nwith its 99 % circle",
        ),
        "person": (symbol("*", 13, **STAR | {"markerfacecolor": PERSON}), "person at sea"),
        "found": (found, "person found"),
        "outside": (Patch(facecolor=LAND, edgecolor=EDGE), "not to be searched"),
        "land": (Patch(**SHORE), "land"),
    }
