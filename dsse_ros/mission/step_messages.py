# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a mission's last step, by topic; `sim_node` publishes and `replay` compares them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.mission import Mission, StepResult
from dsse_ros.mission.step_reports import step_report_of
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import cell_fix
from dsse_ros.scenario.sea_state import sea_state
from dsse_ros.step.fault_kernels import HOME, LOST
from dsse_ros.targets import sea_map
from msg_adapters.battery import battery_state
from msg_adapters.images import probability_image
from msg_adapters.markers import marker_array
from msg_adapters.message_types import message_class
from msg_adapters.mission_report import make_mission_report, mission_report_message
from msg_adapters.occupancy import occupancy_grid
from msg_adapters.particles import particles_message
from msg_adapters.pos import pos_message
from msg_adapters.poses import base_link, nav_sat_fix, path, pose_array, pose_stamped
from msg_adapters.step_report import step_report_message
from msg_adapters.topics import TOPICS


class Display(NamedTuple):
    """Parameters of `sim_node` on which messages for display depend."""

    grid_scaling: str = "max"
    reveal_person: bool = False


DEFAULT = Display()


class StepMessages:
    """Makes the messages of a mission's last step.

    Args:
        mission: The mission.
        frame: Frame of its grid.
        run_id: Identity of the simulation.

    Attributes:
        mission, frame, run_id: As given.
        frames: The frame of each drone.
    """

    def __init__(self, mission: Mission, frame: GridFrame, run_id: int) -> None:
        self.mission = mission
        self.frame = frame
        self.run_id = run_id
        self.frames = [frame.of_drone(i) for i in range(len(mission.env.possible_agents))]
        self._reused: dict[tuple[str, int], Any] = {}
        self._cells: tuple[StepResult, list[list[int]]] | None = None

    def make(self, topic: str, stamp: Any, drone: int = 0, display: Display = DEFAULT) -> Any:
        """Return the message of a topic, None if the mission has none.

        It may be the object that was returned for this topic and drone before.

        Args:
            topic: One of `MESSAGES`.
            stamp: Time of the message, a builtin_interfaces/Time.
            drone: Number of the drone of a topic of each drone.
            display: See `Display`.
        """
        return MESSAGES[topic](self, stamp, drone, display)

    def reused(self, topic: str, drone: int = 0) -> Any:
        """Return the message to fill: making some messages takes as long as publishing them."""
        message = self._reused.get((topic, drone))
        if message is None:
            message = self._reused[topic, drone] = message_class(TOPICS[topic].type_name)()
        return message

    @property
    def cells(self) -> list[list[int]]:
        """The cell [col, row] of each drone."""
        result, found = self.mission.result, self._cells
        if found is None or found[0] is not result:
            found = self._cells = result, result.cells.tolist()
        return found[1]

    @property
    def belief(self) -> NDArray[np.float32] | None:
        """The belief of the persons, None if there is none."""
        mission = self.mission
        return None if mission.pos is None or mission.env.rules.covers else mission.belief()


def _grid(
    of: StepMessages, stamp: Any, display: Display, probability: NDArray[np.float32] | None
) -> Any:
    if probability is None:
        return None
    area = of.mission.env.scenario.area_mask
    return occupancy_grid(of.frame, probability, stamp, display.grid_scaling, area)


def _image(of: StepMessages, stamp: Any, probability: NDArray[np.float32] | None) -> Any:
    return None if probability is None else probability_image(of.frame, probability, stamp)


def _particles(of: StepMessages, stamp: Any) -> Any:
    found, into = of.mission.particles(), of.reused("particles")
    return None if found is None else particles_message(of.frame, *found, stamp, into)


def _fix(of: StepMessages, stamp: Any, drone: int) -> Any:
    place = cell_fix(of.frames[drone], *of.cells[drone])
    name = of.mission.env.possible_agents[drone]
    return nav_sat_fix(of.frame, *place, stamp, name, of.reused("drone<i>/fix", drone))


def _battery(of: StepMessages, stamp: Any, drone: int) -> Any:
    faults, conditions = of.mission.env.world.faults, of.mission.result.conditions
    if faults is None or not faults.has_battery or conditions is None:
        return None
    condition = conditions[drone]
    frame_id = base_link(of.mission.env.possible_agents[drone], of.frame.frame_prefix)
    flying = condition["status"] not in (HOME, LOST)
    return battery_state(stamp, frame_id, float(condition["battery"]), flying=flying)


def _pos(of: StepMessages) -> Any:
    mission, pos = of.mission, of.mission.pos
    step = mission.result.step
    return None if pos is None else pos_message(of.run_id, mission.number, step, pos)


def _step_report(of: StepMessages, stamp: Any) -> Any:
    report = step_report_of(of.mission, of.frame, of.run_id)
    return step_report_message(of.frame, report, stamp, of.reused("step_report"))


def _mission_report(of: StepMessages, stamp: Any) -> Any:
    number, history = of.mission.number, of.mission.history
    report = make_mission_report(of.frame, run_id=of.run_id, mission=number, history=history)
    return mission_report_message(of.frame, report, stamp)


def _markers(of: StepMessages, stamp: Any, reveal_person: bool) -> Any:
    env, result = of.mission.env, of.mission.result
    world, persons = env.world.worlds[0], env.world.persons[0]
    circle = env.rules.circle and env.world.ensemble is None
    return marker_array(
        of.frame,
        stamp,
        drone_cells=result.cells,
        names=env.possible_agents,
        tracks=of.mission.tracks,
        live=(~(result.terminated | result.truncated)).tolist(),
        datum=None if env.rules.covers else (int(world["datum_x"]), int(world["datum_y"])),
        radius_cells=sea_map.radius(world) if circle else None,
        person_cells=np.stack([persons["x"], persons["y"]], axis=1) if reveal_person else None,
        found=persons["found"].tolist() if reveal_person else None,
        sea=sea_state(env.scenario, result.step),
    )


MESSAGES: dict[str, Callable[[StepMessages, Any, int, Display], Any]] = {
    "probability_grid": lambda of, stamp, _, show: _grid(
        of, stamp, show, of.mission.env.probability
    ),
    "probability": lambda of, stamp, *_: _image(of, stamp, of.mission.env.probability),
    "belief_grid": lambda of, stamp, _, show: _grid(of, stamp, show, of.belief),
    "belief": lambda of, stamp, *_: _image(of, stamp, of.belief),
    "particles": lambda of, stamp, *_: _particles(of, stamp),
    "drone<i>/pose": lambda of, stamp, drone, _: pose_stamped(
        of.frames[drone], of.cells[drone], stamp, of.reused("drone<i>/pose", drone)
    ),
    "drone<i>/fix": lambda of, stamp, drone, _: _fix(of, stamp, drone),
    "drone<i>/battery": lambda of, stamp, drone, _: _battery(of, stamp, drone),
    "drone<i>/path": lambda of, stamp, drone, _: path(
        of.frames[drone], of.mission.tracks[drone], stamp, of.reused("drone<i>/path", drone)
    ),
    "drones": lambda of, stamp, *_: pose_array(
        of.frame, of.mission.result.cells, stamp, of.reused("drones")
    ),
    "markers": lambda of, stamp, _, show: _markers(of, stamp, show.reveal_person),
    "probability_of_success": lambda of, *_: _pos(of),
    "mission_report": lambda of, stamp, *_: _mission_report(of, stamp),
    "step_report": lambda of, stamp, *_: _step_report(of, stamp),
}
"""By topic, what makes its message of (messages, stamp, drone, display), or None."""
