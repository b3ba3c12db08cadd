# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A row of the table of promises: how it is measured, and what has to come out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from dsse_ros.progress import progress

T = TypeVar("T")

Figures = dict[str, Any]
"""Numbers by name, as JSON has them."""


@dataclass(frozen=True)
class Run:
    """How a row is measured.

    Attributes:
        quick: Whether in its short form.
        folder: For what is written meanwhile.
    """

    quick: bool
    folder: Path

    def size(self, whole: T, quick: T) -> T:
        """Return how much there is to do."""
        return quick if self.quick else whole

    def each(self, items: Iterable[T], label: str) -> Iterable[T]:
        """Return the items, with a bar on a terminal."""
        return items if self.quick else progress(items, label)


@dataclass(frozen=True)
class Goal:
    """What a figure has to be.

    Attributes:
        figure: Its name.
        least: The smallest value that will do.
        most: The largest one.
        timed: Whether it says how fast this machine is, as no test may.
    """

    figure: str
    least: float = float("-inf")
    most: float = float("inf")
    timed: bool = False

    def met(self, figures: Figures) -> bool:
        """Return whether the figure is there and will do."""
        value = figures.get(self.figure)
        return value is not None and self.least <= value <= self.most

    def __str__(self) -> str:
        if self.least == self.most:
            return f"{self.figure} = {self.most:g}"
        bounds = [f">= {self.least:g}"] if self.least > float("-inf") else []
        bounds += [f"<= {self.most:g}"] if self.most < float("inf") else []
        return f"{self.figure} {' and '.join(bounds)}"


def zero(*figures: str) -> tuple[Goal, ...]:
    """Return the goals of figures that count what must not happen."""
    return tuple(Goal(name, most=0) for name in figures)


@dataclass(frozen=True)
class Row:
    """A promise.

    Attributes:
        name: On the command line and in the results.
        promise: In words.
        measure: Returns the figures.
        says: Makes a line of the figures, as `str.format` does.
        goals: What the figures have to be.
    """

    name: str
    promise: str
    measure: Callable[[Run], Figures]
    says: str
    goals: tuple[Goal, ...]

    def missed(self, figures: Figures, *, timed: bool = True) -> list[str]:
        """Return the goals that are not met, each with the figure.

        Args:
            figures: What was measured.
            timed: Whether those count that say how fast this machine is.
        """
        return [
            f"{goal}, not {_shown(figures.get(goal.figure))}"
            for goal in self.goals
            if (timed or not goal.timed) and not goal.met(figures)
        ]


def _shown(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
