# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The times of several files as one series, and the part of an axis that is needed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.coordinates import time_of
from dsse_ros.world.drift.flow import Span, utc
from dsse_ros.world.drift.netcdf import Unfit, times_of
from dsse_ros.world.drift.velocity_pairs import Pair


class Axis(NamedTuple):
    """The part of an axis that is read.

    Attributes:
        dim: Its dimension.
        indices: (N,) int64.
        values: (N,) float64, increasing values there.
    """

    dim: str
    indices: NDArray[np.int64]
    values: NDArray[np.float64]


class Source(NamedTuple):
    """A pair of variables in an open file.

    Attributes:
        dataset: The file as an `xarray.Dataset`.
        pair: Its variables.
    """

    dataset: Any
    pair: Pair


class Times(NamedTuple):
    """The times of all files.

    Attributes:
        times_s: (T,) float64, increasing, seconds since 1970-01-01 UTC.
        files: (T,) int64, number of the file of each.
        steps: (T,) int64, index in this file.
        dims: Dimension of time in each file; "" for a single time without one.
    """

    times_s: NDArray[np.float64]
    files: NDArray[np.int64]
    steps: NDArray[np.int64]
    dims: tuple[str, ...]

    @classmethod
    def of_sources(cls, sources: Sequence[Source]) -> Times:
        """Return the times of files.

        Raises:
            Unfit: If one has none, or a time twice.
        """
        axes = [time_of(source.dataset, source.pair.east) for source in sources]
        each = [times_of(axis) for axis in axes]
        for axis, times_s in zip(axes, each, strict=True):
            if len(np.unique(times_s)) < len(times_s):
                raise Unfit(f"{axis.name} must have each value once")
        times = np.concatenate(each)
        files = np.repeat(np.arange(len(each)), [len(times_s) for times_s in each])
        steps = np.concatenate([np.arange(len(times_s)) for times_s in each])
        # The first of the reversed times is the last one.
        once, last = np.unique(times[::-1], return_index=True)
        order = len(times) - 1 - last
        dims = tuple(str(axis.dims[0]) if axis.dims else "" for axis in axes)
        return cls(once, files[order], steps[order], dims)

    def within(self, span: Span, names: str, constant_s: float = 0.0) -> NDArray[np.int64]:
        """Return the indices of the times around a span.

        Args:
            span: The span.
            names: Names of the variables, for messages.
            constant_s: Seconds for which a single time counts before and after it.

        Raises:
            Unfit: If there are not two, or none in the span; with `constant_s`, if there are two.
        """
        if constant_s:
            if len(self.times_s) > 1:
                raise Unfit(f"constant_hours is for a file of one time, got {len(self.times_s)}")
            ends = self.times_s + [-constant_s, constant_s]
            part_of("time", "time", ends, span.begin_s, span.end_s, 0)
            return np.zeros(1, np.int64)
        if len(self.times_s) < 2:
            raise Unfit(
                f"{names} must have two or more times, got only {utc(self.times_s[0])}; give files "
                "of other times, too, or state constant_hours"
            )
        return part_of("time", "time", self.times_s, span.begin_s, span.end_s, 0).indices


def part_of(
    what: str, dim: str, coordinates: NDArray[np.float64], low: float, high: float, margin: int
) -> Axis:
    """Return the part of an axis around [low, high] and a margin of some values.

    It may end earlier: a drift outside the file is refused later, with its place and time.

    Raises:
        Unfit: If the axis has nothing there, or a value twice.
    """
    order = np.argsort(coordinates, kind="stable")
    values = coordinates[order]
    if (np.diff(values) <= 0).any():
        raise Unfit(f"{dim} must have each value once")
    if len(values) < 2 or high < values[0] or low > values[-1]:
        shown = utc if what == "time" else "{:.4f}".format
        raise Unfit(
            f"file must cover {what} within {shown(low)} to {shown(high)}, got {shown(values[0])} "
            f"to {shown(values[-1])}"
        )
    first = max(int(np.searchsorted(values, low, "right")) - 1 - margin, 0)
    last = min(int(np.searchsorted(values, high, "left")) + 1 + margin, len(values))
    # Interpolation needs two values.
    first = max(min(first, last - 2), 0)
    last = max(last, first + 2)
    return Axis(dim, order[first:last], values[first:last])
