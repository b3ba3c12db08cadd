# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Look and meaning of the symbols in a picture of a mission."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsse_ros.picture.theme import Theme

PERSON = "#F0E442"
"""Colour of a person at sea."""
FOUND = "limegreen"
"""Colour of the ring around a person found."""
STAR: dict[str, Any] = {"markeredgecolor": "black"}
WAIT = ((-0.28, -0.5), (-0.28, 0.5), (0.28, 0.5), (0.28, -0.5))
"""Ends of the two strokes of the symbol for waiting, as of a pause, in cells from the centre."""


STRIP_ALPHA = 0.22
"""Opacity of the strip that a drone sees."""
_NOSE_ANGLE, _NOSE_LENGTH = 0.75, 0.9
"""Where the nose of a drone leaves its circle, radians, and its length in diameters."""


def shore_style(theme: Theme) -> dict[str, Any]:
    """Return the style of land, through which cells can be seen."""
    return {"facecolor": theme.land + "a0", "edgecolor": theme.edge, "linewidth": 1.2}


def circle_style(theme: Theme) -> dict[str, Any]:
    """Return the style of the circle of possible positions."""
    return {"color": theme.ink, "linewidth": 1.0, "linestyle": (0, (4, 3))}


def datum_style(theme: Theme) -> dict[str, Any]:
    """Return the style of the datum."""
    return {"color": theme.ink, "markeredgewidth": 1.8}


def lkp_styles(theme: Theme) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the styles of the ring and the dot of a last known position: the fix of a chart."""
    ring = {
        "marker": "o", "markersize": 9, "markerfacecolor": theme.paper,
        "markeredgecolor": theme.lkp, "markeredgewidth": 1.6, "linestyle": "none", "zorder": 4.5,
    }  # fmt: skip
    dot = {"marker": ".", "markersize": 5, "color": theme.lkp, "linestyle": "none", "zorder": 4.5}
    return ring, dot


def wait_marker() -> Any:
    """Return the symbol for waiting as a marker."""
    from matplotlib.path import Path

    (west, low), (_, high), (east, _), _ = WAIT
    return Path([(west, low), (west, high), (east, low), (east, high)], [1, 2, 1, 2])


def heading_marker(heading: float) -> Any:
    """Return the symbol of a drone that points to a heading, radians clockwise from north."""
    from matplotlib.path import Path

    ahead = np.pi / 2 - heading
    round_it = ahead + np.linspace(_NOSE_ANGLE, 2 * np.pi - _NOSE_ANGLE, 25)
    angles, radii = [*round_it, ahead], [*[0.5] * len(round_it), _NOSE_LENGTH]
    points = np.array(radii)[:, np.newaxis] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return Path(np.vstack([points, points[:1]]), closed=True)


def _drawn(**style: Any) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], **style)


def _symbol(marker: Any, size: float, **style: Any) -> Any:
    return _drawn(linestyle="none", **{"marker": marker, "markersize": size, **style})


def _line(theme: Theme, **style: Any) -> Any:
    return _drawn(**{"color": theme.soft, "linewidth": 1.8, **style})


def _found_symbol() -> tuple[Any, ...]:
    """Return the symbol for a person who was found: a star in a ring."""
    ring: dict[str, Any] = {"markerfacecolor": "none"}
    return (
        _symbol("*", 9, **STAR | {"markerfacecolor": "white"}),
        _symbol("o", 15, markeredgecolor="black", markeredgewidth=3.4, **ring),
        _symbol("o", 15, markeredgecolor=FOUND, markeredgewidth=1.7, **ring),
    )


def _persons_and_datum(theme: Theme) -> dict[str, tuple[Any, str]]:
    """Return the symbols of waiting drones, of places of interest and of persons."""
    return {
        "waited": (
            _symbol(wait_marker(), 8, markeredgecolor=theme.ink, markeredgewidth=1.6),
            "a drone waited here",
        ),
        "datum": (
            _symbol("+", 10, **datum_style(theme)),
            "datum: where drift alone\nputs the person",
        ),
        "circle": (
            _line(theme, **circle_style(theme)),
            "edge of what is possible:\nno probability outside",
        ),
        "lkp": (
            tuple(_drawn(**style) for style in lkp_styles(theme)),
            "last known position (LKP)\nwith its 99 % circle",
        ),
        "person": (_symbol("*", 13, **STAR | {"markerfacecolor": PERSON}), "person at sea"),
        "found": (_found_symbol(), "person found"),
    }


def legend_entries(
    theme: Theme,
    *,
    numbered: bool,
    shaded: bool,
    every: int,
    step_s: float | None,
    in_metres: bool = False,
) -> dict[str, tuple[Any, str]]:
    """Return the symbols and their meanings by name, in the order of the legend.

    Args:
        theme: Its colours.
        numbered: Whether drones have numbers.
        shaded: Whether shades show the searches.
        every: Steps between two dots of a track.
        step_s: Time of one step in seconds, None if unknown.
        in_metres: Whether drones fly in metres.
    """
    from matplotlib.patches import Patch

    minutes = "" if step_s is None else f" ({every * step_s / 60:.2g} min)"
    steps = "step" if every == 1 else f"{every} steps"
    outlined: dict[str, Any] = {"markeredgecolor": theme.soft, "markerfacecolor": theme.paper}
    drone: dict[str, Any] = {"color": theme.soft, "markeredgecolor": theme.paper}
    strokes: dict[str, Any] = {"facecolor": theme.paper, "edgecolor": theme.soft, "linewidth": 0.7}
    named = "drone with its number" if numbered else "drone"
    marker, size = (heading_marker(np.pi / 4), 14) if in_metres else ("o", 10)
    return {
        "drone": (_symbol(marker, size, **drone), named + ",\npointing ahead" * in_metres),
        "lost": (_symbol("X", 10, **drone), "drone that is lost"),
        "start": (_symbol("s", 5, **outlined), "start of a drone"),
        "flown": (_line(theme, linewidth=2.2), "path flown"),
        "track": (
            _line(theme, marker="o", markersize=4, **outlined),
            f"track, stronger is newer;\ndot every {steps}{minutes}",
        ),
        "searched": (
            Patch(facecolor=theme.soft, alpha=0.5) if shaded else Patch(hatch="///", **strokes),
            "searched, more ink is\nmore often" if shaded else "searched: a stroke\nfor each time",
        ),
        "strip": (Patch(facecolor=theme.soft, alpha=STRIP_ALPHA), "strip that the drones saw"),
        **_persons_and_datum(theme),
        "outside": (Patch(facecolor=theme.land, edgecolor=theme.edge), "not to be searched"),
        "land": (Patch(**shore_style(theme)), "land"),
    }
