# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""GRIB files, editions 1 and 2, by ecCodes (extra `grib`).

The messages are indexed once by their keys. Values are unpacked when they are read, and places are
those that ecCodes computes for each value.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.extras import pip_install
from dsse_ros.world.drift.flow import seconds, utc
from dsse_ros.world.drift.netcdf import MAX_AT_ONCE, Unfit

MAX_MESSAGES = 100_000
UV_ALONG_GRID = "uvRelativeToGrid"
"""Key that is 1 for components along the axes of the grid."""
RUN = "run"
"""Coordinate with the time at which a forecast was made."""
_SPEEDS = ("m s**-1", "m s-1", "m/s", "~", "unknown")
"""Units of velocities, and of parameters that ecCodes does not know."""
_OF_ALL_MEMBERS = (2, 3, 4, 5, 7, 8, 9)
"""Forecasts derived from an ensemble that are no velocities, such as its spread (table 4.7)."""
_PROBABILITIES = (5, 6, 9, 10)
"""Templates of products that are no velocities, such as percentiles (table 4.0)."""
_AS_STORED = ("regular_ll", "rotated_ll", "regular_gg", "rotated_gg")
_SCANS = ("jPointsAreConsecutive", "alternativeRowScanning", "iScansNegatively")
_MISSING = -1e34
_AXES: dict[str, dict[str, str]] = {
    "heightAboveGround": {"units": "m", "positive": "up", "standard_name": "height"},
    "heightAboveSea": {"units": "m", "positive": "up", "standard_name": "height"},
    "depthBelowSea": {"units": "m", "positive": "down", "standard_name": "depth"},
    "isobaricInhPa": {"units": "hPa", "standard_name": "air_pressure"},
    "isobaricInPa": {"units": "Pa", "standard_name": "air_pressure"},
}
"""Attributes of coordinates by the type of their level; the names of others state it."""

Array = NDArray[np.float64]


class _Message(NamedTuple):
    """Where a message is, and what it has.

    Attributes:
        offset: Bytes before it in the file.
        part: Number of its field; a message of GRIB 2 may have several.
        name: CF or short name of the parameter.
        about: Attributes of its variable.
        level_type: Type of its level.
        level: Its level.
        member: Number in an ensemble, 0 without one.
        run_s: When the forecast was made, in seconds since 1970-01-01 UTC.
        valid_s: What it is for.
        grid: Digest of its grid.
        is_instant: Whether it is for one time, not over a period.
    """

    offset: int
    part: int
    name: str
    about: Mapping[str, Any]
    level_type: str
    level: float
    member: int
    run_s: int
    valid_s: int
    grid: str
    is_instant: bool


def open_grib(path: str | os.PathLike[str], select: Mapping[str, Any] | None = None) -> list[Any]:
    """Return the velocities of a file as `xarray` data sets, one for each kind of level.

    Args:
        path: The file.
        select: `run` chooses the forecasts made at this time; of several, the last one that has a
            time counts.

    Raises:
        Unfit: If it cannot be read, or ecCodes is missing.
    """
    try:
        import eccodes
    except ModuleNotFoundError as error:
        raise Unfit(f"{error.name} is missing; {pip_install('grib')}") from None
    try:
        messages = _of_run(_index(path), None if select is None else select.get(RUN))
        groups: dict[Any, dict[str, list[_Message]]] = {}
        for message in messages:
            group = groups.setdefault((message.level_type, message.grid), {})
            group.setdefault(message.name, []).append(message)
        grids: dict[str, _Grid] = {}
        return [
            part for group in groups.values() for part in _datasets(path, _instant(group), grids)
        ]
    except (EOFError, OSError, eccodes.CodesInternalError) as error:
        raise _unreadable(error) from None


def _unreadable(error: Exception) -> Unfit:
    return Unfit(f"file must be GRIB: {' '.join(str(error).split())[:200]}")


def _index(path: str | os.PathLike[str]) -> list[_Message]:
    """Return the messages that may be velocities."""
    import eccodes

    found: list[_Message] = []
    others: dict[str, None] = {}
    count, offset, part = 0, -1, 0
    with open(path, "rb") as file, _several_fields(file):
        for message in _messages(file):
            at = eccodes.codes_get_long(message, "offset")
            offset, part = at, part + 1 if at == offset else 0
            points = eccodes.codes_get_long(message, "numberOfDataPoints")
            if points > MAX_AT_ONCE:
                raise Unfit(f"a field must have at most {MAX_AT_ONCE} values, got {points}")
            count += 1
            if count > MAX_MESSAGES:
                raise Unfit(f"file must have at most {MAX_MESSAGES} fields")
            if _is_velocity(message):
                found.append(_described(message, offset, part))
            else:
                others[_get(message, "shortName")] = None
    if not count:
        raise Unfit("file must have fields, got none")
    if not found:
        raise Unfit(f"file must have velocities, got {', '.join(others)[:300]}")
    return found


@contextmanager
def _several_fields(file: Any) -> Iterator[None]:
    """Let ecCodes read each field of a message, from a clean state."""
    import eccodes

    eccodes.codes_grib_multi_support_on()
    eccodes.codes_grib_multi_support_reset_file(file)
    try:
        yield
    finally:
        eccodes.codes_grib_multi_support_off()


def _messages(file: Any) -> Iterator[Any]:
    import eccodes

    while (message := eccodes.codes_grib_new_from_file(file)) is not None:
        try:
            yield message
        finally:
            eccodes.codes_release(message)


def _get(message: Any, key: str, other: Any = None, kind: type | None = None) -> Any:
    """Return a key of a message, `other` if it has none."""
    import eccodes

    try:
        return eccodes.codes_get(message, key, kind)
    except eccodes.CodesInternalError:
        return other


def _is_velocity(message: Any) -> bool:
    return (
        _get(message, "units") in _SPEEDS
        and _get(message, "derivedForecast", 0) not in _OF_ALL_MEMBERS
        and _get(message, "productDefinitionTemplateNumber", 0) not in _PROBABILITIES
    )


def _name(message: Any) -> str:
    """Return the CF name of a variable, or the short name."""
    names = (_get(message, key) for key in ("cfVarName", "shortName"))
    known = (name for name in names if name not in (None, "unknown", "undef"))
    return next(known, f"paramId_{_get(message, 'paramId')}")


def _described(message: Any, offset: int, part: int) -> _Message:
    about = {"units": _get(message, "units"), "long_name": _get(message, "name")}
    about["standard_name"] = _get(message, "cfName")
    known = {key: value for key, value in about.items() if value not in (None, "unknown", "~")}
    known[f"GRIB_{UV_ALONG_GRID}"] = _get(message, UV_ALONG_GRID, kind=int)
    known["GRIB_typeOfLevel"] = level_type = str(_get(message, "typeOfLevel", "unknown"))
    return _Message(
        offset,
        part,
        _name(message),
        known,
        level_type,
        float(_get(message, "level", 0.0, float)),
        _get(message, "number", 0, int),
        _seconds(message, "dataDate", "dataTime"),
        _seconds(message, "validityDate", "validityTime"),
        str(_get(message, "md5GridSection")),
        _get(message, "stepType") == "instant",
    )


def _seconds(message: Any, date_key: str, time_key: str) -> int:
    """Return a time of a message in seconds since 1970-01-01 UTC."""
    date, time = (_get(message, key, -1, int) for key in (date_key, time_key))
    text = f"{date:08d}T{time:04d}"
    try:
        return int(seconds(f"{text[:4]}-{text[4:6]}-{text[6:11]}:{text[11:]}"))
    except ValueError:
        raise Unfit(f"fields must have a {date_key} and {time_key}, got {date} {time}") from None


def _of_run(messages: list[_Message], run: Any) -> list[_Message]:
    """Return the messages of a run, or of each time those of the last run that has it."""
    if run is None:
        last: dict[Any, _Message] = {}
        for message in messages:
            key = message.name, *message[4:7], message.valid_s, *message[9:]
            if key not in last or last[key].run_s <= message.run_s:
                last[key] = message
        return list(last.values())
    runs = sorted({message.run_s for message in messages})
    try:
        wanted = seconds(str(run))
    except ValueError:
        wanted = None
    if wanted not in runs:
        shown = ", ".join(map(utc, runs[:8])) + (", ..." if len(runs) > 8 else "")
        raise Unfit(f"select must have one of the values of run, {shown}, got {run}")
    return _of_run([message for message in messages if message.run_s == wanted], None)


def _instant(group: dict[str, list[_Message]]) -> dict[str, list[_Message]]:
    """Return the messages for one time, where a parameter has means over a period, too."""
    return {
        name: [message for message in messages if message.is_instant] or messages
        for name, messages in group.items()
    }


def _datasets(
    path: str | os.PathLike[str], group: dict[str, list[_Message]], grids: dict[str, _Grid]
) -> Iterator[Any]:
    """Yield the parameters of one grid and kind of level, one data set for the same levels."""
    import xarray

    by_axes: dict[Any, dict[str, list[_Message]]] = {}
    for name, messages in group.items():
        levels, members = ({message[at] for message in messages} for at in (5, 6))
        by_axes.setdefault((frozenset(levels), frozenset(members)), {})[name] = messages
    for (levels, members), parameters in by_axes.items():
        every = [message for messages in parameters.values() for message in messages]
        grid = grids.get(every[0].grid)
        if grid is None:
            grid = grids[every[0].grid] = _grid(path, every[0])
            if sum(g.lat.size for g in grids.values()) > MAX_AT_ONCE:
                raise Unfit(f"grids must have at most {MAX_AT_ONCE} points")
        kind = every[0].level_type
        axes = {"number": sorted(members), kind: sorted(levels)}
        axes["valid_time"] = sorted({message.valid_s for message in every})
        coordinates = {
            name: xarray.Variable(
                () if len(values) == 1 and name != "valid_time" else (name,),
                values[0] if len(values) == 1 and name != "valid_time" else values,
            )
            for name, values in axes.items()
        }
        coordinates[kind].attrs = _AXES.get(kind, {})
        coordinates["valid_time"].attrs = {
            "standard_name": "time", "units": "seconds since 1970-01-01",
        }  # fmt: skip
        coordinates |= grid.coordinates()
        runs = {message.run_s for message in every}
        if len(runs) == 1:
            coordinates[RUN] = xarray.Variable((), utc(runs.pop()))
        header = [name for name in axes if coordinates[name].dims]
        variables = {}
        for name, messages in parameters.items():
            places = {}
            for message in messages:
                values = dict(
                    zip(axes, (message.member, message.level, message.valid_s), strict=True)
                )
                places[tuple(axes[axis].index(values[axis]) for axis in header)] = message
            shape = *(len(axes[axis]) for axis in header), *grid.shape
            lazy = _lazy(path, places, shape, grid)
            variables[name] = xarray.Variable((*header, *grid.dims), lazy, messages[0].about)
        yield xarray.Dataset(variables, coordinates)


class _Grid(NamedTuple):
    """The places of a grid.

    Attributes:
        dims: Names of its dimensions.
        shape: Their sizes.
        lat: Latitudes, (J, I), (J,) or (N,).
        lon: Longitudes.
        order: How its messages have their values.
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    lat: Array
    lon: Array
    order: _Order

    def coordinates(self) -> dict[str, Any]:
        """Latitudes and longitudes as variables."""
        import xarray

        dims = [self.dims, self.dims] if self.lat.shape == self.shape else [(d,) for d in self.dims]
        return {
            name: xarray.Variable(own, values, {"standard_name": name, "units": units})
            for name, own, values, units in zip(
                ("latitude", "longitude"), dims, (self.lat, self.lon),
                ("degrees_north", "degrees_east"), strict=True,
            )
        }  # fmt: skip


class _Order(NamedTuple):
    """The order of the values of a message.

    Attributes:
        as_stored: Whether ecCodes has places in the order in which the values are stored, as on
            grids without a projection; it brings both to rows and columns along the axes on others.
        by_columns: Whether one column is stored after the other.
        alternates: Whether every other row is stored backwards, which ecCodes has as if it was not.
        flips: Whether columns are stored against the x axis.
    """

    as_stored: bool
    by_columns: bool
    alternates: bool
    flips: bool

    def arranged(self, values: Array, shape: Sequence[int], alternates: bool) -> Array:
        """Return values, or places, as rows and columns, with columns along the x axis."""
        if len(shape) == 1 or not self.as_stored:
            return values.reshape(shape)
        rows = values.reshape(shape[::-1] if self.by_columns else shape)
        if alternates:
            rows = rows.copy()
            rows[1::2] = rows[1::2, ::-1]
        rows = rows.T if self.by_columns else rows
        return rows[:, ::-1] if self.flips else rows


def _grid(path: str | os.PathLike[str], about: _Message) -> _Grid:
    """Return the grid of a message."""
    import eccodes

    with _message_at(path, about) as message:
        kind, points = _get(message, "gridType"), eccodes.codes_get_long(message, "numberOfPoints")
        shape = tuple(_get(message, key, 0, int) for key in ("Ny", "Nx"))
        order = _Order(kind in _AS_STORED, *(bool(_get(message, key, 0, int)) for key in _SCANS))
        try:
            lat, lon = (
                eccodes.codes_get_array(message, key) for key in ("latitudes", "longitudes")
            )
        except eccodes.CodesInternalError:
            raise Unfit(f"grid must have places in the file, got {kind}") from None
        is_projected = not order.as_stored and min(shape) > 1
        from_north = not _get(message, "jScansPositively", 1, int)
        if is_projected and (order.flips or from_north or (order.by_columns and order.alternates)):
            # ecCodes has wrong places for these.
            raise Unfit(f"grid {kind} must have its rows from the south and columns to the east")
    if lat.size != points or lon.size != points:
        raise Unfit(f"grid must have a place for each of its {points} values, got {lat.size}")
    if min(shape) < 2 or shape[0] * shape[1] != points:
        return _Grid(("values",), (points,), lat, lon, order)
    lat, lon = (order.arranged(values, shape, False) for values in (lat, lon))
    if (lat == lat[:, :1]).all() and (lon == lon[:1]).all():
        return _Grid(("latitude", "longitude"), shape, lat[:, 0].copy(), lon[0].copy(), order)
    return _Grid(("y", "x"), shape, lat, lon, order)


@contextmanager
def _message_at(path: str | os.PathLike[str], about: _Message) -> Iterator[Any]:
    """Open a message."""
    with open(path, "rb") as file:
        file.seek(about.offset)
        with _several_fields(file):
            for number, message in enumerate(_messages(file)):
                if number == about.part:
                    yield message
                    return
    raise Unfit("file must not change while it is read")


def _lazy(
    path: str | os.PathLike[str], places: dict[Any, _Message], shape: tuple[int, ...], grid: _Grid
) -> Any:
    """Return an array (..., *grid) that xarray reads message by message.

    Args:
        path: The file.
        places: Messages by their indices along the dimensions before those of the grid.
        shape: Shape of the array.
        grid: The grid.
    """
    from xarray.backends import BackendArray
    from xarray.core import indexing

    class Values(BackendArray):
        """The values of a parameter, NaN where there are none."""

        def __init__(self) -> None:
            self.shape, self.dtype = shape, np.dtype(np.float32)

        def __getitem__(self, key: Any) -> Any:
            return indexing.explicit_indexing_adapter(
                key, shape, indexing.IndexingSupport.BASIC, self._read
            )

        def _read(self, key: tuple[Any, ...]) -> NDArray[np.float32]:
            header = len(shape) - len(grid.shape)
            chosen = [np.arange(n)[part] for n, part in zip(shape, key[:header], strict=False)]
            sides = tuple(np.ndim(part) for part in chosen)
            lists = [np.atleast_1d(part).tolist() for part in chosen]
            area = key[header:]
            part = np.empty(grid.shape, np.bool_)[area].shape
            found = np.full((*(len(numbers) for numbers in lists), *part), np.nan, np.float32)
            for at in np.ndindex(*found.shape[:header]):
                index = tuple(numbers[i] for numbers, i in zip(lists, at, strict=True))
                if index in places:
                    found[at] = _values(path, places[index], grid)[area]
            return found.reshape(
                *(len(n) for n, side in zip(lists, sides, strict=True) if side), *part
            )

    return indexing.LazilyIndexedArray(Values())


def _values(path: str | os.PathLike[str], about: _Message, grid: _Grid) -> Array:
    """Return the values of a message in the shape of its grid, NaN where there are none."""
    import eccodes

    try:
        with _message_at(path, about) as message:
            eccodes.codes_set(message, "missingValue", _MISSING)
            if grid.order.as_stored or len(grid.shape) == 1:
                values = eccodes.codes_get_values(message)
            else:
                values = eccodes.codes_get_array(message, "latLonValues")[2::3]
    except eccodes.CodesInternalError as error:
        raise _unreadable(error) from None
    values = np.where(values == _MISSING, np.nan, values)
    return grid.order.arranged(values, grid.shape, grid.order.alternates)
