# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The results of `make compare`: tables for the pages, and all figures as one CSV.

A table states a difference only if its 99 % interval excludes 0, and a share only if the interval
is at most `WIDEST_SHARE` to either side. The CSV has every figure with its interval.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from benchmarks import incidents
from benchmarks.pages import with_table
from benchmarks.reference_values import Source

NO_DIFFERENCE, NO_STATEMENT = "none shown", "–"
WIDEST_SHARE = 0.03
BASELINE = "greedy"
TITLES = {"v2": "`v2`", "v1": "`v1`", "santos_4": "`paper`", "shore": "Shore"}
SHOWN_AT_SEA = (
    incidents.STOPS, "expanding_square", "greedy", "route", "belief_greedy", "belief",
)  # fmt: skip
SHOWN_IN_METRES = (
    f"spiral{incidents.IN_METRES}", f"{incidents.BASELINE}{incidents.IN_METRES}", incidents.ROUND,
)  # fmt: skip
"""Rows of the table of searches in metres, once they have been flown."""
WITH_FAULTS = ("greedy", "belief")
FIELDS = (
    "part", "case", "condition", "planner", "planner_seeds", "quantity", "value", "low", "high",
)  # fmt: skip

Row = dict[str, Any]
Figure = tuple[str, float, Sequence[float] | None]


def difference(value: float, interval: Sequence[float], digits: int) -> str:
    """Return a difference with the greater half of its interval, unless that contains 0."""
    low, high = interval
    if low <= 0.0 <= high:
        return NO_DIFFERENCE
    return f"{value:+.{digits}f} ± {max(high - value, value - low):.{digits}f}"


def share(row: Row) -> str:
    """Return the share found in percent, unless its interval is too wide for a statement."""
    low, high = row["found_interval"]
    too_wide = max(high - row["found"], row["found"] - low) > WIDEST_SHARE
    if too_wide:
        return NO_STATEMENT
    return "> 99.9" if 0.9995 <= row["found"] < 1.0 else f"{100 * row['found']:.1f}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def all_table(results: Mapping[str, Any], published: Mapping[str, Sequence[Source]]) -> str:
    """Return share found and mean steps of every planner in the cases of `TITLES`, and at sea."""
    cases = {key: results["cases"][key] for key in TITLES}
    lines = [
        [
            f"published: {source.name}",
            *(f"{100 * source.found:.1f}, {source.steps:.1f}" if source in published[key] else ""
              for key in cases),
            "",
        ]
        for sources in published.values() for source in sources
    ]  # fmt: skip
    for name in next(iter(cases.values())):
        at_sea = results["incidents"].get(name)
        lines.append(
            [
                f"`{name}`",
                *(f"{share(rows[name])}, {rows[name]['steps']:.1f}" for rows in cases.values()),
                f"{100 * at_sea['found'][-1]:.1f}" if at_sea else "",
            ]
        )
    return markdown(["Planner", *TITLES.values(), f"At sea, {incidents.MINUTES[-1]} min"], lines)


def cost_table(
    rows: Mapping[str, Mapping[str, Row]], titles: Mapping[str, str], names: Sequence[str]
) -> str:
    """Return the mean steps with nothing wrong, and by how many a condition raises them."""
    lines = []
    for key, by_planner in rows.items():
        cells = [
            f"{row['steps']:.1f} steps" if key == "none"
            else difference(row["difference"], row["difference_interval"], 1)
            for row in (by_planner[name] for name in names)
        ]  # fmt: skip
        lines.append([titles[key], *cells])
    return markdown(["What is wrong", *(f"`{name}`" for name in names)], lines)


def at_sea_table(rows: Mapping[str, Row], head: str, baseline: str, beside: str) -> str:
    """Return the shares found in the incidents by two times, and the paired difference."""
    lines = [
        [
            title, *(f"{100 * row['found'][column]:.1f}" for column in (1, 2)),
            "" if title == baseline else difference(
                100 * row["difference"][-1],
                [100 * end for end in row["difference_interval"][-1]], 1,
            ),
        ]
        for title, row in rows.items()
    ]  # fmt: skip
    heads = [f"Found in {minutes} min, %" for minutes in incidents.MINUTES[1:]]
    return markdown([head, *heads, f"Points more than {beside}"], lines)


def _chosen(rows: Mapping[str, Row], names: Sequence[str]) -> dict[str, Row]:
    return {name: rows[name] for name in names if name in rows}


def tables(
    results: Mapping[str, Any],
    published: Mapping[str, Sequence[Source]],
    conditions: Mapping[str, str],
) -> dict[str, str]:
    """Return the tables of the pages by name.

    Args:
        results: As kept in `compare.json`.
        published: Published figures by case.
        conditions: Titles of what is wrong, by key.
    """  # fmt: skip
    written = {"all": all_table(results, published)}
    written["faults"] = cost_table(results["faults"], conditions, WITH_FAULTS)
    baseline = f"`{incidents.BASELINE}`"
    at_sea = {
        f"{baseline}, stopping to search" if name == incidents.STOPS else f"`{name}`": row
        for name, row in _chosen(results["incidents"], SHOWN_AT_SEA).items()
    }
    written["incidents"] = at_sea_table(at_sea, "Planner", baseline, baseline)
    in_metres = _chosen(results["incidents"], SHOWN_IN_METRES)
    if in_metres:
        rows = {
            f"`{planner}`{where}": row
            for name, row in in_metres.items()
            for planner, comma, rest in [name.partition(",")]
            for where in [comma + rest]
        }
        written["in_metres"] = at_sea_table(rows, "Planner", baseline, f"{baseline} on cells")
    by_error = {incidents.ERRORS[name]: row for name, row in results["wrong_drift"].items()}
    written["wrong_drift"] = at_sea_table(
        by_error, "What is wrong", incidents.ERRORS["none"], "with the right drift"
    )
    return written


def with_tables(text: str, written: Mapping[str, str], missions: int) -> str:
    """Return a page with the tables, each between two comments, and the number of missions."""
    for name, table in written.items():
        text = with_table(text, f"compare: {name}", table)
    return re.sub(r"(<!-- missions -->).*?(<!-- end -->)", rf"\g<1>{missions}\g<2>", text)


def _of_missions(row: Row) -> Iterator[Figure]:
    yield "found", row["found"], row["found_interval"]
    yield "steps", row["steps"], row["steps_interval"]
    yield "median_steps", row["median_steps"], None
    yield "steps_difference", row["difference"], row["difference_interval"]


def _at_sea(row: Row) -> Iterator[Figure]:
    for name in ("pos", "found", "found_over_pos", "difference"):
        for column, minutes in enumerate(incidents.MINUTES):
            yield f"{name}_{minutes}_min", row[name][column], row[f"{name}_interval"][column]


def figures(results: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
    """Yield every figure as a row of the CSV, see `FIELDS`."""

    def lines(
        place: Sequence[str], name: str, seeds: Any, quantities: Iterator[Figure]
    ) -> Iterator[Sequence[Any]]:
        for quantity, value, interval in quantities:
            rounded = [f"{x:.6g}" for x in (value, *(interval or ()))]
            yield [*place, name, seeds, quantity, *rounded, *[""] * (3 - len(rounded))]

    for key, rows in results["cases"].items():
        for name, row in rows.items():
            yield from lines(["cases", key, ""], name, row["planner_seeds"], _of_missions(row))
    disturbed = [("disturbed", key, rows) for key, rows in results["disturbed"].items()]
    for part, key, by_condition in [*disturbed, ("faults", "santos_4", results["faults"])]:
        for condition, rows in by_condition.items():
            for name, row in rows.items():
                place = [part, key, condition]
                yield from lines(place, name, row["planner_seeds"], _of_missions(row))
    for name, row in results["incidents"].items():
        yield from lines(["incidents", "", ""], name, 1, _at_sea(row))
    for condition, row in results["wrong_drift"].items():
        place = ["wrong_drift", "", condition]
        yield from lines(place, incidents.BASELINE, 1, _at_sea(row))


def as_csv(results: Mapping[str, Any]) -> str:
    """Return every figure with its 99 % interval as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(FIELDS)
    writer.writerows(figures(results))
    return text.getvalue()
