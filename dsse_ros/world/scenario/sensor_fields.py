# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fields of a scenario for sensors: what they look for, from where, and in which weather."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.base.fields import field
from dsse_ros.world.sensors.lateral_range import LAWS
from dsse_ros.world.sensors.sweep_width import PLATFORMS, SEARCH_OBJECTS, WEATHER_FACTORS


@dataclass(frozen=True, kw_only=True)
class SensorFields:
    """What sensors other than `own_cell` depend on."""

    search_object: str = field(
        "str", "Sensor sweep_width: object of the search.", "person_in_water",
        choices=SEARCH_OBJECTS.keys(),
    )  # fmt: skip
    platform: str = field(
        "str", "Sensor sweep_width: platform.", "helicopter",
        choices=PLATFORMS,
    )  # fmt: skip
    visibility: float = field(
        "float", "Sensor sweep_width: visibility.", 18520.0, low=1852, high=1e6, unit="m"
    )
    weather: str = field(
        "str", "Sensors sweep_width and camera: fair has wind over 15 kt or a sea over 2 ft, poor "
        "wind over 25 kt or a sea over 4 ft.", "good", choices=WEATHER_FACTORS.keys(),
    )  # fmt: skip
    fatigue: bool = field("bool", "Sensor sweep_width: whether the crew is tired.", False)
    detection_law: str = field(
        "str", "Sensor sweep_width: lateral range curve.", "inverse_cube", choices=LAWS.keys()
    )
    object_size: float = field(
        "float", "Sensor camera: visible size of the object.", 0.5,
        low=1e-3, high=1000, unit="m",
    )  # fmt: skip
    image_width: int = field(
        "int", "Sensor camera: pixels across field_of_view.", 3840, low=1, high=10**6, unit="px"
    )
    dwell_time: float = field(
        "float", "Sensor camera: less time in view lowers the POD proportionally.", 0.0,
        low=0, high=1e6, unit="s",
    )  # fmt: skip
