# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which inputs a live search accepts, and what it decides about them."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from typing import NamedTuple

from dsse_ros.belief.forecasts import is_ensemble
from dsse_ros.drift.flow import seconds
from dsse_ros.live.contacts import MOST_OPEN, OPEN
from dsse_ros.live.inputs import Input
from dsse_ros.live.keeper import Entry, Keeper, detection_of
from dsse_ros.result import Accepted, Rejected, Result

MOST_INPUTS = 50_000
"""Inputs of a mission: each takes about a kilobyte."""
MOST_OF_KIND = {"sighting": 100, "searched": 1000, "weather": 1000}
"""Inputs of the kinds that take longer to apply, which need particles."""
AHEAD_S = 1.0
"""How far ahead the clock of a sender may be."""


class Clocks(NamedTuple):
    """The clocks by which an input states its time.

    Attributes:
        now_s: Time since the search began, s.
        stamp_s: The node's clock, s.
        of_stamp: Returns the time since the search began of a stamp of that clock.
    """

    now_s: float
    stamp_s: float
    of_stamp: Callable[[float], float]


class Admission:
    """Decides about the inputs of a keeper, which does not change.

    Args:
        keeper: The keeper.
    """

    def __init__(self, keeper: Keeper) -> None:
        self._keeper = keeper

    def check(self, received: Input, clocks: Clocks) -> Result[Entry | None]:
        """Return the entry of an input, or why it is refused; None for one that is known already.

        Args:
            received: The input.
            clocks: The clocks now.
        """
        known = self._keeper.entries.get(received.id)
        if known is not None:
            if (known.kind, dict(known.values)) == (received.kind, dict(received.values)):
                return Accepted(None)
            return Rejected("id_used", f"id must be new, got {received.id!r} of another input")
        if self._keeper.over:
            return Rejected("mission_over", "the mission is over")
        if refused := self._too_many(received.kind):
            return refused
        if received.kind in MOST_OF_KIND and (refused := self._no_incident(received.kind)):
            return refused
        timed = self._time(received, clocks)
        if isinstance(timed, Rejected):
            return timed
        begin_s, end_s = timed.value
        derived = {"lasts_s": end_s - begin_s} if received.kind == "searched" else {}
        entry = Entry(received.kind, received.id, begin_s, clocks.now_s, received.values, derived)
        checks: dict[str, Callable[[Entry], Result[Entry | None]]] = {
            "detection": self._check_detection, "sighting": self._check_drift,
            "searched": self._check_searched, "weather": self._check_drift,
            "confirm": self._check_contact, "dismiss": self._check_contact,
            "withdraw": self._check_withdraw,
        }  # fmt: skip
        return checks[received.kind](entry)

    def _too_many(self, kind: str) -> Rejected | None:
        most = MOST_OF_KIND.get(kind, MOST_INPUTS)
        if len(self._keeper.entries) >= MOST_INPUTS or self._keeper.counts.get(kind, 0) >= most:
            return Rejected("too_many", f"inputs of a mission must be at most {most}")
        return None

    def _no_incident(self, kind: str) -> Rejected | None:
        if not is_ensemble(self._keeper.rules):
            return Rejected(
                "no_incident", f"{kind} must come with rules sea or flight, got "
                f"{self._keeper.rules.profile}",
            )  # fmt: skip
        incident = self._keeper.scenario.incident
        if kind != "searched" and (incident is None or incident.given_tracks is not None):
            return Rejected("no_incident", f"{kind} must come with an incident with sightings")
        return None

    def _time(self, received: Input, clocks: Clocks) -> Result[tuple[float, float]]:
        """Return the own time of an input, its begin and its end."""
        times = []
        for name in ("time", "end"):
            stated = received.values.get(name)
            if stated is None:
                continue
            converted = self._seconds(stated, clocks)
            if isinstance(converted, Rejected):
                return converted
            if self._is_ahead(stated, converted.value, clocks):
                return Rejected(
                    "time_ahead", f"{received.kind}.{name} must not be in the future, got {stated}"
                )
            times.append(converted.value)
        if len(times) > 1 and times[1] < times[0]:
            return Rejected("bad_value", f"{received.kind}.end must not be before its time")
        if "time" not in received.values:
            times.insert(0, min([clocks.now_s, *times]))
        time_s = times[0]
        if time_s < 0.0 and received.kind in ("detection", "searched"):
            return Rejected(
                "before_search", f"{received.kind}.time must not be before the search began, got "
                f"{received.values['time']}",
            )  # fmt: skip
        return Accepted((time_s, times[-1]))

    def _is_ahead(self, stated: float | str, time_s: float, clocks: Clocks) -> bool:
        if isinstance(stated, str):
            return time_s > clocks.now_s + self._keeper.scenario.step_duration_s
        return stated > clocks.stamp_s + AHEAD_S

    def _seconds(self, stated: float | str, clocks: Clocks) -> Result[float]:
        if not isinstance(stated, str):
            return Accepted(clocks.of_stamp(stated))
        begins_s = self._keeper.begins_s
        if begins_s is None:
            return Rejected(
                "no_utc", f"time must be in seconds without an incident, which has a date, got "
                f"{stated!r}",
            )  # fmt: skip
        return Accepted(seconds(stated) - begins_s)

    def _check_detection(self, entry: Entry) -> Result[Entry | None]:
        place = self._keeper.place(entry.values)
        if place is None:
            return Rejected("bad_value", "detection.lat and lon must be on this side of the Earth")
        drone = entry.values.get("drone", "")
        if drone and int(drone[5:]) >= self._keeper.scenario.num_drones:
            last = self._keeper.scenario.num_drones - 1
            return Rejected("bad_value", f"detection.drone must be 0 to {last}, got {drone!r}")
        contacts = self._keeper.contacts
        name = contacts.match(detection_of(entry, place), self._keeper.moved)
        if name not in contacts.by_name and len(contacts.of_state(OPEN)) >= MOST_OPEN:
            return Rejected("too_many", f"open contacts must be at most {MOST_OPEN}")
        return Accepted(dataclasses.replace(entry, derived={"contact": name}))

    def _check_searched(self, entry: Entry) -> Result[Entry | None]:
        try:
            self._keeper.area(entry)
        except ValueError as error:
            return Rejected("bad_value", f"searched.geometry: {error}")
        return Accepted(entry)

    def _check_drift(self, entry: Entry) -> Result[Entry | None]:
        """Draw the particles with a sighting or weather, because wind may be missing there."""
        keeper = self._keeper
        released_s = entry.time_s - 60.0 * entry.values.get("time_error", 0.0)
        if entry.kind == "sighting" and released_s < keeper.earliest_s:
            earliest = keeper.utc(keeper.earliest_s)
            return Rejected("bad_value", f"sighting.time must not be before {earliest}, with error")
        try:
            entries = [*keeper.of_kinds("sighting", "weather"), entry]
            keeper.forecast_of(keeper.informed(entries))
        except ValueError as error:
            reason = re.sub(r"incident\.seen\[\d+\]", "sighting", str(error))
            return Rejected("bad_value", reason)
        return Accepted(entry)

    def _check_contact(self, entry: Entry) -> Result[Entry | None]:
        name = entry.values["contact"]
        contact = self._keeper.contacts.by_name.get(name)
        if contact is None:
            return Rejected("unknown_contact", f"contact must be one of this search, got {name!r}")
        if contact.state != OPEN:
            return Rejected("contact_closed", f"contact {name} must be open, it is {contact.state}")
        return Accepted(entry)

    def _check_withdraw(self, entry: Entry) -> Result[Entry | None]:
        name = entry.values["input"]
        known = self._keeper.entries.get(name)
        if known is None or name in self._keeper.withdrawn:
            return Rejected(
                "unknown_input", f"input must be an accepted one, not withdrawn, got {name!r}"
            )
        if known.kind in ("confirm", "withdraw"):
            return Rejected("bad_value", f"input must not be a {known.kind}, got {name!r}")
        if known.kind == "detection":
            contact = self._keeper.contacts.by_name[known.derived["contact"]]
            if contact.state != OPEN:
                return Rejected(
                    "contact_closed", f"contact {contact.name} must be open, it is {contact.state}"
                )
        return Accepted(entry)
