# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How evenly our heartbeats go out, whatever else the machine is doing."""

from __future__ import annotations

import time

from dsse_ros.vehicles.control.vehicle import Vehicle

TIMEOUT_S = 120.0


class Pace:
    """Our heartbeats to vehicles that run, from one to a later one of each."""

    def __init__(self, *vehicles: Vehicle) -> None:
        self._vehicles = vehicles
        self._from_s, self._by_s, self._first = self._next()

    def check(self) -> list[tuple[int, int]]:
        """Return how many were sent to each vehicle since, and how many were missed.

        Raises:
            AssertionError: If they are not as many as seconds have passed.
        """
        from_s, by_s, last = self._next()
        counted = []
        for (sent, missed), (sent_before, missed_before) in zip(last, self._first, strict=True):
            sent, missed = sent - sent_before, missed - missed_before
            # The first and the last may each be late by less than one that is missed.
            assert sent + missed <= by_s - self._from_s + 1
            # The next one comes a second after one that is late by more.
            assert sent + 2 * missed >= from_s - self._by_s - 1
            counted.append((sent, missed))
        return counted

    def _next(self) -> tuple[float, float, list[tuple[int, int]]]:
        """Return two times between which each vehicle got its latest one, and the counts then."""
        from_s = time.monotonic()
        before = [vehicle.counts["heartbeats"] for vehicle in self._vehicles]
        for vehicle, sent in zip(self._vehicles, before, strict=True):
            while vehicle.counts["heartbeats"] == sent:
                assert time.monotonic() < from_s + TIMEOUT_S, "no heartbeat"
                time.sleep(0.01)
        snapshots = [vehicle.counts for vehicle in self._vehicles]
        counts = [(one["heartbeats"], one["heartbeats_missed"]) for one in snapshots]
        return from_s, time.monotonic(), counts
