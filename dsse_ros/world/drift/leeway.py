# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Leeway: the drift of an object by the wind, apart from the current.

`leeway_classes.csv` has the classes by published key: slope in percent of the wind speed, offset
and standard deviation in cm/s, each downwind and to the right and left of it. They are those of the
U.S. Coast Guard's SAROPS as of 2010-11-15, published by Ø. Breivik on 2011-08-25 with the model
Leeway: downwind and crosswind by A. A. Allen, "Leeway Divergence" (CG-D-05-05, 2005). `source` and
`page` state who measured the object:

- A99: A. A. Allen and J. V. Plourde, "Review of Leeway: Field Experiments and Implementation"
  (USCG R&D Center, CG-D-08-99, 1999);
- O06: Oceans Ltd., "Investigation of Leeway and Drift for Ovatek Life Rafts" (2006);
- T06: Turner, leeway of the SEIE raft and the SEPIRB (ADA457525, 2006);
- B11: Ø. Breivik, A. A. Allen, C. Maisondieu and J. C. Roth, "Wind-induced drift of objects at sea:
  the leeway field method" (doi:10.1016/j.apor.2011.01.005);
- B12: Ø. Breivik, A. A. Allen, C. Maisondieu, J.-C. Roth and B. Forest, "The leeway of shipping
  containers at different immersion levels" (doi:10.1007/s10236-012-0522-z);
- S10: a later addition to the list, of which we know no publication.

With the wind speed W in m/s, a particle drifts downwind by

    0.01 ((slope + e / 20) W + offset + e / 2) m/s

where e is normal with the standard deviation of its class, drawn once per particle, and again while
slope + e / 20 < 0. The crosswind component has the same form with its own coefficients and error,
which is not truncated. Half of the particles use the right coefficients, the others the left ones.

The part e / 2 of the error does not depend on the wind: particles also spread in a calm. The spread
follows the direction of the wind, so a cloud can contract when the wind turns.
"""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_FILE = Path(__file__).with_name("leeway_classes.csv")
_MOST_HINTS = 5
"""Number of classes that an error suggests."""


class Component(NamedTuple):
    """Coefficients of one component of the leeway.

    Attributes:
        slope_pct: Slope, in percent of the wind speed.
        offset_cmps: Offset in cm/s.
        std_cmps: Standard deviation in cm/s.
    """

    slope_pct: float
    offset_cmps: float
    std_cmps: float


class LeewayClass(NamedTuple):
    """A class of objects that drift alike.

    Attributes:
        key: Its published key.
        description: Objects of the class.
        aliases: Further names.
        downwind: Component along the wind.
        right: Crosswind component, positive to the right of downwind, of half of the particles.
        left: Crosswind component of the other half, with the same sign.
        source: Who measured it, see above; with the page or table if it is known.
    """

    key: str
    description: str
    aliases: tuple[str, ...]
    downwind: Component
    right: Component
    left: Component
    source: str


class Appearance(NamedTuple):
    """How sensors see an object; None for as the scenario states it.

    Attributes:
        search_object: Name of its sweep widths.
        object_size: Its visible size in metres.
    """

    search_object: str | None = None
    object_size: float | None = None


class PossibleObject(NamedTuple):
    """What may be missing.

    Attributes:
        category: Its class of leeway.
        weight: Its weight among several possible objects.
        appearance: How sensors see it.
    """

    category: LeewayClass
    weight: float = 1.0
    appearance: Appearance = Appearance()


class Leeway(NamedTuple):
    """The leeway of M particles: each component is its slope x wind speed + offset.

    Attributes:
        downwind_slope: (M,) float64.
        downwind_mps: (M,) float64, offset in m/s.
        crosswind_slope: (M,) float64, positive to the right of downwind.
        crosswind_mps: (M,) float64, offset in m/s.
        other_slope: (M,) float64, crosswind slope after jibing, which exchanges both.
        other_mps: (M,) float64, its offset.
    """

    downwind_slope: NDArray[np.float64]
    downwind_mps: NDArray[np.float64]
    crosswind_slope: NDArray[np.float64]
    crosswind_mps: NDArray[np.float64]
    other_slope: NDArray[np.float64]
    other_mps: NDArray[np.float64]


@lru_cache(maxsize=1)
def leeway_classes() -> dict[str, LeewayClass]:
    """Return the classes by their published keys."""
    with _FILE.open(encoding="utf-8", newline="") as file:
        return {row["class"]: _class_of(row) for row in csv.DictReader(file)}


def _class_of(row: dict[str, str]) -> LeewayClass:
    """Return the class in a row of the table."""
    downwind, right, left = (
        Component(
            float(row[f"{name}_slope_pct"]),
            float(row[f"{name}_offset_cm_s"]),
            float(row[f"{name}_std_cm_s"]),
        )
        for name in ("dw", "cw_right", "cw_left")
    )
    aliases = tuple(row["aliases"].split("; ")) if row["aliases"] else ()
    source = ", ".join(part for part in (row["source"], row["page"]) if part)
    return LeewayClass(row["class"], row["description"], aliases, downwind, right, left, source)


@lru_cache(maxsize=1)
def _by_words() -> dict[str, LeewayClass]:
    """Return the classes by the words of their keys and aliases."""
    return {
        _words(name): category
        for category in leeway_classes().values()
        for name in (category.key, *category.aliases)
    }


def _words(name: str) -> str:
    """Return the letters and digits of a name in lower case, with one space between words."""
    return " ".join(re.findall(r"[a-z]+|[0-9]+", name.lower()))


def leeway_class(name: str) -> LeewayClass:
    """Return the class with this key or alias, in upper or lower case.

    Raises:
        ValueError: If there is none; it lists the classes that may be meant.
    """
    words, known = _words(str(name)), _by_words()
    if words in known:
        return known[words]
    described = [
        category
        for category in leeway_classes().values()
        if words and set(words.split()) <= set(_words(category.description).split())
    ]
    # Means of several classes come first.
    described.sort(key=lambda category: "(mean)" not in category.description)
    alike = [known[near] for near in difflib.get_close_matches(words, known)]
    nearest = [*dict.fromkeys(category.key for category in (*described, *alike))][:_MOST_HINTS]
    hint = (
        f"did you mean {' or '.join(nearest)}?"
        if nearest
        else f"known are {', '.join(leeway_classes())}"
    )
    raise ValueError(f"object must be a class of leeway, got {name!r}; {hint}")


def draw_objects(
    objects: Sequence[PossibleObject], count: int, rng: np.random.Generator
) -> tuple[Leeway, NDArray[np.int8] | None]:
    """Draw the leeway of `count` particles, each of one of several possible objects.

    Systematic sampling gives each object its share, rounded up or down, in a random order.

    Returns:
        The leeway and, (M,) int8, the number of each particle's object; None for a single object.
    """
    if len(objects) == 1:
        return draw_leeway(objects[0].category, count, rng), None
    chosen = systematic([of_object.weight for of_object in objects], count, rng).astype(np.int8)
    leeway = Leeway(*np.empty((len(Leeway._fields), count)))
    for number, of_object in enumerate(objects):
        own = np.flatnonzero(chosen == number)
        for whole, part in zip(leeway, draw_leeway(of_object.category, len(own), rng), strict=True):
            whole[own] = part
    return leeway, chosen


def systematic(weights: Sequence[float], count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return which of several alternatives each of `count` particles has, in a random order.

    Each alternative gets its share of the particles, rounded up or down.
    """
    shares = np.array(weights, np.float64)
    wanted = (np.arange(count) + rng.random()) / count
    chosen = np.searchsorted(np.cumsum(shares) / shares.sum(), wanted, side="right")
    return rng.permutation(np.minimum(chosen, len(shares) - 1))


def draw_leeway(category: LeewayClass, count: int, rng: np.random.Generator) -> Leeway:
    """Draw the leeway of `count` particles of a class."""
    slope, offset, std = category.downwind
    error = std * rng.standard_normal(count)
    while (negative := slope + error / 20 < 0).any():
        error[negative] = std * rng.standard_normal(int(negative.sum()))
    # Alternating sides make the halves exact, also of the first particles alone.
    is_right = np.arange(count)[:, None] % 2 == 0
    draw = rng.standard_normal(count)
    sides = (
        np.where(is_right, category.right, category.left),
        np.where(is_right, category.left, category.right),
    )
    crosswind = [
        part
        for cross_slope, cross_offset, cross_std in (side.T for side in sides)
        for part in (
            (cross_slope + cross_std * draw / 20) / 100,
            (cross_offset + cross_std * draw / 2) / 100,
        )
    ]
    return Leeway((slope + error / 20) / 100, (offset + error / 2) / 100, *crosswind)
