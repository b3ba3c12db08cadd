# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which vehicle answers under a system id: its own id, its restarts, and whether there are two."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from dsse_ros.vehicles.mavlink.messages import AutopilotVersion, GlobalPosition
from dsse_ros.world.scenario.geodesy import offset_m

_BACK_S = 1.0
"""How far a clock must go back: messages overtake each other by less."""
_RESTARTED_S = 2.0
"""Time after which a clock that has gone back belongs to a restarted autopilot, not to another."""
_JUMP_M, _JUMP_MPS = 30.0, 100.0
"""A position that changes by more, and faster, is another vehicle's or a fault of the GPS."""
_SIGNS = 4
"""Signs of a second vehicle, in a short time, that prove it: one comes of a fault of the GPS."""
_SIGNS_S = 10.0
_FLIPS, _FLIPS_S = 3, 5.0
"""Changes between armed and disarmed, in a short time, that prove two vehicles."""
_DOUBLE_S = 30.0
"""Time without signs after which the second vehicle is gone."""
DOUBLE = "two vehicles have its system id"
"""Why a vehicle that has a double must not be flown."""


@dataclass(frozen=True)
class Identity:
    """Which vehicle answers under a system id.

    Attributes:
        uid: The vehicle's own id, AUTOPILOT_VERSION.uid2 or uid in hexadecimal digits; empty if it
            has none, None if it has not been reported.
        restarts: How often its autopilot has been restarted.
        has_double: Whether another vehicle has the same system id.
    """

    uid: str | None = None
    restarts: int = 0
    has_double: bool = False
    _boot_s: float = math.nan
    _place: tuple[float, float] | None = None
    # The clock that was left, and our time of that.
    _left: tuple[float, float] | None = None
    _signs_s: tuple[float, ...] = ()
    _armed: bool = False
    _flips_s: tuple[float, ...] = ()


def with_heartbeat(identity: Identity, *, armed: bool, now: float) -> Identity:
    """Return the identity after a heartbeat: see `with_position`."""
    recent = tuple(time_s for time_s in identity._flips_s if now - time_s < _FLIPS_S)
    if armed != identity._armed:
        recent = (*recent, now)
    signs = _SIGNS if len(recent) >= _FLIPS else 0
    return _with_signs(replace(identity, _armed=armed, _flips_s=recent), signs, now)


def with_position(identity: Identity, message: GlobalPosition, now: float) -> Identity:
    """Return the identity after a position.

    Args:
        identity: What was known before.
        message: The position, with the autopilot's clock.
        now: Our time in seconds.
    """
    boot_s, before_s = message.time_boot_ms * 1e-3, identity._boot_s
    place = (message.lat * 1e-7, message.lon * 1e-7) if message.lat or message.lon else None
    restarts, left, signs = identity.restarts, identity._left, 0
    if boot_s < before_s - _BACK_S:
        left = left or (before_s, now)
    elif left is not None and boot_s > left[0]:
        signs, left = 1, None
    if left is not None and now - left[1] >= _RESTARTED_S:
        restarts, left = restarts + 1, None
    if place is not None and identity._place is not None:
        away_m = math.hypot(*offset_m(identity._place, place))
        signs += away_m > max(_JUMP_M, _JUMP_MPS * abs(boot_s - before_s))
    uid = identity.uid if restarts == identity.restarts else None
    known = replace(identity, uid=uid, restarts=restarts, _boot_s=boot_s, _place=place, _left=left)
    return _with_signs(known, signs, now)


def with_version(identity: Identity, message: AutopilotVersion, now: float) -> Identity:
    """Return the identity after an AUTOPILOT_VERSION: see `with_position`."""
    uid2 = bytes(message.uid2)
    uid = uid2.hex() if any(uid2) else f"{message.uid:016x}" if message.uid else ""
    # A vehicle is not exchanged without a silence or a restart, which forget the id.
    known = identity.uid or uid
    signs = _SIGNS if known != uid else 0
    return _with_signs(replace(identity, uid=known), signs, now)


def unidentified(identity: Identity) -> Identity:
    """Return the identity of a vehicle whose id has to be reported again."""
    return replace(identity, uid=None)


def without_uid(identity: Identity) -> Identity:
    """Return the identity of a vehicle that does not report an id of its own."""
    return replace(identity, uid="") if identity.uid is None else identity


def _with_signs(identity: Identity, signs: int, now: float) -> Identity:
    recent = tuple(time_s for time_s in identity._signs_s if now - time_s < _DOUBLE_S)
    recent = (*recent, *(now,) * signs)[-2 * _SIGNS :]
    proven = sum(now - time_s < _SIGNS_S for time_s in recent) >= _SIGNS
    has_double = proven or (identity.has_double and bool(recent))
    if (has_double, recent) == (identity.has_double, identity._signs_s):
        return identity
    return replace(identity, has_double=has_double, _signs_s=recent)
