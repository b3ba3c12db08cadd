# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search plan as text, in the parts of the search action plan of the IAMSAR manual, vol. II."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dsse_ros.planners.search_plan.assignments import Assignment
from dsse_ros.results.search_plan.plan import SearchPlan
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.drift.sightings import (
    Bearing,
    Seen,
    SeenArea,
    SeenRaster,
    Sighting,
    Voyage,
)
from dsse_ros.world.scenario.sea_state import sea_state


def action_plan(plan: SearchPlan) -> str:
    """Return the text of a search action plan: positions in degrees and minutes, times in UTC."""
    return "\n".join(_lines(plan)) + "\n"


def _lines(plan: SearchPlan) -> Iterator[str]:
    scenario, assignments = plan.scenario, plan.assignments
    incident = scenario.incident
    assert incident is not None
    yield "SEARCH ACTION PLAN"
    yield ""
    yield "1. SITUATION"
    if scenario.name:
        yield f"   {scenario.name}"
    weights = sum(one.weight for one in incident.objects)
    for one in incident.objects:
        share = "" if len(incident.objects) == 1 else f", {one.weight / weights:.0%}"
        yield f"   search object    {one.category.key}{share}"
    for seen in incident.sightings:
        yield f"   {last_seen(seen)}"
    for flow in sea_state(scenario, 0).flows:
        yield f"   sea              {flow.label}"
    yield f"   search begins    {plan.clock(0.0)}"
    yield ""
    yield "2. SEARCH AREAS"
    rows: list[tuple[str, ...]] = [
        ("area", "size", "centre", "length x width", "heading", "corner points")
    ]
    for name, assignment in zip(plan.names, assignments, strict=True):
        area = assignment.area
        long, short = sorted((area.along, area.across), reverse=True)
        heading = area.heading_deg + (90 if area.along < area.across else 0)
        corners = [position(*plan.place(*corner)) for corner in area.corners.tolist()]
        rows.append(
            (
                name, f"{area.area_m2 / 1e6:.2f} km2",
                position(*plan.place(area.east, area.south)), f"{long:.0f} x {short:.0f} m",
                f"{round(heading) % 180:03d}", ", ".join(corners),
            )
        )  # fmt: skip
    yield from table(rows)
    yield ""
    yield "3. EXECUTION"
    rows = [
        ("area", "unit", "base", "pattern", "first leg", "creep", "commence search point",
         "spacing", "legs", "altitude", "speed"),
    ]  # fmt: skip
    for name, assignment in zip(plan.names, assignments, strict=True):
        unit, pattern = assignment.unit, assignment.search_pattern
        rows.append(
            (
                name, unit.name, position(*plan.place(*unit.base)), pattern.pattern,
                f"{round(pattern.heading) % 360:03d}", f"{creep_deg(assignment):03d}",
                position(*plan.place(*assignment.track[0].tolist())),
                f"{assignment.choice.spacing_m:.0f} m", str(assignment.choice.lanes),
                f"{unit.altitude_m:.0f} m", f"{unit.speed_mps:g} m/s",
            )
        )  # fmt: skip
    yield from table(rows)
    yield ""
    yield "4. CO-ORDINATION"
    rows = [("area", "unit", "leaves base", "commences", "ends", "back at base", "track length")]
    for name, assignment in zip(plan.names, assignments, strict=True):
        unit = assignment.unit
        rows.append(
            (
                name, unit.name, plan.clock(unit.ready_s), plan.clock(assignment.commences_s),
                plan.clock(assignment.ends_s),
                plan.clock(assignment.returns_s) if unit.returns else "-",
                f"{assignment.length_m / 1000:.1f} km",
            )
        )  # fmt: skip
    yield from table(rows)
    yield ""
    yield "5. EFFORT"
    rows = [("area", "unit", "sweep width", "coverage", "POC", "POD", "POS")]
    for name, assignment, of_area in zip(plan.names, assignments, plan.areas, strict=True):
        rows.append(
            (
                name, assignment.unit.name, f"{assignment.unit.sweep_width_m:.0f} m",
                f"{assignment.coverage:.2f}", *(f"{share:.1%}" for share in of_area),
            )
        )  # fmt: skip
    yield from table(rows)
    yield f"   POS of all units: {plan.pos:.1%}"
    if plan.pos_before:
        yield f"   POS of the earlier searches: {plan.pos_before:.1%}"
        yield f"   POS of all searches: {plan.pos_cumulative:.1%}"


def last_seen(seen: Seen) -> str:
    """Return where and when the object was seen, or may have come to grief."""
    place = position(*seen.place)
    within = f"99 % within {seen.radius_m:.0f} m"
    when = f"at {utc(seen.first_s)}"
    if seen.last_s > seen.first_s:
        when = f"between {utc(seen.first_s)} and {utc(seen.last_s)}"
    match seen:
        case Sighting():
            return f"last seen        {place} at {utc(seen.time_s)}, {within}"
        case SeenArea() | SeenRaster():
            return f"last known       in an area around {place} {when}"
        case Voyage():
            end = position(*seen.way_points[-1][:2])
            return f"voyage           from {place} to {end} {when}, {within} of it"
        case Bearing():
            return (
                f"bearing          {seen.bearing_deg:05.1f} +- {seen.bearing_error_deg:g} from "
                f"{place}, {seen.least_m:.0f} to {seen.greatest_m:.0f} m away, {when}"
            )


def position(lat_deg: float, lon_deg: float) -> str:
    """Return a position in degrees and minutes, such as `24-02.100S 046-21.120W`."""
    lon_deg = (lon_deg + 180) % 360 - 180

    def part(degrees: float, letters: str, digits: int) -> str:
        thousandths = round(abs(degrees) * 60_000)
        whole, rest = divmod(thousandths, 60_000)
        return f"{whole:0{digits}d}-{rest / 1000:06.3f}{letters[degrees < 0]}"

    return f"{part(lat_deg, 'NS', 2)} {part(lon_deg, 'EW', 3)}"


def creep_deg(assignment: Assignment) -> int:
    """Return the direction in which the legs follow each other, degrees clockwise from north."""
    return round(assignment.choice.heading_deg + (-90 if assignment.choice.port else 90)) % 360


def table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a table, the first row in capitals."""
    rows = [[cell.upper() for cell in rows[0]], *rows[1:]]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield ("   " + "  ".join(cells)).rstrip()
