# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of a mission's last step, by topic; `sim_node` publishes and `replay` compares them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.message_types import message_class
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.run.mission import Mission, StepResult
from dsse_ros.mission.run.step_reports import mission_report_of, step_report_of
from dsse_ros.search.step.fault_kernels import HOME, LOST
from dsse_ros.vehicles.mission_items.reduced_tracks import corners
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map, map_positions
from dsse_ros.world.scenario.geodesy import cell_fix
from dsse_ros.world.scenario.sea_state import sea_state
from dsse_ros.world.targets import sea_map
from msg_adapters.battery import battery_state
from msg_adapters.images import probability_image
from msg_adapters.markers import (
    Scene,
    ShownDrone,
    ShownFlow,
    ShownPerson,
    ShownSighting,
    marker_array,
)
from msg_adapters.mission_report import mission_report_message
from msg_adapters.occupancy import occupancy_grid
from msg_adapters.particles import particles_message
from msg_adapters.pos import pos_message
from msg_adapters.poses import Position, base_link, nav_sat_fix, path, pose_array, pose_stamped
from msg_adapters.stamps import header
from msg_adapters.step_report import step_report_message
from msg_adapters.topics import TOPICS


class Display(NamedTuple):
    """Parameters of `sim_node` on which messages for display depend."""

    grid_scaling: str = "max"
    reveal_person: bool = False


DEFAULT = Display()


class StepMessages:
    """Makes the messages of a mission's last step.

    Attributes:
        bodies: The body frame of each drone.
    """

    def __init__(self, mission: Mission, frame: GridFrame, run_id: int) -> None:
        self.mission = mission
        self.frame = frame
        self.run_id = run_id
        self.bodies = [base_link(n, frame.frame_prefix) for n in mission.env.possible_agents]
        self._reused: dict[tuple[str, int], Any] = {}
        self._positions: tuple[StepResult, list[Position]] | None = None

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
        """Return the message to fill again: making some takes as long as publishing them."""
        message = self._reused.get((topic, drone))
        if message is None:
            message = self._reused[topic, drone] = message_class(TOPICS[topic].type_name)()
        return message

    def header(self, stamp: Any) -> Any:
        """Return the header of a message in the map frame."""
        return header(self.frame.map_frame, stamp)

    def body_header(self, stamp: Any, drone: int) -> Any:
        """Return the header of a message in the body frame of a drone."""
        return header(self.bodies[drone], stamp)

    @property
    def positions(self) -> list[Position]:
        """Where each drone is in the map frame."""
        result, found = self.mission.result, self._positions
        if found is None or found[0] is not result:
            found = self._positions = result, map_positions(self.frame, result.places)
        return found[1]

    @property
    def probability(self) -> NDArray[np.float32]:
        """The map that drones observe: that of the rules, in a live search the belief."""
        mission = self.mission
        is_live = isinstance(mission.beliefs, LiveBeliefs)
        return mission.belief() if is_live else mission.env.probability

    @property
    def belief(self) -> NDArray[np.float32] | None:
        """The belief of the persons, None if there is none."""
        mission = self.mission
        return None if mission.pos is None or mission.env.rules.covers else mission.belief()


def _grid(
    maker: StepMessages, stamp: Any, display: Display, probability: NDArray[np.float32] | None
) -> Any:
    if probability is None:
        return None
    area = maker.mission.env.scenario.area_mask
    head, resolution_m = maker.header(stamp), maker.frame.cell_size_m
    return occupancy_grid(head, resolution_m, probability, display.grid_scaling, area)


def _image(maker: StepMessages, stamp: Any, probability: NDArray[np.float32] | None) -> Any:
    return None if probability is None else probability_image(maker.header(stamp), probability)


def _particles(maker: StepMessages, stamp: Any) -> Any:
    found, into = maker.mission.particles(), maker.reused("particles")
    return None if found is None else particles_message(maker.header(stamp), *found, into)


def _fix(maker: StepMessages, stamp: Any, drone: int) -> Any:
    fix = cell_fix(maker.frame, drone, *maker.mission.result.places[drone].tolist())
    return nav_sat_fix(maker.body_header(stamp, drone), fix, maker.reused("drone<i>/fix", drone))


def _battery(maker: StepMessages, stamp: Any, drone: int) -> Any:
    faults, conditions = maker.mission.env.world.faults, maker.mission.result.conditions
    if faults is None or not faults.has_battery or conditions is None:
        return None
    condition = conditions[drone]
    flying = condition["status"] not in (HOME, LOST)
    return battery_state(
        maker.body_header(stamp, drone), float(condition["battery"]), flying=flying
    )


def _pos(maker: StepMessages) -> Any:
    mission, pos = maker.mission, maker.mission.pos
    step = mission.result.step
    return None if pos is None else pos_message(maker.run_id, mission.number, step, pos)


def _step_report(maker: StepMessages, stamp: Any) -> Any:
    report = step_report_of(maker.mission, maker.frame, maker.run_id)
    return step_report_message(maker.header(stamp), report, maker.reused("step_report"))


def _mission_report(maker: StepMessages, stamp: Any) -> Any:
    report = mission_report_of(maker.mission, maker.frame, maker.run_id)
    return mission_report_message(maker.header(stamp), report)


def _path(maker: StepMessages, stamp: Any, drone: int) -> Any:
    positions = map_positions(maker.frame, maker.mission.tracks[drone], drone)
    return path(maker.header(stamp), positions, maker.reused("drone<i>/path", drone))


def _markers(maker: StepMessages, stamp: Any, reveal_person: bool) -> Any:
    env, result, frame = maker.mission.env, maker.mission.result, maker.frame
    live = ~(result.terminated | result.truncated)
    tracks = enumerate(zip(env.possible_agents, maker.mission.tracks, strict=True))
    world, persons = env.world.worlds[0], env.world.persons[0]
    circle = env.rules.circle and env.world.ensemble is None
    datum = int(world["datum_x"]), int(world["datum_y"])
    sea = sea_state(env.scenario, result.step)
    scene = Scene(
        frame.cell_size_m,
        *frame.extent,
        drones=[
            ShownDrone(name, maker.positions[i], map_positions(frame, corners(track), i), live[i])
            for i, (name, track) in tracks
        ],
        datum=None if env.rules.covers else _at_sea(frame, *datum),
        radius_m=sea_map.radius(world) * frame.cell_size_m if circle else None,
        persons=[
            ShownPerson(_at_sea(frame, int(person["x"]), int(person["y"])), bool(person["found"]))
            for person in (persons if reveal_person else ())
        ],
        flows=[ShownFlow(flow.kind, flow.velocity_mps, flow.label) for flow in sea.flows],
        shore=sea.shore,
        sightings=[
            ShownSighting((seen.x_m, seen.y_m, 0.0), seen.radius_m, seen.label, seen.lines)
            for seen in sea.sightings
        ],
    )
    return marker_array(maker.header(stamp), scene)


def _at_sea(frame: GridFrame, col: int, row: int) -> Position:
    """Return where the centre of a cell is in the map frame."""
    return (*cell_to_map(frame, col, row), 0.0)


OF_BELIEF = (
    "belief", "belief_grid", "particles", "probability_of_success", "probability",
    "probability_grid",
)  # fmt: skip
"""Topics that show the belief of a live search: inputs change them between steps."""
MESSAGES: dict[str, Callable[[StepMessages, Any, int, Display], Any]] = {
    "probability_grid": lambda maker, stamp, _, show: _grid(maker, stamp, show, maker.probability),
    "probability": lambda maker, stamp, *_: _image(maker, stamp, maker.probability),
    "belief_grid": lambda maker, stamp, _, show: _grid(maker, stamp, show, maker.belief),
    "belief": lambda maker, stamp, *_: _image(maker, stamp, maker.belief),
    "particles": lambda maker, stamp, *_: _particles(maker, stamp),
    "drone<i>/pose": lambda maker, stamp, drone, _: pose_stamped(
        maker.header(stamp),
        maker.positions[drone],
        maker.mission.result.yaws[drone],
        maker.reused("drone<i>/pose", drone),
    ),
    "drone<i>/fix": lambda maker, stamp, drone, _: _fix(maker, stamp, drone),
    "drone<i>/battery": lambda maker, stamp, drone, _: _battery(maker, stamp, drone),
    "drone<i>/path": lambda maker, stamp, drone, _: _path(maker, stamp, drone),
    "drones": lambda maker, stamp, *_: pose_array(
        maker.header(stamp), maker.positions, maker.mission.result.yaws, maker.reused("drones")
    ),
    "markers": lambda maker, stamp, _, show: _markers(maker, stamp, show.reveal_person),
    "probability_of_success": lambda maker, *_: _pos(maker),
    "mission_report": lambda maker, stamp, *_: _mission_report(maker, stamp),
    "step_report": lambda maker, stamp, *_: _step_report(maker, stamp),
}
"""The function that makes the message of a topic, or None, from (maker, stamp, drone, display)."""
