# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The vehicles' part in the steps of a mission, without ROS."""

from __future__ import annotations

import math

from dsse_ros.base.result import Rejected
from dsse_ros.mission.run import status
from dsse_ros.mission.run.command_parsers import parse_place
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_scheduler import StepScheduler
from dsse_ros.mission.vehicles.awaited_vehicles import AwaitedVehicles
from dsse_ros.mission.vehicles.fleet_clock import FleetClock
from dsse_ros.mission.vehicles.vehicle_looks import VehicleLooks, Way
from dsse_ros.mission.vehicles.vehicle_tasks import VehicleTasks
from dsse_ros.mission.vehicles.vehicle_tracks import Position, VehicleTrack, tilt_deg
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.metres_paths import MOST_PIECES
from dsse_ros.vehicles.fleet.vehicle_time import FOLLOWED, IGNORED, VehicleTimeSettings
from dsse_ros.vehicles.mission_items.track_missions import acceptance_radius_m
from dsse_ros.world.scenario.frames import GridFrame, flip_y
from msg_adapters.poses import FramedPose


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
        self.tasks = VehicleTasks(mission)
        self.vehicles = AwaitedVehicles(frame, self.tasks, mission.set_battery)
        self._clock = FleetClock()
        self._watched_s = -1.0
        step_s = mission.env.scenario.step_duration_s
        self._flown = [VehicleTrack(step_s) for _ in mission.tracks]
        self._looks = VehicleLooks(mission)
        self._blind: dict[int, str] = {}

    def restart(self) -> None:
        """Have the vehicles go to where the drones of another mission start."""
        self.vehicles.begin()
        self._scheduler.stop()
        if self.exist:
            self.tasks.restart()

    def begin(self, missing_action: str) -> None:
        """Take the commands of the next step, and have the vehicles begin with it."""
        if not self._scheduler.started:
            self._clock.begin()
            self._scheduler.start(self._clock.time_s)
            for track in self._flown:
                track.begin()
            self._looks.begin()
        self.tasks.begin(self._mission.begin(missing_action))

    def end(self) -> None:
        """End a step that is about to be done.

        The drones have looked where the vehicles flew. On cells, what is not done by now is under
        way.
        """
        if not self.follows:
            return
        mission, flown = self._mission, self._take_flown()
        if mission.env.rules.in_metres:
            for drone, of_drone in flown.items():
                mission.set_flown(drone, *of_drone)
            return
        work = self.vehicles.work(self._radius_m)
        mission.set_work(work)
        mission.set_viewpoints(self._looks.take(flown, self.tasks, work))

    def _take_flown(self) -> dict[int, Way]:
        """Return what the vehicles have flown since the last step, as far as that is known."""
        mission, taken = self._mission, {}
        for drone in mission.live:
            ahead_s, silent_s = self._scheduler.fleet_ahead_s, self._clock.silent_s(drone)
            flown = self._flown[drone].take(MOST_PIECES, ahead_s, silent_s)
            if flown is not None:
                flown[0][:, 1] = flip_y(self._frame.extent.height, flown[0][:, 1])
                taken[drone] = flown
        return taken

    def set_pose(self, drone: int, stamp_ns: int, pose: FramedPose) -> Rejected | None:
        """Set the pose of a vehicle in the map frame, with the stamp of its message.

        Returns:
            Why it is refused, see `parse_place`; the vehicle's place is not known then.
        """
        parsed = parse_place(pose, self._frame)
        if isinstance(parsed, Rejected):
            self.vehicles.set_place(drone, None)
            return parsed
        self.vehicles.set_place(drone, parsed.value)
        reason = self._reason_not_to_look(drone, pose) if self.follows else None
        self._flown[drone].set_place(stamp_ns, Position(*parsed.value, looks=reason is None))
        self._blind.pop(drone, None)
        if reason is not None:
            self._blind[drone] = reason
        return None

    def _reason_not_to_look(self, drone: int, pose: FramedPose) -> str | None:
        """Return why a vehicle with this pose cannot look, None if it can."""
        most_m = self.settings.look_altitude_error
        above_m = pose.position[2] - self._frame.alt_of(drone)
        # A vehicle comes down to search; in metres there are no actions.
        action = self.tasks.actions[drone]
        low = action != NO_ACTION and action == self._mission.env.rules.action_set.search
        if not (-math.inf if low else -most_m) <= above_m <= most_m:
            return f"{abs(above_m):.0f} m {'above' if above_m > 0 else 'below'} its altitude"
        tilt = tilt_deg(pose.orientation)
        return None if tilt <= self.settings.look_tilt else f"tilted by {tilt:.0f} degrees"

    def set_time(self, drone: int, stamp_ns: int, boot_ms: int) -> None:
        """Set the clock of a vehicle, with the stamp of its message.

        Only the vehicles whose drones are in the search count.
        """
        self._flown[drone].set_time(stamp_ns, boot_ms * 1e-3)
        live = self._mission.live
        self._clock.keep(live)
        if drone in live:
            self._clock.set_time(drone, boot_ms)
        self._scheduler.set_fleet_time(self._clock.time_s)

    @property
    def blind(self) -> dict[int, str]:
        """Why vehicles cannot look where they are now, by drone; only those that cannot."""
        return self._blind if self._scheduler.started else {}

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
        if self._mission.env.rules.in_metres:
            return self.settings.acceptance_radius
        return acceptance_radius_m(self._frame, self.settings.acceptance_radius)
