# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a restarted bridge must know about a vehicle."""

from __future__ import annotations

from dataclasses import dataclass, replace

from dsse_ros.vehicles.fleet.custody import AIRBORNE, Custody

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
        launched: Whether the bridge has ordered it to arm, and it has not been seen disarmed on the
            ground since.
        lost: Why it no longer follows its drone in that search; None if it does.
        arm: While it is cleared, whether the bridge may arm it.
        cleared_by: What has cleared it, `~/arm` or the parameter, while it is cleared or flown.
        cleared_from: While it is cleared, or free since then, who controlled it before.
        cleared_lost: `lost` before it was cleared.
        from_modes: While it is cleared, held or recalled, modes of others that the bridge may
            change.
        end: As it was recalled last, `return` or `land`; None if it was not.
        mode: While the bridge flies it, the last mode that the bridge has brought about; None if it
            does not.
        ordered: Modes to which its last order leads.
        top_amsl_m: Altitude above mean sea level to which it takes off for that search.
        looked: Number of the last leg for which it has searched, -1 for none.
        home: While the bridge flies it, its home at the take-off; None if it was not reported.
        items: While it flies a mission of the bridge, the number of its items without home; 0 if it
            does not.
        plan: Digest of that mission as it was read back; None if it flies none.
    """

    custody: Custody = Custody.FREE
    search: SearchId | None = None
    flown: bool = False
    launched: bool = False
    lost: str | None = None
    arm: bool = False
    cleared_by: str | None = None
    cleared_from: Custody = Custody.FREE
    cleared_lost: str | None = None
    from_modes: tuple[str, ...] = ()
    end: str | None = None
    mode: str | None = None
    ordered: tuple[str, ...] = ()
    top_amsl_m: float = 0.0
    looked: int = -1
    home: Place | None = None
    items: int = 0
    plan: str | None = None


def entering(record: FlightRecord, custody: Custody, mode: str) -> FlightRecord:
    """Return the record of a vehicle whose custody changes: what has held only before is dropped.

    Args:
        record: Its record before.
        custody: Who controls it now.
        mode: The mode in which it is.
    """
    after = replace(record, custody=custody)
    if custody not in AIRBORNE:
        by = record.cleared_by if custody is Custody.CLEARED else None
        after = replace(after, mode=None, ordered=(), cleared_by=by)
    elif record.custody not in AIRBORNE:
        after = replace(after, mode=mode, flown=True)
    if custody not in (Custody.CLEARED, Custody.FREE):
        after = replace(after, cleared_from=Custody.FREE, cleared_lost=None)
    return after


def inherited(record: FlightRecord, *, fresh: bool) -> FlightRecord:
    """Return the record with which a restarted bridge begins.

    A clearance ends with the bridge that was given it: the vehicle is what it was before. But it is
    unknown who armed a vehicle that this bridge was about to launch. A vehicle in the air is flown
    on only if the bridge was gone for a short time: then nobody else can have controlled it unseen.

    Args:
        record: Record of the bridge before.
        fresh: Whether that bridge was there a short time ago.
    """
    custody = record.custody
    if custody is Custody.CLEARED:
        custody = Custody.TAKEN if record.launched else Custody.FREE
    if custody is Custody.FREE and record.cleared_from is not Custody.FREE:
        custody = record.cleared_from
        record = replace(record, lost=record.cleared_lost)
    if custody in AIRBORNE and not fresh:
        custody = Custody.RELEASED
    return replace(
        record, custody=custody, cleared_by=None, cleared_from=Custody.FREE, cleared_lost=None
    )
