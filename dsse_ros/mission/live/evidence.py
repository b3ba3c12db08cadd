# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the reports of a live search do to a belief.

A look in which a drone detects something has not failed: somebody at a place has been detected
there with the POD, or was missed and the detection is a false alarm. With the rate of false alarms
f and their density u, spread over what the drone looked at, and the density g of the report for
somebody at the place, the place counts by (1 - POD) + POD g / (f u), where a failed look counts
1 - POD (Stone, "Theory of Optimal Search", 1975, chapter 6, has false targets). A report by anybody
else counts by 1 - c + c g A, with its confidence c and the area A of the grid.

One contact at most is the person: the detections of one contact may all be of the person, or each
of them a false alarm, and those of all others are false alarms. So probabilities of contacts add up
to 1 at most, also where one particle would explain two of them.

Of several detections of a contact in one look, each place counts by the best. So a further
detection never makes its contact less probable: what there is if the contact is a false alarm stays
the same, and the rest does not become less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.live.chain import Posterior
from dsse_ros.mission.live.contacts import Detection
from dsse_ros.mission.live.places import Places, from_piece, inside, inverse_cubes
from dsse_ros.mission.live.step_looks import AnyBelief, Look, Sensors, StepLooks
from dsse_ros.search.belief.weighing import weigh

LEAST_FALSE_ALARMS = 1e-6
"""Rate of false alarms of a detector for which the scenario states none."""
CONFIDENCE = 0.5
"""Of a report that states none."""
LEAST_DENSITY = 1e-15
"""Of false alarms, 1/m^2: less would be certainty."""
LATEST_STEPS = 3
"""Steps before a detection in which its look is: a pass takes time, and so does a detector."""
LEAST_SEEN = 0.02
"""How much of the report lies where its own step's look was, relative to the best look: it is
almost always its look, also if the error of the position leads elsewhere."""
NOT_SEEN = 1e-4
"""Share of a report below which the drone has not looked there, 3.7 standard deviations beside."""
LEAST_M = 1.0
"""Least standard deviation of a report."""
MOST_MISSED = 100
"""Looks whose effect is kept."""
KEPT_BYTES = 1 << 26
"""Memory of the effects of detections that are kept."""
NOBODY = -1
"""Stands for the drone of a report that is of no drone's look."""


class SearchedArea(NamedTuple):
    """What others have searched.

    Attributes:
        id: Of the input.
        times_s: Time of its begin and end, s.
        lines: Rings of a polygon or, with a sweep width, a line, (K, 2) metres.
        pod: POD of what is inside or beside the line.
        sweep_width_m: Sweep width along a line; 0 for a polygon.
        by_inverse_cube: Whether a line was searched by the inverse cube law, not definite range.
    """

    id: str
    times_s: tuple[float, float]
    lines: list[NDArray[np.float64]]
    pod: float
    sweep_width_m: float
    by_inverse_cube: bool = False

    @property
    def middle_s(self) -> float:
        """Middle of its time."""
        return sum(self.times_s) / 2

    def missed(self, places: Places) -> NDArray[np.float64]:
        """Return the probability that somebody at each place was missed, (M,)."""
        if not self.sweep_width_m:
            return np.asarray(1.0 - self.pod * inside(places.at(self.middle_s), self.lines))
        (line,) = self.lines
        lengths = np.hypot(*np.diff(line, axis=0).T)
        ends = np.concatenate([[0.0], lengths.cumsum()]) / max(lengths.sum(), 1e-9)
        begin_s, end_s = self.times_s
        near = np.zeros(len(places.at(self.middle_s)), np.bool_)
        exposure = np.zeros(len(near))
        for start, end, share in zip(line[:-1], line[1:], (ends[:-1] + ends[1:]) / 2, strict=True):
            there = places.at(begin_s + share * (end_s - begin_s))
            if self.by_inverse_cube:
                exposure += inverse_cubes(there, start, end)
            else:
                near |= from_piece(there, start, end) <= self.sweep_width_m / 2
        if self.by_inverse_cube:
            return 1.0 + self.pod * np.expm1(-(self.sweep_width_m**2) / (8 * math.pi) * exposure)
        return np.asarray(1.0 - self.pod * near)


class Evidence:
    """The reports of a search, as the two beliefs of a `LiveSearch` apply them.

    Args:
        sensors: What the drones see.
        false_alarms: (K,) float64, rate of false alarms of a look of each kind of drone.
        step_s: Duration of a step.
        area_m2: Area of the grid.
        weighs: Whether detections weigh a belief; if not, the looks that made them are left out.

    Attributes:
        places: The places of the forecast that `draw` has taken up.
        areas: What others have searched, by id.
        detections: By look, contact and id.
        left_out: Looks that made detections which are not weighed; they have not failed, either.
    """

    def __init__(
        self, sensors: Sensors, false_alarms: NDArray[np.float64], step_s: float, area_m2: float,
        *, weighs: bool = True,
    ) -> None:  # fmt: skip
        self._weighs = weighs
        self._sensors, self._step_s, self._area_m2 = sensors, step_s, area_m2
        self._false_alarms = np.maximum(false_alarms, LEAST_FALSE_ALARMS)
        self.areas: dict[str, SearchedArea] = {}
        self.detections: dict[Look, dict[str, dict[str, Detection]]] = {}
        self.left_out: set[Look] = set()

    def step_of(self, time_s: float) -> int:
        """Return the number of steps after which what was reported for a time is applied."""
        return max(round(time_s / self._step_s), 0)

    def add(self, contact: str, detection: Detection, look: Look) -> None:
        """Add a detection of a contact in a look, see `look_of`."""
        self.detections.setdefault(look, {}).setdefault(contact, {})[detection.id] = detection

    def remove(self, contact: str) -> list[int]:
        """Remove the detections of a contact; return the steps of their looks."""
        looks = [look for look, contacts in self.detections.items() if contact in contacts]
        for look in looks:
            del self.detections[look][contact]
            if not self.detections[look]:
                del self.detections[look]
            self._real.pop((look, contact), None)
        return [step for step, _ in looks]

    def look_of(self, detection: Detection, steps: Sequence[StepLooks]) -> Look:
        """Return the look of a detection: the drone's last one that saw the place.

        It is a look to come if the step of the detection is not done, and nobody's if the drone has
        not looked there.
        """
        at = max(math.ceil(detection.time_s / self._step_s - 1e-6) - 1, 0)
        if 0 <= detection.drone < self._sensors.count:
            if at >= len(steps):
                return at, detection.drone
            looks = [
                (step, detection.drone)
                for step in range(at, max(at - LATEST_STEPS, -1), -1)
                if steps[step].has(detection.drone)
            ]
            place, spread_m = (detection.x_m, detection.y_m), max(detection.radius_m, LEAST_M)
            seen = [
                self._sensors.share_seen(steps[step], drone, place, spread_m)
                for step, drone in looks
            ]
            for look, by_look in zip(looks, seen, strict=True):
                if by_look >= max(LEAST_SEEN * max(seen), NOT_SEEN):
                    return look
        return self.step_of(detection.time_s), NOBODY

    def _missed(self, done: StepLooks, look: Look) -> NDArray[np.float64]:
        """Return the probability that a look missed somebody at each place."""
        if look not in self._missed_by:
            if len(self._missed_by) >= MOST_MISSED:
                self._missed_by.clear()
            self._missed_by[look] = self._sensors.missed(self.places, done, look)
        return self._missed_by[look]

    def draw(self, places: Places) -> None:
        """Take up the places of a new forecast."""
        self.places = places
        self._missed_by: dict[Look, NDArray[np.float64]] = {}
        self._real: dict[tuple[Look, str], tuple[set[str], NDArray[np.float64]]] = {}

    def searched(self, step: int, posterior: Posterior, steps: int, places: Places) -> None:
        """Apply what others have searched after `step` of `steps` steps, see `chain.Effects`.

        Args:
            step: Number of the steps.
            posterior: The belief.
            steps: Number of the steps so far.
            places: Of the belief.
        """
        areas = sorted(self.areas.values(), key=lambda area: (area.middle_s, area.id))
        for area in areas:
            if min(self.step_of(area.middle_s), steps) == step:
                missed = area.missed(places)
                self._change(posterior, partial(weigh, factors=missed, searched=True))

    def reported(self, step: int, posterior: Posterior, steps: int) -> None:
        """Apply what nobody's look has detected after `step` of `steps` steps, as `searched`."""
        if not self._weighs:
            return
        # What is reported for a time to come counts as now.
        due = [step] if step < steps else sorted(
            at for at, drone in self.detections if drone == NOBODY and at >= steps
        )  # fmt: skip
        for at in due:
            self._reported(posterior, self.detections.get((at, NOBODY), {}))

    def look(self, step: int, posterior: Posterior, done: StepLooks) -> None:
        """Apply the looks of a step, with what the drones detected."""
        drones = range(self._sensors.count)
        looks = [(step, drone) for drone in drones if (step, drone) in self.detections]
        others = np.ones(len(drones), np.bool_)
        others[[drone for drone in drones if (step, drone) in self.left_out]] = False
        others[[drone for _, drone in looks]] = False
        self._change(posterior, partial(self._sensors.apply, done=done.of_drones(others)))
        for look in looks if self._weighs else ():
            contacts = sorted(self.detections[look])
            real = {contact: self._real_of(look, contact, done) for contact in contacts}
            self._learn(posterior, self._missed(done, look), real)

    def _real_of(self, look: Look, contact: str, done: StepLooks) -> NDArray[np.float64]:
        """Return how much each place gains by the detections of a contact in a look, (M,)."""
        detections = self.detections[look][contact]
        known, real = self._real.get((look, contact), (set(), None))
        if not known <= detections.keys():
            known, real = set(), None
        rate = self._false_alarms[self._sensors.looks.kind[look[1]]]
        for detection_id in detections.keys() - known:
            detection = detections[detection_id]
            false = max(rate * self._false_density(detection, look, done), LEAST_DENSITY)
            of_detection = self.places.density(*detection[1:5]) / false
            real = of_detection if real is None else np.maximum(real, of_detection)
        assert real is not None
        if len(self._real) * real.nbytes > KEPT_BYTES:
            self._real.clear()
        self._real[look, contact] = set(detections), real
        return np.asarray((1.0 - self._missed(done, look)) * real)

    def _reported(
        self, posterior: Posterior, by_contact: Mapping[str, Mapping[str, Detection]]
    ) -> None:
        """Apply reports that are of no drone's look: one for each drone, and each of a person."""
        for contact, detections in sorted(by_contact.items()):
            real: dict[tuple[int, str], NDArray[np.float64]] = {}
            for _, detection in sorted(detections.items()):
                sure = CONFIDENCE if math.isnan(detection.confidence) else detection.confidence
                odds = sure / max(1.0 - sure, LEAST_FALSE_ALARMS)
                of_detection = odds * self._area_m2 * self.places.density(*detection[1:5])
                source = detection.drone, detection.id if detection.drone < 0 else ""
                real[source] = np.maximum(real.get(source, 0.0), of_detection)
            for _, of_source in sorted(real.items()):
                self._learn(posterior, np.ones_like(of_source), {contact: of_source})

    def _false_density(self, detection: Detection, look: Look, done: StepLooks) -> float:
        """Return the density of a report if it is a false alarm of a look."""
        place, spread_m = (detection.x_m, detection.y_m), self.places.spread_m(*detection[1:5])
        return self._sensors.false_density(done, look[1], place, spread_m)

    def _learn(
        self, posterior: Posterior, false: NDArray[np.float64],
        real: Mapping[str, NDArray[np.float64]],
    ) -> None:  # fmt: skip
        """Weigh a belief with detections.

        Args:
            posterior: The belief.
            false: How much each place counts if they are false alarms, (M,).
            real: By contact, how much it gains if its detections are of the person, (M,).
        """
        belief, parts = posterior.belief, posterior.parts
        parts.setdefault(None, belief.density)
        for contact in real:
            parts.setdefault(contact, np.zeros_like(parts[None]))
        # A contact is the person together with none of the others.
        gains = {name: (parts[None] + parts[name]) * of_place for name, of_place in real.items()}
        before, gained = sum(parts.values()), sum(gains.values())
        factors = np.zeros_like(parts[None])
        np.divide(before * false + gained, before, out=factors, where=before > 0.0)
        left = float((belief.density * factors).sum())
        if not weigh(belief, factors, searched=False):
            return
        for whose, part in parts.items():
            gain = 0.0 if whose is None else gains.get(whose, 0.0)
            parts[whose] = (part * false + gain) / left

    def _change(self, posterior: Posterior, change: Callable[[AnyBelief], object]) -> None:
        """Change a belief, and its parts in the same proportions."""
        if not posterior.parts:
            change(posterior.belief)
            return
        before = posterior.belief.density
        change(posterior.belief)
        ratio = np.zeros(before.shape)
        np.divide(posterior.belief.density, before, out=ratio, where=before > 0.0)
        for whose, part in posterior.parts.items():
            posterior.parts[whose] = part * ratio


def probability(posterior: Posterior, contact: str) -> float:
    """Return the probability that an open contact is the person, and so no other is."""
    if contact not in posterior.parts:
        return 0.0
    shares = {name: float(part.sum()) for name, part in posterior.parts.items()}
    total = sum(shares.values())
    return shares[contact] / total if total > 0.0 else 0.0
