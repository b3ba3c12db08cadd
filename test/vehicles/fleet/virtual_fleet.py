# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A fleet controller, simulated autopilots and searches, without sockets and real time."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from autopilot.local_frame import Place
from numpy.typing import NDArray
from virtual_flight import STEP_S, VirtualFlight

from dsse_ros.vehicles.control.orders import Hold
from dsse_ros.vehicles.control.vehicle_controller import Order, Outcome
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.fleet_controller import FleetController
from dsse_ros.vehicles.fleet.flight_record import FlightRecord, inherited
from dsse_ros.vehicles.fleet.flight_records import FRESH_S
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.mavlink.messages import StatusText
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from msg_adapters.mission_report import MISSION_REPORT_DTYPE
from msg_adapters.step_report import step_report_dtype

ACTIONS = ("left", "right", "up", "down", "search")
MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1), (0, 0))
SEARCH = 4
FRAME = GridFrame(4, 60.0, -24.04, -46.17, 0.0, 40.0)
TURN_STEPS = 2


class Records:
    """The records of vehicles, which outlive the programs of a test, as `FlightRecords` has them.

    Args:
        vehicles: How many.

    Attributes:
        alive_s: When a program was there last.
        rebooted: Whether the machine has been restarted since.
        written: The last record of each vehicle that has been seen, by its own id.
    """

    def __init__(self, vehicles: int) -> None:
        self.alive_s, self.rebooted = 0.0, False
        self.written: dict[str, FlightRecord] = {}
        self._names = [f"connection {i}" for i in range(vehicles)]
        self._clock = lambda: 0.0
        self._fresh = True

    def begin(self, clock: Callable[[], float]) -> None:
        """Begin another program."""
        self._clock = clock
        self._fresh = not self.rebooted and clock() - self.alive_s <= FRESH_S
        self.rebooted = False
        for name, record in self.written.items():
            self.written[name] = inherited(record, fresh=self._fresh)

    def __getitem__(self, i: int) -> FlightRecord:
        return self.written.get(self._names[i], FlightRecord())

    def identify(self, i: int, uid: str) -> FlightRecord:
        """Return the record of the vehicle that is connected."""
        if uid and uid != self._names[i]:
            if self._names[i].startswith("connection") and uid not in self.written:
                self.written[uid] = self[i]
            self._names[i] = uid
        return self[i]

    def update(self, i: int, record: FlightRecord) -> None:
        """Keep a record."""
        self.written[self._names[i]] = record

    def keep_alive(self) -> None:
        """Remember that the program is there."""
        self.alive_s = self._clock()


class VirtualSearch:
    """What a simulation that waits for its vehicles publishes.

    Args:
        run_id: Of the simulation.
        cells: Where the drones start.
        frame: Where the grid lies.
        seed: Of the moves.
        speeds_mps: Planned airspeeds of the drones; none by default.

    Attributes:
        cells: Where the drones are.
        over: Whether the mission is.
    """

    def __init__(
        self,
        run_id: int,
        cells: Sequence[tuple[int, int]],
        frame: GridFrame = FRAME,
        seed: int = 0,
        speeds_mps: Sequence[float] = (),
    ) -> None:
        self.run_id, self.frame, self._speeds = run_id, frame, tuple(speeds_mps)
        self._starts = list(cells)
        self._random = random.Random(seed)
        self.mission = 0
        self.reset()

    def reset(self) -> None:
        """Start another mission."""
        self.mission += 1
        self.step, self.over, self.commanded = 0, False, True
        self.cells = list(self._starts)
        self.terminated = [False] * len(self.cells)
        self._reports = [self.report()]

    @property
    def stamp_ns(self) -> int:
        """Stamp of the last step."""
        return self.step * 10**9

    def agents(self) -> AgentsInfo:
        """Return what `agents` says."""
        return AgentsInfo(
            agents=tuple(f"drone{i}" for i in range(len(self.cells))),
            actions=ACTIONS,
            rules="paper",
            seed=0,
            frame=replace(self.frame, origin_alt_m=0.0),
            timestep_limit=1000,
            step_duration_s=1.0,
            mission=self.mission,
            run_id=self.run_id,
            commanded=self.commanded,
            speeds_mps=self._speeds,
        )

    def report(self, actions: Sequence[int] | None = None) -> NDArray[Any]:
        """Return what `step_report` says."""
        made = np.zeros(len(self.cells), step_report_dtype(len(ACTIONS)))
        made["run_id"], made["mission"], made["step"] = self.run_id, self.mission, self.step
        made["col"], made["row"] = np.array(self.cells).T
        made["action"] = -1 if actions is None else actions
        made["terminated"] = self.terminated
        made["truncated"] = self.over
        return made

    @property
    def last(self) -> NDArray[Any]:
        """The last report."""
        return self._reports[-1]

    def mission_report(self) -> NDArray[Any]:
        """Return what `mission_report` says."""
        made = np.zeros((len(self._reports), len(self.cells)), MISSION_REPORT_DTYPE)
        for name in ("run_id", "mission", "step", "col", "row", "action"):
            made[name] = np.stack([one[name] for one in self._reports])
        return made

    def lose(self, drone: int) -> None:
        """Go on without a drone."""
        self.terminated[drone] = True
        self.over = self.over or all(self.terminated)
        self._reports[-1] = self.report(self._reports[-1]["action"].tolist())

    def advance(self, actions: Sequence[int] | None = None) -> None:
        """Do a step, with random actions that stay on the grid."""
        chosen = list(actions or [])
        grid = self.frame.grid_size
        for i, (col, row) in enumerate(self.cells):
            allowed = [
                a for a, (dx, dy) in enumerate(MOVES)
                if grid.holds(col + dx, row + dy)
            ]  # fmt: skip
            if actions is None:
                chosen.append(self._random.choice(allowed))
            if not self.terminated[i]:
                dx, dy = MOVES[chosen[i]]
                self.cells[i] = (col + dx, row + dy)
        self.step += 1
        self._reports.append(self.report(chosen))

    def end(self) -> None:
        """Be over."""
        self.over = True
        self._reports[-1] = self.report(self._reports[-1]["action"].tolist())


class VirtualVehicle:
    """A vehicle as a fleet controller has it."""

    def __init__(self, flight: VirtualFlight, system_id: int) -> None:
        self.flight, self.system_id, self.trouble = flight, system_id, None
        self.connection = f"udpin:127.0.0.1:{14540 + system_id}"

    @property
    def state(self) -> VehicleState:
        """What it reports."""
        return self.flight.state

    @property
    def outcome(self) -> Outcome:
        """What has become of its order."""
        return self.flight.outcome

    def adopt(self, mode: str) -> None:
        """Take it over from an earlier program."""
        self.flight.controller.modes.adopt(mode)

    def give(self, order: Order, authority: int = 0) -> int:
        """Give an order."""
        self.flight.give(order, authority)
        return self.outcome.number

    def release(self) -> int:
        """Drop the order."""
        self.flight._send(self.flight.controller.release(Hold(), self.flight.now))
        return self.outcome.number

    def take_texts(self) -> list[StatusText]:
        """Return none: nobody reads them."""
        return []


class VirtualFleet:
    """Vehicles, the program that flies them, and the simulations that they may follow.

    Args:
        vehicles: How many.
        autopilot: Which autopilots they have.
        homes_m: Where they stand, east and north of the grid's corner, and above the sea; by
            default 20 m apart, at the sea.
        vehicle: Fields of the vehicles' `Settings`, also by vehicle.
        frame: Where the grid lies.
        seed: Of links and vehicles.
        settings: Fields of `BridgeSettings`.

    Attributes:
        flights: Links, controllers and vehicles.
        controller: The fleet controller.
        searches: The simulations that are there.
        log: Lines of the program.
    """

    def __init__(
        self,
        vehicles: int = 1,
        autopilot: str = "ardupilot",
        *,
        homes_m: Sequence[tuple[float, ...]] | None = None,
        vehicle: Mapping[str, Any] | None = None,
        frame: GridFrame = FRAME,
        seed: int = 0,
        **settings: Any,
    ) -> None:
        homes_m = homes_m or [(20.0 + 20.0 * i, 20.0) for i in range(vehicles)]
        options = {"arm": "true", "autopilot": autopilot, "num_vehicles": vehicles}
        self.settings = BridgeSettings(**{**options, **settings})
        self.frame = frame
        self.flights = [
            VirtualFlight(
                autopilot,
                seed=seed + i,
                delay_s=0.05,
                alt_tolerance_m=1.0 if vehicles > 1 else 3.0,
                speed_mps=self.settings.speed,
                vehicle={
                    "home": Place(*map_to_geodetic(frame, *home[:2], 0.0)[:2], *home[2:] or (0.0,)),
                    "ready_s": 3.0,
                    **(vehicle or {}),
                },
            )
            for i, home in enumerate(homes_m)
        ]  # fmt: skip
        for i, flight in enumerate(self.flights):
            flight.vehicle.uid = i + 1
        self.records = Records(vehicles)
        self.searches: list[VirtualSearch] = []
        self.log: list[str] = []
        self.steps = 0
        self.start()

    # Programs

    def start(self) -> None:
        """Start the program, again if there is one."""
        vehicles = []
        self.records.begin(lambda: self.now)
        for i, flight in enumerate(self.flights):
            flight.restart()
            vehicles.append(VirtualVehicle(flight, i + 1))
        self.controller = FleetController(
            self.settings,
            vehicles,
            self.records,  # type: ignore[arg-type]
            lambda level, text: self.log.append(f"{level}: {text}"),
        )
        for search in self.searches:
            self.publish(search)

    def simulate(
        self, run_id: int, cells: Sequence[tuple[int, int]] | None = None, **options: Any
    ) -> VirtualSearch:
        """Start a simulation."""
        starts = cells or [(i % self.frame.grid_size.columns, 3) for i in range(len(self.flights))]
        search = VirtualSearch(run_id, starts, options.pop("frame", self.frame), **options)
        self.searches.append(search)
        self.publish(search)
        return search

    def end(self, search: VirtualSearch) -> None:
        """End a simulation."""
        self.searches.remove(search)

    def publish(self, search: VirtualSearch) -> None:
        """Publish all that a late listener gets of a simulation."""
        now_s, takes = self.now, self.controller.search
        takes.take_agents(search.agents())
        self.controller.handle_news(now_s)
        takes.take_report(search.stamp_ns, search.last, now_s)
        self.controller.handle_news(now_s)
        if search.over:
            takes.take_mission_report(search.stamp_ns, search.mission_report())
            self.controller.handle_news(now_s)

    # Time

    @property
    def now(self) -> float:
        """The time of all."""
        return self.flights[0].now

    def step(self) -> None:
        """Let a moment pass."""
        for flight in self.flights:
            flight.step()
        self.steps += 1
        if self.steps % TURN_STEPS == 0:
            changed = self.controller.set_publishers(len(self.searches))
            self.controller.turn(self.now)
            if changed:
                # A new subscription gets them some time later.
                for search in self.searches:
                    self.controller.search.take_agents(search.agents())
                    self.controller.handle_news(self.now)
            self._simulate()

    def _simulate(self) -> None:
        """Do what simulations do that wait for their vehicles."""
        for search in self.searches:
            info = self.controller.search.info
            if info is None or (info.run_id, info.mission) != (search.run_id, search.mission):
                continue
            dispatchers = self.controller.dispatchers
            lost = [i for i, one in enumerate(dispatchers) if one.lost and not search.terminated[i]]
            for i in lost:
                search.lose(i)
            if lost:
                self.publish(search)

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(math.ceil(seconds / STEP_S)):
            self.step()

    def until(self, condition: Any, limit_s: float = 600.0) -> None:
        """Let time pass until something is true."""
        end_s = self.now + limit_s
        while not condition():
            assert self.now < end_s, f"not within {limit_s:g} s: {self.shown()}\n" + "\n".join(
                self.log[-20:]
            )
            self.step()

    def arrived(self, search: VirtualSearch) -> bool:
        """Whether all vehicles have done the last step."""
        return all(
            one.arrived_number == search.stamp_ns or search.terminated[i]
            for i, one in enumerate(self.controller.dispatchers)
        )

    def fly(self, search: VirtualSearch, steps: int, actions: Sequence[int] | None = None) -> None:
        """Do steps of the search, each once the vehicles have done the one before."""
        for _ in range(steps):
            self.until(lambda: self.arrived(search))
            search.advance(actions)
            self.publish(search)

    def finish(self, search: VirtualSearch) -> None:
        """End the mission of a search."""
        search.end()
        self.publish(search)

    def shown(self) -> str:
        """Return what is known of the vehicles."""
        return "; ".join(
            f"{name}: {one.custody.state.value} {one.lost!r} {one.blocked!r} "
            f"{flight.vehicle.mode.name} {flight.vehicle.craft.up_m:.1f} m {flight.outcome}"
            for name, one, flight in zip(
                self.controller.names, self.controller.dispatchers, self.flights, strict=True
            )
        )

    def custody(self, i: int = 0) -> str:
        """Return who has a vehicle."""
        return self.controller.dispatchers[i].custody.state.value

    def amsl_m(self, i: int = 0) -> float:
        """Return how high a vehicle is above the sea."""
        vehicle = self.flights[i].vehicle
        return float(vehicle.settings.home.alt_amsl_m + vehicle.craft.up_m)

    def down(self) -> bool:
        """Whether all vehicles stand on the ground, disarmed."""
        return all(not one.vehicle.armed and one.vehicle.landed for one in self.flights)

    def tops_m_until_down(self) -> list[float]:
        """Let time pass until all are down, and return how high each vehicle was."""
        tops_m = [0.0] * len(self.flights)

        def down() -> bool:
            crafts = [one.vehicle.craft for one in self.flights]
            tops_m[:] = [max(top_m, one.up_m) for top_m, one in zip(tops_m, crafts, strict=True)]
            return self.down()

        self.until(down)
        return tops_m


def pilots_mode(flight: VirtualFlight) -> str:
    """Return a mode that only a pilot sets."""
    return "POSCTL" if flight.vehicle.settings.autopilot == "px4" else "LOITER"


def with_settings(fleet: VirtualFleet, **changes: Any) -> None:
    """Change the parameters that the next program is started with."""
    fleet.settings = replace(fleet.settings, **changes)
