# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recognises modes set by a person or a failsafe rather than by our orders."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import replace
from typing import NamedTuple

from dsse_ros.vehicles.autopilots import Failsafe
from dsse_ros.vehicles.control.commands import (
    DO_SET_MODE,
    EFFECT_S,
    OVERTAKEN_S,
    CommandSender,
    Situation,
    TakenOverError,
)
from dsse_ros.vehicles.control.vehicle_state import VehicleState

_COMMANDED = 8
_NOT_SHOWN = 2
"""Heartbeats without an acknowledged mode that prove that somebody has changed it since."""
_CONFIRMATIONS = 2
"""Heartbeats that confirm the mode after a silence or a sign of a failsafe."""
_MODE_RESTORED_S = 5.0
"""How long an autopilot may take to return to its guided mode once setpoints come again."""


class _Acknowledged(NamedTuple):
    """A mode that was commanded and acknowledged.

    Attributes:
        mode: The mode.
        since_s: When it was acknowledged.
        missing: How many heartbeats have not shown it since.
    """

    mode: str
    since_s: float
    missing: int = 0


class ModeWatch:
    """Compares a vehicle's mode with the modes that our orders set.

    Args:
        situation: The situation of the vehicle.
        commands: What sets modes.
        counts: Counts events, by a short key.

    Attributes:
        allowed: Modes that our orders set; None before the first order, when any is allowed.
        given_up: Whether somebody else has the vehicle; nothing is sent then.
        setpoints_missed: Whether it is known that the failsafe that is active comes of missing
            setpoints.
    """

    def __init__(self, situation: Situation, commands: CommandSender, counts: Counter[str]) -> None:
        self._situation = situation
        self._commands = commands
        self._counts = counts
        self.allowed: frozenset[str] | None = None
        self.given_up = False
        self.setpoints_missed = False
        # Modes that orders have set, without those in which the vehicle was found.
        self._ours: set[str] = set()
        self._announced: dict[str, float] = {}
        self._foreign = False
        self._unconfirmed = 0
        self._setpoint_loss_until_s: float | None = None
        self._disarmed_s = -math.inf
        # Modes that were commanded and not acknowledged, with the times, oldest first; and the one
        # acknowledged last, until heartbeats show it.
        self._commanded: deque[tuple[str, float]] = deque(maxlen=_COMMANDED)
        self._acknowledged: _Acknowledged | None = None

    @property
    def _mode(self) -> str:
        return self._situation.state.mode

    @property
    def _failsafe_is_named(self) -> bool:
        return self._situation.state.failsafe not in (None, Failsafe.CRITICAL, Failsafe.OFFBOARD)

    # What orders bring about

    def announce(self, mode: str) -> None:
        """Record that a command will make the vehicle change to a mode."""
        self._announced[mode] = self._situation.now + EFFECT_S

    @property
    def announced(self) -> frozenset[str]:
        """Modes that a recent command sets and that may not show yet."""
        now = self._situation.now
        return frozenset(mode for mode, until_s in self._announced.items() if now < until_s)

    def allow(self, *modes: str) -> None:
        """Allow these modes, and those that a recent command still sets."""
        self.allowed = frozenset(modes) | self.announced
        self._ours |= self.allowed

    def tolerate(self, mode: str) -> None:
        """Allow a mode in which the vehicle was found, without counting it as ours."""
        self.allowed = frozenset({mode}) | self.announced

    def expect_failsafe(self, *, to_setpoints: bool) -> None:
        """Allow only the present mode if a failsafe has set it, or is about to change it.

        Nothing is sent until the mode is confirmed. If it changes before that, we have not changed
        it.

        Args:
            to_setpoints: Whether the order has the vehicle fly to setpoints, for lack of which it
                may be where it is.
        """
        situation, autopilot = self._situation, self._situation.autopilot
        elsewhere = (
            situation.state.failsafe is not None and self._mode not in autopilot.take_off_modes
        )
        lacks = to_setpoints and autopilot.streams_setpoints
        if self.allowed is None and (self._failsafe_is_named or (elsewhere and not lacks)):
            self.tolerate(self._mode)

    def adopt(self, mode: str) -> None:
        """Count a mode as ours, because an earlier run of the program has set it."""
        self._ours.add(mode)

    def is_ours(self, mode: str) -> bool:
        """Return whether our orders, or those of an earlier run of the program, set a mode."""
        return mode in self._ours

    def allow_any(self) -> None:
        """Allow any mode until the next `allow`."""
        self.allowed, self._foreign = None, False

    def check(self) -> None:
        """Raise a `TakenOverError` if our orders have not set the mode."""
        known = self._situation.autopilot.orderly_modes | self._ours
        if self._mode not in known or self._mode not in (self.allowed or known):
            raise TakenOverError

    def change(self, mode: str, *others: str, from_mode: str | None = None) -> str:
        """Change the mode as `CommandSender.send` does; these others are allowed until then.

        Args:
            mode: The mode to set.
            others: Modes that are allowed until then.
            from_mode: Mode of somebody else that may be changed too.

        Raises:
            TakenOverError: If somebody else or a failsafe has set the one in which it is.
        """
        situation = self._situation
        state, autopilot = situation.state, situation.autopilot
        if self._mode != from_mode:
            self.check()
            acts = state.armed and state.failsafe not in (None, Failsafe.OFFBOARD)
            if acts and self._mode not in autopilot.take_off_modes | {mode}:
                raise TakenOverError
        self.announce(mode)
        self.allow(self._mode, mode, *others)
        last = self._acknowledged if state.armed else None
        if last and last.mode == mode and situation.now - last.since_s < EFFECT_S:
            # It has been in that mode. The next heartbeats show it, or that somebody has left it.
            return f"waiting for {mode}"
        parameters, sent = autopilot.mode_parameters(mode), len(situation.out)
        waiting = self._commands.send_long(DO_SET_MODE, f"waiting for {mode}", *parameters)
        if len(situation.out) > sent:
            self._commanded.append((mode, situation.now))
            self._acknowledged = None
        return waiting

    def acknowledge(self, *, accepted: bool) -> None:
        """Take the answer to the oldest command of a mode."""
        now = self._situation.now
        while self._commanded:
            mode, sent_s = self._commanded.popleft()
            if now - sent_s < EFFECT_S:
                self._acknowledged = _Acknowledged(mode, now) if accepted else None
                return

    def _watch_acknowledged(self) -> None:
        """Raise a `TakenOverError` if somebody has left a mode before a heartbeat showed it."""
        situation = self._situation
        if self._acknowledged is None:
            return
        mode, since_s, missing = self._acknowledged
        shown = mode == self._mode or (
            mode == situation.autopilot.mission_mode
            and self._mode in situation.autopilot.mission_modes
        )
        if shown or not situation.state.armed or situation.state.failsafe:
            self._acknowledged = None
            return
        missing += 2 if situation.now - since_s > OVERTAKEN_S else 1
        self._acknowledged = _Acknowledged(mode, since_s, missing)
        if missing >= _NOT_SHOWN and not self.given_up:
            raise TakenOverError

    @property
    def resting(self) -> bool:
        """Whether the vehicle is in the resting mode and stays there."""
        resting_mode = self._situation.autopilot.resting_mode
        return self._mode == resting_mode and not self.announced - {resting_mode}

    # Who controls the vehicle

    def give_up(self) -> None:
        """Leave the vehicle to the person or failsafe that has set its mode."""
        self.allow_any()
        self.given_up = True
        self._announced.clear()
        self._commanded.clear()
        self._acknowledged = None
        self._ours.clear()
        self.end_setpoint_loss()

    def resume(self) -> None:
        """Take the vehicle back, because a person has allowed it."""
        self.given_up, self._unconfirmed = False, 0
        self.allow_any()

    @property
    def confirmed(self) -> bool:
        """Whether the mode of the last heartbeats is one in which something may be sent."""
        return not (self.given_up or self._foreign or self._unconfirmed)

    @property
    def streams_unconfirmed(self) -> bool:
        """Whether a stream of setpoints goes on although the mode is to be confirmed.

        The vehicle is in its guided mode still: without setpoints it would leave it.
        """
        autopilot = self._situation.autopilot
        guided = autopilot.streams_setpoints and self._mode == autopilot.guided_mode
        return guided and not (self.given_up or self._foreign)

    def require_confirmation(self) -> None:
        """Send nothing until heartbeats have confirmed the mode: it may be about to change."""
        self._unconfirmed = _CONFIRMATIONS

    def watch(self, before: VehicleState) -> None:
        """Take a heartbeat.

        Raises:
            TakenOverError: If the mode is a foreign one; in two of them where it may be an old one
                of ours that has been overtaken, or come of missing setpoints.
        """
        situation, autopilot = self._situation, self._situation.autopilot
        state, mode = situation.state, self._mode
        self._unconfirmed = max(self._unconfirmed - 1, 0)
        if mode in self._announced:
            # Earlier commands have had their effect.
            until_s = self._announced[mode]
            overtaken = {m for m, s in self._announced.items() if s < until_s}
            self._announced = {m: s for m, s in self._announced.items() if m not in overtaken}
            self.allowed = None if self.allowed is None else self.allowed - overtaken
        if self.lacks_setpoints:
            self._foreign = False
            return
        if self._setpoint_loss_until_s is not None and mode == autopilot.guided_mode:
            self._counts["offboard_lost"] += 1
        self.end_setpoint_loss()
        self._watch_acknowledged()
        if before.armed and not state.armed:
            self._disarmed_s = situation.now
        if self.given_up or self.allowed is None or mode in self.allowed:
            self._foreign = False
            return
        just_disarmed = situation.now - self._disarmed_s < autopilot.disarming_s
        if not state.armed and (just_disarmed or mode in autopilot.disarmed_modes):
            self.allowed |= {mode}
            return
        critical = state.failsafe is Failsafe.CRITICAL and autopilot.streams_setpoints
        may_be_ours = critical or (mode in self._ours and not self._failsafe_is_named)
        if self._foreign or not may_be_ours:
            raise TakenOverError
        self._foreign = True

    # Loss of setpoints

    def with_setpoint_loss(
        self, state: VehicleState, *, wanted: bool, heartbeat: bool = False
    ) -> VehicleState:
        """Return the state with the failsafe `offboard` where setpoints are missing.

        PX4 has left OFFBOARD, or whatever it was in before we connected, is critical and reports no
        other reason, and it is known that it has missed setpoints. Another reason is reported until
        the second heartbeat. Without that knowledge nothing is sent: see `setpoints_missed`.

        Args:
            state: What the vehicle reports.
            wanted: Whether the order that is carried out has the vehicle fly to setpoints. Only
                then may they pull it out of a return that it has begun.
            heartbeat: Whether that is news of a heartbeat.
        """
        if state.failsafe not in (Failsafe.CRITICAL, Failsafe.OFFBOARD):
            return state
        critical = self._situation.state.failsafe is Failsafe.CRITICAL
        confirmed = critical and self._unconfirmed <= int(heartbeat)
        situation, autopilot = self._situation, self._situation.autopilot
        elsewhere = state.mode not in (self.allowed or ())
        missed = (
            wanted
            and self.setpoints_missed
            and (confirmed or self.lacks_setpoints)
            and not self.given_up
            and state.flying
            and state.alt_m >= situation.settings.recovery_alt_m
            and state.mode in autopilot.setpoint_loss_modes
            and (elsewhere or self.lacks_setpoints)
            and (self.allowed is None or autopilot.guided_mode in self.allowed)
        )
        return replace(state, failsafe=Failsafe.OFFBOARD if missed else Failsafe.CRITICAL)

    @property
    def lacks_setpoints(self) -> bool:
        """Whether the vehicle has left the guided mode for lack of setpoints."""
        return self._situation.state.failsafe is Failsafe.OFFBOARD

    def await_guided_mode(self) -> None:
        """Wait until the autopilot goes back to its guided mode by itself, as setpoints come.

        Raises:
            TakenOverError: If it does not for too long.
        """
        now = self._situation.now
        if self._setpoint_loss_until_s is None:
            self._setpoint_loss_until_s = now + _MODE_RESTORED_S
            allowed = frozenset({self._mode}) if self.allowed is None else self.allowed
            self.allowed = allowed | {self._situation.autopilot.guided_mode}
        if now > self._setpoint_loss_until_s:
            raise TakenOverError

    def end_setpoint_loss(self) -> None:
        """Record that setpoints are not missing, or that this cannot be known."""
        self._setpoint_loss_until_s = None
