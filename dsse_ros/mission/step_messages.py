# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a mission's last step that combine several parts of the mission."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsse_ros.mission.mission import Mission
from dsse_ros.scenario.sea_state import sea_state
from dsse_ros.step.fault_kernels import HOME, LOST
from dsse_ros.targets import sea_map
from msg_adapters.battery import battery_state
from msg_adapters.frames import GridFrame
from msg_adapters.markers import marker_array
from msg_adapters.poses import base_link


def battery_of(mission: Mission, frame: GridFrame, drone: int, stamp: Any) -> Any:
    """Return the charge of a drone's battery, None if batteries do not run down.

    It is a sensor_msgs/BatteryState.

    Args:
        mission: The mission.
        frame: Frame of its grid.
        drone: Number of the drone.
        stamp: Time of the message, a builtin_interfaces/Time.
    """
    faults, conditions = mission.env.world.faults, mission.result.conditions
    if faults is None or not faults.has_battery or conditions is None:
        return None
    condition = conditions[drone]
    frame_id = base_link(mission.env.possible_agents[drone], frame.frame_prefix)
    flying = condition["status"] not in (HOME, LOST)
    return battery_state(stamp, frame_id, float(condition["battery"]), flying=flying)


def markers_of(mission: Mission, frame: GridFrame, stamp: Any, *, reveal_person: bool) -> Any:
    """Return the markers of drones, tracks, datum, sea and, if wanted, the persons.

    They are a visualization_msgs/MarkerArray.

    Args:
        mission: The mission.
        frame: Frame of its grid.
        stamp: Time of the markers, a builtin_interfaces/Time.
        reveal_person: Whether to show the persons.
    """
    env, result = mission.env, mission.result
    world, persons = env.world.worlds[0], env.world.persons[0]
    circle = env.rules.circle and env.world.ensemble is None
    return marker_array(
        frame,
        stamp,
        drone_cells=result.cells,
        names=env.possible_agents,
        tracks=mission.tracks,
        live=(~(result.terminated | result.truncated)).tolist(),
        datum=None if env.rules.covers else (int(world["datum_x"]), int(world["datum_y"])),
        radius_cells=sea_map.radius(world) if circle else None,
        person_cells=np.stack([persons["x"], persons["y"]], axis=1) if reveal_person else None,
        found=persons["found"].tolist() if reveal_person else None,
        sea=sea_state(env.scenario, result.step),
    )
