# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which inputs a live search accepts, and what it decides about them."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from typing import NamedTuple

from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.mission.live.contacts import MOST_OPEN, OPEN
from dsse_ros.mission.live.inputs import Input
from dsse_ros.mission.live.live_search import Entry, LiveSearch, detection_of
from dsse_ros.search.belief.forecasts import is_ensemble
from dsse_ros.world.drift.flow import seconds

MOST_OF_KIND = {
    "detection": 50_000, "sighting": 100, "searched": 1000, "weather": 1000,
    "confirm": 10_000, "dismiss": 10_000, "withdraw": 10_000,
}  # fmt: skip
"""Inputs of a mission by kind: each takes about a kilobyte, and detections leave room for what is
decided about them."""
NEEDS_INCIDENT = ("sighting", "searched", "weather")
"""Kinds that change the drift or need its particles; they take longer to apply."""
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
    """Decides about the inputs of a live search, which does not change.

    Args:
        live_search: The live search.
    """

    def __init__(self, live_search: LiveSearch) -> None:
        self._live_search = live_search

    def check(self, received: Input, clocks: Clocks) -> Result[Entry | None]:
        """Return the entry of an input, or why it is refused; None for one that is known already.

        Args:
            received: The input.
            clocks: The clocks now.
        """
        known = self._live_search.entries.get(received.id)
        if known is not None:
            if (known.kind, dict(known.values)) == (received.kind, dict(received.values)):
                return Accepted(None)
            return Rejected("id_used", f"id must be new, got {received.id!r} of another input")
        if self._live_search.over:
            return Rejected("mission_over", "the mission is over")
        if refused := self._too_many(received.kind):
            return refused
        if received.kind in NEEDS_INCIDENT and (refused := self._no_incident(received.kind)):
            return refused
        timed = self._time(received, clocks)
        if isinstance(timed, Rejected):
            return timed
        begin_s, end_s = timed.value
        derived = {"lasts_s": end_s - begin_s} if received.kind == "searched" else {}
        entry = Entry(received.kind, received.id, begin_s, clocks.now_s, received.values, derived)
        try:
            self._live_search.check_near(entry)
        except ValueError as error:
            return Rejected("bad_value", str(error))
        checks: dict[str, Callable[[Entry], Result[Entry | None]]] = {
            "detection": self._check_detection, "sighting": self._check_drift,
            "searched": Accepted, "weather": self._check_drift,
            "confirm": self._check_contact, "dismiss": self._check_contact,
            "withdraw": self._check_withdraw,
        }  # fmt: skip
        return checks[received.kind](entry)

    def left_out(self, received: Input, clocks: Clocks) -> Entry | None:
        """Return the entry that has the look of a detection left out, of which there are too many.

        A look that detected has not failed. None if there is no such look, or nothing changes.
        """
        drone = received.values.get("drone", "")
        timed = self._time(received, clocks)
        if not drone or isinstance(timed, Rejected):
            return None
        entry = Entry(
            received.kind, received.id, timed.value[0], clocks.now_s, received.values,
            {"contact": ""},
        )  # fmt: skip
        try:
            self._live_search.check_near(entry)
        except ValueError:
            return None
        return entry if self._live_search.leaves_out(entry) else None

    def _too_many(self, kind: str) -> Rejected | None:
        most = MOST_OF_KIND[kind]
        if self._live_search.counts.get(kind, 0) >= most:
            return Rejected("too_many", f"{kind} must come at most {most} times in a mission")
        return None

    def _no_incident(self, kind: str) -> Rejected | None:
        if not is_ensemble(self._live_search.rules):
            return Rejected(
                "no_incident", f"{kind} must come with rules sea or flight, got "
                f"{self._live_search.rules.profile}",
            )  # fmt: skip
        incident = self._live_search.scenario.incident
        if kind != "searched" and (incident is None or incident.model_tracks is not None):
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
            return time_s > clocks.now_s + self._live_search.scenario.step_duration_s
        return stated > clocks.stamp_s + AHEAD_S

    def _seconds(self, stated: float | str, clocks: Clocks) -> Result[float]:
        if not isinstance(stated, str):
            return Accepted(clocks.of_stamp(stated))
        begins_s = self._live_search.scenario.begins_s
        if begins_s is None:
            return Rejected(
                "no_utc", f"time must be in seconds without an incident, which has a date, got "
                f"{stated!r}",
            )  # fmt: skip
        return Accepted(seconds(stated) - begins_s)

    def _check_detection(self, entry: Entry) -> Result[Entry | None]:
        drone = entry.values.get("drone", "")
        if drone and int(drone[5:]) >= self._live_search.scenario.num_drones:
            last = self._live_search.scenario.num_drones - 1
            return Rejected("bad_value", f"detection.drone must be 0 to {last}, got {drone!r}")
        contacts, place = self._live_search.contacts, self._live_search.place(entry.values)
        name = contacts.match(detection_of(entry, place), self._live_search.moved)
        if name not in contacts.by_name and len(contacts.of_state(OPEN)) >= MOST_OPEN:
            return Rejected("too_many", f"open contacts must be at most {MOST_OPEN}")
        return Accepted(dataclasses.replace(entry, derived={"contact": name}))

    def _check_drift(self, entry: Entry) -> Result[Entry | None]:
        """Draw the particles with a sighting or weather, because wind may be missing there."""
        live_search = self._live_search
        released_s = entry.time_s - 60.0 * entry.values.get("time_error", 0.0)
        if entry.kind == "sighting" and released_s < live_search.earliest_s:
            earliest = live_search.utc(live_search.earliest_s)
            return Rejected("bad_value", f"sighting.time must not be before {earliest}, with error")
        try:
            entries = [*live_search.of_kinds("sighting", "weather"), entry]
            # Nor may those of the POS fail.
            _ = live_search.forecast_of(live_search.informed(entries)).of_pos
        except ValueError as error:
            reason = re.sub(r"incident\.seen\[\d+\]", "sighting", str(error))
            return Rejected("bad_value", reason)
        return Accepted(entry)

    def _check_contact(self, entry: Entry) -> Result[Entry | None]:
        name = entry.values["contact"]
        contact = self._live_search.contacts.by_name.get(name)
        if contact is None:
            return Rejected("unknown_contact", f"contact must be one of this search, got {name!r}")
        if contact.state != OPEN:
            return Rejected("contact_closed", f"contact {name} must be open, it is {contact.state}")
        return Accepted(entry)

    def _check_withdraw(self, entry: Entry) -> Result[Entry | None]:
        name = entry.values["input"]
        known = self._live_search.entries.get(name)
        if known is None or name in self._live_search.withdrawn:
            return Rejected(
                "unknown_input", f"input must be an accepted one, not withdrawn, got {name!r}"
            )
        if known.kind in ("confirm", "withdraw"):
            return Rejected("bad_value", f"input must not be a {known.kind}, got {name!r}")
        if known.kind == "detection":
            contact = self._live_search.contacts.by_name[known.derived["contact"]]
            if contact.state != OPEN:
                return Rejected(
                    "contact_closed", f"contact {contact.name} must be open, it is {contact.state}"
                )
        return Accepted(entry)
