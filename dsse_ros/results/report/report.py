# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a recorded mission: a page, figures and tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dsse_ros.base.whole_files import write_whole
from dsse_ros.picture.rendering import MissionView
from dsse_ros.picture.theme import DARK, LIGHT, Theme
from dsse_ros.results.report import figures, texts
from dsse_ros.results.report.metrics import (
    METRICS,
    Curves,
    Work,
    curves,
    effort,
    metrics,
    num_cells,
    work,
)
from dsse_ros.results.report.page import Illustration, LegendEntry, Page, Table
from dsse_ros.results.report.record import RecordedMission

_Chart: TypeAlias = tuple[str, str, str, Callable[[Theme], Any]]
"""Name, caption, text for readers who do not see it, and figure."""
OF_INCIDENT = ("pos_alive", "poc_outside", "stranded")
FACTS = ("pos", *OF_INCIDENT, "time_to_detection", "expected_time_at_least",
         "expected_time_at_most", "coverage", "path_length", "collisions")  # fmt: skip
"""Metrics at the top of the page, those of an incident only where there is one."""
IN_OVERVIEW = ("pos", "time_to_detection", "coverage", "redundancy", "path_length", "collisions")
"""Metrics for comparing several missions of a file."""


@dataclass(frozen=True)
class MissionReport:
    """The content of a report.

    Attributes:
        record: The mission.
        views: Maps at chosen recorded steps, 0 to K - 1.
        missions: All missions of the file, including this one.
        source: Name of the file.
        notices: Notices for the reader.
    """

    record: RecordedMission
    views: Mapping[int, MissionView]
    missions: Sequence[RecordedMission]
    source: str
    notices: Sequence[str] = ()

    @property
    def num_figures(self) -> int:
        """Number of figures."""
        return len(self.views) + 4 + (self.record.object_shares is not None)

    def write(self, folder: Path, drawn: Callable[[], object] = lambda: None) -> Path:
        """Write all files; returns the path of the page.

        Args:
            drawn: Called after each figure.

        Raises:
            OSError: If a file cannot be written.
        """
        progress, done = curves(self.record), work(self.record)
        pictures = folder / "figures"
        pictures.mkdir(exist_ok=True)
        drawings: dict[bool, list[Illustration]] = {True: [], False: []}
        for is_map, illustration in self._illustrations(progress, done):
            write_whole(pictures / f"{illustration.name}.png", illustration.png)
            write_whole(pictures / f"{illustration.name}.svg", illustration.svg)
            drawings[is_map].append(illustration)
            drawn()
        for name, head, rows in self._tables(progress, done):
            write_whole(folder / f"{name}.csv", texts.csv_text(head, rows).encode())
        path = folder / "report.html"
        html = self._page(
            done, self._legend(pictures), maps=drawings[True], charts=drawings[False]
        ).html()
        write_whole(path, html.encode())
        return path

    def _illustrations(self, progress: Curves, done: Work) -> Iterable[tuple[bool, Illustration]]:
        """Yield each figure, and whether it is a map."""
        record = self.record
        for k, view in self.views.items():
            figure = figures.map_figure(view, LIGHT)
            time = texts.duration(float(record.times_s[k]))
            yield (
                True,
                Illustration(
                    name=f"map_step_{view.step}",
                    caption=f"After {time}: {view.status}.",
                    alt=f"Map of the search after {time}. {view.headline}.",
                    png=figures.png(figure),
                    svg=figures.svg(figure),
                    dark_png=figures.png(figures.map_figure(view, DARK)),
                ),
            )
        area, count = num_cells(record), effort(record)
        share = progress.cells_searched[-1] / area
        known = "" if progress.pos is None else f"POS rises to {progress.pos[-1]:.1%}, "
        most = int(count.max())
        total = len(record.agents)
        charts: tuple[_Chart, ...] = (
            *self._objects_chart(),
            (
                "progress",
                "Probability of success (POS) and area coverage over time.",
                f"Curves over the mission time: {known}area coverage rises to {share:.1%}; "
                f"{int(progress.num_detections[-1])} finds.",
                lambda theme: figures.progress_figure(progress, area, theme),
            ),
            (
                "work",
                "Work of the drones: steps in which each searched, flew on, waited and held.",
                f"Bars for {total} drones: {int(done.searching.sum())} steps searching, "
                f"{int(done.moving.sum())} moving, {int(done.waiting.sum())} waiting, "
                f"{int(done.holding.sum())} holding.",
                lambda theme: figures.work_figure(record, done, theme),
            ),
            (
                "effort",
                "Effort per cell: how often each was searched.",
                f"Map of the search effort: {np.count_nonzero(count)} of {area} cells were "
                f"searched, none more than {most} times.",
                lambda theme: figures.effort_figure(record, theme),
            ),
            (
                "tracks",
                "Tracks, drawn beside each other: o is the start, the triangle the end, an X where "
                "a drone was lost.",
                f"Map of the tracks of {total} drones, "
                f"{texts.distance(progress.path_length_m[-1])} in all.",
                lambda theme: figures.tracks_figure(record, theme),
            ),
        )
        for name, caption, alt, draw in charts:
            figure = draw(LIGHT)
            yield False, Illustration(
                name, caption, alt, figures.png(figure), figures.svg(figure),
                figures.svg(draw(DARK)),
            )  # fmt: skip

    def _objects_chart(self) -> Iterable[_Chart]:
        record, shares = self.record, self.record.object_shares
        if shares is None:
            return
        moved = ", ".join(
            f"{key} from {first:.1%} to {last:.1%}"
            for key, first, last in zip(record.object_names, shares[0], shares[-1], strict=True)
        )
        yield (
            "objects",
            "What the object may be: the probability of each class of leeway, given that the "
            "searches have not found it.",
            f"Stacked areas over the mission time: {moved}.",
            lambda theme: figures.objects_figure(record, theme),
        )

    def _legend(self, folder: Path) -> list[LegendEntry]:
        """Return the legend of the maps, and write it beside them."""
        if not self.views:
            return []
        light, dark = (figures.symbols(self.views.values(), theme) for theme in (LIGHT, DARK))
        figure = figures.legend_figure(light, LIGHT)
        write_whole(folder / "legend.png", figures.png(figure))
        write_whole(folder / "legend.svg", figures.svg(figure))
        return [
            LegendEntry(symbol.label, symbol.icon(), other.icon())
            for symbol, other in zip(light, dark, strict=True)
        ]

    def _page(
        self, done: Work, legend: Sequence[LegendEntry], **drawings: Sequence[Illustration]
    ) -> Page:
        record, numbers = self.record, metrics(self.record)
        scenario, rules = record.scenario, record.rules
        drones, persons = len(record.agents), scenario.person_amount
        search = [
            f"{drones} drone{'s' if drones > 1 else ''}",
            f"{record.grid_size} cells of {scenario.cell_size:g} m",
            f"profile {rules.profile}",
            "coverage" if rules.covers else f"{persons} person{'s' if persons > 1 else ''}",
            f"limit of {scenario.timestep_limit} steps",
        ]
        if record.seed is not None:
            search.append(f"seed {record.seed}")
        shown = {metric.name: texts.value(metric, numbers[metric.name]) for metric in METRICS}
        labels = {metric.name: metric.label for metric in METRICS}
        return Page(
            title=scenario.name or "Search mission",
            verdicts=(texts.verdict(record, numbers["pos"]),),
            subtitles=(", ".join(search), f"Mission {record.number} of {self.source}"),
            notices=self.notices,
            facts=[
                *(
                    (labels[name], shown[name])
                    for name in FACTS
                    if name not in OF_INCIDENT or numbers[name] is not None
                ),
                *texts.objects(record),
            ],
            metrics=[(m.label, shown[m.name], m.meaning) for m in METRICS],
            drones=self._drones(done),
            missions=self._missions() if len(self.missions) > 1 else None,
            legend=legend,
            **drawings,
        )

    def _drones(self, done: Work) -> Table:
        record = self.record
        return Table(
            "What each drone did",
            ("Drone", "Searches", "Cells", "Moves", "Waits", "Holds", "Path", "Finds", "Return",
             "Ended"),
            [
                (
                    name, str(done.searching[i]), str(done.cells[i]), str(done.moving[i]),
                    str(done.waiting[i]), str(done.holding[i]),
                    texts.distance(float(done.path_length_m[i])),
                    str(done.detections[i]), f"{done.returns[i]:.1f}",
                    texts.ended(record, done, i),
                )
                for i, name in enumerate(record.agents)
            ],
        )  # fmt: skip

    def _missions(self) -> Table:
        chosen = [metric for metric in METRICS if metric.name in IN_OVERVIEW]
        rows = []
        for record in self.missions:
            numbers = metrics(record)
            values = [texts.value(metric, numbers[metric.name]) for metric in chosen]
            rows.append([_name(record), texts.outcome(record), *values])
        head = ("Mission", "Outcome", *(metric.label for metric in chosen))
        return Table("All missions of the file; missions.csv has every metric", head, rows)

    def _tables(
        self, progress: Curves, done: Work
    ) -> Iterable[tuple[str, Sequence[str], Iterable[Sequence[Any]]]]:
        """Yield the name, the columns and the rows of each CSV."""
        record, numbers = self.record, metrics(self.record)
        yield (
            "metrics", ("metric", "value", "unit"),
            [(m.name, _number(numbers[m.name]), m.unit) for m in METRICS],
        )  # fmt: skip
        yield (
            "missions", ("run_id", "mission", "complete", *(m.name for m in METRICS)),
            [
                (
                    "" if mission.run_id is None else mission.run_id,
                    mission.number, int(mission.complete),
                    *(_number(value) for value in metrics(mission).values()),
                )
                for mission in self.missions
            ],
        )  # fmt: skip
        names = (
            "times_s", "pos", "num_searches", "cells_searched", "path_length_m", "num_in_flight",
            "num_detections", "num_collisions", "separation_m",
        )  # fmt: skip
        columns = [getattr(progress, name) for name in names]
        yield (
            "steps", ("step", "time_s", *names[1:]),
            [
                (
                    step,
                    *(_number(None if c is None else c.tolist()[k]) for c in columns),
                )
                for k, step in enumerate(record.steps.tolist())
            ],
        )  # fmt: skip
        if record.object_shares is not None:
            yield (
                "objects", ("step", "time_s", *record.object_names),
                [
                    (step, *map(_number, (time_s, *shares)))
                    for step, time_s, shares in zip(
                        record.steps.tolist(), record.times_s.tolist(),
                        record.object_shares.tolist(), strict=True,
                    )
                ],
            )  # fmt: skip
        yield (
            "drones",
            ("drone", "searches", "cells_searched", "moves", "waits", "holds", "path_length_m",
             "finds", "episode_return", "lost_at_step"),
            [
                (
                    name, done.searching[i], done.cells[i], done.moving[i], done.waiting[i],
                    done.holding[i],
                    _number(float(done.path_length_m[i])), done.detections[i],
                    _number(float(done.returns[i])),
                    "" if done.lost_at[i] < 0 else done.lost_at[i],
                )
                for i, name in enumerate(record.agents)
            ],
        )  # fmt: skip
        count = effort(record)
        yield (
            "effort", ("col", "row", "searches"),
            [(col, row, count[row, col]) for row, col in np.argwhere(count).tolist()],
        )  # fmt: skip


def _name(record: RecordedMission) -> str:
    run = "" if record.run_id is None else f" of run {record.run_id}"
    return f"{record.number}{run}"


def _number(value: float | None) -> str:
    """Return a number with all its digits, "" where there is none."""
    if value is None or value != value:
        return ""
    return repr(int(value)) if value == int(value) else repr(float(value))
