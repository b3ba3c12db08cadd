# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Timing of a mission's steps, without ROS and without a clock: times in, decisions out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

_RESOLUTION_S = 1e-9
"""Remaining waits below this are 0, because they are differences of large numbers."""


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Settings for when a step is due.

    Attributes:
        mode: `lockstep` steps when all commands and vehicles are ready, `realtime` by time,
            `manual` never by itself.
        step_rate: In lockstep the maximum rate of steps, 0 for no limit; in real time the rate,
            0 for the rate of `real_time_factor`.
        command_timeout_s: In lockstep, the time that a step waits for commands and vehicles, 0 for
            no timeout.
        real_time_factor: Simulated seconds per second.
        step_duration_s: Simulated time of a step.
        by_vehicles: Whether a step lasts as long by the clocks of the vehicles, whatever the rates.
    """

    mode: str = "lockstep"
    step_rate: float = 0.0
    command_timeout_s: float = 0.0
    real_time_factor: float = 1.0
    step_duration_s: float = 1.0
    by_vehicles: bool = False

    @property
    def period_s(self) -> float:
        """Time between steps: exact in real time, the minimum in lockstep; 0 for none."""
        if self.mode == "manual":
            return 0.0
        if self.by_vehicles:
            return self.step_duration_s
        if self.step_rate > 0:
            return 1.0 / self.step_rate
        return self.step_duration_s / self.real_time_factor if self.mode == "realtime" else 0.0

    @property
    def decision_time_s(self) -> float | None:
        """Wall time that a step waits for commands; None without a timeout."""
        if self.mode == "realtime":
            return None if self.by_vehicles else self.period_s
        if self.mode == "lockstep" and self.command_timeout_s > 0:
            return max(self.period_s, self.command_timeout_s)
        return None


class Due(Enum):
    """The decision of the scheduler."""

    NOTHING = auto()
    STEP = auto()
    """Do a step: all commands and vehicles that it waits for are ready."""
    TIMEOUT = auto()
    """Do a step although commands or vehicles are missing, because the timeout has passed."""
    TICK = auto()
    """Do a step in real time, whether or not commands and vehicles are ready."""


class Pace:
    """Progress through successive steps.

    Times are seconds of any steady clock. The completed share of a step never decreases until the
    next step begins, whatever else changes: mission time follows it and must not run backwards.
    """

    def __init__(self) -> None:
        self._share = 0.0
        self._since_s = 0.0
        self._period_s = 0.0
        self._held = False

    def begin(self, now_s: float, *, makes_up: float) -> None:
        """Begin a step now, or at the scheduled end of the last one.

        Args:
            now_s: The time.
            makes_up: Delays of fewer steps than this are made up: 0 begins the step now.
        """
        over = self._unbounded(now_s) - 1.0
        self._share = over if 0.0 < over < makes_up else 0.0
        self._since_s = now_s

    def set_period(self, now_s: float, period_s: float) -> None:
        """Set the duration of a step from now on; 0 stops time."""
        self._share, self._since_s = self.share(now_s), now_s
        self._period_s = period_s

    def hold(self, now_s: float, held: bool) -> None:
        """Stop time, or let it continue."""
        self._share, self._since_s = self.share(now_s), now_s
        self._held = held

    def share(self, now_s: float) -> float:
        """Return the completed share of the step, 0 to 1."""
        return min(self._unbounded(now_s), 1.0)

    def left_s(self, now_s: float) -> float:
        """Return the wall time until the end of the step, if time runs; 0 without a period."""
        return (1.0 - self.share(now_s)) * self._period_s

    def over_s(self, now_s: float) -> float:
        """Return the time since the end of the step; 0 before it."""
        return max(self._unbounded(now_s) - 1.0, 0.0) * self._period_s

    def _unbounded(self, now_s: float) -> float:
        if self._held or self._period_s <= 0:
            return self._share
        return self._share + max(now_s - self._since_s, 0.0) / self._period_s


class StepScheduler:
    """Decides when to do the steps of a mission.

    Times are seconds of any steady clock. The caller passes whether a step is `ready`: every drone
    in flight has a command, and every awaited vehicle has arrived. If steps go by the clocks of the
    vehicles, the caller also sets their time with `set_fleet_time`; `start` begins the first step.

    Attributes:
        timing: Settings for when a step is due.
        paused: Whether the mission is held.
        done: Whether the mission is over.
    """

    def __init__(self, timing: Timing, now_s: float) -> None:
        self.timing = timing
        self.paused = False
        self.done = False
        self._pace = Pace()
        self._fleet_s: float | None = None
        self._deadline_s = math.inf
        self.set_timing(timing, now_s)

    def set_timing(self, timing: Timing, now_s: float) -> None:
        """Change the timing of steps from now on; the timeout restarts."""
        self.timing = timing
        self._pace.set_period(self._pace_s(now_s), timing.period_s)
        self._start_timeout(now_s)

    def pause(self, paused: bool, now_s: float) -> None:
        """Hold the mission, or let it continue; the timeout restarts."""
        self.paused = paused
        self._pace.hold(self._pace_s(now_s), paused)
        self._start_timeout(now_s)

    def begin(self, now_s: float, *, done: bool) -> None:
        """Begin to wait for the next step, after a step or the start of a mission.

        Args:
            now_s: The time.
            done: Whether the mission is over, so that there is no next step.
        """
        self.done = done
        makes_up = math.inf if self.timing.by_vehicles else 1.0 if self.moving else 0.0
        self._pace.begin(self._pace_s(now_s), makes_up=makes_up)
        self._start_timeout(now_s)

    @property
    def started(self) -> bool:
        """Whether the time of the vehicles counts for the mission."""
        return self._fleet_s is not None

    def start(self, fleet_s: float) -> None:
        """Begin the first step of a mission at this time of the vehicles."""
        self._fleet_s = fleet_s
        self._pace.begin(fleet_s, makes_up=0.0)

    def set_fleet_time(self, fleet_s: float) -> None:
        """Set the time of the vehicles; it counts once the mission has been started."""
        if self.started:
            self._fleet_s = fleet_s

    @property
    def fleet_ahead_s(self) -> float:
        """The time of the vehicles since the end of the step; 0 before it."""
        return 0.0 if self._fleet_s is None else self._pace.over_s(self._fleet_s)

    def stop(self) -> None:
        """Count the time of the vehicles no more, until the mission is started."""
        self._fleet_s = None

    def end(self) -> None:
        """End the mission between two steps."""
        self.done = True

    @property
    def running(self) -> bool:
        """Whether steps are done without a request."""
        return self.timing.mode != "manual" and not self.paused and not self.done

    @property
    def moving(self) -> bool:
        """Whether drones are moving between two cells, or held there."""
        return self.timing.mode == "realtime" and not self.done

    def share(self, now_s: float) -> float:
        """Return the completed share of the step, 0 to 1; it never decreases within a step."""
        return self._pace.share(self._pace_s(now_s))

    def wait_s(self, now_s: float, *, ready: bool) -> float:
        """Return the time until something is due, infinite if nothing is due by itself."""
        if not self.running:
            return math.inf
        left_s = self._pace.left_s(self._pace_s(now_s))
        if self.timing.by_vehicles and left_s > 0.0:
            # How fast their clocks go is not known.
            return math.inf
        if self.timing.mode == "realtime" or ready:
            return left_s
        return max(left_s, self._deadline_s - now_s)

    def due(self, now_s: float, *, ready: bool) -> Due:
        """Return the decision for now; after a step the caller calls `begin`."""
        if self.wait_s(now_s, ready=ready) > _RESOLUTION_S:
            return Due.NOTHING
        if self.timing.mode == "realtime":
            return Due.TICK
        return Due.STEP if ready else Due.TIMEOUT

    def _pace_s(self, now_s: float) -> float:
        """Return the time that the pace follows; it stands still until the mission is started."""
        return (self._fleet_s or 0.0) if self.timing.by_vehicles else now_s

    def _start_timeout(self, now_s: float) -> None:
        timeout_s = self.timing.command_timeout_s
        self._deadline_s = now_s + timeout_s if timeout_s > 0 else math.inf
