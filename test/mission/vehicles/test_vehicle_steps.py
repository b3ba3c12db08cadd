# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The steps of a mission with vehicles, with their times made up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_scheduler import Due, StepScheduler, Timing
from dsse_ros.mission.vehicles.vehicle_steps import VehicleSteps
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.fault_kernels import SEARCHING
from dsse_ros.vehicles.fleet.vehicle_time import VehicleTimeSettings
from dsse_ros.world.scenario.frames import cell_to_map
from dsse_ros.world.scenario.scenario import scenario_frame
from msg_adapters.vehicles import Progress

RUN = 7
REPORT_S = 1.0
DRONES = 2


@dataclass
class Vehicle:
    """A vehicle that takes its time for each task."""

    boot_s: float
    looks_s: float
    comes_back_s: float
    task: int = 0
    since_s: float = 0.0

    def progress(self, task: int, now_s: float) -> Progress:
        """Return how far it is with a task."""
        if task != self.task:
            self.task, self.since_s = task, now_s
        takes_s = now_s - self.since_s
        looked = task if takes_s >= self.looks_s else -1
        arrived = task if takes_s >= self.looks_s + self.comes_back_s else -1
        return Progress(task, looked, arrived, run_id=RUN)


class Flight:
    """A mission whose sea follows the vehicles, which begin when the test says so."""

    def __init__(self, vehicles: list[Vehicle], vehicle_time: str = "followed") -> None:
        env = parallel_env(
            grid_size=20, drones_positions=[(10, 10), (5, 5)], rules="sea", timestep_limit=500,
            person_initial_position=(0, 0), probability_of_detection=0.0,
            vehicle_timed_actions=vehicle_time == "followed",
        )  # fmt: skip
        self.mission, self.vehicles, self.now_s = Mission(env, 1, belief=False), vehicles, 0.0
        self.step_s, self.frame = env.scenario.step_duration_s, scenario_frame(env.scenario)
        by_vehicles = vehicle_time == "followed"
        timing = Timing(step_duration_s=self.step_s, by_vehicles=by_vehicles)
        self.scheduler = StepScheduler(timing, 0.0)
        choice = VehicleTimeSettings(vehicle_time=vehicle_time)
        self.steps = VehicleSteps(self.mission, self.frame, self.scheduler, choice)
        self.steps.restart()
        self.scheduler.begin(0.0, done=False)
        self.begun_s: float | None = None

    def report(self) -> None:
        """Let the vehicles report."""
        tasks = self.steps.tasks
        for i, vehicle in enumerate(self.vehicles):
            progress = vehicle.progress(int(tasks.numbers[i]), self.now_s)
            self.steps.vehicles.set_progress(i, progress, RUN)
            self.steps.vehicles.set_place(i, cell_to_map(self.frame, *tasks.ends[i].tolist()))
            self.steps.set_time(i, 0, round((vehicle.boot_s + self.now_s) * 1e3))

    def begin(self, actions: list[int]) -> None:
        """Command the drones, if that is all that is waited for."""
        if not self.mission.begun and not self.steps.awaited():
            self.begun_s = self.now_s if self.begun_s is None else self.begun_s
            self.mission.command_all([a % len(self.mission.env.rules.actions) for a in actions])
            self.steps.begin("hold")

    def step(self) -> bool:
        """Do the step if it is due; returns whether it was."""
        ready = self.mission.begun and not self.steps.awaited()
        if self.scheduler.due(0.0, ready=ready) is not Due.STEP:
            return False
        self.steps.end()
        self.mission.advance("hold")
        self.scheduler.begin(0.0, done=self.mission.done)
        return True


vehicles_ = st.builds(
    Vehicle, st.floats(0, 1e6), st.floats(0, 60), st.sampled_from([0.0, 0.0, 7.0, 40.0])
)
choices = st.lists(st.integers(0, 8), min_size=2, max_size=2)


@pytest.mark.slow
@settings(max_examples=25)
@given(
    st.lists(vehicles_, min_size=DRONES, max_size=DRONES),
    st.lists(choices, min_size=1, max_size=12),
)
def test_the_sea_takes_as_long_as_the_vehicles_and_a_drone_acts_when_its_vehicle_has(
    vehicles: list[Vehicle], commands: list[list[int]]
) -> None:
    flight, done = Flight(vehicles), 0
    while done < len(commands) and not flight.mission.done:
        flight.report()
        flight.begin(commands[done])
        before = flight.steps.tasks.numbers.copy()
        if flight.step():
            done += 1
            assert flight.begun_s is not None
            late_s = flight.now_s - flight.begun_s - done * flight.step_s
            assert -2e-3 <= late_s <= REPORT_S + 2e-3
            result = flight.mission.result
            assert result.conditions is not None
            for i in flight.mission.live:
                progress = vehicles[i].progress(int(before[i]), flight.now_s)
                if result.actions[i] >= 0:
                    assert progress.looked_task == before[i]
                is_free = result.conditions["status"][i] == SEARCHING
                assert is_free == (progress.arrived_task == before[i])
        flight.now_s += REPORT_S


def test_the_first_step_waits_until_all_vehicles_are_in_place() -> None:
    flight = Flight([Vehicle(100.0, 30.0, 0.0), Vehicle(5.0, 50.0, 0.0)])
    while flight.now_s < 49.5:
        flight.report()
        flight.begin([0, 0])
        assert not flight.mission.begun and not flight.step()
        flight.now_s += REPORT_S
    flight.now_s = 50.0
    flight.report()
    flight.begin([0, 0])
    assert flight.mission.begun and flight.begun_s == 50.0


def test_an_awaited_sea_stands_still_until_all_have_done_their_tasks() -> None:
    flight = Flight([Vehicle(0.0, 3.0, 0.0), Vehicle(0.0, 90.0, 0.0)], "awaited")
    flight.now_s = 0.0
    for wait_s in (0.0, 90.0):
        flight.now_s += wait_s
        flight.report()
    flight.begin([0, 0])
    for wait_s, is_done in ((0.0, False), (89.0, False), (1.0, True)):
        flight.now_s += wait_s
        flight.report()
        assert flight.step() == is_done


def test_a_sea_without_vehicles_waits_for_none() -> None:
    flight = Flight([], "ignored")
    assert not flight.steps.exist and flight.steps.awaited() == []
    assert flight.steps.tasks.numbers.tolist() == [0, 0]
    assert np.array_equal(flight.mission.result.cells, [[10, 10], [5, 5]])


def test_it_is_noticed_when_the_clocks_stand_still() -> None:
    flight = Flight([Vehicle(0.0, 0.0, 0.0), Vehicle(0.0, 0.0, 0.0)])
    flight.report()
    flight.begin([0, 0])
    assert flight.steps.waiting() == ""
    flight.steps.watch()
    assert flight.steps.waiting() == "waiting for the clocks of the vehicles"
    flight.now_s += 1.0
    flight.report()
    assert flight.steps.waiting() == ""


@pytest.mark.parametrize("value", ["", "clock", "none"])
def test_another_time_of_the_vehicles_is_refused_in_one_line(value: str) -> None:
    with pytest.raises(ValueError, match="^vehicle_time must be one of ignored, followed, awaited"):
        VehicleTimeSettings(vehicle_time=value)
