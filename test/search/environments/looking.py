# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Searches of cells, as a belief learns from them."""

from __future__ import annotations

from collections.abc import Iterable

from dsse_ros.search.belief.protocol import TargetBelief
from dsse_ros.search.step.looks import Looked, searches_of
from dsse_ros.world.scenario.actions import Cell


def looks_at(belief: TargetBelief, cells: Iterable[Cell]) -> list[Looked]:
    """What searches of these cells look at."""
    return searches_of(belief.forecast.scenario, belief.forecast.rules, cells)


def search_in_vain(belief: TargetBelief, cells: Iterable[Cell]) -> None:
    """Have a belief learn that searches of these cells have found nobody."""
    belief.update(looks_at(belief, cells))


def find_in(belief: TargetBelief, cell: Cell) -> None:
    """Have a belief learn that a search of this cell has found somebody."""
    (look,) = looks_at(belief, [cell])
    belief.observe_find(look)
