# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a campaign: tables, figures and one page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from dsse_ros.base.whole_files import write_whole
from dsse_ros.picture.theme import DARK, LIGHT
from dsse_ros.results.campaign import figures
from dsse_ros.results.campaign.config import Campaign, Case
from dsse_ros.results.campaign.estimates import Estimate
from dsse_ros.results.campaign.statistics import (
    MEASURES,
    PlannerPair,
    Played,
    horizon_of,
    pairs,
    pos_at,
    pos_times,
)
from dsse_ros.results.report.figures import png, svg
from dsse_ros.results.report.page import Illustration, Section, SectionPage, Table
from dsse_ros.results.report.texts import csv_text, distance, duration


@dataclass(frozen=True)
class Row:
    """An estimate of a planner in a scenario, as a line of `summary.csv`."""

    played: Played
    measure: str
    label: str
    unit: str
    time_s: float | None
    estimate: Estimate


def played_of(campaign: Campaign, table: pa.Table) -> list[Played]:
    """Return the missions of each scenario and planner, in the order of the campaign."""
    found = []
    for case in campaign.cases:
        of_case = table.filter(pc.equal(table["scenario"], case.name))
        for entry in campaign.planners:
            rows = of_case.filter(pc.equal(of_case["planner"], entry.name))
            columns = {name: rows[name].to_numpy() for name in rows.column_names}
            seeds = pc.fill_null(rows["planner_seed"], -1).to_numpy()
            hit = columns["found"].astype(bool)
            found.append(
                Played(
                    entry.name, case, columns["seed"], seeds, hit, columns["steps"].astype(float),
                    np.where(hit, columns["time_s"], np.inf), columns["path_length_m"],
                    columns["collisions"].astype(float), columns["drones_lost"].astype(float),
                )
            )  # fmt: skip
    return found


def rows_of(campaign: Campaign, played: Played) -> list[Row]:
    """Return all estimates of a planner in a scenario."""
    level, horizon_s = campaign.settings.confidence, horizon_of(campaign, played.case)
    rows = [
        Row(
            played,
            measure.name,
            measure.label,
            measure.unit,
            None,
            measure.estimate(played, horizon_s, level),
        )
        for measure in MEASURES
    ]
    for time_s in pos_times(campaign, played.case):
        label = f"POS after {duration(time_s)}"
        rows.append(Row(played, "pos", label, "share", time_s, pos_at(played, time_s, level)))
    return rows


def write(campaign: Campaign, table: pa.Table, folder: Path) -> Path:
    """Write summary, pairs, figures and page; return the path of the page.

    Args:
        folder: An existing folder.

    Raises:
        OSError: If a file cannot be written.
    """
    missions = played_of(campaign, table)
    rows = [rows_of(campaign, played) for played in missions]
    compared = list(pairs(campaign, missions))
    for name, head, lines in (
        ("summary", ("scenario", "planner", "measure", "time_s", "unit", "value", "low", "high"),
         [_summary_line(row) for of_planner in rows for row in of_planner]),
        ("pairs", ("scenario", "first", "second", "only_first", "only_second", "found_difference",
                   "found_low", "found_high", "mcnemar_p", "time_difference_s", "time_low_s",
                   "time_high_s", "wilcoxon_p"),
         [_pair_line(pair) for pair in compared]),
    ):  # fmt: skip
        write_whole(folder / f"{name}.csv", csv_text(head, lines).encode())
    pictures = folder / "figures"
    pictures.mkdir(exist_ok=True)
    sections, verdicts = [], []
    for number, case in enumerate(campaign.cases):
        of_case = [played for played in missions if played.case is case]
        drawn = list(_illustrations(campaign, of_case, number))
        for figure in drawn:
            for suffix, content in (("png", figure.png), ("svg", figure.svg)):
                write_whole(pictures / f"{figure.name}.{suffix}", content)
        of_pairs = [pair for pair in compared if pair.case is case]
        tables = [_estimates(case, [group for group in rows if group[0].played.case is case])]
        tables += [_comparison(campaign, case, of_pairs)] if of_pairs else []
        shares = {played.planner: float(played.found.mean()) for played in of_case}
        best = verdict(of_pairs, shares, 1.0 - campaign.settings.confidence)
        verdicts.append(f"{case.name}: {best}")
        sections.append(Section(case.name, _about(case), drawn, tables))
    path = folder / "report.html"
    write_whole(path, _page(campaign, sections, verdicts).html().encode())
    return path


def _summary_line(row: Row) -> tuple[Any, ...]:
    played = row.played
    named = played.case.name, played.planner, row.measure
    return (*named, row.time_s, row.unit, *astuple(row.estimate))


def _pair_line(pair: PlannerPair) -> tuple[Any, ...]:
    return (
        pair.case.name, pair.first, pair.second, pair.only_first, pair.only_second,
        *astuple(pair.found), pair.found_p, *astuple(pair.time_s), pair.time_p,
    )  # fmt: skip


def _illustrations(
    campaign: Campaign, missions: Sequence[Played], number: int
) -> Iterator[Illustration]:
    case, level = missions[0].case, campaign.settings.confidence
    finals = ", ".join(f"{played.planner} {played.found.mean():.1%}" for played in missions)
    for name, caption, alt, draw in (
        (
            "pos",
            "Probability of success over the mission time, with its "
            f"{100 * level:.4g} % confidence band.",
            f"Curves of the POS over time for {case.name}; at the end {finals}.",
            lambda theme: figures.pos_figure(missions, level, theme),
        ),
        (
            "measures",
            "Missions with all found, and the restricted mean time to detection, with intervals.",
            f"Points with intervals for {len(missions)} planners; found: {finals}.",
            lambda theme: figures.estimates_figure(
                missions, horizon_of(campaign, case), level, theme
            ),
        ),
    ):
        figure = draw(LIGHT)
        yield Illustration(
            f"{name}_{number}", caption, alt, png(figure), svg(figure), svg(draw(DARK))
        )


def verdict(compared: Sequence[PlannerPair], shares: Mapping[str, float], alpha: float) -> str:
    """Return in words which planner of a scenario is best, and by how much.

    Args:
        compared: All pairs of the planners.
        shares: Share of the missions in which each planner has found every person.
        alpha: Largest p-value of a difference that counts.
    """
    best, *others = sorted(shares, key=lambda name: -shares[name])
    text = f"{best} finds everyone in {shares[best]:.1%} of its missions"
    if not others:
        return f"{text}."
    second = others[0]
    pair = next(pair for pair in compared if {pair.first, pair.second} == {best, second})
    faster = pair.first if pair.time_s.value < 0 else pair.second
    if pair.found_p < alpha:
        more = 100 * abs(pair.found.value)
        return f"{text}, {more:.1f} percentage points more than {second} (next best)."
    text += f", {second} in {shares[second]:.1%}: no difference beyond chance"
    if pair.time_p < alpha:
        return f"{text}, but {faster} is faster by {duration(abs(pair.time_s.value))}."
    return f"{text}, nor in the time to detection."


def _about(case: Case) -> str:
    scenario = case.scenario
    size, drones = scenario.grid_size, scenario.num_drones
    people = f"{scenario.person_amount} person{'s' if scenario.person_amount > 1 else ''}"
    return (
        f"Profile {case.rules.profile}, {size} cells of {scenario.cell_size:g} m, "
        f"{drones} drone{'s' if drones > 1 else ''}, {people}, limit of "
        f"{scenario.timestep_limit} steps ({duration(case.limit_s)})."
    )


def _shown(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return "\N{INFINITY}" if value > 0 else "-\N{INFINITY}"
    if unit == "share":
        return f"{value:.1%}"
    if unit == "s":
        return f"{value:.0f} s"
    return distance(value) if unit == "m" else f"{value:.2f}"


def _interval(estimate: Estimate, unit: str) -> str:
    low, high = _shown(estimate.low, unit), _shown(estimate.high, unit)
    return f"{_shown(estimate.value, unit)} [{low}, {high}]"


def _estimates(case: Case, rows: Sequence[Sequence[Row]]) -> Table:
    return Table(
        f"{case.name}: estimates with confidence intervals; summary.csv has all digits",
        ("Measure", *(of_planner[0].played.planner for of_planner in rows)),
        [
            (same[0].label, *(_interval(row.estimate, row.unit) for row in same))
            for same in zip(*rows, strict=True)
        ],
    )


def _comparison(campaign: Campaign, case: Case, compared: Sequence[PlannerPair]) -> Table:
    seconds = duration(horizon_of(campaign, case))
    return Table(
        f"{case.name}: planners in pairs on the same seeds, first minus second; times to detection "
        f"restricted to {seconds}; p-values adjusted for all pairs (Holm)",
        ("Pair", "Only first found", "Only second found", "Found", "p (McNemar)",
         "Time to detection", "p (Wilcoxon)"),
        [
            (
                f"{pair.first}, {pair.second}", str(pair.only_first), str(pair.only_second),
                _interval(pair.found, "share"), _p(pair.found_p), _interval(pair.time_s, "s"),
                _p(pair.time_p),
            )
            for pair in compared
        ],
    )  # fmt: skip


def _p(value: float) -> str:
    return "< 0.0001" if value < 1e-4 else f"{value:.4f}"


def _page(campaign: Campaign, sections: Sequence[Section], verdicts: Sequence[str]) -> SectionPage:
    settings = campaign.settings
    each, seeds = settings.missions, f"{settings.seed} to {settings.seed + settings.missions - 1}"
    total = each * len(campaign.planners) * len(campaign.cases)
    meanings = Table(
        "What each measure means, and how its interval is made",
        ("Measure", "Meaning"),
        [
            *((measure.label, measure.meaning) for measure in MEASURES),
            ("POS after a time", "The probability of success by then, estimated by the share of "
             "missions that had found every person. Wilson interval."),
        ],
    )  # fmt: skip
    return SectionPage(
        title=settings.name,
        verdicts=verdicts,
        subtitles=(
            f"{total} missions: {each} of each planner in each scenario, seeds {seeds}.",
            f"Intervals have a confidence level of {100 * settings.confidence:.4g} %.",
        ),
        facts=(
            ("Planners", ", ".join(entry.name for entry in campaign.planners)),
            ("Scenarios", str(len(campaign.cases))),
            ("Missions", str(total)),
        ),
        sections=(*sections, Section("Measures", "", (), (meanings,), prose=True)),
    )
