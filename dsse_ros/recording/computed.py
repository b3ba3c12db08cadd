# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The messages of a step that follow from the mission, and digests to compare them by."""

from __future__ import annotations

import array
import struct
from collections.abc import Iterator
from hashlib import blake2b
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time

from dsse_ros.mission.mission import Mission
from dsse_ros.mission.step_messages import battery_of, markers_of
from msg_adapters.frames import GridFrame
from msg_adapters.geodesy import cell_fix
from msg_adapters.images import probability_image
from msg_adapters.mission_report import make_mission_report, mission_report_message
from msg_adapters.occupancy import SCALINGS, occupancy_grid
from msg_adapters.particles import particles_message
from msg_adapters.pos import pos_message
from msg_adapters.poses import nav_sat_fix, path, pose_array, pose_stamped


def computed(
    topic: str, mission: Mission, frame: GridFrame, run_id: int, stamp: Time
) -> Iterator[Any]:
    """Yield the messages that the last step may have on a topic; none if this is not known.

    Args:
        topic: One that `replay` compares.
        mission: The mission.
        frame: Frame of its grid.
        run_id: Identity of the simulation.
        stamp: Time of the step.
    """
    env, cells = mission.env, mission.result.cells
    drone, _, name = topic.rpartition("/")
    if name in ("probability", "probability_grid"):
        probability = env.probability
    elif name in ("belief", "belief_grid"):
        if mission.pos is None or env.rules.covers:
            return
        probability = mission.belief()
    match name:
        case "probability" | "belief":
            yield probability_image(frame, probability, stamp)
        case "probability_grid" | "belief_grid":
            # The scaling is a parameter of the node.
            for scaling in SCALINGS:
                yield occupancy_grid(frame, probability, stamp, scaling, env.scenario.area_mask)
        case "probability_of_success" if mission.pos is not None:
            yield pos_message(run_id, mission.number, mission.result.step, mission.pos)
        case "particles" if (particles := mission.particles()) is not None:
            yield particles_message(frame, *particles, stamp)
        case "mission_report":
            history = mission.history
            report = make_mission_report(
                frame, run_id=run_id, mission=mission.number, history=history
            )
            yield mission_report_message(frame, report, stamp)
        case "drones":
            yield pose_array(frame, cells, stamp)
        case "markers":
            # Whether they show the persons is a parameter of the node.
            for reveal_person in (False, True):
                yield markers_of(mission, frame, stamp, reveal_person=reveal_person)
        case _ if drone in env.possible_agents:
            yield from _of_drone(name, mission, frame, env.possible_agents.index(drone), stamp)


def _of_drone(
    name: str, mission: Mission, frame: GridFrame, drone: int, stamp: Time
) -> Iterator[Any]:
    cell, of_drone = mission.result.cells[drone].tolist(), frame.of_drone(drone)
    match name:
        case "pose":
            yield pose_stamped(of_drone, cell, stamp)
        case "fix":
            agent = mission.env.possible_agents[drone]
            yield nav_sat_fix(frame, *cell_fix(of_drone, *cell), stamp, agent)
        case "path":
            yield path(of_drone, mission.tracks[drone], stamp)
        case "battery" if (battery := battery_of(mission, frame, drone, stamp)) is not None:
            yield battery


def digest(message: Any) -> bytes:
    """Return a digest of all fields of a message.

    It is not that of the serialized message, in which rclpy leaves padding undefined.
    """
    found = blake2b(digest_size=16)
    for part in _parts(message):
        found.update(part)
    return found.digest()


def _parts(value: Any, kind: str = "") -> Iterator[bytes]:
    if hasattr(value, "get_fields_and_field_types"):
        for name, kind_of_field in value.get_fields_and_field_types().items():
            yield from _parts(getattr(value, name), kind_of_field)
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _parts(one)
    elif isinstance(value, array.array | np.ndarray):
        yield value.tobytes()
    elif isinstance(value, float):
        # The text of every NaN is the same.
        yield struct.pack("<f" if kind == "float" else "<d", value)
    else:
        yield f"{value!r};".encode()
