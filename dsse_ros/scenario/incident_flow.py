# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current of an incident: constants, files, and values in a message."""

from __future__ import annotations

import glob
import math
import os
from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from dsse_ros.drift.flow import (
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
from dsse_ros.scenario.fields import FieldError, Spec, check_known, shown

_NOT_NEGATIVE = Spec("float", "", low=0, high=1e6)
_OF_ERROR = ("error", "correlation_minutes")
_OF_FILE = ("file", "variables", "select", "units", "axes", "gap_cells")
_MAX_GAP_CELLS = 100
_MAX_FILES = 500


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
    sense = SENSE[kind]
    values = mapping(name, {"speed": 0.0, sense: 0.0} if value is None else value)
    std = _NOT_NEGATIVE.check(f"{name}.error", values.get("error", 0.0))
    minutes = values.get("correlation_minutes")
    if minutes is not None:
        minutes = _NOT_NEGATIVE.check(f"{name}.correlation_minutes", minutes)
    law = Uncertainty(std, math.inf if minutes is None else 60 * minutes)
    if "times_s" in values:
        return _flow_of(name, values), law
    if "file" in values:
        return _flow_of_file(name, kind, values, folder, span), law
    check_known(name, values, ("speed", sense, *_OF_FILE, *_OF_ERROR))
    for part in ("speed", sense):
        if part not in values:
            raise FieldError(f"{name} must have speed and {sense}, or a file")
    speed = Spec("float", "", low=0, high=MAX_SPEED_MPS, unit="m/s").check(
        f"{name}.speed", values["speed"]
    )
    toward = Spec("float", "", low=-360, high=360, unit="deg").check(
        f"{name}.{sense}", values[sense]
    )
    return constant_flow(kind, speed, toward), law


def _flow_of_file(
    name: str, kind: Kind, values: Mapping[str, Any], folder: str, span: Span
) -> Flow:
    """Return the flow of a file; see `read_flow`."""
    # Without a file, none of the readers is loaded.
    from dsse_ros.drift.flow_files import GAP_CELLS, read_forecast
    from dsse_ros.drift.velocity_pairs import Axes, Choice

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
    return read_forecast(kind, paths, span, Choice(variables, select, units, axes), cells)


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


def flow_dict(flow: Flow, law: Uncertainty) -> dict[str, Any]:
    """Return a flow and its uncertainty for JSON, without the name of a file to read."""
    values: dict[str, Any] = {name: getattr(flow, name).tolist() for name in _AXES}
    values |= {name: _numbers(getattr(flow, name)) for name in _COMPONENTS}
    if flow.rows.size:
        values |= {name: _numbers(getattr(flow, name)) for name in _LOOKUP}
        values["shape"] = list(flow.east_mps.shape[1:])
    values |= {"source": flow.source, "gap_cells": flow.gap_cells}
    if flow.extent is not None:
        values["extent"] = list(flow.extent)
    return values | _error_dict(law)


def _numbers(values: NDArray[Any]) -> list[float | None]:
    """Return the values of an array in a list; JSON has no NaN."""
    return [None if math.isnan(number) else number for number in values.ravel().tolist()]


def flow_identity(flow: Flow, law: Uncertainty) -> dict[str, Any]:
    """Return the digest of a flow and its uncertainty for JSON."""
    return {"sha256": flow.sha256} | _error_dict(law)


def _error_dict(law: Uncertainty) -> dict[str, float]:
    values = {"error": law.std_mps}
    if math.isfinite(law.correlation_s):
        values["correlation_minutes"] = law.correlation_s / 60
    return values


def _flow_of(name: str, values: Mapping[str, Any]) -> Flow:
    """Return the flow of `flow_dict`.

    Raises:
        FieldError: If the values are not such a flow.
    """
    check_known(name, values, (*_AXES, *_COMPONENTS, *_LOOKUP, *_ABOUT, *_OF_ERROR))
    try:
        axes = [np.array(values[part], np.float64) for part in _AXES]
        times, *place = (len(axis) for axis in axes)
        shape = tuple(int(count) for count in values.get("shape", place))
        parts = [np.array(values[part], np.float32).reshape(times, *shape) for part in _COMPONENTS]
        lookup = [np.array(values[part], np.float64).reshape(place) for part in _LOOKUP
                  if "shape" in values]  # fmt: skip
        fits = all(
            axis.ndim == 1 and len(axis) and np.isfinite(axis).all() and (np.diff(axis) > 0).all()
            for axis in axes
        ) and not any((np.abs(part) > MAX_SPEED_MPS).any() for part in parts)
        extent = Extent(*(float(end) for end in values["extent"])) if "extent" in values else None
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


def mapping(name: str, value: Any) -> Mapping[str, Any]:
    """Return a value that is a mapping.

    Raises:
        FieldError: If it is not a mapping.
    """
    if not isinstance(value, Mapping):
        raise FieldError(f"{name} must be a mapping of fields to values, got {shown(value)}")
    return value
