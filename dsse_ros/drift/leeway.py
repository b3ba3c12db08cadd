# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Leeway: the drift of an object by the wind, apart from the current.

Sources: A. A. Allen and J. V. Plourde, "Review of Leeway: Field Experiments and Implementation"
(USCG R&D Center, CG-D-08-99, 1999), Table 8-1; A. A. Allen, "Leeway Divergence" (CG-D-05-05, 2005),
for the split into downwind and crosswind. `leeway_classes.csv` has their classes by published key:
slope in percent of the wind speed, offset and standard deviation in cm/s.

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
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_FILE = Path(__file__).with_name("leeway_classes.csv")


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
        description: Objects of the class.
        downwind: Component along the wind.
        right: Crosswind component, positive to the right of downwind, of half of the particles.
        left: Crosswind component of the other half, with the same sign.
    """

    description: str
    downwind: Component
    right: Component
    left: Component


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
        return {
            row["class"]: LeewayClass(
                row["description"],
                *(
                    Component(
                        float(row[f"{name}_slope_pct"]),
                        float(row[f"{name}_offset_cm_s"]),
                        float(row[f"{name}_std_cm_s"]),
                    )
                    for name in ("dw", "cw_right", "cw_left")
                ),
            )
            for row in csv.DictReader(file)
        }


def leeway_class(key: str) -> LeewayClass:
    """Return the class with this key.

    Raises:
        ValueError: If there is none.
    """
    classes = leeway_classes()
    if key not in classes:
        near = difflib.get_close_matches(str(key).upper(), classes, n=1)
        hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(classes)}"
        raise ValueError(f"object must be a class of leeway, got {key!r}; {hint}")
    return classes[key]


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
