# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether the motors of a vehicle have stopped on the ground or in the air.

Copters that are not armed report to be on the ground, wherever they are, and stay in their mode.
Only the altitude tells: what has lost its motors falls. A fixed wing glides, and what stands on the
ground does not move. ArduPlane, whose altitude is useless once it is disarmed, says that it flies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

SINK_MPS = 4.0
"""Speed downwards at which no vehicle lands."""
_GLIDE_MPS, _GLIDE_M = 0.8, 5.0
"""A fixed wing glides: it sinks more slowly, but on and on."""
_ROLL_MPS, _ROLL_S = 3.0, 2.0
"""Speed over ground of what rolls or glides, and for how long what has landed may seem to fly."""
_HIT_S = 3.0
"""Time from the ground to motors that stop: by a crash check, or seen in a late heartbeat."""
_SETTLED_S = 1.0
"""Vehicle time after which a vehicle that does not move stands on the ground."""


@dataclass(frozen=True)
class MotorStop:
    """What is known of the last stop of a vehicle's motors; times are its own.

    Attributes:
        crashed: How it has crashed; None if it has not, or has been armed since, but not in the
            fall.
        settled: Whether it is known if it has, as far as positions come.
    """

    crashed: str | None = None
    settled: bool = True
    _flown: bool = False
    _sink_s: float = -math.inf
    _sink_mps: float = 0.0
    # Home's altitude above the sea as it flew first: PX4 moves its home along once it is disarmed.
    _home_amsl_m: float = 0.0
    # Time of the stop, and its altitude above the sea.
    _stop: tuple[float, float] | None = None


def with_motors(
    stop: MotorStop, *, before: bool, armed: bool, boot_s: float, alt_amsl_m: float,
    climb_mps: float,
) -> MotorStop:  # fmt: skip
    """Return what is known after a heartbeat.

    Args:
        stop: What was known.
        before: Whether the motors turned at the heartbeat before.
        armed: Whether they do.
        boot_s: Vehicle time of its last position.
        alt_amsl_m: Altitude of that above mean sea level.
        climb_mps: Speed upwards there.
    """
    if armed:
        if before:
            return stop
        # Somebody may start them again before the fall is fast.
        falls = stop._stop is not None and stop._stop[0] < boot_s and climb_mps < -_GLIDE_MPS
        return MotorStop(crashed=_stopped(stop)) if falls and not stop.settled else MotorStop()
    if not before or not stop._flown or not math.isfinite(boot_s):
        return stop
    if boot_s - stop._sink_s <= _HIT_S:
        height_m = alt_amsl_m - stop._home_amsl_m
        what = f"it fell at {stop._sink_mps:.0f} m/s, {height_m:.0f} m above home"
        return replace(stop, crashed=what)
    return replace(stop, crashed=None, settled=False, _stop=(boot_s, alt_amsl_m))


def _stopped(stop: MotorStop) -> str:
    assert stop._stop is not None
    return f"its motors stopped {stop._stop[1] - stop._home_amsl_m:.0f} m above home"


def with_altitude(
    stop: MotorStop, *, armed: bool, flying: bool, boot_s: float, alt_amsl_m: float, alt_m: float,
    climb_mps: float, speed_mps: float,
) -> MotorStop:  # fmt: skip
    """Return what is known after a position.

    Args:
        stop: What was known.
        armed: Whether the motors turn.
        flying: Whether it reports to be in the air, armed or not.
        boot_s: Vehicle time of the position.
        alt_amsl_m: Altitude above mean sea level.
        alt_m: Altitude above home.
        climb_mps: Speed upwards.
        speed_mps: Speed over ground.
    """
    if armed:
        if flying and not stop._flown:
            stop = replace(stop, _flown=True, _home_amsl_m=alt_amsl_m - alt_m)
        if climb_mps < -SINK_MPS:
            return replace(stop, _sink_s=boot_s, _sink_mps=-climb_mps)
        return stop
    if stop.settled or stop._stop is None:
        return stop
    stop_s, stop_amsl_m = stop._stop
    if boot_s < stop_s:
        # Its autopilot was restarted, or this is another vehicle's position.
        return replace(stop, settled=True)
    glides = climb_mps < -_GLIDE_MPS
    moves, since_s = speed_mps > _ROLL_MPS, boot_s - stop_s
    lower = glides and alt_amsl_m < stop_amsl_m - _GLIDE_M
    if climb_mps < -SINK_MPS or lower or (flying and moves and since_s >= _ROLL_S):
        return replace(stop, crashed=_stopped(stop), settled=True)
    known = not (glides or moves) and since_s >= _SETTLED_S
    return replace(stop, settled=True) if known else stop
