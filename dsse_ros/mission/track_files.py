# SPDX-License-Identifier: Apache-2.0
"""The files of vehicles' missions, without ROS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msg_adapters.mission_files import Mission, plan_text, qgc_wpl


def write_missions(directory: Path, missions: Mapping[str, Mission], firmware: str) -> list[Path]:
    """Write missions, by the names of their drones, as `.waypoints` and as `.plan` files.

    Args:
        directory: Where; made if it is not there.
        missions: By name.
        firmware: One of `FIRMWARES`.

    Raises:
        OSError: If that is not possible.
    """
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    for name, mission in missions.items():
        for suffix, text in (
            (".waypoints", qgc_wpl(mission.numbered(firmware))),
            (".plan", plan_text(mission, firmware=firmware)),
        ):
            path = directory / f"{name}{suffix}"
            path.write_text(text, encoding="utf-8")
            written.append(path)
    return written
