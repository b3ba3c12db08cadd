# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the reports of a live search do to a belief.

A look in which a drone detects something has not failed: somebody at a place has been detected
there with the POD, or was missed and the detection is a false alarm. With the rate of false alarms
f and their density u, spread over what the drone looked at, and the density g of the report for
somebody at the place, the place counts by (1 - POD) + POD g / (f u), where a failed look counts
1 - POD (Stone, "Theory of Optimal Search", 1975, chapter 6, has false targets). A report by anybody
else counts by (1 - c) + c g A, with its confidence c and the area A of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.live.contacts import Detection
from dsse_ros.live.places import Places, from_piece, inside
from dsse_ros.live.step_looks import AnyBelief, Sensors, StepLooks, weigh

LEAST_FALSE_ALARMS = 1e-6
"""Rate of false alarms of a detector for which the scenario states none."""
CONFIDENCE = 0.5
"""Of a report that states none."""
LEAST_DENSITY = 1e-15
"""Of false alarms, 1/m^2: less would be certainty."""
MOST_OF_CONTACT = 12
"""Looks whose detections count for a contact."""
LATEST_STEPS = 3
"""Steps before a detection in which its look is: a pass takes time, and so does a detector."""
LEAST_SEEN = 0.02
"""How well the look of the detection's own step has seen the place, relative to the best: it is
almost always its look, also if the error of the position leads elsewhere."""
MOST_MISSED = 100
"""Looks whose effect is kept."""
NOBODY = -1
"""Stands for the drone of a report that is of no drone's look."""

Look = tuple[int, int]
"""Number of the step, and of the drone or `NOBODY`."""


class SearchedArea(NamedTuple):
    """What others have searched.

    Attributes:
        id: Of the input.
        times_s: Time of its begin and end, s.
        lines: Rings of a polygon or, with a sweep width, a line, (K, 2) metres.
        pod: POD of what is inside or beside the line.
        sweep_width_m: Sweep width along a line; 0 for a polygon.
    """

    id: str
    times_s: tuple[float, float]
    lines: list[NDArray[np.float64]]
    pod: float
    sweep_width_m: float

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
        for start, end, share in zip(line[:-1], line[1:], (ends[:-1] + ends[1:]) / 2, strict=True):
            there = places.at(begin_s + share * (end_s - begin_s))
            near |= from_piece(there, start, end) <= self.sweep_width_m / 2
        return np.asarray(1.0 - self.pod * near)


class Evidence:
    """The reports of a search, as the two beliefs of a `Keeper` apply them.

    Args:
        sensors: What the drones see.
        false_alarms: (K,) float64, rate of false alarms of a look of each kind of drone.
        step_s: Duration of a step.
        area_m2: Area of the grid.

    Attributes:
        places: The places of the forecast that `draw` has taken up.
        areas: What others have searched, by id.
        detections: By look and contact.
        shares: By contact and look, how probable it is at each place that the detection is a false
            alarm, (M,); one number where places do not keep their numbers.
    """

    def __init__(
        self, sensors: Sensors, false_alarms: NDArray[np.float64], step_s: float, area_m2: float
    ) -> None:
        self._sensors, self._step_s, self._area_m2 = sensors, step_s, area_m2
        self._false_alarms = np.maximum(false_alarms, LEAST_FALSE_ALARMS)
        self.areas: dict[str, SearchedArea] = {}
        self.detections: dict[Look, dict[str, Detection]] = {}
        self.shares: dict[str, dict[Look, NDArray[np.float32] | float]] = {}

    def step_of(self, time_s: float) -> int:
        """Return the number of steps after which what was reported for a time is applied."""
        return max(round(time_s / self._step_s), 0)

    def look_of(self, contact: str, detection: Detection, steps: Sequence[StepLooks]) -> Look:
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
            if looks and contact in self.detections.get(looks[0], {}):
                return looks[0]
            there = self.places.density(*detection[1:5])
            seen = [(there * (1.0 - self._missed(steps[look[0]], look))).sum() for look in looks]
            for look, by_look in zip(looks, seen, strict=True):
                if by_look > 0.0 and by_look >= LEAST_SEEN * max(seen):
                    return look
        return self.step_of(detection.time_s), NOBODY

    def _missed(self, done: StepLooks, look: Look) -> NDArray[np.float64]:
        """Return the probability that a look missed somebody at each place."""
        if look not in self._missed_by:
            if len(self._missed_by) >= MOST_MISSED:
                self._missed_by.clear()
            self._missed_by[look] = self._sensors.missed(self._start(), done, look)
        return self._missed_by[look]

    def draw(self, start: Callable[[], AnyBelief], places: Places) -> None:
        """Take up a new forecast: its belief at the start, and its places."""
        self._start, self.places = start, places
        self._missed_by: dict[Look, NDArray[np.float64]] = {}

    def before(self, step: int, belief: AnyBelief, steps: int, *, weighed: bool) -> None:
        """Apply what was reported for after `step` of `steps` steps, see `chain.Effects`."""
        areas = sorted(self.areas.values(), key=lambda area: (area.middle_s, area.id))
        for area in areas:
            if min(self.step_of(area.middle_s), steps) == step:
                weigh(belief, area.missed(self.places), searched=True)
        for look, by_contact in sorted(self.detections.items()) if weighed else ():
            if look[1] == NOBODY and min(look[0], steps) == step:
                self._reported(belief, look, by_contact)

    def look(self, step: int, belief: AnyBelief, done: StepLooks) -> None:
        """Apply the looks of a step, with what the drones detected."""
        looks = [
            (step, drone)
            for drone in range(self._sensors.count)
            if (step, drone) in self.detections
        ]
        others = np.ones(self._sensors.count, np.bool_)
        others[[drone for _, drone in looks]] = False
        self._sensors.apply(belief, done.of_drones(others))
        for look in looks:
            missed, kind = self._missed(done, look), self._sensors.looks.kind[look[1]]
            rate = self._false_alarms[kind]
            real = {
                contact: (1.0 - missed)
                * self.places.density(*detection[1:5])
                / max(rate * self._false_density(detection, look, done), LEAST_DENSITY)
                for contact, detection in sorted(self.detections[look].items())
            }
            self._learn(belief, look, missed, real)

    def _reported(self, belief: AnyBelief, look: Look, by_contact: Mapping[str, Detection]) -> None:
        """Apply reports that are of no drone's look."""
        for contact, detection in sorted(by_contact.items()):
            sure = CONFIDENCE if math.isnan(detection.confidence) else detection.confidence
            real = {contact: sure * self._area_m2 * self.places.density(*detection[1:5])}
            false = np.full(belief.mass.layers.shape[-1], 1.0 - sure)
            self._learn(belief, look, false, real)

    def _false_density(self, detection: Detection, look: Look, done: StepLooks) -> float:
        """Return the density of a report if it is a false alarm of a look."""
        place, spread_m = (detection.x_m, detection.y_m), self.places.spread_m(*detection[1:5])
        return self._sensors.false_density(done, look[1], place, spread_m)

    def _learn(
        self, belief: AnyBelief, look: Look, false: NDArray[np.float64],
        real: Mapping[str, NDArray[np.float64]],
    ) -> None:  # fmt: skip
        """Weigh a belief with detections, and note how probable it is that each is false."""
        factors = false + sum(real.values())
        weigh(belief, factors, searched=False)
        for contact, of_contact in real.items():
            is_false = np.ones(factors.shape)
            np.divide(factors - of_contact, factors, out=is_false, where=factors > 0.0)
            share: NDArray[np.float32] | float
            if self.places.are_particles:
                share = is_false.reshape(-1).astype(np.float32)
            else:
                share = float((belief.density * is_false).sum())
            self.shares.setdefault(contact, {})[look] = share

    def probability(self, contact: str, belief: AnyBelief) -> float:
        """Return the probability that an open contact is the person."""
        shares = self.shares.get(contact, {})
        if not shares:
            return 0.0
        if not self.places.are_particles:
            return 1.0 - float(shares[max(shares)])
        false = np.ones(belief.mass.layers.shape[-1])
        for look in sorted(shares):
            false *= shares[look]
        return min(max(float(1.0 - (belief.density.sum(axis=0) * false).sum()), 0.0), 1.0)
