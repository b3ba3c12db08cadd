# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The transition probabilities of a Markov chain on the grid: an array, or a file (.npy, .npz)."""

from __future__ import annotations

import math
import zipfile
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.world.scenario.array_files import array_header, check_numbers, read_npy
from dsse_ros.world.scenario.scenario_array import ScenarioArray, frozen
from dsse_ros.world.targets.motion import STEPS

NAME = "transition_probabilities"
LONGEST_SIDE = 1000
"""Cells along a side of the largest grid: its probabilities take 72 MB."""
ALLOWED = (
    f"an array (R, C, {STEPS}) or, of a square grid, a matrix (G G, G G) of "
    f"probabilities with at most {LONGEST_SIDE} a side, or a .npy file of one, or a sparse matrix "
    "(CSR or CSC) in SciPy's .npz"
)
SUM_TOLERANCE = 1e-9

_MOST = STEPS * LONGEST_SIDE**2
"""Values of the largest array or matrix."""
_LONGEST_TEXT = 64
"""Bytes of the largest shape or format in an .npz file."""


@dataclass(frozen=True)
class TransitionProbabilities(ScenarioArray):
    """The probabilities (R, C, 9) [row, col, step] of the steps from each cell; row 0 is north.

    The steps are numbered as in `targets.motion`. A matrix [from, to] of a square grid numbers the
    cells row by row.
    """

    NAME = NAME
    ALLOWED = ALLOWED

    @classmethod
    def _made(cls, path: str, array: NDArray[Any]) -> TransitionProbabilities:
        check_numbers(array.dtype)
        _check_shape(array.shape)
        if array.ndim == 2:
            start, to = np.nonzero(array)
            array = _by_step(math.isqrt(len(array)), start, to, array[start, to])
        digest, values = frozen(array)
        least, total = values.min(axis=2), values.sum(axis=2)
        # These forms of the comparisons also refuse NaN.
        _check_cells(least >= 0.0, "be >= 0", least)
        _check_cells(abs(total - 1.0) <= SUM_TOLERANCE, f"sum to 1 within {SUM_TOLERANCE:g}", total)
        return cls(digest, path, values)


def _check_cells(fine: NDArray[np.bool_], wanted: str, found: NDArray[np.float64]) -> None:
    """Raise for the first cell that fails a check; the arrays are (R, C)."""
    if not fine.all():
        row, col = np.argwhere(~fine)[0].tolist()
        raise FieldError(
            f"{NAME} must {wanted} in each cell, got {found[row, col]:.12g} in cell [{col}, {row}]"
        )


def _check_shape(shape: tuple[int, ...]) -> None:
    """Raise unless this shape is allowed, before any memory is allocated."""
    side = math.isqrt(shape[0]) if len(shape) == 2 else 0
    of_cells = len(shape) == 3 and shape[2] == STEPS and max(shape) <= LONGEST_SIDE
    allowed = of_cells or shape == (side**2, side**2)
    if not allowed or not 0 < math.prod(shape) <= _MOST:
        raise ValueError(f"its shape is {shape}")


def _by_step(
    side: int, start: NDArray[np.int64], to: NDArray[np.int64], chances: NDArray[Any]
) -> NDArray[np.float64]:
    """Return the probabilities (G, G, 9) of the entries of a matrix.

    Args:
        side: G.
        start: (E,) rows of the entries, the cells where the steps start.
        to: (E,) columns of the entries, the cells that the steps lead to.
        chances: (E,) values of the entries.

    Raises:
        FieldError: If a step leads further than to a neighbour.
    """
    possible = chances != 0
    start, to, chances = start[possible], to[possible], chances[possible]
    (row, col), (to_row, to_col) = np.divmod(start, side), np.divmod(to, side)
    dx, dy = to_col - col, to_row - row
    far = np.flatnonzero((abs(dx) > 1) | (abs(dy) > 1))
    if len(far):
        k = far[0]
        raise FieldError(
            f"{NAME} must be 0 for moves of more than one cell along an axis, got "
            f"{chances[k]:.12g} from cell [{col[k]}, {row[k]}] to [{to_col[k]}, {to_row[k]}]"
        )
    steps = STEPS * start + 3 * (dy + 1) + dx + 1
    sums: NDArray[Any] = np.bincount(steps, weights=chances, minlength=STEPS * side**2)
    return sums.reshape(side, side, STEPS)


def _read_npy(path: str) -> tuple[NDArray[Any]]:
    return (read_npy(path, _check_shape),)


def _read_npz(path: str) -> tuple[NDArray[np.float64]]:
    """Return the probabilities of a sparse matrix, as `scipy.sparse.save_npz` writes it.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If its shape or a move is not allowed.
    """
    try:
        entries = _entries(path)
    except (OSError, MemoryError):
        raise
    except Exception:
        # NumPy and zipfile raise errors of many types for a damaged file.
        raise ValueError("it is no sparse matrix of SciPy, or damaged") from None
    return (_by_step(*entries),)


def _entries(path: str) -> tuple[int, NDArray[np.int64], NDArray[np.int64], NDArray[Any]]:
    """Return the arguments of `_by_step` from a file."""
    with zipfile.ZipFile(path) as archive:
        # NumPy allocates the size stated in the header of an array.
        for name in ("data", "indices", "indptr", "shape", "format"):
            with archive.open(f"{name}.npy") as file:
                shape, dtype = array_header(file)
            if name in ("shape", "format"):
                allowed = math.prod(shape) * dtype.itemsize <= _LONGEST_TEXT
            else:
                check_numbers(dtype)
                allowed = len(shape) == 1 and shape[0] <= _MOST
            if not allowed:
                raise ValueError
    with np.load(path, allow_pickle=False) as arrays:
        cells, across = arrays["shape"].tolist()
        side = math.isqrt(cells)
        if not 1 <= side <= LONGEST_SIDE or cells != across or cells != side**2:
            raise ValueError
        chances = arrays["data"]
        minor, first = (arrays[name].astype(np.int64) for name in ("indices", "indptr"))
        order = arrays["format"].item()
    order = order.decode() if isinstance(order, bytes) else order
    counts = np.diff(first)
    if len(counts) != cells or first[0] != 0 or (counts < 0).any():
        raise ValueError
    if not first[-1] == len(minor) == len(chances) or ((minor < 0) | (minor >= cells)).any():
        raise ValueError
    major = np.repeat(np.arange(cells), counts)
    start, to = {"csr": (major, minor), "csc": (minor, major)}[order]
    return side, start, to, chances


TransitionProbabilities.READERS = {".npy": _read_npy, ".npz": _read_npz}
