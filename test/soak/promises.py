# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keeps a promise of the table for a short time."""

from __future__ import annotations

import importlib
from pathlib import Path

from soak.row import Run


def keep(module: str, name: str, folder: Path) -> None:
    """Measure a row in its short form, and hold it to the goals that depend on no clock.

    Raises:
        AssertionError: If a goal is missed.
    """
    (row,) = (row for row in importlib.import_module(f"soak.{module}").ROWS if row.name == name)
    figures = row.measure(Run(quick=True, folder=folder))
    assert row.missed(figures, timed=False) == [], figures
