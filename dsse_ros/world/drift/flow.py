# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current over time and place, and how uncertain they are.

Constants, tables over time and gridded files have the same form. Wind is stated by the direction
that it blows from, a current by the direction that it flows toward.
"""

from __future__ import annotations

import csv
import hashlib
import math
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime, timezone
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.shore import Box

Kind = Literal["wind", "current", "waves"]
"""Air, water, and the Stokes drift of waves."""
SENSE: dict[Kind, str] = {"wind": "from", "current": "toward", "waves": "toward"}
"""How the direction of each is stated."""
MAX_SPEED_MPS: dict[Kind, float] = {"wind": 100.0, "current": 12.0, "waves": 12.0}
"""Greatest speed. No tide is as fast as 12 m/s; Saltstraumen comes close to it."""
MAX_BYTES = 10_000_000
NO_LOOKUP = np.empty((0, 0))
"""`rows` and `cols` of a `Flow` on a grid of latitude and longitude."""


@dataclass(frozen=True, eq=False)
class Flow:
    """The velocity of air or water.

    An axis of length 1 means that the flow does not change along it. Values
    are interpolated linearly along an axis; beyond its ends there is none.

    On a grid that is not of latitude and longitude, `rows` and `cols` are the row and the column in
    the velocities, (T, J, I), of the places at `lats_deg` and `lons_deg`.

    Attributes:
        times_s: (T,) float64, increasing, seconds since 1970-01-01 UTC.
        lats_deg: (Y,) float64, increasing WGS84 latitudes.
        lons_deg: (X,) float64, increasing WGS84 longitudes; they may exceed 180.
        east_mps: (T, Y, X) float32, velocity to the east; NaN where there is none, as on land.
        north_mps: (T, Y, X) float32, velocity to the north.
        source: File and variables, for messages.
        extent: What the file covers, for messages; None for what the axes cover.
        gap_cells: Cells over which gaps are filled already, for messages.
        rows: (Y, X) float64, NaN off the grid; (0, 0) on a grid of latitude and longitude.
        cols: (Y, X) float64.
    """

    times_s: NDArray[np.float64]
    lats_deg: NDArray[np.float64]
    lons_deg: NDArray[np.float64]
    east_mps: NDArray[np.float32]
    north_mps: NDArray[np.float32]
    source: str = ""
    extent: Extent | None = None
    gap_cells: int = 0
    rows: NDArray[np.float64] = field(default_factory=lambda: NO_LOOKUP)
    cols: NDArray[np.float64] = field(default_factory=lambda: NO_LOOKUP)

    @property
    def arrays(self) -> FlowArrays:
        """The arrays, as the compiled functions read them."""
        return FlowArrays(
            self.times_s, self.lats_deg, self.lons_deg, self.east_mps, self.north_mps, self.rows,
            self.cols,
        )  # fmt: skip

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Flow) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    @cached_property
    def sha256(self) -> str:
        """Digest of the arrays; flows with the same one are equal, whatever their source."""
        return digest_of(self.arrays)

    def covered(self) -> str:
        """Return the times and the area that the file covers, for messages."""
        return (self.extent or Extent.of_axes(self.times_s, self.lats_deg, self.lons_deg)).shown()

    def why_none(self, lat_deg: float, lon_deg: float, begin_s: float, end_s: float) -> str:
        """Return why the flow has no value at a place between two times, for messages."""
        read = Extent.of_axes(self.times_s, self.lats_deg, self.lons_deg)
        within = read.holds(lat_deg, lon_deg, begin_s, end_s)
        if within and self._is_on_grid(lat_deg, lon_deg):
            return (
                f"it has a gap there, with no value within {self.gap_cells} cells; give a shore "
                "that ends the drift before the gap, or more gap_cells"
            )
        if not within and (self.extent or read).holds(lat_deg, lon_deg, begin_s, end_s):
            return f"only a part around the sightings was read; the file covers {self.covered()}"
        return f"it covers {self.covered()}"

    def _is_on_grid(self, lat_deg: float, lon_deg: float) -> bool:
        """Return whether the grid has a row and a column near a place within the axes."""
        if not self.rows.size:
            return True
        row = int(np.abs(self.lats_deg - lat_deg).argmin())
        turns = np.abs((self.lons_deg - lon_deg + 180.0) % 360.0 - 180.0)
        at = self.rows[row, turns.argmin()], self.cols[row, turns.argmin()]
        return all(0 <= v <= n - 1 for v, n in zip(at, self.east_mps.shape[1:], strict=True))


class Extent(NamedTuple):
    """First and last time, latitude and longitude; infinite where a flow does not change."""

    begin_s: float
    end_s: float
    south_deg: float
    north_deg: float
    west_deg: float
    east_deg: float

    @classmethod
    def of_axes(cls, *axes: NDArray[np.float64]) -> Extent:
        """Return the extent of times, latitudes and longitudes in any order of each."""
        anywhere = (-math.inf, math.inf)
        ends = [(axis.min(), axis.max()) if len(axis) > 1 else anywhere for axis in axes]
        return cls(*(float(end) for pair in ends for end in pair))

    def holds(self, lat_deg: float, lon_deg: float, begin_s: float, end_s: float) -> bool:
        """Return whether a place lies within it between two times, whole turns apart."""
        return (
            self.begin_s <= begin_s
            and end_s <= self.end_s
            and self.south_deg <= lat_deg <= self.north_deg
            and any(
                self.west_deg <= lon_deg + turn <= self.east_deg for turn in (-360.0, 0.0, 360.0)
            )
        )

    def shown(self) -> str:
        """Return what it covers, for messages."""
        parts = []
        if math.isfinite(self.begin_s):
            parts.append(f"{utc(self.begin_s)} to {utc(self.end_s)}")
        for ends, (low, high) in ((self[2:4], "SN"), (self[4:6], "WE")):
            if math.isfinite(ends[0]):
                parts.append(" to ".join(f"{abs(v):.4f} {low if v < 0 else high}" for v in ends))
        return ", ".join(parts)


def digest_of(arrays: Iterable[NDArray[Any]]) -> str:
    """Return the SHA-256 of arrays, with their shapes and types."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(repr((array.shape, array.dtype.str)).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


class FlowArrays(NamedTuple):
    """The arrays of a `Flow`."""

    times_s: NDArray[np.float64]
    lats_deg: NDArray[np.float64]
    lons_deg: NDArray[np.float64]
    east_mps: NDArray[np.float32]
    north_mps: NDArray[np.float32]
    rows: NDArray[np.float64]
    cols: NDArray[np.float64]


class Span(NamedTuple):
    """Where and when a flow may be needed.

    Attributes:
        box: The area.
        begin_s: First time, in seconds since 1970-01-01 UTC.
        end_s: Last time.
    """

    box: Box
    begin_s: float
    end_s: float


class Uncertainty(NamedTuple):
    """The error of a flow, normal and independent along each axis and for each particle.

    Attributes:
        std_mps: Standard deviation of each component in m/s.
        correlation_s: Time after which the correlation has fallen to 1 / e, in seconds: infinite
            for one draw per particle, 0 for a new draw in every step. The last averages out over
            many steps.
    """

    std_mps: float = 0.0
    correlation_s: float = math.inf


def components(kind: Kind, speed_mps: float, direction_deg: float) -> tuple[float, float]:
    """Return the velocity to the east and to the north in m/s.

    Args:
        kind: Whether the direction is that of wind (from) or of a current (toward).
        speed_mps: Speed.
        direction_deg: Direction, clockwise from north.
    """
    sign = -1.0 if kind == "wind" else 1.0
    angle = math.radians(direction_deg)
    return sign * speed_mps * math.sin(angle), sign * speed_mps * math.cos(angle)


def speed_and_direction(kind: Kind, east_mps: float, north_mps: float) -> tuple[float, float]:
    """Return speed in m/s and direction in degrees, 0 to 360: the inverse of `components`."""
    sign = -1.0 if kind == "wind" else 1.0
    direction_deg = math.degrees(math.atan2(sign * east_mps, sign * north_mps)) % 360.0
    return math.hypot(east_mps, north_mps), direction_deg


def constant_flow(kind: Kind, speed_mps: float, direction_deg: float) -> Flow:
    """Return a flow that is constant in time and place; see `components`."""
    return table_flow(np.zeros(1), [components(kind, speed_mps, direction_deg)])


def table_flow(times_s: NDArray[np.float64], velocities: object, source: str = "") -> Flow:
    """Return a flow that depends on time alone.

    Args:
        times_s: (T,) float64, increasing, seconds since 1970-01-01 UTC.
        velocities: (T, 2), to the east and to the north in m/s.
        source: See `Flow`.
    """
    east, north = np.array(velocities, np.float32).reshape(-1, 2).T.copy()
    anywhere = np.zeros(1)
    return Flow(times_s, anywhere, anywhere, east[:, None, None], north[:, None, None], source)


def read_table(kind: Kind, path: str | os.PathLike[str]) -> Flow:
    """Return a flow from a CSV file with the columns `time`, `speed_mps` and `from` or `toward`.

    Times are ISO 8601, in UTC unless they state an offset, and increase. A table has two or more,
    because it covers the time between them.

    Raises:
        ValueError: If the file cannot be read or is not such a table.
    """
    name, sense = os.fspath(path), SENSE[kind]
    columns = ["time", "speed_mps", sense]
    try:
        if os.path.getsize(path) > MAX_BYTES:
            raise ValueError(f"{kind} {name!r} must have at most {MAX_BYTES} bytes")
        # Spreadsheets put a byte order mark first.
        with open(path, encoding="utf-8-sig", newline="") as file:
            header, *lines = [*csv.reader(file)] or [[]]
    except OSError as error:
        raise ValueError(f"{kind} {name!r}: {error.strerror}") from None
    except (csv.Error, UnicodeDecodeError) as error:
        raise ValueError(f"{kind} {name!r} must be CSV: {error}") from None
    if sorted(header) != sorted(columns):
        raise ValueError(
            f"{kind} {name!r} must have the columns {', '.join(columns)}, separated by commas, got "
            f"the line {','.join(header)[:80]!r}"
        )
    times, velocities = [], []
    for number, line in enumerate(lines, start=2):
        try:
            row = dict(zip(header, line, strict=True))
            speed, direction = float(row["speed_mps"]), float(row[sense])
            if not (0 <= speed <= MAX_SPEED_MPS[kind] and math.isfinite(direction)):
                raise ValueError
            times.append(seconds(row["time"]))
        except ValueError:
            raise ValueError(
                f"{kind} {name!r}, line {number} must be {','.join(header)}: a time with an hour, "
                f"a speed from 0 to {MAX_SPEED_MPS[kind]:g} m/s with a decimal point and a "
                f"direction in degrees, got {','.join(line)[:80]!r}"
            ) from None
        velocities.append(components(kind, speed, direction))
    if len(times) < 2 or (np.diff(times) <= 0).any():
        raise ValueError(f"{kind} {name!r} must have two or more rows with increasing times")
    return table_flow(np.array(times), velocities, name)


_HAS_HOUR = re.compile(r"\d[Tt ]\d")


def seconds(time: str) -> float:
    """Return an ISO 8601 time as seconds since 1970-01-01 UTC; without an offset it is in UTC.

    Raises:
        ValueError: If the text is not an ISO 8601 time, or a date alone, which would be midnight.
    """
    if not _HAS_HOUR.search(time):
        raise ValueError(f"time must have an hour, got {time!r}")
    # Python 3.10 does not read the Z.
    read = datetime.fromisoformat(time.strip().replace("Z", "+00:00"))
    return (read if read.tzinfo else read.replace(tzinfo=timezone.utc)).timestamp()


def utc(time_s: float) -> str:
    """Return a time in seconds since 1970-01-01 as ISO 8601 in UTC."""
    # A file may state a time that no calendar has.
    if not abs(time_s) < 2.5e11:
        return f"{time_s:g} s"
    epoch = np.datetime64(0, "s") + np.timedelta64(round(time_s), "s")
    return f"{epoch}Z"
