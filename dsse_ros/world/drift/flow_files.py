# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current from files of forecasts: open a file, find the pair, bring it to a grid.

`kernels.flow_at` interpolates it.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from dsse_ros.base.defects import reason_of
from dsse_ros.world.drift.coordinates import role, time_of
from dsse_ros.world.drift.flow import Flow, Kind, Span
from dsse_ros.world.drift.flow_grids import flow_on_grid
from dsse_ros.world.drift.flow_times import Source
from dsse_ros.world.drift.forecast_files import opened_forecast
from dsse_ros.world.drift.netcdf import Unfit, check_installed, times_of
from dsse_ros.world.drift.velocity_pairs import ANY, Choice, find_among, find_pair, half

GAP_CELLS = 2
"""Cells over which the nearest value fills a gap, unless a scenario states them."""
_LOGGER = logging.getLogger(__name__)


def read_forecast(
    kind: Kind,
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    span: Span,
    choice: Choice = ANY,
    gap_cells: int = GAP_CELLS,
) -> Flow:
    """Return the flow of files where and when it may be needed.

    Args:
        kind: What to read.
        paths: A NetCDF or GRIB file; or several, of different times or of one component each.
        span: Where the flow may be needed; values far beyond it are not read.
        choice: What the scenario states about their variables.
        gap_cells: Cells over which the nearest value fills a gap, as at the coast of a coarse
            model.

    Raises:
        ValueError: If a file cannot be read or they have nothing in the span; one line.
    """
    several = [paths] if isinstance(paths, str | os.PathLike) else paths
    first_name, *others = [os.fspath(path) for path in several]
    name = f"{first_name} and {len(others)} more" if others else first_name
    what = f"{kind} {name!r}"
    check_installed(what)
    with ExitStack() as stack:
        files = [_opened(kind, path, choice, stack) for path in (first_name, *others)]
        try:
            sources = _sources([_fitting(dataset, kind, choice) for dataset in files], kind, choice)
            first = sources[0].pair
            if first.note:
                _LOGGER.warning("%s %s", what, first.note)
            # The source ends in the variables, so that every message about gaps has them.
            return flow_on_grid(
                kind, sources, span, gap_cells, f"{name}: {first.names}", choice.constant_s
            )
        except Unfit as unfit:
            raise ValueError(f"{what}: {unfit}") from None
        except (IndexError, KeyError, OSError, RuntimeError, TypeError, ValueError) as error:
            reason = reason_of(error)
            raise ValueError(f"{what} must be a forecast: {reason}") from None


def _opened(kind: Kind, path: str, choice: Choice, stack: ExitStack) -> list[Any]:
    """Return the data sets of a file."""
    try:
        return stack.enter_context(opened_forecast(path, choice.select))
    except Unfit as unfit:
        raise ValueError(f"{kind} {path!r}: {unfit}") from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise ValueError(f"{kind} {path!r} must be a NetCDF or GRIB file: {reason}") from None
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        reason = reason_of(error)
        raise ValueError(f"{kind} {path!r} must be a forecast: {reason}") from None


def _fitting(datasets: Sequence[Any], kind: Kind, choice: Choice) -> Any:
    """Return the data set that has the pair, or one of its components."""
    if len(datasets) == 1:
        return datasets[0]
    try:
        return find_among(datasets, kind, choice)[0]
    except Unfit:
        halves = [dataset for dataset in datasets if half(dataset, kind, choice) is not None]
        if len(halves) != 1:
            raise
        return halves[0]


def _sources(datasets: Sequence[Any], kind: Kind, choice: Choice) -> list[Source]:
    """Return the pair in each file, or in files of one component each and the same times.

    Raises:
        Unfit: If there is a file without a pair, or two pairs differ.
    """
    halves: dict[tuple[float, ...], Any] = {}
    complete = []
    for dataset in datasets:
        component = half(dataset, kind, choice) if len(datasets) > 1 else None
        if component is None:
            complete.append(dataset)
            continue
        axis = time_of(dataset, component)
        times_s = tuple(times_of(axis).tolist())
        own = _alone(dataset, component)
        halves[times_s] = _joined(halves[times_s], own, axis.dims) if times_s in halves else own
    sources = [
        Source(dataset, find_pair(dataset, kind, choice))
        for dataset in (*complete, *halves.values())
    ]
    names = {source.pair.names: None for source in sources}
    if len(names) > 1:
        raise Unfit(f"files must have the same variables, got {'; '.join(names)}")
    return sources


def _alone(dataset: Any, component: Any) -> Any:
    """Return a file with one variable and its coordinates."""
    kept = (component.name, component.attrs.get("grid_mapping"))
    others = [
        name
        for name, variable in dataset.data_vars.items()
        if name not in kept and variable.ndim > 2
    ]
    return dataset.drop_vars(others)


def _joined(first: Any, other: Any, time_dims: Sequence[str]) -> Any:
    """Return two files of the same times in one; places that differ get other names."""
    import xarray

    places = [
        name
        for name, variable in other.variables.items()
        if name in first.variables
        and role(other[name]) in ("lat", "lon", "y", "x")
        and variable.ndim < 3
    ]
    if not all(first[name].equals(other[name]) for name in places):
        dims = [dim for dim in other.dims if dim not in time_dims]
        names = {name for name in other.variables if set(other[name].dims) & set(dims)} - {
            *other.data_vars
        }
        other = other.rename({name: f"{name}_2" for name in (*dims, *names, *places)})
    return xarray.merge([first, other], compat="override", join="override")
