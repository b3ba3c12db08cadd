# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a restarted bridge must know about a vehicle."""

from __future__ import annotations

from dataclasses import dataclass, replace

from dsse_ros.bridge.custody import AIRBORNE, Custody

SearchId = tuple[int, int]
"""run_id and mission."""
Place = tuple[float, float, float]
"""Latitude and longitude in degrees, and altitude above mean sea level in metres."""


@dataclass(frozen=True)
class FlightRecord:
    """The state of a vehicle that a restarted bridge needs.

    Attributes:
        custody: Who controls it.
        search: The search that the record belongs to; None for the next one.
        flown: Whether it has been in the air for that search.
        launched: Whether the bridge has ordered it to arm, or has taken off with it, and it has not
            been seen disarmed on the ground since.
        lost: Why it no longer follows its drone in that search; empty if it does.
        arm: While it is cleared, whether the bridge may arm it.
        from_modes: While it is cleared or recalled, modes of others that the bridge may change.
        end: While it is recalled, `return` or `land`.
        mode: While the bridge flies it, the last mode that the bridge has brought about.
        ordered: Modes to which its last order leads.
        top_amsl_m: Altitude above mean sea level to which it takes off for that search.
        looked: Number of the last leg for which it has searched, -1 for none.
        home: While the bridge flies it, its home at the take-off; None if it was not reported.
        items: While it flies a mission of the bridge, the number of its items without home; 0 if it
            does not.
    """

    custody: Custody = Custody.FREE
    search: SearchId | None = None
    flown: bool = False
    launched: bool = False
    lost: str = ""
    arm: bool = False
    from_modes: tuple[str, ...] = ()
    end: str = ""
    mode: str = ""
    ordered: tuple[str, ...] = ()
    top_amsl_m: float = 0.0
    looked: int = -1
    home: Place | None = None
    items: int = 0


def inherited(record: FlightRecord, *, fresh: bool) -> FlightRecord:
    """Return the record with which a restarted bridge begins.

    A clearance ends with the bridge that was given it, and it is unknown who armed a vehicle that
    this bridge was about to launch. A vehicle in the air is flown on only if the bridge was gone
    for a short time: then nobody else can have controlled it unseen.

    Args:
        record: Record of the bridge before.
        fresh: Whether that bridge was there a short time ago.
    """
    custody = record.custody
    if custody is Custody.CLEARED:
        custody = Custody.TAKEN if record.launched else Custody.FREE
    if custody in AIRBORNE and not fresh:
        custody = Custody.RELEASED
    return replace(record, custody=custody)
