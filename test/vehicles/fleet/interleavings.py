# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Random interleavings of searches, restarts, persons, failsafes and links, held to plain rules.

The rules know nothing of the table of states. They look at what is true of the simulated vehicles,
at what persons have done, and at each message that is sent.
"""

from __future__ import annotations

import random
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from autopilot.local_frame import Point
from autopilot.maneuvers import GoTo
from virtual_fleet import VirtualFleet, VirtualSearch, pilots_mode
from virtual_flight import VirtualFlight

from dsse_ros.vehicles.mavlink.messages import (
    CommandAck,
    CommandLong,
    Heartbeat,
    HomePosition,
    PositionTarget,
    SetPositionTarget,
)
from dsse_ros.world.scenario.frames import cell_to_map
from dsse_ros.world.scenario.geodesy import geodetic_to_map

ARM, TAKE_OFF, SET_MODE, START = 400, 22, 176, 300
STARTS = (ARM, TAKE_OFF, START)
NEAR_TOP_M = 31.0
TURN_S = 0.2
"""How long it may take from a message about the search to an order."""
HERE_M = 25.0
"""How far from a vehicle a setpoint is that has it stay, hold or climb where it is."""


@dataclass
class Facts:
    """What is true of one vehicle.

    Attributes:
        may_start: Whether a person has cleared it to take off, and nothing has happened since.
        may_move: Whether it is in the air by that.
        recalled: Whether it was ordered to return or land.
        held_since: Since which received message somebody else has had it; None if nobody has.
        shows: Whether a message shows that.
        shown: How many such messages it takes.
        by_failsafe: Whether a failsafe has.
        released: Whether a person has given it back while it was armed.
        fresh: Whether it has never been flown, taken, lost or grounded.
        was_fresh: Whether that was so before somebody else has had it.
        up_since: Since which received message it has been armed by that; None while it is not.
        was_up: Whether it has flown since then.
        down_since: Since which received message it has been down again; None while it is not.
    """

    may_start: bool = False
    may_move: bool = False
    recalled: bool = False
    held_since: int | None = None
    shows: Callable[[object], bool] = bool
    shown: int = 1
    by_failsafe: bool = False
    released: bool = False
    fresh: bool = True
    was_fresh: bool = True
    up_since: int | None = None
    was_up: bool = False
    down_since: int | None = None

    def taken(self, flight: VirtualFlight, *, by_motors: bool = False) -> None:
        """Somebody else has it; that shows in a later heartbeat, by its mode or its motors."""
        mode, armed = flight.vehicle.custom_mode, flight.vehicle.armed
        self.held_since, self.shown = len(flight.received), 1
        if by_motors:
            self.shows = lambda m: isinstance(m, Heartbeat) and bool(m.base_mode & 128) == armed
        else:
            # On the ground its mode may be of before.
            self.shows = lambda m: (
                isinstance(m, Heartbeat)
                and m.custom_mode == mode
                and bool(m.base_mode & 128) == armed
            )
        self.was_fresh = self.fresh
        self.fresh = self.released = self.by_failsafe = False

    def lose_all(self) -> None:
        """Nothing may be sent that starts or moves it."""
        self.may_start = self.may_move = self.recalled = False


def sets_mode_of(command: CommandLong, flight: VirtualFlight) -> bool:
    """Whether a command sets the mode in which a vehicle is anyway."""
    if command.command != SET_MODE:
        return False
    main, sub = int(command.param2), int(command.param3)
    number = main if flight.vehicle.custom_mode < 1 << 16 else main << 16 | sub << 24
    return number == flight.vehicle.custom_mode


def is_critical(message: object) -> bool:
    """Whether it is a heartbeat of an autopilot that a failsafe has."""
    return isinstance(message, Heartbeat) and message.system_status == 5


@dataclass
class Interleaving:
    """One run.

    Args:
        seed: Draws everything.

    Attributes:
        events: What has happened, for the message of a failure.
    """

    seed: int
    events: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        draw = self.random = random.Random(self.seed)
        self.autopilot = draw.choice(["ardupilot", "px4"])
        self.arm = draw.choice(["true", "true", "always", "false"])
        vehicles = draw.choice([1, 1, 2])
        self.fleet = VirtualFleet(
            vehicles,
            self.autopilot,
            arm=self.arm,
            seed=self.seed,
            at_end=draw.choice(["return", "land", "hold"]),
            planner_timeout=draw.choice([5.0, 30.0]),
            lost_timeout=15.0,
        )
        self.facts = [Facts() for _ in range(vehicles)]
        self.sent = [0] * vehicles
        self.first_sent = [0] * vehicles
        self.first_received = [0] * vehicles
        self.cells: list[list[tuple[float, tuple[int, int]]]] = [[] for _ in range(vehicles)]
        self.run_id = 7
        self.search: VirtualSearch | None = None
        self.other: VirtualSearch | None = None
        self.first_search: tuple[int, int] | None = None
        self.followed: tuple[int, int] | None = None
        self.cut_until_s = [0.0] * vehicles

    # What happens

    def run(self, length: int) -> Interleaving:
        """Let so many things happen.

        Raises:
            AssertionError: If something was sent that must not be.
        """
        self.start_simulation()
        self.wait(self.random.uniform(0.0, 40.0))
        events: list[tuple[Callable[[], None], int]] = [
            (self.step, 8), (self.finish, 2), (self.reset, 2), (self.restart_bridge, 3),
            (self.restart_simulation, 3), (self.restart_both, 1), (self.end_simulation, 1),
            (self.start_other, 1), (self.pilot, 4), (self.foreign_mode, 3), (self.foreign_arm, 2),
            (self.foreign_disarm, 2), (self.failsafe, 2), (self.cut, 2), (self.clear, 4),
            (self.withdraw, 1), (self.operate, 2), (self.power_cycle, 2), (self.exchange, 1),
            (self.come_back_late, 1), (self.reboot, 1), (self.move_home, 1), (self.fly_here, 2),
        ]  # fmt: skip
        kinds, weights = zip(*events, strict=True)
        for _ in range(length):
            (event,) = self.random.choices(kinds, weights)
            event()
            self.wait(self.random.choice([0.1, 1.0, 3.0, 10.0, 40.0]) * self.random.random())
        return self

    def note(self, what: str) -> None:
        """Remember what has happened."""
        self.events.append(f"{self.fleet.now:.1f} s: {what}")
        self.counts[what.split()[0]] += 1

    def wait(self, seconds: float) -> None:
        """Let time pass, and look at all that is sent."""
        end_s = self.fleet.now + seconds
        while self.fleet.now < end_s:
            self.fleet.step()
            self.follow()
            for i in range(len(self.facts)):
                self.look(i)

    def start_simulation(self) -> None:
        """Start a simulation."""
        self.run_id += 1
        self.search = self.fleet.simulate(self.run_id, seed=self.seed)
        self.note(f"simulation {self.run_id}")

    def end_simulation(self) -> None:
        """Kill the simulation, if there is one."""
        if self.search is not None:
            self.fleet.end(self.search)
            self.search = None
            self.note("simulation_killed")

    def restart_simulation(self) -> None:
        """Kill the simulation and start it again."""
        self.end_simulation()
        self.wait(self.random.choice([0.0, 2.0]))
        self.start_simulation()

    def start_other(self) -> None:
        """Start another simulation beside it, or end that."""
        if self.other is None:
            self.run_id += 100
            self.other = self.fleet.simulate(self.run_id, [(1, 1)] * len(self.facts))
            self.note(f"other_simulation {self.run_id}")
        else:
            self.fleet.end(self.other)
            self.other = None
            self.note("other_simulation_killed")

    def restart_bridge(self) -> None:
        """Kill the bridge and start it again."""
        for i, facts in enumerate(self.facts):
            # Its clearances end with it.
            launched = self.fleet.controller.dispatchers[i].custody.record.launched
            facts.may_start = facts.may_start and launched
            if self.fleet.flights[i].vehicle.landed and self.unsure(i):
                # Who has seen the one does not see the other.
                facts.held_since, facts.fresh = None, facts.was_fresh
        self.fleet.start()
        self.first_search = self.followed = None
        self.sent = [len(flight.sent) for flight in self.fleet.flights]
        self.first_sent = list(self.sent)
        self.first_received = [len(flight.received) for flight in self.fleet.flights]
        self.note("bridge_restarted")

    def restart_both(self) -> None:
        """Start both again."""
        self.end_simulation()
        self.restart_bridge()
        self.start_simulation()

    def come_back_late(self) -> None:
        """Kill the bridge and start it again after more than a minute."""
        end_s = self.fleet.now + 70.0
        self.note("bridge_killed")
        while self.fleet.now < end_s:
            for flight in self.fleet.flights:
                # Nobody decides anything; what is under way goes on.
                flight.step()
        self.lose_flights()
        self.restart_bridge()

    def reboot(self) -> None:
        """Start the computer of the bridge again."""
        self.fleet.records.rebooted = True
        self.note("computer_restarted")
        self.lose_flights()
        self.restart_bridge()

    def lose_flights(self) -> None:
        """See that a bridge that comes late may fly nothing on, but with arm:=always."""
        for facts in self.facts:
            if self.arm == "always":
                # Nor does it know who had it meanwhile.
                facts.held_since = None
                continue
            facts.lose_all()
            facts.up_since = None

    def power_cycle(self) -> None:
        """Switch an autopilot off and on, on the ground."""
        i, flight, facts = self.any_vehicle()
        if flight.vehicle.armed or not flight.vehicle.landed or facts.up_since is not None:
            return
        if any(one.command == ARM for one in self.just_asked(flight)):
            return
        if self.fleet.custody(i) != "free":
            facts.fresh = False
        facts.may_start = False
        flight.vehicle.power_cycle()
        self.note(f"power_cycle {i}")

    def exchange(self) -> None:
        """Put another airframe in place of a vehicle."""
        before = len(self.events)
        self.power_cycle()
        if len(self.events) == before:
            return
        i = int(self.events[-1].split()[-1])
        self.fleet.flights[i].vehicle.uid += 100
        self.facts[i] = Facts(held_since=None)
        self.note(f"exchange {i}")

    def move_home(self) -> None:
        """Have a ground station set the home of a vehicle where that is."""
        i, flight, facts = self.any_vehicle()
        vehicle = flight.vehicle
        high = vehicle.craft.up_m - vehicle.home.up_m > 8.0 and not vehicle.landed
        known = self.fleet.controller.dispatchers[i].custody.record.home is not None
        # With PX4 it holds first, as it would return without setpoints.
        if self.autopilot != "ardupilot" or not (high and known) or not facts.may_move:
            return
        vehicle.home = vehicle.craft.point
        vehicle.broadcast_home()
        facts.taken(flight)
        facts.shows = lambda message: isinstance(message, HomePosition)
        self.note(f"home {i}")

    def fly_here(self) -> None:
        """Have a ground station send a vehicle elsewhere in its guided mode."""
        i, flight, facts = self.any_vehicle()
        vehicle = flight.vehicle
        guided = self.autopilot == "ardupilot" and vehicle.mode.name == "GUIDED"
        there = flight.outcome.status == "done" and not vehicle.landed and facts.may_move
        if not (guided and there) or not isinstance(vehicle.maneuver, GoTo):
            return
        if self.cut_until_s[i] > self.fleet.now:
            return
        north_m, east_m, up_m = vehicle.craft.point
        vehicle.maneuver = GoTo(Point(north_m + 60.0, east_m, up_m))
        facts.taken(flight)
        lat, _ = vehicle.frame.geodetic(north_m + 60.0, east_m)
        facts.shows = lambda message: (
            isinstance(message, PositionTarget) and abs(message.lat_int * 1e-7 - lat) < 1e-4
        )
        facts.shown = 3
        self.note(f"fly_here {i}")

    def step(self) -> None:
        """Do a step, if the vehicles have done the last one."""
        search = self.search
        if search is not None and not search.over and self.fleet.arrived(search):
            search.advance()
            self.fleet.publish(search)
            self.note("step")

    def finish(self) -> None:
        """End the mission."""
        if self.search is not None:
            self.fleet.finish(self.search)
            self.note("finish")

    def reset(self) -> None:
        """Start another mission of the same simulation."""
        if self.search is not None:
            self.search.reset()
            self.fleet.publish(self.search)
            self.note("reset")

    def any_vehicle(self) -> tuple[int, VirtualFlight, Facts]:
        """Return one of the vehicles."""
        i = self.random.randrange(len(self.facts))
        return i, self.fleet.flights[i], self.facts[i]

    def pilot(self) -> None:
        """Have a pilot choose a mode."""
        i, flight, facts = self.any_vehicle()
        mode = self.random.choice([pilots_mode(flight), "LAND", "RTL"])
        if self.shows_anyway(flight, mode):
            return
        flight.vehicle.pilot_takes_over(mode)
        comes_down = mode in ("LAND", "RTL")
        if self.arm == "always" and comes_down and not flight.vehicle.armed:
            # That is where it may have been left after a flight.
            return
        if any(sets_mode_of(one, flight) for one in self.just_asked(flight)):
            return
        if flight.vehicle.mode.name == mode:
            # Its failsafe chooses these too.
            by_failsafe = (facts.by_failsafe or bool(flight.vehicle.failsafes)) and comes_down
            facts.taken(flight)
            facts.by_failsafe = by_failsafe
            self.note(f"pilot {i} {mode}")

    def foreign_mode(self) -> None:
        """Have another ground station set the mode in which vehicles wait for orders."""
        i, flight, facts = self.any_vehicle()
        if self.waits_for_a_hand(i):
            return
        mode = "HOLD" if self.autopilot == "px4" else "GUIDED"
        top = flight.vehicle.mode.name == "TAKEOFF" and flight.vehicle.craft.up_m > NEAR_TOP_M
        # At the top of its climb it goes there by itself.
        if top or self.shows_anyway(flight, mode):
            return
        flight.vehicle.request_mode(*((4, 3) if self.autopilot == "px4" else (4, 0)))
        asked = any(sets_mode_of(one, flight) for one in self.just_asked(flight))
        if not flight.vehicle.armed:
            # On the ground it takes nothing: that is where vehicles wait.
            self.note(f"station {i} {mode} on the ground")
        elif flight.vehicle.mode.name == mode and not asked:
            heard = flight.received[self.first_received[i] :]
            number = flight.vehicle.custom_mode
            if not any(isinstance(m, Heartbeat) and m.custom_mode != number for m in heard):
                # A bridge that has just come has not seen that there was another one.
                facts.held_since = None
                return
            facts.taken(flight)
            facts.released = flight.vehicle.armed and mode == "GUIDED"
            self.note(f"station {i} {mode}")

    def just_asked(self, flight: VirtualFlight) -> list[CommandLong]:
        """Return the commands of the last seconds."""
        since_s = self.fleet.now - 3.0
        return [
            message
            for time_s, message in flight.sent[-20:]
            if time_s > since_s and isinstance(message, CommandLong)
        ]

    def shows_anyway(self, flight: VirtualFlight, mode: str) -> bool:
        """Whether nobody could see that a person sets a mode."""
        heartbeats = [one for one in flight.received if isinstance(one, Heartbeat)]
        number = int(type(flight.vehicle.mode)[mode])
        shown = not heartbeats or heartbeats[-1].custom_mode == number
        return flight.vehicle.mode.name == mode or shown

    def waits_for_a_hand(self, i: int) -> bool:
        """Whether a person is waited for to arm a vehicle, or to set the mode that is named."""
        custody = self.fleet.controller.dispatchers[i].custody
        state = custody.state.value
        begins = state == "following" and self.fleet.flights[i].vehicle.landed
        return (begins or state == "cleared") and not custody.record.arm

    def foreign_arm(self) -> None:
        """Have another ground station arm it and take off."""
        i, flight, facts = self.any_vehicle()
        vehicle = flight.vehicle
        asked = any(one.command == ARM for one in self.just_asked(flight))
        # Nobody knows its arming from the one that the bridge has just asked for.
        if asked or vehicle.armed or vehicle.arm(force=False) != 0:
            return
        self.note(f"armed {i}")
        # With arm:=false that is what is waited for.
        if self.waits_for_a_hand(i):
            facts.held_since, facts.may_start = None, True
        else:
            facts.taken(flight, by_motors=True)
            if self.random.random() < 0.5:
                vehicle.maneuver = vehicle.take_off(20.0)

    def foreign_disarm(self) -> None:
        """Have another ground station disarm it on the ground."""
        i, flight, facts = self.any_vehicle()
        if flight.vehicle.armed and flight.vehicle.landed:
            flight.vehicle.disarm()
            if self.seen_armed(i, self.first_received[i]) or self.knows_of_arming(i):
                facts.taken(flight, by_motors=True)
            self.note(f"disarmed {i}")

    def unsure(self, i: int) -> bool:
        """Whether but one heartbeat has shown that somebody else has it: that may be an old one."""
        flight, facts = self.fleet.flights[i], self.facts[i]
        if facts.held_since is None:
            return False
        return sum(map(facts.shows, flight.received[facts.held_since :])) < 2

    def knows_of_arming(self, i: int) -> bool:
        """Whether this bridge has asked it to arm, and heard that it does."""
        flight = self.fleet.flights[i]
        for k in range(self.first_sent[i], len(flight.sent)):
            asked = flight.sent[k][1]
            if isinstance(asked, CommandLong) and asked.command == ARM:
                replies = flight.received[flight.heard[k] :]
                return any(isinstance(m, CommandAck) and m.command == ARM for m in replies)
        return False

    def failsafe(self) -> None:
        """Have the battery run low."""
        i, flight, facts = self.any_vehicle()
        vehicle = flight.vehicle
        if vehicle.landed or vehicle.failsafes:
            return
        vehicle.failsafes.add("battery")
        vehicle.battery = min(vehicle.battery, 0.1)
        vehicle.battery_failsafe()
        facts.taken(flight)
        facts.by_failsafe = True
        if self.autopilot == "px4":
            # Its mode may be for lack of setpoints, too.
            facts.shows, facts.shown = is_critical, 3
        self.note(f"battery {i}")

    def cut(self) -> None:
        """Cut a link for some time."""
        i, flight, _ = self.any_vehicle()
        if self.cut_until_s[i] > self.fleet.now:
            return
        seconds = self.random.choice([3.0, 10.0, 30.0])
        put = flight._put
        self.cut_until_s[i] = self.fleet.now + seconds

        def cut_off(data: bytes, *, to_vehicle: bool) -> None:
            if self.fleet.now >= self.cut_until_s[i]:
                put(data, to_vehicle=to_vehicle)

        flight._put = cut_off  # type: ignore[method-assign]
        self.note(f"cut {i} {seconds:g}")

    def clear(self) -> None:
        """Have a person clear the vehicles, or one of them."""
        i = self.random.choice([None, *range(len(self.facts))])
        dispatchers = self.fleet.controller.dispatchers
        _, text = self.fleet.controller.arm(i, True)
        cleared = re.findall(r"drone\d+", "".join(re.findall(r"cleared [a-z ]*: [^;]*", text)))
        for k, facts in enumerate(self.facts):
            if f"drone{k}" not in cleared:
                continue
            flight = self.fleet.flights[k]
            if flight.vehicle.landed:
                facts.may_start, facts.may_move, facts.recalled = True, False, False
                facts.fresh = True
            elif dispatchers[k].custody.airborne:
                facts.may_move, facts.recalled = True, False
            elif not self.known(k, len(flight.received)):
                # It is seen on the ground, until the first message of who has taken it.
                facts.may_start, facts.recalled = True, False
                continue
            facts.held_since = None
        self.note(f"clear {text}")

    def withdraw(self) -> None:
        """Have a person keep the vehicles on the ground."""
        _, text = self.fleet.controller.arm(None, False)
        for k, facts in enumerate(self.facts):
            if f"drone{k}" in "".join(re.findall(r"kept on the ground: [^;]*", text)):
                facts.may_start = facts.fresh = False
        self.note(f"withdraw {text}")

    def operate(self) -> None:
        """Have a person hold, return or land the vehicles, or one of them."""
        what = self.random.choice(["hold", "return", "land"])
        i = self.random.choice([None, *range(len(self.facts))])
        _, text = self.fleet.controller.operate(i, what)
        ordered = "".join(re.findall(r"ordered to [a-z]*: [^;]*", text))
        kept = "".join(re.findall(r"kept on the ground: [^;]*", text))
        for k, facts in enumerate(self.facts):
            if f"drone{k}" in ordered:
                # A launched vehicle comes down, in anybody's hands; otherwise that comes after what
                # nobody has seen.
                facts.held_since = None
                facts.may_move = facts.may_move or not self.fleet.flights[k].vehicle.landed
            if f"drone{k}" in ordered + kept:
                if not facts.may_move:
                    facts.may_start = False
                facts.recalled, facts.fresh = what != "hold", False
        self.note(f"operate {what} {text}")

    # What may be sent

    def follow(self) -> None:
        """See which search is followed: what was cleared for another one may not start."""
        info = self.fleet.controller.search.info
        followed = None if info is None else (info.run_id, info.mission)
        if followed == self.followed or followed is None:
            return
        self.followed = followed
        # It may have followed another one in between.
        self.first_search = self.fleet.controller._first
        for dispatcher, facts in zip(self.fleet.controller.dispatchers, self.facts, strict=True):
            record = dispatcher.custody.record
            if dispatcher.custody.state.value != "cleared" or record.search != followed:
                facts.may_start = False
            if facts.released and self.arm == "always":
                # What a person has given back is cleared as one that nobody has had.
                facts.held_since, facts.may_move = None, True

    def look(self, i: int) -> None:
        """Look at what was sent to a vehicle since the last time, and at what is true of it."""
        flight, facts = self.fleet.flights[i], self.facts[i]
        self.clear_by_parameter(i)
        self.cells_of(i)
        for k in range(self.sent[i], len(flight.sent)):
            self.check(i, flight.sent[k][1], flight.heard[k])
        self.sent[i] = len(flight.sent)
        vehicle = flight.vehicle
        if vehicle.armed and facts.may_start and facts.held_since is None:
            facts.may_move, facts.may_start, facts.was_up = True, False, False
            facts.up_since = len(flight.received)
        facts.was_up = facts.was_up or not vehicle.landed
        if facts.may_move and vehicle.landed and not vehicle.armed:
            if facts.up_since is not None and not facts.was_up and not self.seen_armed(i):
                # It has disarmed itself before anybody knew.
                facts.may_move, facts.may_start = False, True
                return
            facts.lose_all()
            facts.down_since = len(flight.received)
            facts.fresh = facts.fresh and not facts.was_up
            if facts.by_failsafe:
                # It has ended with the flight.
                facts.held_since, facts.by_failsafe = None, False

    def seen_armed(self, i: int, since: int = 0) -> bool:
        """Whether a heartbeat has shown that it is armed as it was cleared to be.

        Args:
            i: Number of the vehicle.
            since: How many messages were received before those that count.
        """
        since = max(since, self.facts[i].up_since or 0)
        received = self.fleet.flights[i].received[since:]
        return any(isinstance(one, Heartbeat) and one.base_mode & 128 for one in received)

    def seen_down(self, i: int, heard: int) -> bool:
        """Whether a heartbeat has shown that it is down again, if it is."""
        since = self.facts[i].down_since
        if since is None or self.fleet.flights[i].vehicle.armed:
            return True
        received = self.fleet.flights[i].received[since:heard]
        return any(isinstance(one, Heartbeat) and not one.base_mode & 128 for one in received)

    def clear_by_parameter(self, i: int) -> None:
        """See whether the parameter clears a vehicle now."""
        dispatcher, facts = self.fleet.controller.dispatchers[i], self.facts[i]
        first = self.followed is not None and self.followed == self.first_search
        state = dispatcher.custody.state.value
        fresh = facts.fresh and facts.held_since is None and first
        person = facts.held_since is not None
        again = self.arm == "always" and not person
        vehicle = self.fleet.flights[i].vehicle
        if (fresh or again) and vehicle.landed and not vehicle.armed and state == "cleared":
            facts.may_start, facts.was_up = True, False
        if again and dispatcher.custody.airborne and facts.may_move:
            facts.recalled = facts.recalled and state == "recalled"

    def known(self, i: int, heard: int) -> bool:
        """Whether it was among the first messages received that somebody else has a vehicle."""
        flight, facts = self.fleet.flights[i], self.facts[i]
        if facts.held_since is None:
            return False
        since = flight.received[facts.held_since : heard]
        return sum(map(facts.shows, since)) >= facts.shown

    def check(self, i: int, message: object, heard: int) -> None:
        """Hold a message to the rules; so many were received before it was sent.

        Raises:
            AssertionError: If it must not be sent.
        """
        facts, flight = self.facts[i], self.fleet.flights[i]
        number = message.command if isinstance(message, CommandLong) else 0
        moves = isinstance(message, SetPositionTarget)
        if not (moves or number in (SET_MODE, *STARTS)):
            return
        if self.known(i, heard):
            self.fail(i, f"{message} though somebody else has it")
        if facts.held_since is not None:
            # It was on its way before anybody could know.
            if number == ARM and flight.vehicle.armed and not facts.released:
                # Nobody knows whose arming shows.
                facts.held_since, facts.may_move = None, True
            elif isinstance(message, CommandLong) and sets_mode_of(message, flight):
                # Nor whose mode.
                facts.held_since = None
            return
        if number not in STARTS and not self.seen_down(i, heard):
            return
        if number in STARTS and not (facts.may_start or facts.may_move):
            self.fail(i, f"{message} though nobody has cleared it")
        armed_unseen = facts.up_since is not None and not self.seen_armed(i)
        if number == ARM and self.arm == "false" and not (facts.may_start or armed_unseen):
            self.fail(i, f"{message} though a person should arm it")
        if number == SET_MODE and not (facts.may_start or facts.may_move):
            self.fail(i, f"{message} though nobody has cleared it")
        if moves and (not facts.may_move or facts.recalled):
            self.fail(i, f"{message} though it must not fly anywhere")
        if moves:
            assert isinstance(message, SetPositionTarget)
            self.check_place(i, flight, message)

    def check_place(self, i: int, flight: VirtualFlight, message: SetPositionTarget) -> None:
        """Hold a setpoint to where its drone is, the vehicle is, or its home."""
        frame = self.fleet.frame
        place = geodetic_to_map(frame, message.lat_deg, message.lon_deg, 0.0)[:2]
        craft, home = flight.vehicle.craft, flight.vehicle.frame.home
        home_m = geodetic_to_map(frame, home.lat_deg, home.lon_deg, 0.0)[:2]
        here_m = (home_m[0] + craft.east_m, home_m[1] + craft.north_m)
        near = [here_m, home_m]
        near += [cell_to_map(frame, *cell) for cell in self.cells_of(i)]
        away_m = min(((x - place[0]) ** 2 + (y - place[1]) ** 2) ** 0.5 for x, y in near)
        if away_m > HERE_M:
            self.fail(i, f"{message} is {away_m:.0f} m from where it should be")

    def cells_of(self, i: int) -> list[tuple[int, int]]:
        """Return the cell of a drone's leg, and the one of before for as long as that may take."""
        legs = self.fleet.controller.search.legs
        known = self.cells[i]
        if legs and (not known or known[-1][1] != legs[i].cell):
            known.append((self.fleet.now, legs[i].cell))
        current = [cell for _, cell in known[-1:]] if legs else []
        late = len(known) > 1 and self.fleet.now - known[-1][0] < TURN_S
        return current + ([known[-2][1]] if late else [])

    def fail(self, i: int, what: str) -> None:
        """Raise.

        Raises:
            AssertionError: Always.
        """
        raise AssertionError(
            f"seed {self.seed}, {self.autopilot}, arm:={self.arm}, vehicle {i}: {what}\n"
            f"{self.facts[i]}\n{self.fleet.shown()}\n"
            + "\n".join(self.events[-15:])
            + "\n"
            + "\n".join(self.fleet.log[-15:])
        )
