# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which two variables of a file are the wind at 10 m, or current or Stokes drift at the surface.

`flow_names.csv` has the CF standard names and common names of the two components in the order of
preference, and whether they point to the east and north (`earth`) or along the axes of their grid
(`grid`). Neither is stated for names that models use differently.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

from dsse_ros.world.drift.flow import Kind
from dsse_ros.world.drift.levels import WIND_HEIGHT_M, Level, sliced, words
from dsse_ros.world.drift.netcdf import Unfit

_FILE = Path(__file__).with_name("flow_names.csv")
_WORDS = {
    "current": ("sea_water", "sea water", "ocean", "current"),
    "wind": ("wind", "air_velocity"),
    "ice": ("sea_ice", "sea ice", "ice velocity"),
    "waves": ("stokes", "sea_surface_wave"),
}
"""Words of standard names and long names by what moves."""
_PART = re.compile(
    r"due_to|tide|geostrophic|barotropic|sea_floor|seabed|bottom|depth.?(mean|average)"
    r"|vertical(ly)?.(mean|averag|integrat)"
)
"""A part of the current, or its mean over the depth."""
_SIDES = re.compile(r"eastward|northward|east|north|zonal|meridional|ew|ns|zo|me|[uvxy]")

Axes = Literal["earth", "grid", ""]


class Choice(NamedTuple):
    """What a scenario states about the variables of a file.

    Attributes:
        variables: Names of the components to the east and to the north; empty to find them.
        select: Values of dimensions other than time and place, such as a depth or an ensemble
            member.
        units: Units of both variables, which count more than those of the file; "" if not stated.
        axes: Whether they point to the east and north or along their grid, "" if not stated.
        constant_s: Seconds before and after the only time of a file for which it counts, 0 for
            none.
    """

    variables: tuple[str, ...] = ()
    select: Mapping[str, Any] = {}
    units: str = ""
    axes: Axes = ""
    constant_s: float = 0.0


ANY = Choice()
"""Find the variables; nothing is to be selected."""


class Pair(NamedTuple):
    """The two components of a velocity, at one level.

    Attributes:
        east: `xarray` variable of the component to the east, or along the rows of its grid.
        north: The other one.
        axes: Which of them; "" if unknown.
        note: Which other pairs and units the file has, "" for none.
    """

    east: Any
    north: Any
    axes: Axes
    note: str = ""

    @property
    def names(self) -> str:
        """Both names, for messages."""
        return f"{self.east.name} and {self.north.name}"


class _Row(NamedTuple):
    """A row of the table of names."""

    medium: str
    found_by: str
    east: str
    north: str
    axes: Axes


class _Candidate(NamedTuple):
    """A pair, the number of its row, its level and its data set."""

    rank: int
    pair: Pair
    level: Level
    dataset: Any

    @property
    def shown(self) -> str:
        """Names and levels, for messages."""
        return f"{self.pair.names} at {self.level.shown or 'no stated level'}"


@lru_cache(maxsize=1)
def _rows() -> tuple[_Row, ...]:
    with _FILE.open(encoding="utf-8", newline="") as file:
        return tuple(_Row._make(row.values()) for row in csv.DictReader(file))


def find_pair(dataset: Any, kind: Kind, choice: Choice) -> Pair:
    """Return the wind at 10 m, or the current or the Stokes drift at the surface.

    Args:
        dataset: The file as an `xarray.Dataset`, with times as numbers.
        kind: Which of them.
        choice: What the scenario states.

    Raises:
        Unfit: If the file has no such pair, or several that nothing distinguishes.
    """
    return find_among([dataset], kind, choice)[1]


def find_among(datasets: Sequence[Any], kind: Kind, choice: Choice) -> tuple[Any, Pair]:
    """Return `find_pair` of a file of several data sets, with the data set that has it."""
    found: list[_Candidate] = []
    failures, lacks = [], []
    for dataset in datasets:
        try:
            ranked = (
                _stated(dataset, kind, choice)
                if choice.variables
                else _named(dataset, kind, choice)
            )
        except Unfit as unfit:
            lacks.append(unfit)
            continue
        for rank, pair in ranked:
            try:
                found.append(_at_level(dataset, kind, choice, rank, pair))
            except Unfit as unfit:
                failures.append(unfit)
    if not found:
        raise next(iter((*failures, *lacks)), Unfit(_nothing(datasets[0], kind)))
    best = _best(kind, found)
    return best.dataset, best.pair


def half(dataset: Any, kind: Kind, choice: Choice) -> Any | None:
    """Return the component of a file that lacks the other one; None for any other file."""
    if choice.variables:
        sides = [[dataset[name]] if name in dataset.variables else [] for name in choice.variables]
    else:
        every, rows = _variables(dataset, kind), _rows_of(kind)
        sides = [
            [variable for variable in every if any(_is_of(variable, row, side) for row in rows)]
            for side in ("east", "north")
        ]
    east, north = sides
    return next(iter(east or north), None) if not (east and north) else None


def _best(kind: Kind, found: list[_Candidate]) -> _Candidate:
    """Return the candidate at the wanted level."""
    fitting = [candidate for candidate in found if candidate.level.fits]
    if not fitting and all(candidate.level.fits is None for candidate in found):
        fitting = found
    if not fitting:
        wanted = f"{WIND_HEIGHT_M:g} m above ground" if kind == "wind" else "the surface"
        shown = "; ".join(candidate.shown for candidate in found)
        raise Unfit(f"{kind} must be at {wanted}, got {shown}; choose by variables or select")
    best = min(candidate.rank for candidate in fitting)
    first, *more = [candidate for candidate in fitting if candidate.rank == best]
    if more:
        names = "; ".join(candidate.shown for candidate in (first, *more))
        raise Unfit(f"{kind} must be one pair of variables, got {names}; choose by variables")
    others = [candidate.pair.names for candidate in fitting if candidate is not first]
    notes = [first.pair.note] if first.pair.note else []
    notes += [f"takes {first.pair.names}, not {', '.join(others)}"] if others else []
    note = " and ".join(notes)
    return first._replace(pair=first.pair._replace(note=note))


def _stated(dataset: Any, kind: Kind, choice: Choice) -> list[tuple[int, Pair]]:
    """Return the pair that a scenario names.

    Raises:
        Unfit: If the file does not have it, or it is of another medium.
    """
    for name in choice.variables:
        if name not in dataset.variables:
            raise Unfit(f"file must have the variable {name}, got {_all(dataset)}")
        if _medium(dataset[name]) not in (kind, ""):
            raise Unfit(f"{name} must be a {kind}, got {_described(dataset[name])}")
    east, north = (dataset[name] for name in choice.variables)
    row = next((row for row in _rows_of(kind) if _is_of(east, row, "east")), None)
    return [(0, Pair(east, north, "" if row is None else row.axes))]


def _named(dataset: Any, kind: Kind, choice: Choice) -> list[tuple[int, Pair]]:
    """Return the pairs of the table that a file has, with the numbers of their rows."""
    found: dict[str, tuple[int, Pair]] = {}
    for rank, row in enumerate(_rows_of(kind)):
        sides = [
            [variable for variable in _variables(dataset, kind) if _is_of(variable, row, side)]
            for side in ("east", "north")
        ]
        for east, north in product(*sides):
            pair = Pair(east, north, row.axes)
            if _belong_together(east, north, choice):
                found.setdefault(pair.names, (rank, pair))
    return list(found.values())


def _rows_of(kind: Kind) -> list[_Row]:
    return [row for row in _rows() if row.medium == kind]


def _variables(dataset: Any, kind: Kind) -> list[Any]:
    """Return the variables of a medium, or of none that is stated."""
    every = [dataset[name] for name, variable in dataset.variables.items() if variable.ndim]
    return [
        variable
        for variable in every
        if _medium(variable) in (kind, "") and not _PART.search(words(variable))
    ]


def _is_of(variable: Any, row: _Row, side: str) -> bool:
    """Return whether a variable has a name of the table."""
    by_standard_name = row.found_by == "standard_name"
    name = variable.attrs.get("standard_name", "") if by_standard_name else variable.name
    return str(name).lower() == getattr(row, side)


def _medium(variable: Any) -> str:
    """Return what moves by the standard name, or else the long name; "" if neither states it."""
    for name in ("standard_name", "long_name"):
        text = str(variable.attrs.get(name, "")).lower()
        media = [medium for medium, words in _WORDS.items() if any(word in text for word in words)]
        if len(media) == 1:
            return media[0]
    return ""


def _belong_together(east: Any, north: Any, choice: Choice) -> bool:
    """Return whether two components have the same name but for their side, and the same form."""
    stems = {_SIDES.sub("*", str(component.name).lower()) for component in (east, north)}
    units = {
        choice.units or str(component.attrs.get("units", "")).strip() for component in (east, north)
    }
    return len(stems) == len(units) == 1 and east.ndim == north.ndim


def _nothing(dataset: Any, kind: Kind) -> str:
    """Return why a file has no pair, with the variables that come nearest."""
    rows = _rows_of(kind)
    every = [dataset[name] for name in dataset.variables]
    near = [
        f"{variable.name} ({_described(variable)})"
        for variable in every
        if any(_is_of(variable, row, side) for row in rows for side in ("east", "north"))
    ]
    cf = next(row for row in rows if (row.found_by, row.axes) == ("standard_name", "earth"))
    return (
        f"file must have a pair of variables such as {cf.east} and {cf.north}, got "
        f"{', '.join(near) or _all(dataset)}; choose by variables"
    )


def _described(variable: Any) -> str:
    words = (variable.attrs.get(name) for name in ("standard_name", "long_name", "units"))
    return next((str(word) for word in words if word), "without a description")


def _all(dataset: Any) -> str:
    names = ", ".join(map(str, dataset.variables)) or "none"
    return names if len(names) <= 300 else names[:297] + "..."


def _may_select(name: str, component: Any) -> bool:
    """Return whether a variable has this dimension, or a coordinate of one value."""
    return name in component.dims or (name in component.coords and not component.coords[name].ndim)


def _at_level(dataset: Any, kind: Kind, choice: Choice, rank: int, pair: Pair) -> _Candidate:
    """Return a pair at the wanted level, or at that of the file.

    Raises:
        Unfit: If its components differ, or a dimension is left that nothing selects.
    """
    for name in choice.select:
        # Components may have dimensions of their own, such as depthu and depthv.
        if not any(_may_select(name, component) for component in pair[:2]):
            dims = ", ".join(dict.fromkeys(map(str, (*pair.east.dims, *pair.north.dims))))
            raise Unfit(f"select must name dimensions of {pair.names}, {dims}, got {name}")
    east, level = sliced(dataset, kind, choice.select, pair.east)
    north, other = sliced(dataset, kind, choice.select, pair.north)
    if (level.fits, level.at) != (other.fits, other.at):
        raise Unfit(
            f"{pair.names} must be at one level, got {level.shown or 'none stated'} and "
            f"{other.shown or 'none stated'}"
        )
    # Who names two variables knows their level, unless they have several.
    if choice.variables and east.ndim == pair.east.ndim:
        level = level._replace(fits=True)
    note = ""
    for variable in (east, north):
        if choice.units:
            stated = str(variable.attrs.get("units", "")).strip()
            if stated not in ("", choice.units):
                note = f"has {pair.names} in {choice.units}, not in {stated}"
            variable.attrs["units"] = choice.units
    # GRIB states it, whatever the names.
    of_grib: dict[Any, Axes] = {0: "earth", 1: "grid"}
    axes = choice.axes or of_grib.get(pair.east.attrs.get("GRIB_uvRelativeToGrid"), pair.axes)
    return _Candidate(
        rank, pair._replace(east=east, north=north, axes=axes, note=note), level, dataset
    )
