# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the time of vehicles counts for the sea."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.base.fields import check_all, field

IGNORED, FOLLOWED, AWAITED = "ignored", "followed", "awaited"
"""What the time of vehicles counts for the sea: nothing; the sea follows their clocks; or it stands
still until they have done their tasks."""


@dataclass(frozen=True, kw_only=True)
class ArrivalSettings:
    """Setting for when a vehicle has arrived."""

    acceptance_radius: float = field(
        "float", "Distance from the centre of a cell within which a vehicle has arrived; at most "
        "half the side of a cell.", 10.0, low=1, high=255, unit="m",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class VehicleTimeSettings(ArrivalSettings):
    """Settings of the vehicles' part in the steps.

    Raises:
        FieldError: If a value is not allowed.
    """

    vehicle_time: str = field(
        "str",
        "Whether the sea goes on without the vehicles, follows their clocks, or waits until they "
        "have done their actions.",
        IGNORED,
        choices=(IGNORED, FOLLOWED, AWAITED),
    )

    look_altitude_error: float = field(
        "float", "Greatest difference between the altitudes of a vehicle and of its drone at which "
        "the vehicle looks; to search a cell it may come down.", 20.0, low=0, high=1e5, unit="m",
    )  # fmt: skip
    look_tilt: float = field(
        "float", "Greatest tilt of a vehicle at which it looks.", 60.0, low=0,
        high=180, unit="degrees",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_all(self)
