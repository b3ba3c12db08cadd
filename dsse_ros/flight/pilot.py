# SPDX-License-Identifier: Apache-2.0
"""Carries out orders, without a link and without a clock: told the time and what was heard."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, get_args

from dsse_ros.flight.defects import Defects, describe
from dsse_ros.flight.helm import Helm, NotOursError, OrderFailedError, PilotSettings
from dsse_ros.flight.maneuvers import Maneuver, maneuver
from dsse_ros.flight.mavlink_messages import CommandAck, Heartbeat, Incoming, Outgoing, StatusText
from dsse_ros.flight.mission_messages import Address, MissionMessage
from dsse_ros.flight.orders import Hold, Order, TakeOff
from dsse_ros.flight.streams import Streams
from dsse_ros.flight.vehicle_state import VehicleState, observe, without_link

__all__ = ["Outcome", "Pilot", "PilotSettings", "Status"]

Status = Literal["idle", "under_way", "done", "failed", "taken_over", "silent"]

_MISSION_MESSAGES = get_args(MissionMessage)
_TICK_S = 0.2
_GIVES_BACK_S = 5.0
"""How long PX4 may take to go back to OFFBOARD once it gets setpoints again."""
_OFFBOARD_LOSS_MODES = frozenset({"RTL", "HOLD", "LAND", "POSCTL", "ALTCTL", "STABILIZED"})
"""What PX4 does when it misses setpoints: parameter COM_OBL_RC_ACT."""
_DISARMS_S = 3.0
"""Until the mode that PX4 falls into by disarming shows in a heartbeat."""


@dataclass(frozen=True)
class Outcome:
    """What has become of the latest order.

    Attributes:
        order: The order, None if there was none.
        number: Its number, from 1; 0 if there was none.
        status: `idle` without an order; `done` only by what the vehicle did; `failed`;
            `taken_over` by a pilot or a failsafe, and nothing is sent until an order is given
            while the vehicle is in GUIDED again (PX4: HOLD or OFFBOARD); `silent` while no
            heartbeats come, and nothing is sent, after which an order goes on.
        reason: One line for people: what it waits for, or what went wrong.
        final: Whether an order that has failed would fail again.
    """

    order: Order | None = None
    number: int = 0
    status: Status = "idle"
    reason: str = ""
    final: bool = False


class Pilot:
    """Flies one vehicle, one order at a time, of which the latest counts.

    It takes only what its vehicle says: whoever drives it keeps other senders away. Heartbeats of
    ours are not its business. No defect of ours makes it raise: the order fails, with the reason.

    Args:
        target: The vehicle's autopilot.
        source: Ourselves.
        settings: How to fly.

    Attributes:
        counts: Events by a short key.

    Raises:
        ValueError: If the target is everybody.
    """

    def __init__(self, target: Address, source: Address, settings: PilotSettings) -> None:
        if not 1 <= target.system <= 255:
            raise ValueError(f"target: system {target.system!r} is not allowed; 1 to 255")
        self.counts: Counter[str] = Counter()
        self._settings = settings
        self._target, self._source = target, source
        self._helm = Helm(target, settings)
        self._streams = Streams(target, settings.dialect, settings.position_hz)
        self._maneuver: Maneuver | None = None
        self._outcome = Outcome()
        self._defects = Defects(f"vehicle {target.system}")
        self._suspect = False
        self._taken_over = False
        self._missing_until_s: float | None = None
        self._disarmed_s = -math.inf
        self._due_s = -math.inf
        self._parting = False

    @property
    def state(self) -> VehicleState:
        """What the vehicle says of itself."""
        return self._helm.state

    @property
    def outcome(self) -> Outcome:
        """What has become of the latest order."""
        if self._silent:
            silence = f"no heartbeat for {self._settings.link_timeout_s:g} s"
            return replace(self._outcome, status="silent", reason=silence)
        return self._outcome

    @property
    def deadline(self) -> float:
        """Time at which `tick` is due."""
        helm = self._helm
        if not self._may_act:
            return self._due_s
        transfer_s = helm.exchange.deadline if helm.exchange is not None else None
        return min(self._due_s, helm.due_s, math.inf if transfer_s is None else transfer_s)

    def give(self, order: Order, now: float) -> list[Outgoing]:
        """Take an order in place of any other; returns what to send."""
        self._outcome = Outcome(order, self._outcome.number + 1, "under_way", "given")
        self._maneuver = None
        return self._guarded(now, lambda: self._give(order))

    def _give(self, order: Order) -> None:
        helm = self._helm
        if self._taken_over:
            if not (helm.state.connected and helm.state.mode in helm.handed_over):
                self._outcome = replace(
                    self._outcome, status="taken_over", reason=self._elsewhere()
                )
                return
            self._taken_over = self._suspect = False
        helm.begin()
        self._maneuver = maneuver(helm, order, self._source)

    def receive(self, message: Incoming, now: float) -> list[Outgoing]:
        """Take a message of the vehicle; returns what to send."""
        return self._guarded(now, lambda: self._receive(message, now))

    def _receive(self, message: Incoming, now: float) -> None:
        helm = self._helm
        was_silent, before = self._silent, helm.state
        helm.state = self._judge(observe(before, message, now, self._settings.dialect))
        self._streams.heard(message, now)
        match message:
            case Heartbeat():
                if was_silent:
                    self.counts["link_found"] += 1
                    helm.be_patient()
                self._watch_mode(before)
            case StatusText(_, text):
                helm.words(text)
            case CommandAck(_, _, system, component):
                if system in (0, self._source.system) and component in (0, self._source.component):
                    helm.acknowledged(message)
            case message if isinstance(message, _MISSION_MESSAGES) and helm.exchange is not None:
                helm.out += helm.exchange.receive(message, self._target, now)

    def tick(self, now: float) -> list[Outgoing]:
        """Let time pass; returns what to send."""
        self._due_s = now + _TICK_S
        return self._guarded(now, lambda: self._tick(now))

    def _tick(self, now: float) -> None:
        helm = self._helm
        if helm.state.connected and now - helm.state.heard_s > self._settings.link_timeout_s:
            helm.state = without_link(helm.state)
            self._missing_until_s = None
            self.counts["link_lost"] += 1
        if self._may_act:
            if helm.exchange is not None:
                helm.out += helm.exchange.tick(now)
            helm.out += self._streams.requests(now, flies_somewhere=helm.set_point is not None)

    def part(self, now: float) -> list[Outgoing]:
        """Have a vehicle that flies to our setpoints hold by itself; returns what to send.

        One that takes off, comes down or flies a mission does that without us, and one that is in
        somebody else's hands is left alone.
        """
        helm, outcome = self._helm, self._outcome
        climbs = isinstance(outcome.order, TakeOff) and outcome.status == "under_way"
        ours = self._may_act and helm.own_modes is not None and helm.state.flying
        modes = helm.coming or {helm.state.mode}
        if not ours or helm.guided not in modes or modes - helm.handed_over:
            return []
        if climbs and not helm.px4:
            return []
        self._parting = True
        return self.give(Hold(), now)

    @property
    def parting(self) -> bool:
        """Whether it is still to be seen that the vehicle holds, after `part`."""
        helm = self._helm
        if not (self._parting and self._may_act and self._outcome.status == "under_way"):
            return False
        return not (helm.rests and (helm.px4 or helm.confirmed))

    @property
    def _may_act(self) -> bool:
        """Whether the vehicle hears us, and is not in somebody else's hands."""
        return self._helm.state.connected and not self._taken_over and not self._suspect

    @property
    def _silent(self) -> bool:
        state = self._helm.state
        return bool(state.mode) and not state.connected

    def _guarded(self, now: float, happen: Callable[[], None]) -> list[Outgoing]:
        """Let something happen, go on with the order, and return what is to be sent."""
        helm = self._helm
        helm.now = now
        try:
            happen()
            if self._may_act:
                self._advance()
        except OrderFailedError as error:
            self._end("failed", str(error), final=error.final)
        except NotOursError:
            self._take_over()
        except Exception as error:
            self._break(error)
        said, helm.out = helm.out, []
        return said if self._may_act else []

    def _break(self, error: Exception) -> None:
        """End what a defect of ours has broken; setpoints of PX4 go on, and keep it where it is."""
        self.counts["errors"] += 1
        self._defects.log(error)
        self._helm.exchange = None
        if self._outcome.status == "under_way":
            self._end("failed", describe(error))

    def _advance(self) -> None:
        helm = self._helm
        if self._misses_set_points:
            self._give_set_points()
            return
        if self._maneuver is not None:
            try:
                self._wait(next(self._maneuver))
            except StopIteration:
                self._end("done", "")
        helm.keep_set_point(under_way=self._maneuver is not None)

    def _wait(self, reason: str) -> None:
        if reason != self._outcome.reason or self._outcome.status != "under_way":
            self._outcome = replace(self._outcome, status="under_way", reason=reason)

    def _end(self, status: Status, reason: str, *, final: bool = False) -> None:
        self._maneuver = None
        self._outcome = replace(self._outcome, status=status, reason=reason, final=final)
        self.counts[status] += 1

    # PX4 without setpoints

    def _judge(self, state: VehicleState) -> VehicleState:
        """Return the state with the failsafe `offboard` where PX4 may be missing setpoints.

        It says so in no message that pymavlink knows. It has left OFFBOARD, or whatever it was in
        before we were there, is critical, and does not say why: so it has missed ours, be it that
        we were late, that they were lost on their way or that we have been restarted. To send
        them is harmless, as in any other mode they have no effect.
        """
        helm = self._helm
        if state.failsafe not in ("critical", "offboard"):
            return state
        wanted = helm.own_modes is None or helm.set_point is not None
        elsewhere = state.mode not in (helm.own_modes or ())
        missed = (
            helm.px4
            and not self._taken_over
            and state.flying
            and state.mode in _OFFBOARD_LOSS_MODES
            and ((wanted and elsewhere) or self._misses_set_points)
        )
        return replace(state, failsafe="offboard" if missed else "critical")

    @property
    def _misses_set_points(self) -> bool:
        return self._helm.px4 and self._helm.state.failsafe == "offboard"

    def _give_set_points(self) -> None:
        """Send setpoints and command no mode: PX4 goes back to OFFBOARD by itself, or it is lost.

        Raises:
            NotOursError: If it has not for too long.
        """
        helm = self._helm
        if self._maneuver is None and helm.set_point is None:
            return
        if helm.set_point is None:
            if not helm.state.has_position:
                self._wait("waits for the vehicle's position")
                return
            helm.aim(helm.state.lat_deg, helm.state.lon_deg, helm.state.alt_m)
        if self._missing_until_s is None:
            self._missing_until_s = helm.now + _GIVES_BACK_S
            if helm.own_modes is not None:
                helm.own_modes |= {helm.guided}
        if helm.now > self._missing_until_s:
            raise NotOursError(helm.state.mode)
        if self._maneuver is not None:
            helm.be_patient()
            self._wait(f"misses setpoints: waits for {helm.guided}")
        helm.keep_set_point(under_way=self._maneuver is not None)

    def _watch_mode(self, before: VehicleState) -> None:
        """See whether the mode is another than what we and the autopilot have made it."""
        helm, mode = self._helm, self._helm.state.mode
        if self._misses_set_points:
            self._suspect = False
            return
        if self._missing_until_s is not None and mode == helm.guided:
            # That was it.
            self.counts["offboard_lost"] += 1
        self._missing_until_s = None
        if before.armed and not helm.state.armed:
            self._disarmed_s = helm.now
        if self._taken_over or helm.own_modes is None or mode in helm.own_modes:
            self._suspect = False
            return
        if helm.px4 and not helm.state.armed and helm.now - self._disarmed_s < _DISARMS_S:
            # By disarming it falls back into a mode that it was in before.
            helm.own_modes |= {mode}
            return
        if helm.px4 and mode == "HOLD" and not helm.state.armed:
            helm.own_modes |= {"HOLD"}
            return
        # One heartbeat may have been overtaken by another.
        if self._suspect:
            self._take_over()
        self._suspect = True

    def _take_over(self) -> None:
        self._taken_over = True
        self._missing_until_s = None
        self._helm.let_go()
        self._helm.state = self._judge(self._helm.state)
        self._end("taken_over", self._elsewhere() + self._helm.said_lately())

    def _elsewhere(self) -> str:
        state = self._helm.state
        failsafe = f", {state.failsafe} failsafe" if state.failsafe else ""
        return f"in {state.mode or 'no known mode'}{failsafe}"
