# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of a report as people read them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dsse_ros.mission.run.collided import nobody_left
from dsse_ros.results.report.metrics import Metric, Work, path_lengths
from dsse_ros.results.report.record import RecordedMission

NONE = "\N{EN DASH}"


def csv_text(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as CSV."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return out.getvalue()


def duration(seconds: float) -> str:
    """Return a time as minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    parts = [(hours, "h"), (minutes, "min"), (rest, "s")]
    first = next((i for i, (value, _) in enumerate(parts) if value), 2)
    return " ".join(f"{value} {unit}" for value, unit in parts[first:])


def distance(metres: float) -> str:
    """Return a length in metres or kilometres."""
    return f"{metres:.0f} m" if metres < 10_000 else f"{metres / 1000:.1f} km"


def value(metric: Metric, number: float | None) -> str:
    """Return the value of a metric with its unit."""
    if number is None:
        return NONE
    if metric.unit == "share":
        return f"{number:.1%}"
    if metric.unit == "s":
        return duration(number)
    if metric.unit == "m":
        return distance(number)
    return f"{number:.0f}" if number == round(number) else f"{number:.2f}"


def outcome(record: RecordedMission) -> str:
    """Return how a mission has ended."""
    finders = np.flatnonzero(record.found.any(axis=0))
    found = ""
    if len(finders):
        first = record.times_s[np.argmax(record.found.any(axis=1))]
        names = ", ".join(record.agents[i] for i in finders)
        found = f"found by {names} after {duration(float(first))}"
        people = record.person_found
        if people is not None and people.shape[1] > 1:
            found += f" ({int(people.any(axis=0).sum())} of {people.shape[1]} persons)"
    if record.coverage_rate is not None:
        rate = float(record.coverage_rate[-1])
        if rate == 1.0:
            return f"all covered after {duration(float(record.times_s[-1]))}"
        found = f"{rate:.1%} covered"
    if not record.complete:
        return ", ".join(filter(None, [found, "cut off"]))
    if record.found[-1].any():
        return found
    last = record.in_flight[-1]
    end = "out of time" if record.truncated[-1][last].any() else _nobody_left(record)
    if not record.scenario.has_persons:
        return f"live search over: {end}"
    return ", ".join([found or "not found", end])


def _nobody_left(record: RecordedMission) -> str:
    fields = [("col", "<i8"), ("row", "<i8"), ("terminated", "?")]
    history = np.empty(record.terminated.shape, fields)
    history["col"], history["row"] = np.moveaxis(record.cells, -1, 0)
    history["terminated"] = record.terminated
    return nobody_left(record.agents, history, collide=record.rules.collisions)


def objects(record: RecordedMission) -> list[tuple[str, str]]:
    """Return what the object of an incident may be in the end, as a fact; none if it is known."""
    if record.object_shares is None:
        return []
    shares = zip(record.object_names, record.object_shares[-1].tolist(), strict=True)
    return [("Object", ", ".join(f"{key} {share:.1%}" for key, share in shares))]


def verdict(record: RecordedMission, pos: float | None) -> str:
    """Return in one line whether, when and by whom persons were found, and the POS.

    Args:
        pos: Its cumulative probability of success; None if unknown.
    """
    result, several = outcome(record), record.scenario.person_amount > 1
    if record.covers or not record.scenario.has_persons:
        text = f"{result[0].upper()}{result[1:]}."
        return text if pos is None or record.covers else f"{text} POS {pos:.1%}."
    text = f"{'Persons' if several else 'Person'} {result}."
    if pos is None:
        return text
    if several:
        return f"{text} Searches like these find {pos:.1%} of the persons on average (POS)."
    return f"{text} Searches like these find the person in {pos:.1%} of missions (POS)."


def summary(record: RecordedMission) -> str:
    """Return the result of the mission as text."""
    scenario = record.scenario
    steps = min(len(record.steps) - 1, scenario.timestep_limit)
    metres = path_lengths(record)[-1]
    finders = [record.agents[i] for i in np.flatnonzero(record.found.any(axis=0))]
    assert record.person_found is not None
    found, persons = int(record.person_found[-1].sum()), record.person_found.shape[1]
    out_of_time = "out of time" if record.truncated[-1].any() else _nobody_left(record)
    shares = {"POS": record.pos, "coverage rate": record.coverage_rate,
              "repeated coverage": record.repeated_coverage}  # fmt: skip
    if record.coverage_rate is not None:
        all_covered = record.coverage_rate[-1] == 1
        end = "ALL COVERED" if all_covered else f"not all covered: {out_of_time}"
    elif not scenario.has_persons:
        end = f"live search over: {out_of_time}"
    elif found == persons:
        end = f"FOUND by {', '.join(finders)}"
    else:
        end = f"not found: {out_of_time}"
    if persons > 1 and scenario.has_persons:
        end += f" ({found} of {persons} persons)"
    rewards = record.rewards.sum(axis=0)
    # The end of a mission terminates or truncates every drone left.
    success = end.startswith(("FOUND", "ALL"))
    down = 0 if success else int((record.terminated & ~record.truncated)[-1].sum())
    rows = {
        "end": end,
        "steps": f"{steps} of {scenario.timestep_limit}",
        "time at sea": duration(float(record.times_s[-1])),
        "drones": f"{len(metres)}, {down} lost" if down else f"{len(metres)}",
        "flown": f"{metres.sum():.0f} m ({', '.join(f'{m:.0f}' for m in metres)})",
        **{name: f"{share[-1]:.1%}" for name, share in shares.items() if share is not None},
        "reward": f"{rewards.sum():.1f} ({', '.join(f'{r:.1f}' for r in rewards)})",
    }
    title = scenario.name or "Mission"
    return "\n".join([title, *(f"  {name:<20} {value}" for name, value in rows.items())])


def ended(record: RecordedMission, done: Work, drone: int) -> str:
    """Return how a mission has ended for a drone."""
    if done.lost_at[drone] >= 0:
        return f"lost in step {done.lost_at[drone]}"
    return "at the end of the mission" if record.complete else "in flight"
