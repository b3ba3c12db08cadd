# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which level of a variable is 10 m above ground, or the surface of the sea."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from dsse_ros.world.drift.coordinates import (
    PRESSURES,
    coordinates,
    is_level,
    metres,
    place_of,
    role,
)
from dsse_ros.world.drift.flow import Kind, seconds
from dsse_ros.world.drift.netcdf import Unfit

WIND_HEIGHT_M = 10.0
DEEPEST_M = 10.0
"""Greatest depth of a level that counts as the surface; models have their first within 10 m."""
LOWEST_SIGMA = 0.2
"""The same in sigma coordinates, as a share of the depth."""

_ANONYMOUS = ("lev", "level", "levels", "z")
_OTHER_LEVEL = re.compile(r"\d+ ?h?pa\b|\d+ ?mb\b|isobaric|pressure|sigma|hybrid")
_HEIGHT = re.compile(
    r"(?:^|[^\d.])(\d+(?:\.\d+)?)[ _-]?(?:metres?|meters?|m)(?:above|agl|(?![a-z0-9/]| ?s\b))"
)


class Level(NamedTuple):
    """The level of a variable.

    Attributes:
        fits: Whether it is the wanted one; None if the file does not state it.
        shown: The levels that the file has, for messages.
        at: Which one it is: the meaning of its coordinate and the value, or words.
    """

    fits: bool | None = None
    shown: str = ""
    at: tuple[str, float] | str = ""


def words(variable: Any) -> str:
    """Return the standard name and the long name of a variable."""
    names = (variable.attrs.get(name, "") for name in ("standard_name", "long_name"))
    return " ".join(map(str, names)).lower()


def sliced(dataset: Any, kind: Kind, select: Mapping[str, Any], variable: Any) -> tuple[Any, Level]:
    """Return a variable along time and place alone, and its level.

    Args:
        dataset: Its file.
        kind: What it is of.
        select: Values of dimensions; those that it does not have do not count.
        variable: The variable.

    Raises:
        Unfit: If another dimension is left.
    """
    for name in set(select).intersection(variable.coords).difference(variable.dims):
        if not variable.coords[name].ndim:
            _selected(variable, name, [variable.coords[name]], select[name])
    along = {
        dim: [axis for axis in coordinates(dataset, variable) if axis.dims == (dim,)]
        for dim in variable.dims
    }
    place = place_of(dataset, variable).dims
    level = Level()
    for dim, found in along.items():
        levels = [axis for axis in found if is_level(axis)] or _sloping(dataset, dim)
        if dim in select:
            index = _selected(variable, dim, found, select[dim])
            if levels:
                level = Level(True, at=(role(levels[0]), float(metres(levels[0])[index])))
        elif dim in place or any(role(axis) == "time" for axis in found):
            continue
        elif levels:
            index, level = _nearest(kind, levels[0])
        elif variable.sizes[dim] == 1:
            index = 0
        else:
            raise Unfit(
                f"{variable.name} must have one {dim}, got {variable.sizes[dim]}; choose by "
                f"select: {{{dim}: ...}}"
            )
        variable = variable.isel({dim: index})
    scalars = [axis for axis in variable.coords.values() if axis.ndim == 0 and is_level(axis)]
    if level.fits is None and not level.shown:
        scalars = scalars or _unlinked(dataset, kind, variable)
        _, level = _nearest(kind, scalars[0]) if scalars else (0, level)
    return variable, _bywords(kind, variable, level)


def _unlinked(dataset: Any, kind: Kind, variable: Any) -> list[Any]:
    """Return model or pressure levels of one value, if a file has a wind on no other level."""
    every = [
        dataset[name]
        for name, other in dataset.variables.items()
        if other.size == 1 and not set(other.dims) & set(variable.dims) and kind == "wind"
    ]
    levels = [axis for axis in every if is_level(axis)]
    fitting = any(_nearest(kind, axis)[1].fits for axis in levels)
    return [] if fitting else [axis for axis in levels if role(axis) in ("level", "sigma")]


def _sloping(dataset: Any, dim: str) -> list[Any]:
    """Return the mean of a vertical coordinate of a dimension that differs from place to place."""
    if dim in dataset.variables and dataset[dim].ndim == 2 and is_level(dataset[dim]):
        other = next(name for name in dataset[dim].dims if name != dim)
        return [dataset[dim].mean(other, keep_attrs=True)]
    return []


def _selected(variable: Any, dim: str, found: list[Any], value: Any) -> int:
    """Return the index of a value along a dimension; without a coordinate, the value."""
    own = next((axis for axis in found if axis.name == dim), found[0] if found else None)
    values = np.arange(variable.sizes[dim]) if own is None else np.atleast_1d(own.values)
    matches = [i for i, found_value in enumerate(values.tolist()) if _equal(found_value, value)]
    if len(matches) != 1:
        shown = ", ".join(map(str, values[:8].tolist())) + (", ..." if len(values) > 8 else "")
        raise Unfit(f"select must have one of the values of {dim}, {shown}, got {value}")
    return matches[0]


def _equal(known: Any, value: Any) -> bool:
    try:
        return abs(float(known) - float(value)) <= 1e-4 * max(abs(float(value)), 1.0)
    except (TypeError, ValueError):
        return str(known) == str(value) or _is_same_time(str(known), str(value))


def _is_same_time(known: str, value: str) -> bool:
    try:
        return seconds(known) == seconds(value)
    except ValueError:
        return False


def _nearest(kind: Kind, coordinate: Any) -> tuple[int, Level]:
    """Return the index of the level nearest to the wanted one, and whether that fits."""
    values, meaning = metres(coordinate), role(coordinate)
    if not np.isfinite(values).all():
        return 0, Level(False, f"{coordinate.name} without values")
    raw = np.atleast_1d(coordinate.values)[:8]
    shown = f"{coordinate.name} {', '.join(f'{value:g}' for value in raw)}"
    shown += ", ..." if len(values) > 8 else ""
    units = str(coordinate.attrs.get("units", ""))
    shown = f"{shown} {units}".rstrip()
    index, fits = 0, False
    if kind == "wind" and meaning == "height":
        index = int(np.abs(values - WIND_HEIGHT_M).argmin())
        fits = bool(abs(values[index] - WIND_HEIGHT_M) < 0.5)
    elif kind != "wind" and meaning == "seabed":
        index, fits = int(values.argmax()), True
    elif kind != "wind" and (
        meaning in ("depth", "sigma") or (meaning == "height" and values.max() <= 0.0)
    ):
        index = int(np.abs(values).argmin())
        limit = LOWEST_SIGMA if meaning == "sigma" else DEEPEST_M
        fits = bool(abs(values[index]) <= limit)
    # A level of one value whose kind only its name states, such as lev, contradicts no other name.
    stated = coordinate.attrs.get("standard_name") or units.lower() in PRESSURES
    if len(values) == 1 and str(coordinate.name).lower() in _ANONYMOUS and not stated:
        return index, Level(fits, shown, ("", float(values[index])))
    return index, Level(fits, shown, (meaning, float(values[index])))


def _bywords(kind: Kind, variable: Any, level: Level) -> Level:
    """Return the level that the names of a wind state where its coordinates do not."""
    if kind != "wind" or level.fits:
        return level
    if level.fits is False and level.at[:1] != ("",):
        # Its own coordinate counts more than a name such as u10.
        return level
    of_grib = variable.attrs.get("GRIB_typeOfLevel", "surface")
    if level.fits is None and of_grib not in ("surface", "heightAboveGround", "meanSea"):
        return Level(False, str(of_grib), str(of_grib))
    text = f"{words(variable)} {variable.name}".lower()
    height = _HEIGHT.search(text) or re.fullmatch(r"[uv]_?(\d+)|(\d+)[uv]", text.split()[-1])
    if height:
        value = float(next(filter(None, height.groups())))
        if abs(value - WIND_HEIGHT_M) < 0.5:
            return Level(True, "10 m", "10 m")
        return Level(False, level.shown or f"{value:g} m", f"{value:g} m")
    elsewhere = _OTHER_LEVEL.search(text)
    return Level(False, elsewhere[0], elsewhere[0]) if level.fits is None and elsewhere else level
