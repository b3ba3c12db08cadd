# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The vehicles' part in the steps of a mission, without ROS."""

from __future__ import annotations

from dsse_ros.mission import status
from dsse_ros.mission.awaited_vehicles import AwaitedVehicles
from dsse_ros.mission.fleet_clock import FleetClock
from dsse_ros.mission.mission import Mission
from dsse_ros.mission.step_scheduler import StepScheduler
from dsse_ros.mission.vehicle_tasks import VehicleTasks
from dsse_ros.mission.vehicle_time import FOLLOWED, IGNORED, VehicleTimeSettings
from dsse_ros.mission_items.track_missions import acceptance_radius_m
from dsse_ros.scenario.frames import GridFrame


class VehicleSteps:
    """Begins the steps of a mission with its vehicles, and says which of them a step waits for.

    Args:
        mission: The mission.
        frame: Frame of its grid.
        scheduler: When its steps are due.
        settings: The parameters of the simulation.

    Attributes:
        exist: Whether there are vehicles; without them nothing here has an effect.
        follows: Whether the sea follows their clocks.
        tasks: Their tasks.
        vehicles: How far they are with these.
        settings: As given; they may change.
    """

    def __init__(
        self,
        mission: Mission,
        frame: GridFrame,
        scheduler: StepScheduler,
        settings: VehicleTimeSettings,
    ) -> None:
        self._mission = mission
        self._frame = frame
        self._scheduler = scheduler
        self.settings = settings
        self.exist = settings.vehicle_time != IGNORED
        self.follows = settings.vehicle_time == FOLLOWED
        self.tasks = VehicleTasks(len(mission.tracks))
        self.vehicles = AwaitedVehicles(frame, self.tasks, mission.set_battery)
        self._clock = FleetClock()
        self._watched_s = -1.0

    def restart(self) -> None:
        """Have the vehicles go to where the drones of another mission start."""
        self.vehicles.begin()
        self._scheduler.stop()
        if self.exist:
            self.tasks.restart(self._mission)

    def begin(self, missing_action: str) -> None:
        """Take the commands of the next step, and have the vehicles begin with it."""
        if not self._scheduler.started:
            self._scheduler.start(self._clock.time_s)
        self.tasks.begin(self._mission, self._mission.begin(missing_action))

    def end(self) -> None:
        """End a step that is about to be done: what is not done by now is under way."""
        if self.follows:
            self._mission.set_work(self.vehicles.work(self._radius_m))

    def set_time(self, drone: int, boot_ms: int) -> None:
        """Set the clock of a vehicle; only those whose drones are in the search count."""
        live = self._mission.live
        self._clock.keep(live)
        if drone in live:
            self._clock.set_time(drone, boot_ms)
        self._scheduler.set_fleet_time(self._clock.time_s)

    @property
    def stopped(self) -> bool:
        """Whether no time of the vehicles has passed since `watch`."""
        return self._watched_s == self._clock.time_s

    def watch(self) -> None:
        """See from now on whether the time of the vehicles passes."""
        self._watched_s = self._clock.time_s

    def late(self) -> list[int]:
        """Return the drones whose vehicles have not done their tasks."""
        if not self.exist or self._mission.done:
            return []
        return self.vehicles.late(self._mission.live, self._radius_m)

    def awaited(self) -> list[int]:
        """Return the drones whose vehicles have to arrive before the step.

        The sea that follows them waits only until they have arrived where the drones start.
        """
        return [] if self.follows and self._scheduler.started else self.late()

    def waiting(self) -> str:
        """Return a text of what the step has been waiting for, empty for nothing."""
        return status.awaited(
            self._mission, self._scheduler, self.awaited(), clock_stopped=self.stopped
        )

    @property
    def _radius_m(self) -> float:
        return acceptance_radius_m(self._frame, self.settings.acceptance_radius)
