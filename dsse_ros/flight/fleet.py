# SPDX-License-Identifier: Apache-2.0
"""Several vehicles."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence

from dsse_ros.flight.vehicle import CLOSE_S, Vehicle, VehicleSettings


def default_connections(number: int, dialect: str = "ardupilot") -> list[str]:
    """Return where simulators send to by themselves: 14550, 14560, ..., PX4 to 14540, 14541, ..."""
    first, step = (14540, 1) if dialect == "px4" else (14550, 10)
    return [f"udpin:127.0.0.1:{first + step * index}" for index in range(number)]


class Fleet:
    """Vehicles by index, which start and close together; one that fails does not stop others.

    Args:
        settings: One for each vehicle.

    Raises:
        ValueError: If two of them would share a link, or as `Vehicle` does.
    """

    def __init__(self, settings: Sequence[VehicleSettings]) -> None:
        links = Counter(one.connection for one in settings)
        for connection, number in links.items():
            if number > 1:
                raise ValueError(f"connection: {connection!r} is of {number} vehicles; one each")
        self._vehicles = [Vehicle(one) for one in settings]

    def __len__(self) -> int:
        return len(self._vehicles)

    def __getitem__(self, index: int) -> Vehicle:
        return self._vehicles[index]

    def __iter__(self) -> Iterator[Vehicle]:
        return iter(self._vehicles)

    def start(self) -> None:
        """Start them all."""
        for vehicle in self._vehicles:
            vehicle.start()

    def close(self) -> None:
        """Close them all, in the time of one."""
        for vehicle in self._vehicles:
            vehicle.stop()
        end_s = time.monotonic() + CLOSE_S
        for vehicle in self._vehicles:
            vehicle.join(max(0.0, end_s - time.monotonic()))

    def __enter__(self) -> Fleet:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
