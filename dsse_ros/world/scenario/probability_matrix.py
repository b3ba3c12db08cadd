# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A given probability matrix: an array, or a file (.npy, CSV or GeoTIFF)."""

from __future__ import annotations

import csv
import dataclasses
import logging
import math
import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.array_files import check_numbers, read_npy
from dsse_ros.world.scenario.limits import MAX_SIDE
from dsse_ros.world.scenario.rasters import Raster, raster_of_grid
from dsse_ros.world.scenario.scenario_array import ScenarioArray, frozen

if TYPE_CHECKING:
    from typing_extensions import Self

    from dsse_ros.world.scenario.geodesy import Origin

NAME = "probability_matrix"
ALLOWED = (
    f"a matrix of finite numbers >= 0, not all 0, at most {MAX_SIDE} a side, or a file of "
    "one: .npy, .csv, .tif or .tiff"
)

_LONGEST_LINE = 32 * MAX_SIDE
"""Characters of a line in a CSV file; a float64 takes 25."""

OFF_GRID = 0.001
"""Share of the probability off the grid from which on the log has it."""
_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProbabilityMatrix(ScenarioArray):
    """A matrix (R, C) [row, col] with row 0 in the north.

    Attributes:
        raster: Where its cells lie; None for those of the grid.
    """

    raster: Raster | None = field(compare=False)

    NAME = NAME
    ALLOWED = ALLOWED

    @classmethod
    def _made(cls, path: str, array: NDArray[Any], raster: Raster | None = None) -> Self:
        check_numbers(array.dtype)
        if raster is None:
            _check_shape(array.shape)
        _check_values(array)
        digest, values = frozen(array)
        return cls(digest, path, values, raster)

    def on_grid(self, grid: GridShape, cell_size_m: float, origin: Origin) -> Self:
        """See `ScenarioArray`; a raster with other cells is resampled, and its sum is kept.

        Raises:
            FieldError: If it has another number of cells, or nothing on the grid.
        """
        if self.raster is None:
            return super().on_grid(grid, cell_size_m, origin)
        of_grid = raster_of_grid(grid, cell_size_m, origin)
        if self.grid == grid and self.raster.is_near(of_grid, grid):
            return dataclasses.replace(self, raster=None)
        values = self.raster.resampled(self.values, of_grid, grid)
        if not values.any():
            raise FieldError(
                f"{NAME} must be on the grid of origin_lat, origin_lon and cell_size, got "
                f"{self.source} elsewhere"
            )
        _LOGGER.info("%s: %s of %s cells is resampled on the grid", NAME, self.source, self.grid)
        off = 1.0 - float(values.sum() / self.values.sum())
        if off > OFF_GRID:
            _LOGGER.warning("%s: %.1f %% of %s is off the grid", NAME, 100 * off, self.source)
        values.flags.writeable = False
        return dataclasses.replace(self, values=values, raster=None)


_Read = tuple[NDArray[Any], Raster | None]


def _check_shape(shape: tuple[int, ...]) -> None:
    """Raise unless this shape is allowed, before any memory is allocated."""
    if len(shape) != 2:
        raise ValueError(f"it has {len(shape)} axes, not two")
    if not all(1 <= size <= MAX_SIDE for size in shape):
        raise ValueError(f"it has {shape[0]} rows and {shape[1]} columns")


def _check_values(array: NDArray[Any]) -> None:
    """Raise for the first cell whose value is not allowed.

    Raises:
        ValueError: If there is one, or all are 0.
    """
    # This form of the comparison also finds NaN.
    wrong = ~((array >= 0) & np.isfinite(array))
    if wrong.any():
        row, col = np.argwhere(wrong)[0]
        raise ValueError(f"row {row + 1}, column {col + 1} is {float(array[row, col]):g}")
    if not array.any():
        raise ValueError("all its values are 0")


def _read_npy(path: str) -> _Read:
    return read_npy(path, _check_shape), None


def _read_csv(path: str) -> _Read:
    rows: list[NDArray[np.float64]] = []
    with open(path, newline="", encoding="utf-8-sig") as file:
        for line, row in enumerate(csv.reader(_lines(file)), start=1):
            if row:
                rows.append(np.array([_number(value, line) for value in row]))
                if len(rows) > MAX_SIDE:
                    raise ValueError(f"it has more than {MAX_SIDE} rows")
                if len(rows[-1]) != len(rows[0]):
                    raise ValueError(
                        f"line {line} has {len(rows[-1])} values, the first one {len(rows[0])}"
                    )
    return np.array(rows), None


def _number(value: str, line: int) -> float:
    """Return the number of a cell in a CSV file."""
    try:
        return float(value)
    except ValueError:
        other = next((mark for mark in (";", "\t", " ") if mark in value.strip()), "")
        reason = f"; values are separated by commas, not by {other!r}" if other else ""
        raise ValueError(f"line {line} has {shown(value)}{reason}") from None


def _lines(file: TextIO) -> Iterator[str]:
    """Yield the lines of a CSV file, none longer than those of the largest matrix."""
    while line := file.readline(_LONGEST_LINE):
        if len(line) == _LONGEST_LINE:
            raise ValueError(f"a line has {_LONGEST_LINE} characters or more")
        yield line


def _read_tiff(path: str) -> _Read:
    """Return the first band, north up, 0 where it has no data, and where its cells lie."""
    try:
        import rasterio
    except ModuleNotFoundError:
        raise FieldError(
            f"{NAME}: {shown(path)} needs rasterio; {pip_install('geotiff')}"
        ) from None
    # Raise the usual error for a missing file; that of rasterio differs.
    os.stat(path)
    try:
        with warnings.catch_warnings():
            # A file without georeference is allowed.
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            raster = rasterio.open(path)
        with raster:
            # rasterio reads a block as a whole, even if it is larger than the image.
            if max(math.prod(raster.shape), math.prod(raster.block_shapes[0])) > MAX_SIDE**2:
                raise ValueError(f"it has {raster.shape[0]} x {raster.shape[1]} cells")
            values, place = raster.read(1, masked=True).filled(0), raster.transform
            crs = raster.crs
    except rasterio.errors.RasterioError as error:
        raise ValueError(reason_of(error)) from None
    if crs is None and (place.b or place.d):
        raise FieldError(f"{NAME} must have its rows from west to east, got {shown(path)}")
    a, b, c, d, e, f = place[:6]
    rows, cols = values.shape
    # Rows from the south are those of a transform that is no mere numbering.
    if e > 0 and not place.is_identity:
        values, (b, c, e, f) = values[::-1], (-b, c + b * rows, -e, f + e * rows)
    if a < 0:
        values, (a, c, d, f) = values[:, ::-1], (-a, c + a * cols, -d, f + d * cols)
    values = np.ascontiguousarray(values)
    if crs is None:
        return values, None
    where = Raster(crs, rasterio.Affine(a, b, c, d, e, f))
    if not where.is_on_earth((rows, cols)):
        raise FieldError(f"{NAME} must have its corners on the Earth, got {shown(path)}")
    return values, where


ProbabilityMatrix.READERS = {
    ".npy": _read_npy,
    ".csv": _read_csv,
    ".tif": _read_tiff,
    ".tiff": _read_tiff,
}
