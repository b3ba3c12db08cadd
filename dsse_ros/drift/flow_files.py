# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current from files of forecasts: open a file, find the pair, bring it to a grid.

`kernels.flow_at` interpolates it.
"""

from __future__ import annotations

import logging
import os

from dsse_ros.drift.flow import Flow, Kind
from dsse_ros.drift.flow_grids import Span, flow_on_grid
from dsse_ros.drift.netcdf import Unfit, check_installed, opened
from dsse_ros.drift.velocity_pairs import ANY, Choice, find_pair

GAP_CELLS = 2
"""Cells over which the nearest value fills a gap, unless a scenario states them."""
_LOGGER = logging.getLogger(__name__)


def read_forecast(
    kind: Kind,
    path: str | os.PathLike[str],
    span: Span,
    choice: Choice = ANY,
    gap_cells: int = GAP_CELLS,
) -> Flow:
    """Return the flow of a file where and when it may be needed.

    Args:
        kind: What to read.
        path: A NetCDF file.
        span: Where the flow may be needed; values far beyond it are not read.
        choice: What the scenario states about its variables.
        gap_cells: Cells over which the nearest value fills a gap, as at the coast of a coarse
            model.

    Raises:
        ValueError: If the file cannot be read or has nothing in the span; one line.
    """
    name = os.fspath(path)
    what = f"{kind} {name!r}"
    check_installed(what)
    try:
        with opened(path) as dataset:
            pair = find_pair(dataset, kind, choice)
            if pair.note:
                _LOGGER.warning("%s %s", what, pair.note)
            # The source ends in the variables, so that every message about gaps has them.
            return flow_on_grid(dataset, pair, span, gap_cells, f"{name}: {pair.names}")
    except Unfit as unfit:
        raise ValueError(f"{what}: {unfit}") from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise ValueError(f"{what} must be a NetCDF file: {reason}") from None
    except (IndexError, KeyError, RuntimeError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ValueError(f"{what} must be a CF-NetCDF file: {reason}") from None
