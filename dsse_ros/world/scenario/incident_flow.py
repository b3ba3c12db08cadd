# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current of an incident: constants, files, and values in a message."""

from __future__ import annotations

import glob
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec, check_known, shown
from dsse_ros.world.drift.flow import (
    MAX_SPEED_MPS,
    NO_LOOKUP,
    SENSE,
    Extent,
    Flow,
    Kind,
    Span,
    Uncertainty,
    constant_flow,
    read_table,
)

_TOTAL = "utotal and vtotal"
"""Variables of the total current of Copernicus: that of the model, of the tide and of waves."""
_NOT_NEGATIVE = Spec("float", "", low=0, high=1e6)
_OF_ERROR = ("error", "correlation_minutes")
_OF_FILE = ("file", "variables", "select", "units", "axes", "gap_cells", "constant_hours")
_MAX_CONSTANT_HOURS = 48
_MAX_GAP_CELLS = 100
_MAX_FILES = 500
_ROUNDING = 1 + 1e-6
"""By which two components may exceed a speed."""


def read_flow(
    name: str, kind: Kind, value: Any, folder: str, span: Span
) -> tuple[Flow, Uncertainty]:
    """Return wind or current, and its uncertainty.

    Args:
        name: Name of the field, for messages.
        kind: Which of them.
        value: Its value as in YAML; None for none.
        folder: Folder to which paths of files are relative.
        span: Where and when a file must cover it.

    Raises:
        ValueError: If it is not allowed, or a file does not fit.
    """
    values = mapping(name, {"speed": 0.0, SENSE[kind]: 0.0} if value is None else value)
    if "file" in values:
        return _flow_of_file(name, kind, values, folder, span), _uncertainty_of(name, values)
    return stated_flow(name, kind, values)


def stated_flow(name: str, kind: Kind, value: Any) -> tuple[Flow, Uncertainty]:
    """Return wind or current without a file, and its uncertainty; arguments as in `read_flow`.

    Raises:
        FieldError: If it is not allowed.
    """
    sense, values = SENSE[kind], mapping(name, value)
    uncertainty = _uncertainty_of(name, values)
    if "times_s" in values:
        return _flow_of(name, kind, values), uncertainty
    check_known(name, values, ("speed", sense, *_OF_ERROR))
    for part in ("speed", sense):
        if part not in values:
            raise FieldError(f"{name} must have speed and {sense}, or a file")
    speed = Spec("float", "", low=0, high=MAX_SPEED_MPS[kind], unit="m/s").check(
        f"{name}.speed", values["speed"]
    )
    toward = Spec("float", "", low=-360, high=360, unit="deg").check(
        f"{name}.{sense}", values[sense]
    )
    return constant_flow(kind, speed, toward), uncertainty


def _uncertainty_of(name: str, values: Mapping[str, Any]) -> Uncertainty:
    std = _NOT_NEGATIVE.check(f"{name}.error", values.get("error", 0.0))
    minutes = values.get("correlation_minutes")
    if minutes is not None:
        minutes = _NOT_NEGATIVE.check(f"{name}.correlation_minutes", minutes)
    return Uncertainty(std, math.inf if minutes is None else 60 * minutes)


def _flow_of_file(
    name: str, kind: Kind, values: Mapping[str, Any], folder: str, span: Span
) -> Flow:
    """Return the flow of a file; see `read_flow`."""
    # Without a file, none of the readers is loaded.
    from dsse_ros.world.drift.flow_files import GAP_CELLS, read_forecast
    from dsse_ros.world.drift.velocity_pairs import Axes, Choice

    paths = _paths(f"{name}.file", values["file"], folder)
    if len(paths) == 1 and paths[0].lower().endswith(".csv"):
        check_known(f"{name} with a table", values, ("file", *_OF_ERROR))
        return read_table(kind, paths[0])
    check_known(name, values, (*_OF_FILE, *_OF_ERROR))
    variables = Spec("names", "").check(f"{name}.variables", values.get("variables", []))
    if len(variables) not in (0, 2):
        raise FieldError(
            f"{name}.variables must be two names, of the components to the east and to the "
            f"north, got {shown(values['variables'])}"
        )
    cells = Spec("int", "", low=0, high=_MAX_GAP_CELLS).check(
        f"{name}.gap_cells", values.get("gap_cells", GAP_CELLS)
    )
    select = mapping(f"{name}.select", values.get("select", {}))
    units = Spec("str", "").check(f"{name}.units", values.get("units", ""))
    axes = Spec("str", "", choices=get_args(Axes)).check(f"{name}.axes", values.get("axes", ""))
    hours = Spec("float", "", low=0, high=_MAX_CONSTANT_HOURS, unit="h").check(
        f"{name}.constant_hours", values.get("constant_hours", 0.0)
    )
    choice = Choice(variables, select, units, axes, 3600 * hours)
    return read_forecast(kind, paths, span, choice, cells)


def _paths(name: str, value: Any, folder: str) -> list[str]:
    """Return the paths of a file, a pattern such as `wind_*.nc`, or a list of both.

    Raises:
        FieldError: If there are too many, or none matches a pattern.
    """
    names = Spec("names", "").check(name, [value] if isinstance(value, str) else value)
    paths: list[str] = []
    for pattern in names:
        # An address has no folder.
        path = pattern if "://" in pattern else os.path.join(folder, pattern)
        if glob.has_magic(path) and not os.path.exists(path):
            found = sorted(glob.glob(path))
            if not found:
                raise FieldError(f"{name} must match files, got {pattern!r}")
            paths += found
        else:
            paths.append(path)
    if not 0 < len(paths) <= _MAX_FILES:
        raise FieldError(f"{name} must be 1 to {_MAX_FILES} files, got {len(paths)}")
    return paths


_AXES = ("times_s", "lats_deg", "lons_deg")
_COMPONENTS = ("east_mps", "north_mps")
_LOOKUP = ("rows", "cols")
_ABOUT = ("shape", "source", "gap_cells", "extent")


def flow_dict(flow: Flow, uncertainty: Uncertainty) -> dict[str, Any]:
    """Return a flow and its uncertainty for JSON, without the name of a file to read."""
    values: dict[str, Any] = {name: getattr(flow, name).tolist() for name in _AXES}
    values |= {name: _numbers(getattr(flow, name)) for name in _COMPONENTS}
    if flow.rows.size:
        values |= {name: _numbers(getattr(flow, name)) for name in _LOOKUP}
        values["shape"] = list(flow.east_mps.shape[1:])
    values |= {"source": flow.source, "gap_cells": flow.gap_cells}
    if flow.extent is not None:
        # JSON has no infinity either.
        values["extent"] = [end if math.isfinite(end) else None for end in flow.extent]
    return values | _error_dict(uncertainty)


def _extent_of(values: Sequence[float | None]) -> Extent:
    """Return the extent of `flow_dict`: without an end, it goes on for ever.

    Raises:
        TypeError: If the values are no ends.
        ValueError: As well.
    """
    ends = zip(values, (-math.inf, math.inf) * 3, strict=True)
    return Extent(*(for_ever if end is None else float(end) for end, for_ever in ends))


def _numbers(values: NDArray[Any]) -> list[float | None]:
    """Return the values of an array in a list; JSON has no NaN."""
    return [None if math.isnan(number) else number for number in values.ravel().tolist()]


def flow_identity(flow: Flow, uncertainty: Uncertainty) -> dict[str, Any]:
    """Return the digest of a flow and its uncertainty for JSON."""
    return {"sha256": flow.sha256} | _error_dict(uncertainty)


def _error_dict(uncertainty: Uncertainty) -> dict[str, float]:
    values = {"error": uncertainty.std_mps}
    if math.isfinite(uncertainty.correlation_s):
        values["correlation_minutes"] = uncertainty.correlation_s / 60
    return values


def _flow_of(name: str, kind: Kind, values: Mapping[str, Any]) -> Flow:
    """Return the flow of `flow_dict`."""
    check_known(name, values, (*_AXES, *_COMPONENTS, *_LOOKUP, *_ABOUT, *_OF_ERROR))
    try:
        axes = [np.array(values[part], np.float64) for part in _AXES]
        times, *place = (len(axis) for axis in axes)
        shape = tuple(int(count) for count in values.get("shape", place))
        parts = [np.array(values[part], np.float32).reshape(times, *shape) for part in _COMPONENTS]
        lookup = [np.array(values[part], np.float64).reshape(place) for part in _LOOKUP
                  if "shape" in values]  # fmt: skip
        fits = (
            all(
                axis.ndim == 1
                and len(axis)
                and np.isfinite(axis).all()
                and (np.diff(axis) > 0).all()
                for axis in axes
            )
            and not (np.hypot(*parts) > MAX_SPEED_MPS[kind] * _ROUNDING).any()
        )
        extent = _extent_of(values["extent"]) if "extent" in values else None
        cells = int(values.get("gap_cells", 0))
    except (KeyError, TypeError, ValueError):
        fits = False
    if not fits:
        raise FieldError(
            f"{name} must have increasing axes and a velocity for each of their points"
        )
    rows, cols = lookup or (NO_LOOKUP, NO_LOOKUP)
    (times_s, lats, lons), (east, north) = axes, parts
    source = str(values.get("source", ""))
    return Flow(times_s, lats, lons, east, north, source, extent, cells, rows, cols)


def check_stokes_once(name: str, current: Flow, waves: Flow | None) -> None:
    """Check that a current with waves does not contain their Stokes drift.

    Raises:
        FieldError: If it does.
    """
    if waves is not None and current.source.lower().endswith(_TOTAL):
        raise FieldError(
            f"{name}.waves must not be given with a current {_TOTAL}, which contains the Stokes "
            f"drift: state its variables without, such as [uo, vo], got {current.source!r}"
        )


def mapping(name: str, value: Any) -> Mapping[str, Any]:
    """Return a value that is a mapping.

    Raises:
        FieldError: If it is not a mapping.
    """
    if not isinstance(value, Mapping):
        raise FieldError(f"{name} must be a mapping of fields to values, got {shown(value)}")
    return value
