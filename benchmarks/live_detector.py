# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether the contact of the true person stays above all others, with a detector at 10 Hz.

`python -m benchmarks.live_detector` searches an hour of search time with one drone: it detects the
person in sight in some of its images, misses it in the others, and reports false alarms. It prints
how often another contact was above that of the person.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.contacts import Contact
from dsse_ros.mission.run.live_intake import LiveIntake
from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.environments.factories import parallel_env

RATE_HZ = 10.0
ERROR_M = 15.0
SEEN_OF_LOOKS = 0.6
"""Share of the looks in which a person in sight is seen."""
SEEN_OF_IMAGES = 1 / 3
"""Share of the images of such a look."""
ELSEWHERE = 0.3
"""Share of the steps in which the drone does not fly to the person."""
PARTICLES = 3000
INCIDENT = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
    "wind": {"speed": 4, "from": 90, "error": 1},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:50Z", "radius": 150},
}  # fmt: skip


class Row(NamedTuple):
    """The contacts at a time.

    Attributes:
        detections: Number of detections so far.
        contacts: Number of contacts.
        person: Probability of the contact of the person; 0 before its first detection.
        other: The largest of another contact.
    """

    detections: int
    contacts: int
    person: float
    other: float


class Search:
    """A search with a person whom only its detector knows.

    Args:
        hours: Search time.
        false_alarms: False alarms a look.
        seed: Of the person, its detections and the false alarms.
    """

    def __init__(self, hours: float, false_alarms: float, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._false_alarms = false_alarms
        fields = {
            "incident": INCIDENT, "particles": PARTICLES, "num_drones": 1,
            "timestep_limit": max(int(hours * 300), 10), "false_alarm_rate": false_alarms,
            "probability_of_detection": SEEN_OF_LOOKS,
        }  # fmt: skip
        env = parallel_env(fields, rules="sea", truth="none")
        self._mission = Mission(env, seed)
        assert isinstance(self._mission.beliefs, LiveBeliefs)
        self._beliefs = self._mission.beliefs
        self._intake = LiveIntake(self._mission, lambda *_: None, Counter())
        self._scenario, self.step_s = env.scenario, env.scenario.step_duration_s
        forecast = self._beliefs.live_search.belief.forecast
        assert isinstance(forecast, EnsembleForecast)
        self._track = forecast.positions[forecast.first_step :, self._rng.integers(PARTICLES)]
        self._true_ids: set[str] = set()

    def step(self) -> Row:
        """Fly a step, report what the detector sees, and return the contacts."""
        mission = self._mission
        number = mission.result.step
        person = self._track[number]
        mission.command_all([self._action(person)])
        mission.advance("hold")
        self._intake.clock.set(number + 1, mission.result.stamp_ns / 1e9)
        for i, (place, is_true) in enumerate(self._reports(person)):
            self._put("detection", f"{number}-{i}", x=place[0], y=place[1], radius=ERROR_M, drone=0,
                      time=mission.result.stamp_ns / 1e9 - 0.01)  # fmt: skip
            if is_true:
                self._true_ids.add(f"{number}-{i}")
        self._intake.decide(mission.result.stamp_ns / 1e9)
        row = self._row()
        self._dismiss()
        return row

    def _put(self, kind: str, id_: str, **values: Any) -> None:
        self._intake.take(kind, json.dumps({"id": id_, **values}))

    def _action(self, person: NDArray[np.float64]) -> int:
        """Return an action that leads to the person, mostly."""
        env, grid = self._mission.env, self._scenario.grid_size
        col, row = (person / self._scenario.cell_size).astype(int).tolist()
        goal = np.array([col, grid.rows - 1 - row])
        if self._rng.random() < ELSEWHERE:
            goal = self._rng.integers(0, grid)
        east, south = np.sign(goal - env.positions[0]).tolist()
        words = {(0, -1): "up", (0, 1): "down", (-1, 0): "left", (1, 0): "right"}
        parts = [words.get((0, south), ""), words.get((east, 0), "")]
        name = "_".join(filter(None, parts)) or "search"
        actions = env.rules.actions
        allowed = env.action_masks()[0]
        may = name in actions and allowed[actions.index(name)]
        return actions.index(name if may else "search")

    def _reports(self, person: NDArray[np.float64]) -> list[tuple[list[float], bool]]:
        """Return what is reported, and whether it is the person."""
        rng, cell_m = self._rng, self._scenario.cell_size
        col, row = (self._mission.env.positions[0] + 0.5).tolist()
        middle = np.array([col, self._scenario.grid_size - row]) * cell_m
        places = []
        in_sight = np.abs(person - middle).max() <= cell_m / 2
        if in_sight and rng.random() < SEEN_OF_LOOKS:
            images = rng.binomial(int(RATE_HZ * self.step_s), SEEN_OF_IMAGES)
            places = [(rng.normal(person, ERROR_M).tolist(), True) for _ in range(images)]
        if rng.random() < self._false_alarms:
            # A wave looks like a person in a few images.
            wave = middle + rng.uniform(-0.5, 0.5, 2) * cell_m
            images = int(rng.integers(1, 6))
            places += [(rng.normal(wave, 3.0).tolist(), False) for _ in range(images)]
        return places

    def _dismiss(self) -> None:
        """Dismiss contacts that are impossible, as somebody would, so that others can be opened."""
        live_search = self._beliefs.live_search
        for name, contact in list(live_search.contacts.by_name.items()):
            probability = live_search.probability(contact)
            if probability is not None and probability < 1e-4 and not self._is_person(contact):
                self._put("dismiss", f"no-{name}", contact=name)
        self._intake.decide(self._mission.result.stamp_ns / 1e9)

    def _is_person(self, contact: Contact) -> bool:
        return len(contact.detections.keys() & self._true_ids) > len(contact.detections) / 2

    def _row(self) -> Row:
        live_search = self._beliefs.live_search
        best = {True: 0.0, False: 0.0}
        for contact in live_search.contacts.by_name.values():
            is_person = self._is_person(contact)
            best[is_person] = max(best[is_person], live_search.probability(contact) or 0.0)
        counts = live_search.counts.get("detection", 0), len(live_search.contacts.by_name)
        return Row(*counts, person=best[True], other=best[False])


def main(argv: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--false-alarms", type=float, default=0.05)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args(argv)
    for seed in range(arguments.seeds):
        begun_s = time.monotonic()
        search = Search(arguments.hours, arguments.false_alarms, seed)
        rows = [search.step() for _ in range(int(arguments.hours * 3600 / search.step_s))]
        first = next((i for i, row in enumerate(rows) if row.person > 0.0), len(rows))
        below = sum(row.person <= row.other for row in rows[first:])
        print(
            f"seed {seed}: {rows[-1].detections} detections, {rows[-1].contacts} contacts; the "
            f"person is detected from step {first} of {len(rows)} on, and below another contact "
            f"after {below} steps; at the end {rows[-1].person:.4f}, the next "
            f"{rows[-1].other:.2g}; {time.monotonic() - begun_s:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
