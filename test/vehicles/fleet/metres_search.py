# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search in metres that follows the clocks of simulated vehicles, without ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from virtual_fleet import VirtualFleet

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import mission_report_of, step_report_of
from dsse_ros.mission.run.step_scheduler import Due, StepScheduler, Timing
from dsse_ros.mission.vehicles.vehicle_steps import VehicleSteps
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.vehicles.fleet.vehicle_time import VehicleTimeSettings
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import geodetic_to_map
from msg_adapters.poses import pose_from_message
from msg_adapters.stamps import header, to_stamp
from msg_adapters.vehicles import Progress, vehicle_pose

RUN = 9


class MetresSearch:
    """What `sim_node` publishes of a search in metres, and takes from the vehicles.

    Args:
        frame: Where the grid lies.
        seed: Of the mission.
        limits: Of the looks, see `VehicleTimeSettings`.
        fields: Of the scenario.

    Attributes:
        begun_s: The clocks of the vehicles at the first step; None before it.
        ways: What the vehicles had to do in each step, (N, P, 2) (col, row).
        flown: Positions of each vehicle since the first step, (time, x, y), m in the map frame.
        winds: The winds that the bridge has published, to the east and to the north, m/s.
    """

    def __init__(
        self,
        frame: GridFrame,
        seed: int = 1,
        limits: Mapping[str, float] | None = None,
        **fields: Any,
    ) -> None:
        env = parallel_env(**{"rules": "flight", "vehicle_timed_actions": True, **fields})
        made = Mission(env, seed)
        self.flight, self.run_id = made, RUN
        self.step_s = env.scenario.step_duration_s
        self.frame = frame
        timing = Timing(step_duration_s=self.step_s, by_vehicles=True)
        self.scheduler = StepScheduler(timing, 0.0)
        choice = VehicleTimeSettings(vehicle_time="followed", **(limits or {}))  # type: ignore[arg-type]
        self.steps = VehicleSteps(made, frame, self.scheduler, choice)
        self.steps.restart()
        self.scheduler.begin(0.0, done=False)
        self.commanded = True
        self.placed_s = [-math.inf] * len(made.tracks)
        self.begun_s: list[float] | None = None
        self.flown: list[list[tuple[float, float, float]]] = [[] for _ in made.tracks]
        self.ways: list[NDArray[np.float64]] = []
        self.winds: list[tuple[float, float]] = []

    @property
    def mission(self) -> int:
        """Number of the mission."""
        return self.flight.number

    @property
    def over(self) -> bool:
        """Whether the mission is over."""
        return self.flight.done

    def agents(self) -> AgentsInfo:
        """Return what `agents` says."""
        env = self.flight.env
        return AgentsInfo(
            agents=tuple(env.possible_agents),
            actions=(),
            rules="flight",
            seed=1,
            frame=self.frame,
            timestep_limit=int(env.scenario.timestep_limit or 0),
            step_duration_s=self.step_s,
            mission=self.mission,
            run_id=self.run_id,
            commanded=self.commanded,
            speeds_mps=self.flight.space.speeds_mps,
        )

    @property
    def stamp_ns(self) -> int:
        """Stamp of the last step."""
        return self.flight.result.stamp_ns

    @property
    def last(self) -> NDArray[Any]:
        """The last report."""
        return step_report_of(self.flight, self.frame, self.run_id)

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Whether each drone is terminated."""
        return self.flight.result.terminated

    def mission_report(self) -> NDArray[Any]:
        """Return what `mission_report` says."""
        return mission_report_of(self.flight, self.frame, self.run_id)

    def lose(self, drone: int) -> None:
        """Go on without a drone."""
        self.flight.lose(drone)

    def publish(self, fleet: VirtualFleet) -> None:
        """Publish report and tasks."""
        fleet.publish(self)  # type: ignore[arg-type]
        tasks = self.steps.tasks.points(self.frame, self.run_id)
        fleet.controller.search.take_tasks(tasks)
        fleet.controller.handle_news(fleet.now)

    def hear(self, fleet: VirtualFleet) -> None:
        """Take the positions, clocks and progress that the bridge publishes of the vehicles."""
        for i, (flight, dispatcher) in enumerate(
            zip(fleet.flights, fleet.controller.dispatchers, strict=True)
        ):
            state, number = flight.state, dispatcher.progress.number
            progress = Progress(
                number, dispatcher.looked_number, dispatcher.arrived_number, dispatcher.lost,
                run_id=self.run_id if number else 0,
            )  # fmt: skip
            self.steps.vehicles.set_progress(i, progress, self.run_id)
            if not state.has_position or state.position_s <= self.placed_s[i]:
                continue
            self.placed_s[i] = state.position_s
            alt_m = self.frame.origin_alt_m + state.alt_amsl_m
            x, y, z = geodetic_to_map(self.frame, state.lat_deg, state.lon_deg, alt_m)
            stamp = round(fleet.now * 1e9)
            attitude = (state.roll_rad, state.pitch_rad, state.heading_deg)
            pose = vehicle_pose(header(self.frame.map_frame, to_stamp(stamp)), (x, y, z), attitude)
            self.steps.set_pose(i, stamp, pose_from_message(pose))
            self.steps.set_time(i, stamp, round(state.boot_s * 1e3))
            if self.begun_s is not None:
                self.flown[i].append((state.boot_s - self.begun_s[i], x, y))

    def turn(self, fleet: VirtualFleet, command: Callable[[], Sequence[Any]]) -> bool:
        """Begin the step, or do it if it is due; returns whether it was.

        Args:
            fleet: The vehicles.
            command: Returns the turns and speeds of all drones.
        """
        self.hear(fleet)
        wind_mps = fleet.controller.take_wind(fleet.now)
        if wind_mps is not None:
            self.winds.append(wind_mps)
            self.flight.report_wind(wind_mps)
            self.publish(fleet)
        ready = not self.steps.awaited()
        if not self.flight.begun and ready:
            if self.begun_s is None:
                self.begun_s = [one.state.boot_s for one in fleet.flights]
            self.flight.command_all(command())
            self.steps.begin("hold")
            self.ways.append(self.steps.tasks.ways.copy())
            self.publish(fleet)
        if self.scheduler.due(0.0, ready=ready and self.flight.begun) is not Due.STEP:
            return False
        self.steps.end()
        self.flight.advance("hold")
        self.scheduler.begin(0.0, done=self.flight.done)
        self.publish(fleet)
        return True
