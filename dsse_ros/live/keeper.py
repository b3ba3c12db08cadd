# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The keeper of a live search: its belief as a pure function of the looks and inputs so far."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from dsse_ros.belief.belief import Belief, Forecast
from dsse_ros.belief.ensemble_belief import EnsembleBelief, EnsembleForecast
from dsse_ros.belief.followers import DRIFT_SAMPLES
from dsse_ros.belief.forecasts import forecast_for
from dsse_ros.belief.protocol import TargetForecast
from dsse_ros.drift.flow import Kind, utc
from dsse_ros.live.chain import Chain
from dsse_ros.live.contacts import (
    CONFIRMED,
    DISMISSED,
    OPEN,
    Contact,
    Contacts,
    Detection,
)
from dsse_ros.live.evidence import MOST_OF_CONTACT, Evidence, SearchedArea
from dsse_ros.live.places import Places
from dsse_ros.live.step_looks import AnyBelief, Sensors, StepLooks
from dsse_ros.scenario.frames import scenario_frame
from dsse_ros.scenario.geodesy import geodetic_to_map, map_to_geodetic, on_near_side
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search.faults import false_alarms
from dsse_ros.search.flights import lateral_ranges
from dsse_ros.step.looks import looks_of
from dsse_ros.step.sightings import eyes_of

EARLIEST_S = 86400.0
"""Time from a sighting to the search: particles drift for so long, which takes time."""
FLOWS: tuple[Kind, ...] = ("wind", "current")
"""What a report of weather may have."""
Forecasts = Callable[[ResolvedScenario], TargetForecast]
_OF_CONTACT = {"confirm": CONFIRMED, "dismiss": DISMISSED}


@dataclass(frozen=True)
class Entry:
    """An accepted input, as the journal has it.

    Attributes:
        kind: One of `inputs.KINDS`.
        id: Its identity.
        time_s: Its own time, s since the search began.
        received_s: When it was received, on the same clock.
        values: Its fields.
        derived: What the keeper has decided: the `contact` of a detection, and how long a searched
            area took, `lasts_s`.
    """

    kind: str
    id: str
    time_s: float
    received_s: float
    values: Mapping[str, Any]
    derived: Mapping[str, Any] = dataclasses.field(default_factory=dict)


class Keeper:
    """The state of a live search.

    `apply` takes up what `Admission` has accepted, and `step` the looks of a step. Equal calls in
    the same order give equal beliefs, bit for bit.

    Args:
        scenario: The scenario.
        rules: The rules.
        forecasts: Makes the forecast of a scenario; by default that of a mission's belief.

    Attributes:
        scenario: As given, with what inputs changed.
        history: The steps and entries so far, in order.
        steps: The steps among them.
        contacts: The contacts.
        found: Number of persons who were confirmed.
    """

    def __init__(
        self, scenario: ResolvedScenario, rules: Rules, forecasts: Forecasts | None = None
    ) -> None:
        self.scenario = self._stated = scenario
        self.rules = rules
        self._forecasts = forecasts or partial(
            forecast_for, rules=rules, drift_samples=DRIFT_SAMPLES
        )
        self._frame = scenario_frame(scenario)
        looks = looks_of(scenario, rules)
        eyes = None
        rates = np.full(len(scenario.kinds), scenario.false_alarm_rate)
        if rules.in_metres:
            eyes = eyes_of(lateral_ranges(scenario), scenario.step_duration_s)
        else:
            rates = false_alarms(scenario, looks).max(axis=1)
        step_s = scenario.step_duration_s
        self._sensors = Sensors(looks, eyes, scenario.cell_size, step_s, scenario.grid_size)
        self._forecast = self.forecast_of(scenario)
        self._evidence = Evidence(self._sensors, rates, step_s, self._frame.side_m**2)
        self._evidence.draw(self._start, Places(self._forecast))
        self.history: list[StepLooks | Entry] = []
        self.steps: list[StepLooks] = []
        self.contacts = Contacts()
        self.found = 0
        self.entries: dict[str, Entry] = {}
        self.withdrawn: set[str] = set()
        self._pending: list[str] = []
        self.counts: dict[str, int] = {}
        # Steps from which the two beliefs must be computed again.
        self._late: dict[bool, int] = {}
        self._chains = {False: self._chain(weighed=False)}

    # The beliefs

    def forecast_of(self, scenario: ResolvedScenario) -> Forecast | EnsembleForecast:
        """Return the forecast of a scenario under the rules.

        Raises:
            ValueError: If its particles cannot be drawn.
        """
        forecast = self._forecasts(scenario)
        assert isinstance(forecast, Forecast | EnsembleForecast)
        return forecast

    def _chain(self, *, weighed: bool) -> Chain:
        return Chain(self._start, self.steps, _Effects(self, weighed=weighed))

    def _start(self) -> AnyBelief:
        belief = self._forecast.belief()
        assert isinstance(belief, Belief | EnsembleBelief)
        return belief

    @property
    def belief(self) -> AnyBelief:
        """The belief from the looks and all inputs; its POS does not count."""
        self.update()
        return self._chains.get(True, self._chains[False]).belief

    @property
    def pos(self) -> float:
        """Cumulative probability of success of the looks and of the searches by others.

        It is the prior probability, by all sightings and weather, that searches like these detect
        the person. It does not depend on detections.
        """
        self.update()
        return self._chains[False].belief.pos

    def update(self) -> None:
        """Compute the beliefs again as far as inputs have changed them."""
        for weighed, step in self._late.items():
            if weighed and not self._evidence.detections:
                self._chains.pop(True, None)
            elif weighed not in self._chains:
                self._chains[weighed] = self._chain(weighed=weighed)
            else:
                self._chains[weighed].update(min(step, len(self.steps)))
        self._late.clear()

    def _mark(self, step: int, *, searched: bool) -> None:
        """Note that beliefs change from a step on: the weighed one, and the other if `searched`."""
        for weighed in (False, True) if searched else (True,):
            if weighed is False or self._evidence.detections or True in self._chains:
                self._late[weighed] = min(self._late.get(weighed, step), step)

    def step(self, done: StepLooks) -> None:
        """Take up the looks of a step."""
        self.update()
        self.history.append(done)
        self.steps.append(done)
        self._mark(len(self.steps) - 1, searched=True)
        pending, self._pending = self._pending, []
        for detection_id in pending:
            self._weigh(detection_id)

    def repeat(self, history: Iterable[StepLooks | Entry]) -> None:
        """Take up steps and entries of another keeper, in their order."""
        for record in history:
            if isinstance(record, Entry):
                self.apply(record)
            else:
                self.step(record)

    # Inputs

    @property
    def over(self) -> bool:
        """Whether every person was confirmed."""
        return self.found >= self.scenario.person_amount

    @property
    def begins_s(self) -> float | None:
        """When the search began, s since 1970-01-01 UTC; None if unknown."""
        incident = self.scenario.incident
        return None if incident is None or incident.laid is None else incident.laid.begins_s

    @property
    def earliest_s(self) -> float:
        """Time of the earliest sighting that is accepted: a day before the search, or the first."""
        incident = self._stated.incident
        assert incident is not None and self.begins_s is not None
        released = [
            sighting.time_s - sighting.time_error_s - self.begins_s
            for sighting in incident.sightings
        ]
        return min(-EARLIEST_S, *released)

    def utc(self, time_s: float) -> str | None:
        """Return the time of day of a time since the search began; None if unknown."""
        return None if self.begins_s is None else utc(self.begins_s + time_s)

    def place(self, values: Mapping[str, Any]) -> tuple[float, float] | None:
        """Return the place of an input in metres in the map frame; None beyond the horizon."""
        if "x" in values:
            return values["x"], values["y"]
        if not on_near_side(self._frame, values["lat"], values["lon"]):
            return None
        x, y, _ = geodetic_to_map(self._frame, values["lat"], values["lon"], 0.0)
        return float(x), float(y)

    def lat_lon(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return latitude and longitude of a place in the map frame."""
        lat, lon, _ = map_to_geodetic(self._frame, x_m, y_m, 0.0)
        return float(lat), float(lon)

    def moved(self, *values: float) -> tuple[float, float]:
        """Return where the sea takes what floats at a place, see `Places.moved`."""
        return self._evidence.places.moved(*values)

    def apply(self, entry: Entry) -> None:
        """Take up an entry that `check` returned."""
        self.history.append(entry)
        self.entries[entry.id] = entry
        self.counts[entry.kind] = self.counts.get(entry.kind, 0) + 1
        self._take(entry, counts=True)

    def _take(self, entry: Entry, *, counts: bool) -> None:
        """Count an entry, or stop counting it."""
        match entry.kind:
            case "detection":
                self._take_detection(entry, counts=counts)
            case "sighting" | "weather":
                self._draw()
            case "searched":
                area = self.area(entry)
                if counts:
                    self._evidence.areas[entry.id] = area
                else:
                    del self._evidence.areas[entry.id]
                self._mark(self._evidence.step_of(area.middle_s), searched=True)
            case "confirm" | "dismiss":
                self._close(entry, counts=counts)
            case "withdraw":
                withdrawn = self.entries[entry.values["input"]]
                self.withdrawn.add(withdrawn.id)
                self._take(withdrawn, counts=False)

    def _take_detection(self, entry: Entry, *, counts: bool) -> None:
        name = entry.derived["contact"]
        if not counts:
            detections = self._forget(name)
            self.contacts.remove(entry.id)
            detections.discard(entry.id)
            self._weigh_all(sorted(detections))
            return
        place = self.place(entry.values)
        assert place is not None
        self.contacts.add(name, detection_of(entry, place))
        self._weigh(entry.id)

    def _close(self, entry: Entry, *, counts: bool) -> None:
        """Confirm or dismiss a contact, or open it again."""
        contact = self.contacts.by_name[entry.values["contact"]]
        contact.state = _OF_CONTACT[entry.kind] if counts else OPEN
        if counts:
            self.found += contact.state == CONFIRMED
            self._forget(contact.name)
        else:
            self._weigh_all(sorted(contact.detections))

    def _forget(self, name: str) -> set[str]:
        """Take the detections of a contact out of the belief; return their ids."""
        for look in [
            look for look, contacts in self._evidence.detections.items() if name in contacts
        ]:
            del self._evidence.detections[look][name]
            if not self._evidence.detections[look]:
                del self._evidence.detections[look]
            self._mark(look[0], searched=False)
        self._evidence.shares.pop(name, None)
        self._pending = [
            detection_id
            for detection_id in self._pending
            if self.entries[detection_id].derived["contact"] != name
        ]
        return set(self.contacts.by_name[name].detections)

    def _weigh_all(self, ids: Iterable[str]) -> None:
        for detection_id in ids:
            self._weigh(detection_id)

    def _weigh(self, detection_id: str) -> None:
        """Weigh the belief with a detection, at its look."""
        name = self.entries[detection_id].derived["contact"]
        contact = self.contacts.by_name[name]
        detection = contact.detections[detection_id]
        if contact.state != OPEN or self.scenario.person_amount > 1:
            # Of several persons, nobody knows who was detected.
            return
        look = self._evidence.look_of(name, detection, self.steps)
        if look[0] >= len(self.steps) and look[1] >= 0:
            self._pending.append(detection_id)
            return
        of_look = self._evidence.detections.get(look, {})
        looks = sum(name in contacts for contacts in self._evidence.detections.values())
        if name not in of_look and looks >= MOST_OF_CONTACT:
            return
        before = of_look.get(name)
        if before is None or (before.time_s, before.id) <= (detection.time_s, detection.id):
            self._evidence.detections.setdefault(look, {})[name] = detection
            self._mark(look[0], searched=False)

    def of_kinds(self, *kinds: str) -> list[Entry]:
        """Return the entries of these kinds that count."""
        return [
            entry
            for entry in self.entries.values()
            if entry.kind in kinds and entry.id not in self.withdrawn
        ]

    def informed(self, entries: Iterable[Entry]) -> ResolvedScenario:
        """Return the scenario with the sightings and the weather of these entries.

        Raises:
            ValueError: If one does not fit.
        """
        incident = self._stated.incident
        assert incident is not None
        seen: list[dict[str, Any]] = []
        flows: dict[Kind, Any] = {}
        for entry in sorted(entries, key=lambda entry: (entry.time_s, entry.id)):
            if entry.kind == "sighting":
                seen.append(self._seen(entry))
            flows |= {kind: entry.values[kind] for kind in FLOWS if kind in entry.values}
        return dataclasses.replace(self._stated, incident=incident.informed(seen, flows))

    def _seen(self, entry: Entry) -> dict[str, Any]:
        """Return the fields of a sighting as in an incident."""
        values = dict(entry.values)
        if "x" in values:
            values["lat"], values["lon"] = self.lat_lon(values.pop("x"), values.pop("y"))
        return {**values, "time": self.utc(entry.time_s)}

    def _draw(self) -> None:
        """Draw the particles again, and apply all looks and reports to them."""
        entries = self.of_kinds("sighting", "weather")
        self.scenario = self.informed(entries) if entries else self._stated
        self._forecast = self.forecast_of(self.scenario)
        self._evidence.draw(self._start, Places(self._forecast))
        self._chains = {False: self._chain(weighed=False)}
        self._late.clear()
        if self._evidence.detections:
            self._chains[True] = self._chain(weighed=True)

    def area(self, entry: Entry) -> SearchedArea:
        """Return what others have searched.

        Raises:
            ValueError: If a point is beyond the horizon.
        """
        values, lines = entry.values, []
        of_geometry = values["geometry"]["coordinates"]
        is_line = values["geometry"]["type"] == "LineString"
        for ring in [of_geometry] if is_line else of_geometry:
            places = [self.place({"lat": lat, "lon": lon}) for lon, lat, *_ in ring]
            if None in places:
                raise ValueError("points must be on this side of the Earth")
            lines.append(np.array(places, np.float64))
        end_s = entry.time_s + entry.derived["lasts_s"]
        return SearchedArea(
            entry.id, (entry.time_s, end_s), lines, values.get("pod", 1.0),
            values["sweep_width"] if is_line else 0.0,
        )  # fmt: skip

    # What is published

    def probability(self, contact: Contact) -> float | None:
        """Return the probability that a contact is the person; None if it is not open."""
        if contact.state != OPEN:
            return None
        return self._evidence.probability(contact.name, self.belief)

    def contact_now(self, contact: Contact, now_s: float) -> tuple[Detection, float, float]:
        """Return the last detection of a contact, and where the sea has taken it, (x, y)."""
        last = self.contacts.last(contact.name)
        return last, *self.moved(last.x_m, last.y_m, last.time_s, max(now_s, 0.0))


def detection_of(entry: Entry, place: tuple[float, float]) -> Detection:
    """Return the detection of an entry at a place in the map frame."""
    values = entry.values
    drone = int(values["drone"][5:]) if "drone" in values else -1
    return Detection(
        entry.id, entry.time_s, *place, values["radius"], drone, values.get("confidence", math.nan)
    )


class _Effects:
    """The reports of a keeper, for one of its beliefs; see `chain.Effects`."""

    def __init__(self, keeper: Keeper, *, weighed: bool) -> None:
        self._keeper, self._weighed = keeper, weighed

    def before(self, step: int, belief: AnyBelief) -> None:
        keeper = self._keeper
        keeper._evidence.before(step, belief, len(keeper.steps), weighed=self._weighed)

    def look(self, step: int, belief: AnyBelief, done: StepLooks) -> None:
        if self._weighed:
            self._keeper._evidence.look(step, belief, done)
        else:
            self._keeper._sensors.apply(belief, done)
