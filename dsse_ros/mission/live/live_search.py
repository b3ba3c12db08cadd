# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A live search: its belief as a pure function of the looks and inputs so far."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from dsse_ros.mission.live.chain import Chain, Posterior
from dsse_ros.mission.live.contacts import (
    CONFIRMED,
    DISMISSED,
    OPEN,
    Contact,
    Contacts,
    Detection,
)
from dsse_ros.mission.live.evidence import Evidence, SearchedArea, probability
from dsse_ros.mission.live.inputs import INVERSE_CUBE
from dsse_ros.mission.live.places import Places
from dsse_ros.mission.live.step_looks import AnyBelief, Look, Sensors, StepLooks
from dsse_ros.search.belief.belief import Forecast
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.belief.filters import DRIFT_SAMPLES
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.belief.protocol import TargetForecast
from dsse_ros.search.environments.faults import false_alarms
from dsse_ros.search.environments.metres_drones import detectors_of_kinds
from dsse_ros.search.step.looks import looks_of
from dsse_ros.world.drift.flow import Kind, utc
from dsse_ros.world.scenario.geodesy import geodetic_to_map, map_to_geodetic
from dsse_ros.world.scenario.place_checks import check_distance, check_near
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame

EARLIEST_S = 86400.0
"""Time from a sighting to the search: particles drift for so long, which takes time."""
FLOWS: tuple[Kind, ...] = ("wind", "current")
"""What a report of weather may have."""
AnyForecast = Forecast | EnsembleForecast
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
        derived: What the search has decided: the `contact` of a detection, "" for one that was
            refused but whose look did not fail, and how long a searched area took, `lasts_s`.
    """

    kind: str
    id: str
    time_s: float
    received_s: float
    values: Mapping[str, Any]
    derived: Mapping[str, Any] = dataclasses.field(default_factory=dict)


class LiveSearch:
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
        detectors = None
        rates = np.full(len(scenario.kinds), scenario.false_alarm_rate)
        if rules.in_metres:
            detectors = detectors_of_kinds(scenario)
        else:
            rates = false_alarms(scenario, looks).max(axis=1)
        step_s = scenario.step_duration_s
        self._sensors = Sensors(looks, detectors, scenario.cell_size, step_s, scenario.grid_size)
        # Of several persons, nobody knows who was detected.
        self._evidence = Evidence(
            self._sensors,
            rates,
            step_s,
            math.prod(self._frame.extent),
            weighs=scenario.person_amount == 1,
        )
        self.history: list[StepLooks | Entry] = []
        self.steps: list[StepLooks] = []
        self.contacts = Contacts()
        self.found = 0
        self.entries: dict[str, Entry] = {}
        self.withdrawn: set[str] = set()
        self._pending: list[str] = []
        self._unweighed: dict[Look, Detection] = {}
        self.counts: dict[str, int] = {}
        self._draw()

    # The beliefs

    def forecast_of(self, scenario: ResolvedScenario) -> AnyForecast:
        """Return the forecast of a scenario under the rules.

        Raises:
            ValueError: If its particles cannot be drawn.
        """
        forecast = self._forecasts(scenario)
        assert isinstance(forecast, Forecast | EnsembleForecast)
        return forecast

    @property
    def _published(self) -> Posterior:
        """The belief that is published; without detections and particles it is that of the POS."""
        # A planner asks for no POS, so its live search draws no particles for it.
        if isinstance(self._forecast, EnsembleForecast) or bool(
            self._evidence.detections or self._evidence.left_out
        ):
            return self._by_detections.posterior
        self._by_detections.forget()
        return self._by_searches.posterior

    @property
    def belief(self) -> AnyBelief:
        """The belief from the looks and all inputs; its POS does not count."""
        return self._published.belief

    @property
    def pos(self) -> float:
        """Cumulative probability of success of the looks and of the searches by others.

        It is the prior probability, by all sightings and weather, that searches like these detect
        the person. It does not depend on detections.
        """
        return self._by_searches.posterior.belief.pos

    @property
    def pos_alive(self) -> float | None:
        """As `pos`, to find the person alive; None without a survival curve."""
        alive = self._by_searches_alive
        return None if alive is None else alive.posterior.belief.pos

    def update(self) -> None:
        """Compute both beliefs again as far as inputs have changed them.

        Raises:
            ValueError: If their particles cannot be drawn.
        """
        _ = self.pos, self.belief

    def _invalidate(self, step: int) -> None:
        """Have both beliefs computed again from a step on."""
        self._by_searches.invalidate(step)
        if self._by_searches_alive is not None:
            self._by_searches_alive.invalidate(step)
        self._by_detections.invalidate(step)

    def step(self, done: StepLooks) -> None:
        """Take up the looks of a step."""
        self.history.append(done)
        self.steps.append(done)
        self._invalidate(len(self.steps) - 1)
        pending, self._pending = self._pending, []
        for detection_id in pending:
            self._weigh(detection_id)
        unweighed, self._unweighed = self._unweighed, {}
        for detection in unweighed.values():
            self._leave_out(detection)

    def repeat(self, history: Iterable[StepLooks | Entry]) -> None:
        """Take up steps and entries of another live search, in their order."""
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
    def earliest_s(self) -> float:
        """Time of the earliest sighting that is accepted: a day before the search, or the first."""
        incident = self._stated.incident
        assert incident is not None and self.scenario.begins_s is not None
        released = [sighting.first_s - self.scenario.begins_s for sighting in incident.sightings]
        return min(-EARLIEST_S, *released)

    def utc(self, time_s: float) -> str | None:
        """Return the time of day of a time since the search began; None if unknown."""
        return None if self.scenario.begins_s is None else utc(self.scenario.begins_s + time_s)

    def check_near(self, entry: Entry) -> None:
        """Check that the places of an input are near the grid.

        Raises:
            FieldError: If one is too far from it.
        """
        values, (width, height) = entry.values, self._frame.extent
        radius_m = math.hypot(width, height) / 2
        if "x" in values:
            away_m = math.hypot(values["x"] - width / 2, values["y"] - height / 2) - radius_m
            shown = f"x {values['x']:.6g} and y {values['y']:.6g} m"
            check_distance(entry.kind, away_m, "the grid", shown)
            return
        places, order = [], "latitude, longitude"
        if "lat" in values:
            places = [(values["lat"], values["lon"])]
        elif "geometry" in values:
            places = [place for line in lines_of(values["geometry"]) for place in line]
            order = "longitude, latitude"
        for place in places:
            middle = self.lat_lon(width / 2, height / 2)
            check_near(entry.kind, place, middle, within_m=radius_m, order=order)

    def place(self, values: Mapping[str, Any]) -> tuple[float, float]:
        """Return the place of an input in metres in the map frame."""
        if "x" in values:
            return values["x"], values["y"]
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
        if entry.derived.get("contact") == "":
            self._leave_out(detection_of(entry, self.place(entry.values)))
            return
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
                self._invalidate(self._evidence.step_of(area.middle_s))
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
        self.contacts.add(name, detection_of(entry, self.place(entry.values)))
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
        for step in self._evidence.remove(name):
            self._by_detections.invalidate(step)
        self._pending = [
            detection_id
            for detection_id in self._pending
            if self.entries[detection_id].derived["contact"] != name
        ]
        return set(self.contacts.by_name[name].detections)

    def leaves_out(self, entry: Entry) -> bool:
        """Return whether a look made this detection, and is still taken for one that failed."""
        look = self._evidence.look_of(detection_of(entry, self.place(entry.values)), self.steps)
        known = (self._evidence.left_out, self._evidence.detections, self._unweighed)
        return look[1] >= 0 and not any(look in looks for looks in known)

    def _leave_out(self, detection: Detection) -> None:
        """Take the look of a detection out of the belief: the look did not fail."""
        look = self._evidence.look_of(detection, self.steps)
        if look[0] >= len(self.steps) and look[1] >= 0:
            self._unweighed[look] = detection
        elif look[1] >= 0:
            self._evidence.left_out.add(look)
            self._by_detections.invalidate(look[0])

    def _weigh_all(self, ids: Iterable[str]) -> None:
        for detection_id in ids:
            self._weigh(detection_id)

    def _weigh(self, detection_id: str) -> None:
        """Weigh the belief with a detection, at its look."""
        name = self.entries[detection_id].derived["contact"]
        contact = self.contacts.by_name[name]
        detection = contact.detections[detection_id]
        if contact.state != OPEN:
            return
        look = self._evidence.look_of(detection, self.steps)
        if look[0] >= len(self.steps) and look[1] >= 0:
            self._pending.append(detection_id)
            return
        self._evidence.add(name, detection, look)
        self._by_detections.invalidate(look[0])

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
        """Forecast with all sightings and weather, and have both beliefs computed from the start.

        No detection changes the belief of the POS, `_by_searches`.
        """
        entries = self.of_kinds("sighting", "weather")
        self.scenario = self.informed(entries) if entries else self._stated
        self._forecast = forecast = self.forecast_of(self.scenario)
        self._evidence.draw(Places(forecast))
        # Without a reference to this search: its arrays are freed with it, not when the garbage
        # collector finds a cycle of few objects.
        known = self._evidence, self._sensors, self.steps
        self._by_searches = Chain(
            lambda: forecast.of_pos.belief(), self.steps,
            _Searches(*known, lambda: forecast.of_pos),
        )  # fmt: skip
        alive = forecast.of_pos_alive if isinstance(forecast, EnsembleForecast) else None
        self._by_searches_alive = None
        if alive is not None:
            self._by_searches_alive = Chain(
                alive.belief, self.steps, _Searches(*known, lambda: alive)
            )
        self._by_detections = Chain(
            forecast.belief, self.steps, _Detections(*known, lambda: forecast)
        )

    def area(self, entry: Entry) -> SearchedArea:
        """Return what others have searched."""
        values, lines = entry.values, []
        is_line = values["geometry"]["type"] == "LineString"
        for ring in lines_of(values["geometry"]):
            places = [self.place({"lat": lat, "lon": lon}) for lat, lon in ring]
            lines.append(np.array(places, np.float64))
        end_s = entry.time_s + entry.derived["lasts_s"]
        return SearchedArea(
            entry.id, (entry.time_s, end_s), lines, values.get("pod", 1.0),
            values["sweep_width"] if is_line else 0.0,
            is_line and values.get("law") == INVERSE_CUBE,
        )  # fmt: skip

    # What is published

    def probability(self, contact: Contact) -> float | None:
        """Return the probability that a contact is the person.

        None if it is not open, or if several persons are missing: nobody knows who was detected.
        """
        if contact.state != OPEN or self.scenario.person_amount > 1:
            return None
        return probability(self._published, contact.name)

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


def lines_of(geometry: Mapping[str, Any]) -> list[list[tuple[float, float]]]:
    """Return the rings of a GeoJSON polygon, or the line of one, as places (lat, lon)."""
    lines = geometry["coordinates"]
    if geometry["type"] == "LineString":
        lines = [lines]
    return [[(lat, lon) for lon, lat, *_ in line] for line in lines]


class _Searches:
    """The looks, which all failed, and the searches by others; see `chain.Effects`.

    Args:
        evidence: What was reported.
        sensors: What the drones see.
        steps: The looks of all steps so far.
        forecast: Returns the forecast of the belief.
    """

    def __init__(
        self, evidence: Evidence, sensors: Sensors, steps: Sequence[StepLooks],
        forecast: Callable[[], AnyForecast],
    ) -> None:  # fmt: skip
        self._evidence, self._sensors, self._steps = evidence, sensors, steps
        self._forecast = forecast

    @cached_property
    def _places(self) -> Places:
        return Places(self._forecast())

    def before(self, step: int, posterior: Posterior) -> None:
        self._evidence.searched(step, posterior, len(self._steps), self._places)

    def look(self, step: int, posterior: Posterior, done: StepLooks) -> None:
        self._sensors.apply(posterior.belief, done)


class _Detections(_Searches):
    """As `_Searches`, with the detections."""

    def before(self, step: int, posterior: Posterior) -> None:
        super().before(step, posterior)
        self._evidence.reported(step, posterior, len(self._steps))

    def look(self, step: int, posterior: Posterior, done: StepLooks) -> None:
        self._evidence.look(step, posterior, done)
