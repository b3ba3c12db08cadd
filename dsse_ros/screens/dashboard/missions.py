# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state of each mission, by the namespace of its simulation, from the messages so far."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.screens.dashboard.inbox import Received
from dsse_ros.screens.dashboard.map_image import map_png
from dsse_ros.screens.dashboard.search_history import EXACT_LAYERS, LAYERS, MapImage, SearchHistory
from dsse_ros.search.environments.metres_drones import strips_of
from dsse_ros.search.step.looks import Looks, looks_of, own_cell_looks
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.agents_inbox import AgentsInbox, Latest
from dsse_ros.world.scenario.frames import map_to_places
from dsse_ros.world.scenario.live_texts import (
    Answer,
    ShownContact,
    answer_from_json,
    contacts_from_json,
)
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.scenario.sea_state import SeaState, sea_state
from msg_adapters.diagnostics import OF_OBJECT
from msg_adapters.images import image_to_probability
from msg_adapters.mission_report import mission_report_from_message
from msg_adapters.occupancy import occupancy_to_array, probability_to_occupancy
from msg_adapters.pos import pos_from_message
from msg_adapters.poses import pose_from_message
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message

_VALUES = ("paused", "publishers", "planner", "answer", "vehicle_answer", "live_answer")
"""Attributes of a mission that the node sets."""
_EARLY = 1000
"""Number of POS values that are kept until the first report of their search."""
MAX_MISSIONS = 20
"""Number of missions that are kept; one whose simulation is gone makes room for another."""
MAX_BYTES = 256 * 2**20
"""Size of the maps and steps of all missions. Above it, the page drops the mission that has been
gone for longest and, if that is not enough, every second map of the others."""
_MAX_INPUTS = 200
"""Inputs of a live search that are kept, the last ones."""
_MAX_VEHICLES = 1000
"""Largest number of vehicles of one mission."""


@dataclass
class ShownVehicle:
    """The vehicle of a drone, as the bridge reports it.

    Attributes:
        message: Its state on one line.
        level: As in DiagnosticStatus: 0 is fine.
        place: Column and row, with fractions between cells; None if unknown.
    """

    message: str = ""
    level: int = 0
    place: tuple[float, float] | None = None

    @property
    def severity(self) -> str:
        """The level as a word."""
        return ("ok", "warn", "error", "stale")[min(self.level, 3)]


def _looks_of(info: AgentsInfo) -> Looks | None:
    """Return the looks of the drones; None if each entered cell counts as searched."""
    if info.definition is None:
        return own_cell_looks(len(info.agents), info.actions)
    rules = info.definition.rules
    if rules.covers or rules.in_metres:
        return None
    return looks_of(info.definition.scenario.resolve(rules), rules)


class _Map(NamedTuple):
    """A map that has arrived."""

    layer: str
    published_ns: int
    image: MapImage


def objects_of(values: Iterable[Any]) -> dict[str, float]:
    """Return the probability of each possible object, from the key values of diagnostics."""
    return {
        value.key.removeprefix(OF_OBJECT): float(value.value)
        for value in values if value.key.startswith(OF_OBJECT)
    }  # fmt: skip


class ShownMission:
    """The mission of one simulation.

    A map has no `run_id`, and runs start at the same stamp. A map therefore belongs to the report
    with its stamp, unless it was published before the last report of another search.

    Args:
        namespace: Namespace of the simulation, "" for none.

    Attributes:
        history: The steps of the current search; None before the first report.
        vehicles: By name of the drone.
        state: Reported state of the simulation: running, paused, what it is waiting for, ...
        level: Level of the state, as in DiagnosticStatus.
        objects: Probability of each class of leeway that the object of an incident may be; empty
            if it is known.
        paused: Whether the mission is paused, as last reported.
        publishers: Number of publishers of its reports, 0 while its simulation is gone.
        planner: Name of the planner, or of the nodes that command the drones; "" if unknown.
        mixed: Whether reports of two runs have arrived in turns.
        answer: Result of the last command.
        bridge: Names of the drones whose vehicles a bridge flies; empty without a bridge.
        had_bridge: Whether there is or was a bridge.
        vehicle_answer: Result of the last command for vehicles.
        contacts: Contacts of a live search.
        inputs: The last answers to inputs of a live search, by the identity of the input.
        live_answer: Result of the last input from a page.
        trouble: Why the last message could not be read, by topic.
        heard: Number of messages of all missions up to the last one of this mission.
    """

    def __init__(self, namespace: str) -> None:
        self.namespace = namespace
        self.history: SearchHistory | None = None
        self.vehicles: dict[str, ShownVehicle] = {}
        self.state = ""
        self.level = 0
        self.objects: dict[str, float] = {}
        self.paused = False
        self.publishers = 1
        self.planner = ""
        self.mixed = False
        self.answer = ""
        self.bridge: tuple[str, ...] = ()
        self.had_bridge = False
        self.vehicle_answer = ""
        self.contacts: tuple[ShownContact, ...] = ()
        self.inputs: Latest[str, Answer] = Latest(_MAX_INPUTS)
        self.live_answer = ""
        self.trouble: dict[str, str] = {}
        self.heard = 0
        self._has_door = False
        self._former_run: int | None = None
        self._arrived: dict[str, _Map] = {}
        self._reported_ns: int | None = None  # Wall time of publication of the last report.
        self._infos = AgentsInbox()
        self._looked: tuple[AgentsInfo, Looks | None] | None = None
        self._strips: tuple[AgentsInfo, tuple[float, ...]] | None = None
        self._seen: tuple[AgentsInfo | None, int, SeaState] | None = None
        self._early_pos: deque[tuple[int, int, int, float]] = deque(maxlen=_EARLY)
        self._read: Mapping[str, Callable[[Any], object]] = {
            "agents": lambda message: self._infos.take(message.data),
            "probability_of_success": self._on_pos,
            "diagnostics": self._on_diagnostics,
            "bridge": self._on_bridge,
            "live/contacts": self._on_contacts,
            "live/answers": self._on_input,
        }

    @property
    def nbytes(self) -> int:
        """Size of the maps and steps."""
        return 0 if self.history is None else self.history.nbytes

    @property
    def title(self) -> str:
        """The name that the page shows."""
        return self.namespace or "/"

    @property
    def done(self) -> bool:
        """Whether the current search has ended."""
        all_down = self.history is not None and self.history.done
        return all_down or self.state.startswith(("mission over", "mission aborted"))

    @property
    def looks(self) -> Looks | None:
        """The looks of the drones; None if unknown, or if each entered cell counts as searched."""
        info = self.info
        if info is None:
            return None
        if self._looked is None or self._looked[0] is not info:
            self._looked = info, _looks_of(info)
        return self._looked[1]

    @property
    def strips(self) -> tuple[float, ...]:
        """Width of the strip that each drone in metres sees, in cells; empty on cells."""
        info = self.info
        if info is None or info.definition is None or not info.definition.rules.in_metres:
            return ()
        if self._strips is None or self._strips[0] is not info:
            scenario = info.definition.scenario.resolve(info.definition.rules)
            self._strips = info, tuple(width / scenario.cell_size for width in strips_of(scenario))
        return self._strips[1]

    @property
    def info(self) -> AgentsInfo | None:
        """The content of `agents` for the current search; None before it is known."""
        if self.history is None:
            return None
        info = self._infos.get(self.history.key[0])
        return info if info and len(info.agents) == self.history.num_drones else None

    @property
    def is_live(self) -> bool:
        """Whether nobody simulates its truth, and its node takes contacts and other inputs."""
        info = self.info
        scenario = None if info is None or info.definition is None else info.definition.scenario
        return self._has_door and scenario is not None and scenario.truth == "none"

    @property
    def confirmed(self) -> str:
        """The confirmed contacts of a live search; "" without one."""
        names = [contact.name for contact in self.contacts if contact.state == "confirmed"]
        return f"contact {' and '.join(names)} confirmed" if names and self.is_live else ""

    @property
    def utc(self) -> str:
        """Time of the last step in UTC; "" if unknown."""
        info = self.info
        if info is None or info.definition is None or self.history is None:
            return ""
        begins_s = info.definition.scenario.begins_s
        if begins_s is None:
            return ""
        return utc(begins_s + self.history.steps[-1] * info.step_duration_s)

    def sea(self, step: int) -> SeaState:
        """Return wind, current, shore and sightings after a step, as far as they are known."""
        info = self.info
        if self._seen is None or self._seen[0] is not info or self._seen[1] != step:
            found = None if info is None or info.definition is None else info.definition.scenario
            sea = sea_state(found, step) if isinstance(found, ResolvedScenario) else SeaState()
            self._seen = info, step, sea
        return self._seen[2]

    def receive(self, topic: str, read: Callable[[], Any], published_ns: int = 0) -> None:
        """Take a message; if it cannot be read, record that in `trouble`.

        Args:
            topic: Relative to the namespace; `vehicle_state` and `vehicle_pose` follow the name of
                a drone and a slash.
            read: Returns the message.
            published_ns: Wall time of its publication, on the clock of its publisher.
        """
        try:
            self._take(topic, read(), published_ns)
        except Exception as error:
            # Anybody can publish anything, and the page must survive it.
            self.trouble[topic] = reason_of(error)
        else:
            self.trouble.pop(topic, None)

    def _take(self, topic: str, message: Any, published_ns: int) -> None:
        drone, _, of_drone = topic.rpartition("/")
        if of_drone == "vehicle_state":
            self._on_vehicle_state(drone, message)
        elif of_drone == "vehicle_pose":
            self._on_vehicle_pose(drone, message)
        elif topic in LAYERS:
            self._on_map(topic, message, published_ns)
        elif topic in EXACT_LAYERS:
            self._on_exact_map(topic, message, published_ns)
        elif topic == "step_report":
            self._on_report(message, published_ns)
        elif topic == "mission_report":
            self._on_mission_report(message, published_ns)
        elif topic in _VALUES:
            setattr(self, topic, message)
        else:
            self._read[topic](message)

    def _on_report(self, message: Any, published_ns: int) -> None:
        report = step_report_from_message(message)
        if not len(report):
            return
        stamp_ns = to_nanoseconds(message.header.stamp)
        history, before_ns = self.history, self._reported_ns
        if history is None or not self._continues(history, report, published_ns):
            history = self._begin(report)
            self._reported_ns = published_ns
        else:
            before_ns, self._reported_ns = None, max(self._reported_ns or 0, published_ns)
        history.add(report, stamp_ns)
        for layer, at_ns, image in self._arrived.values():
            older = before_ns is not None and at_ns < before_ns <= published_ns
            if image.stamp_ns == stamp_ns and not older:
                history.add_map(layer, image)

    def _continues(self, history: SearchHistory, report: NDArray[Any], published_ns: int) -> bool:
        """Return whether a report continues the current search.

        One that is published later than a later step does not: the simulation has restarted, with
        the `run_id` that its parameter gives.
        """
        same = history.key == _key(report) and history.num_drones == len(report)
        back = int(report["step"][0]) < history.steps[-1]
        return same and not (back and published_ns > (self._reported_ns or 0))

    def _on_mission_report(self, message: Any, published_ns: int) -> None:
        reports = mission_report_from_message(message)
        # The page may have missed steps, or been started later.
        history = self.history
        known = history is not None and reports.size > 0 and _key(reports[0]) == history.key
        if history is not None and known and len(reports) > len(history):
            history.add_all(reports)
            self._reported_ns = max(self._reported_ns or 0, published_ns)

    def _begin(self, report: NDArray[Any]) -> SearchHistory:
        """Return the empty history of a new search."""
        before, (run_id, _) = self.history, _key(report)
        if before is not None and before.key[0] != run_id:
            # The publisher of a killed node remains visible for a while, but sends nothing.
            self.mixed = run_id == self._former_run
            self._former_run = before.key[0]
            for vehicle in self.vehicles.values():
                vehicle.place = None
        history = self.history = SearchHistory(*_key(report), len(report))
        self._forget_inputs_before(history.key)
        if before is not None:
            self.live_answer = ""
        for *key, step, pos in self._early_pos:
            if tuple(key) == history.key:
                history.add_pos(step, pos)
        return history

    def _on_map(self, layer: str, message: Any, published_ns: int) -> None:
        occupancy = occupancy_to_array(message)
        if not occupancy.size:
            raise ValueError("data must have at least one cell, got none")
        image = MapImage(to_nanoseconds(message.header.stamp), map_png(occupancy))
        self._keep_map(layer, _Map(layer, published_ns, image))

    def _on_exact_map(self, topic: str, message: Any, published_ns: int) -> None:
        probability = image_to_probability(message)
        info = self._infos.last
        if info is None or info.frame.grid_size.matrix != probability.shape:
            return
        occupancy, area = probability_to_occupancy(probability), info.area_mask
        if area is not None:
            occupancy[~area] = -1
        stamp_ns, top = to_nanoseconds(message.header.stamp), float(probability.max())
        image = MapImage(stamp_ns, map_png(occupancy), top)
        self._keep_map(topic, _Map(EXACT_LAYERS[topic], published_ns, image))

    def _keep_map(self, topic: str, arrived: _Map) -> None:
        # Its report may follow, even if a report with this stamp is known: that of the run before.
        self._arrived[topic] = arrived
        if self.history is not None:
            self.history.add_map(arrived.layer, arrived.image)

    def _on_pos(self, message: Any) -> None:
        run_id, mission, step, pos = pos_from_message(message)
        if self.history is not None and self.history.key == (run_id, mission):
            self.history.add_pos(step, pos)
        else:
            self._early_pos.append((run_id, mission, step, pos))

    def _on_diagnostics(self, status: Any) -> None:
        self.objects = objects_of(status.values)
        self.state, self.level = status.message, ord(status.level)
        self.paused = status.message.partition(";")[0] in ("paused", "stopped")

    def _on_bridge(self, drones: tuple[str, ...]) -> None:
        self.bridge, self.had_bridge = drones, self.had_bridge or bool(drones)

    def _on_contacts(self, message: Any) -> None:
        self.contacts, self._has_door = contacts_from_json(message.data), True

    def _on_input(self, message: Any) -> None:
        answer = answer_from_json(message.data)
        run_id, number = self.history.key if self.history else answer.search
        if answer.search[0] == run_id and answer.search[1] < number:
            # A page that comes later gets those of earlier missions, too.
            return
        self._forget_inputs_before(answer.search)
        # A repeated input must not hide what it has changed.
        if answer.id not in self.inputs or (answer.ok and answer.code != "again"):
            self.inputs.put(answer.id, answer)

    def _forget_inputs_before(self, search: tuple[int, int]) -> None:
        last = self.inputs.last
        if last is not None and last.search != search:
            self.inputs.clear()

    def _on_vehicle_state(self, drone: str, message: Any) -> None:
        for status in message.status:
            if status.name == drone:
                vehicle = self._vehicle(drone)
                vehicle.message, vehicle.level = status.message, ord(status.level)

    def _on_vehicle_pose(self, drone: str, message: Any) -> None:
        info = self.info
        if info is None:
            return
        pose = pose_from_message(message)
        x_m, y_m, _ = pose.position
        is_placed = math.isfinite(x_m) and math.isfinite(y_m)
        known = is_placed and pose.frame_id == info.frame.map_frame
        self._vehicle(drone).place = map_to_places(info.frame, x_m, y_m) if known else None

    def _vehicle(self, drone: str) -> ShownVehicle:
        if drone not in self.vehicles and len(self.vehicles) >= _MAX_VEHICLES:
            raise ValueError(f"vehicles must be at most {_MAX_VEHICLES}, got another one: {drone}")
        return self.vehicles.setdefault(drone, ShownVehicle())


class ShownMissions:
    """The missions by namespace, including those that are gone while there is room.

    Args:
        max_missions: Largest number of missions kept.
        max_bytes: Largest size of all maps and steps, as far as dropping maps can keep it.

    Attributes:
        by_namespace: In order of the namespaces.
    """

    def __init__(self, max_missions: int = MAX_MISSIONS, max_bytes: int = MAX_BYTES) -> None:
        self.by_namespace: dict[str, ShownMission] = {}
        self._max_missions = max_missions
        self._max_bytes = max_bytes
        self._heard = 0

    def take(self, received: Iterable[Received]) -> None:
        """Take the new messages, except those of a mission without room."""
        for message in received:
            mission = self.by_namespace.get(message.namespace)
            if mission is None:
                if len(self.by_namespace) >= self._max_missions and not self._drop():
                    continue
                mission = ShownMission(message.namespace)
                self.by_namespace[message.namespace] = mission
                self.by_namespace = dict(sorted(self.by_namespace.items()))
            self._heard += 1
            mission.heard = self._heard
            mission.receive(message.topic, message.read, message.published_ns)
        self._shrink()

    def _drop(self) -> bool:
        """Drop the mission that has been gone for longest; return whether there is one."""
        missions = self.by_namespace.values()
        gone = [mission for mission in missions if mission.publishers == 0 and not mission.bridge]
        if not gone:
            return False
        del self.by_namespace[min(gone, key=lambda mission: mission.heard).namespace]
        return True

    def _shrink(self) -> None:
        """Drop missions and maps until the others fit."""
        while sum(mission.nbytes for mission in self.by_namespace.values()) > self._max_bytes:
            if self._drop():
                continue
            histories = [
                mission.history for mission in self.by_namespace.values() if mission.history
            ]
            maps = [maps for history in histories for maps in history.maps.values()]
            if not any(
                frames.thin()
                for frames in sorted(maps, key=lambda frames: frames.nbytes, reverse=True)
            ):
                return


def _key(report: NDArray[Any]) -> tuple[int, int]:
    return int(report["run_id"][0]), int(report["mission"][0])
