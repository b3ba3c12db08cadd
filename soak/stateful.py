# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""World, step scheduler and vehicle controller against plain slow references, step by step."""

from __future__ import annotations

import copy
import math
from collections import deque
from fractions import Fraction
from typing import Any

from autopilot.wire import mavlink
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from play import missions, person_cells
from test_against_reference import (
    CHOICES,
    assert_same_map,
    assert_same_step,
    reference_of,
)
from virtual_flight import VirtualFlight

from dsse_ros.mission.run.step_scheduler import Due, StepScheduler, Timing
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import Snapshot
from dsse_ros.search.plain import PlainSearch
from dsse_ros.vehicles.control.orders import GoTo, Hold, Land, Return, TakeOff
from soak.row import Figures, Row, Run, zero

STEPS_OF_EXAMPLE = 50
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


class WorldMachine(RuleBasedStateMachine):
    """A world and its reference: stepped, restarted, saved and restored."""

    steps = 0

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[tuple[bytes, PlainSearch]] = []

    @initialize(fields=missions(max_drones=4), seed=st.integers(0, 2**32 - 1))
    def begin(self, fields: dict[str, Any], seed: int) -> None:
        """Start a mission."""
        self.fields = fields
        self.env: SearchEnv = parallel_env(**fields)
        self.env.reset(seed=seed)
        self.reference = reference_of(fields)

    @precondition(lambda self: self.env.agents)
    @rule(choices=CHOICES)
    def step(self, choices: tuple[int, ...]) -> None:
        """Make a step; `assert_same_step` compares everything observable."""
        type(self).steps += 1
        assert_same_step(self.env, self.reference, choices)

    @rule(seed=st.none() | st.integers(0, 2**32 - 1))
    def reset(self, seed: int | None) -> None:
        """Start the mission again."""
        self.env.reset(seed=seed)
        self.reference = reference_of(self.fields)
        assert person_cells(self.env) == self.reference.persons

    @rule()
    def keep(self) -> None:
        """Take a snapshot."""
        self.kept.append((self.env.snapshot().to_bytes(), copy.deepcopy(self.reference)))

    @precondition(lambda self: self.kept)
    @rule(data=st.data())
    def take_back(self, data: st.DataObject) -> None:
        """Restore a snapshot in another environment."""
        snapshot, reference = data.draw(st.sampled_from(self.kept))
        self.env = parallel_env(**self.fields)
        self.env.restore(Snapshot.from_bytes(snapshot))
        self.reference = copy.deepcopy(reference)

    @invariant()
    def the_same_map(self) -> None:
        """Compare the maps and the persons."""
        if hasattr(self, "env"):
            assert_same_map(self.env, self.reference)
            assert person_cells(self.env) == self.reference.persons


class PlainScheduler:
    """Computes the due actions from all events, in exact fractions."""

    def __init__(self, timing: Timing) -> None:
        self.timing = timing
        self.paused = self.done = False
        self.share = Fraction(0)
        self.waited_since = Fraction(0)

    def period(self) -> Fraction:
        """Return the time of a step."""
        timing = self.timing
        if timing.mode == "manual":
            return Fraction(0)
        if timing.step_rate > 0:
            return 1 / Fraction(timing.step_rate)
        if timing.mode == "realtime":
            return Fraction(timing.step_duration_s) / Fraction(timing.real_time_factor)
        return Fraction(0)

    def wait(self, time: Fraction) -> None:
        """Let time pass."""
        if self.period() > 0 and not self.paused:
            self.share += time / self.period()

    def begin(self, now: Fraction, *, done: bool) -> None:
        """Begin a step; real time catches up on a delay of less than a step."""
        self.done = done
        late = self.share - 1
        moving = self.timing.mode == "realtime" and not done
        self.share = late if moving and 0 < late < 1 else Fraction(0)
        self.waited_since = now

    def change(self, now: Fraction) -> None:
        """Change timing or pause: a step that was due has ended, and the time-out restarts."""
        self.share = min(self.share, Fraction(1))
        self.waited_since = now

    def due(self, now: Fraction, *, ready: bool) -> Due | None:
        """Return what is due; None where rounding may decide."""
        mode, timeout = self.timing.mode, self.timing.command_timeout_s
        if mode == "manual" or self.paused or self.done:
            return Due.NOTHING
        left = (1 - min(self.share, Fraction(1))) * self.period()
        if 0 < left < Fraction(1, 10**6):
            return None
        if left > 0:
            return Due.NOTHING
        if mode == "realtime":
            return Due.TICK
        if ready:
            return Due.STEP
        if timeout == 0:
            return Due.NOTHING
        over = now - self.waited_since - Fraction(timeout)
        if abs(over) < Fraction(1, 10**6):
            return None
        return Due.TIMEOUT if over > 0 else Due.NOTHING


TIMINGS = st.builds(
    Timing,
    mode=st.sampled_from(["lockstep", "realtime", "manual"]),
    step_rate=st.sampled_from([0.0, 0.5, 8.0, 1024.0]),
    command_timeout_s=st.sampled_from([0.0, 0.25, 32.0]),
    real_time_factor=st.sampled_from([0.5, 1.0, 128.0]),
    step_duration_s=st.sampled_from([1.0, 13.0]),
)


class SchedulerMachine(RuleBasedStateMachine):
    """A scheduler and its reference, in simulated time."""

    steps = 0

    @initialize(timing=TIMINGS)
    def begin(self, timing: Timing) -> None:
        """Start a mission."""
        self.now = Fraction(0)
        self.scheduler = StepScheduler(timing, 0.0)
        self.plain = PlainScheduler(timing)
        self.begin_step(done=False)

    def begin_step(self, *, done: bool) -> None:
        """Begin the next step in both."""
        self.scheduler.begin(float(self.now), done=done)
        self.plain.begin(self.now, done=done)

    @rule(time=st.sampled_from([1, 31, 128, 1000, 1024, 13 * 1024, 33 * 1024]))
    def wait(self, time: int) -> None:
        """Let time pass, in 1/1024 s."""
        type(self).steps += 1
        self.now += Fraction(time, 1024)
        self.plain.wait(Fraction(time, 1024))

    @rule(ready=st.booleans(), last=st.integers(0, 9))
    def step_if_due(self, ready: bool, last: int) -> None:
        """Compare the due actions and do them; one step in ten is the last of its mission."""
        type(self).steps += 1
        expected = self.plain.due(self.now, ready=ready)
        due = self.scheduler.due(float(self.now), ready=ready)
        assert expected in (None, due), (expected, due)
        waits = self.scheduler.wait_s(float(self.now), ready=ready)
        assert (waits <= 1e-9) == (due is not Due.NOTHING) and not math.isnan(waits)
        assert 0.0 <= self.scheduler.share(float(self.now)) <= 1.0
        if due is not Due.NOTHING:
            self.begin_step(done=last == 0)

    @rule()
    def restart(self) -> None:
        """Start a new mission."""
        self.begin_step(done=False)

    @rule(timing=TIMINGS)
    def change(self, timing: Timing) -> None:
        """Change the parameters."""
        self.scheduler.set_timing(timing, float(self.now))
        self.plain.change(self.now)
        self.plain.timing = timing

    @rule(paused=st.booleans())
    def pause(self, paused: bool) -> None:
        """Pause or resume the mission."""
        self.scheduler.pause(paused, float(self.now))
        self.plain.change(self.now)
        self.plain.paused = paused


ORDERS = st.one_of(
    st.builds(TakeOff, st.floats(5.0, 40.0)),
    st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(5.0, 40.0)),
    st.sampled_from([Hold(), Return(), Land()]),
)
"""Orders to draw; a flight is given by its target, north, east and up of home."""
ACCEPTANCE_M = 3.0
NEAR_M = ACCEPTANCE_M + 5.0
"""Tolerance of a vehicle's position, because its reports are whole centimetres and seconds."""
REPORTED_STEPS = 30
"""Moments, 1.5 s, by which a report may be late: reports come once a second."""
MODES = {"ardupilot": "LOITER", "px4": "POSCTL"}


class ControllerMachine(RuleBasedStateMachine):
    """A vehicle controller, and the true position and orders of its vehicle."""

    steps = 0

    @initialize(
        autopilot=st.sampled_from(sorted(MODES)), arm=st.booleans(), seed=st.integers(0, 2**32 - 1)
    )
    def begin(self, autopilot: str, arm: bool, seed: int) -> None:
        """Start a vehicle and its controller."""
        self.autopilot, self.arm = autopilot, arm
        self.flight = VirtualFlight(autopilot, seed=seed, delay_s=0.1)
        self.orders = 0
        self.place: tuple[float, float, float] | None = None
        self.taken = False
        self.was_done = False
        self.truth: deque[tuple[bool, bool, float, float, float]] = deque(maxlen=REPORTED_STEPS)
        self.flight.wait(20.0)

    @rule(order=ORDERS)
    def order(self, order: Any) -> None:
        """Give an order; the latest one counts."""
        self.place = None
        if isinstance(order, tuple):
            self.place = order
            lat_deg, lon_deg = self.flight.place(*order[:2])
            order = GoTo(lat_deg, lon_deg, order[2], ACCEPTANCE_M)
        if isinstance(order, TakeOff):
            order = TakeOff(order.alt_amsl_m, arm=self.arm)
        self.orders += 1
        self.was_done = False
        sent = len(self.flight.sent)
        self.flight.give(order)
        assert not (self.taken and len(self.flight.sent) > sent)

    @rule(seconds=st.floats(0.1, 40.0))
    def wait(self, seconds: float) -> None:
        """Let time pass, and compare each moment with the truth."""
        end_s, sent = self.flight.now + seconds, len(self.flight.sent)
        while self.flight.now < end_s:
            self.flight.step()
            type(self).steps += 1
            self.look()
        assert not (self.taken and len(self.flight.sent) > sent)

    def look(self) -> None:
        """Compare the controller's state with the truth."""
        flight, outcome = self.flight, self.flight.outcome
        assert outcome.number == self.orders
        assert self.arm or not (flight.vehicle.armed or flight.commands(ARM))
        craft, vehicle = flight.vehicle.craft, flight.vehicle
        self.truth.append((vehicle.landed, vehicle.armed, craft.north_m, craft.east_m, craft.up_m))
        done = outcome.status == "done"
        if done and not self.was_done:
            assert any(self.is_so(outcome.order, *moment) for moment in self.truth), self.truth
        self.was_done = done

    def is_so(
        self, order: Any, landed: bool, armed: bool, north_m: float, east_m: float, up_m: float
    ) -> bool:
        """Return whether an order is complete for this state of the vehicle."""
        match order:
            case TakeOff(alt_amsl_m=alt_amsl_m):
                return not landed and up_m > alt_amsl_m - NEAR_M
            case GoTo() if self.place is not None:
                north, east, up = self.place
                return math.dist((north, east, up), (north_m, east_m, up_m)) < NEAR_M
            case Return() | Land():
                return landed and not armed
        return True

    @rule(loss=st.sampled_from([0.0, 0.0, 0.2, 1.0]))
    def change_link(self, loss: float) -> None:
        """Have the link lose some messages, or all."""
        self.flight.loss = loss

    @precondition(lambda self: not self.taken)
    @rule()
    def restart(self) -> None:
        """Start the program again, without knowledge of its orders."""
        self.flight.restart()
        self.orders, self.was_done = 0, False

    @precondition(lambda self: not self.taken and not self.flight.vehicle.landed and self.orders)
    @rule()
    def take_over(self) -> None:
        """Let a pilot take the vehicle: from then on nothing is sent to it."""
        flight, mode = self.flight, MODES[self.autopilot]
        flight.loss = 0.0
        flight.wait(10.0)
        if flight.vehicle.landed or flight.outcome.status != "under_way":
            return
        for _ in range(5):
            # A command that was sent before this heartbeat may still arrive: then take over again.
            if flight.vehicle.mode.name != mode:
                flight.vehicle.pilot_takes_over(mode)
            flight.wait(3.0)
        self.taken = flight.vehicle.mode.name == mode


def stateful(machine: Any, run: Run) -> Figures:
    """Compare over random scenarios until there are enough steps.

    Raises:
        AssertionError: If they differ; with the events that led to it.
    """
    machine.steps = 0
    wanted = run.size(100_000, 300)
    turn = 0
    while machine.steps < wanted:
        turn += 1
        run_state_machine_as_test(
            machine,
            settings=settings(
                max_examples=run.size(200, 10),
                stateful_step_count=STEPS_OF_EXAMPLE,
                deadline=None,
                database=None,
                derandomize=run.quick,
                print_blob=True,
                phases=(Phase.generate, Phase.shrink),
                suppress_health_check=list(HealthCheck),
            ),
        )
    return {"steps": machine.steps, "different": 0}


def _row(name: str, what: str, machine: Any) -> Row:
    return Row(
        f"stateful_{name}",
        f"The {what} and its plain reference over random scenarios: no difference in 10^5 steps",
        lambda run: stateful(machine, run),
        "{steps} steps, {different} differences",
        zero("different"),
    )


ROWS = (
    _row("world", "world", WorldMachine),
    _row("scheduler", "step scheduler", SchedulerMachine),
    _row("controller", "vehicle controller", ControllerMachine),
)
