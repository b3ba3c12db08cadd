# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A row of the table of promises: its measurement and its goals."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from dsse_ros.base.progress_bar import progress

T = TypeVar("T")

Figures = dict[str, Any]
"""Numbers by name, as JSON has them."""


@dataclass(frozen=True)
class Run:
    """How a row is measured.

    Attributes:
        quick: Whether to run the short form.
        folder: Folder for temporary files.
    """

    quick: bool
    folder: Path

    def size(self, full: T, quick: T) -> T:
        """Return the size for this form."""
        return quick if self.quick else full

    def each(self, items: Iterable[T], label: str) -> Iterable[T]:
        """Return the items, with a bar on a terminal."""
        return items if self.quick else progress(items, label)


@dataclass(frozen=True)
class Goal:
    """A bound on a figure.

    Attributes:
        figure: Its name.
        least: The smallest allowed value.
        most: The largest allowed value.
        timed: Whether it depends on the speed of the machine, so that no test may check it.
    """

    figure: str
    least: float = float("-inf")
    most: float = float("inf")
    timed: bool = False

    def met(self, figures: Figures) -> bool:
        """Return whether the figure exists and is within the bounds."""
        value = figures.get(self.figure)
        return value is not None and self.least <= value <= self.most

    def __str__(self) -> str:
        if self.least == self.most:
            return f"{self.figure} = {self.most:g}"
        bounds = [f">= {self.least:g}"] if self.least > float("-inf") else []
        bounds += [f"<= {self.most:g}"] if self.most < float("inf") else []
        return f"{self.figure} {' and '.join(bounds)}"


def zero(*figures: str) -> tuple[Goal, ...]:
    """Return the goals of figures that must be 0."""
    return tuple(Goal(name, most=0) for name in figures)


@dataclass(frozen=True)
class Row:
    """A promise.

    Attributes:
        name: Name on the command line and in the results.
        promise: The promise as text.
        measure: Returns the figures.
        says: Format string of the figures, for `str.format`.
        goals: Bounds on the figures.
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
            timed: Whether to include goals that depend on the speed of the machine.
        """
        return [
            f"{goal}, not {_shown(figures.get(goal.figure))}"
            for goal in self.goals
            if (timed or not goal.timed) and not goal.met(figures)
        ]


def _shown(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
