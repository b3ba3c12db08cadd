# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pages of reports: one self-contained HTML file each."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


@dataclass(frozen=True)
class Illustration:
    """A figure as files, and in words.

    Attributes:
        name: Name of its files.
        caption: Text below it.
        alt: Alternative text: what the figure shows.
        png: The light figure.
        svg: The light figure.
        dark_svg: For dark pages; None for a figure that a page shows as PNG.
        dark_png: For dark pages; None for a figure that a page shows as SVG.
    """

    name: str
    caption: str
    alt: str
    png: bytes
    svg: bytes
    dark_svg: bytes | None = None
    dark_png: bytes | None = None

    @property
    def light(self) -> str:
        """Address of the light figure: all of it."""
        # A map with its cells is an image in the SVG too, and larger there.
        return _address("png", self.png) if self.dark_svg is None else _address("svg+xml", self.svg)

    @property
    def dark(self) -> str:
        """Address of the dark figure."""
        if self.dark_svg is not None:
            return _address("svg+xml", self.dark_svg)
        assert self.dark_png is not None
        return _address("png", self.dark_png)


def _address(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


@dataclass(frozen=True)
class LegendEntry:
    """A symbol of the maps, and its meaning.

    Attributes:
        label: The meaning.
        svg: The symbol for light pages.
        dark_svg: The symbol for dark pages.
    """

    label: str
    svg: bytes
    dark_svg: bytes

    @property
    def light(self) -> str:
        """Address of the light symbol."""
        return _address("svg+xml", self.svg)

    @property
    def dark(self) -> str:
        """Address of the dark symbol."""
        return _address("svg+xml", self.dark_svg)


@dataclass(frozen=True)
class Table:
    """A table of texts; the first column names the rows."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Page:
    """Content of the page of a report.

    Attributes:
        title: Of the mission.
        verdicts: How it ended, in one line.
        subtitles: What was searched, and where it was recorded.
        notices: What the reader must know of what is missing.
        facts: Names and values of what is read first.
        maps: At chosen steps; none where no map is known.
        legend: The symbols of the maps.
        charts: The other figures.
        metrics: Label, value and meaning of each metric.
        drones: What each drone did.
        missions: All missions of the file, None if it has one only.
    """

    title: str
    verdicts: Sequence[str]
    subtitles: Sequence[str]
    notices: Sequence[str]
    facts: Sequence[tuple[str, str]]
    maps: Sequence[Illustration]
    legend: Sequence[LegendEntry]
    charts: Sequence[Illustration]
    metrics: Sequence[tuple[str, str, str]]
    drones: Table
    missions: Table | None

    def html(self) -> str:
        """Return the page."""
        return _rendered("page.html", vars(self))


@dataclass(frozen=True)
class Section:
    """A part of a page in sections.

    Attributes:
        title: Its heading.
        text: Below it; "" for none.
        figures: All in one row, if there is room.
        tables: Below them.
        prose: Whether the tables hold sentences.
    """

    title: str
    text: str
    figures: Sequence[Illustration]
    tables: Sequence[Table]
    prose: bool = False


@dataclass(frozen=True)
class SectionPage:
    """Content of a page with sections.

    Attributes:
        title: Of the page.
        verdicts: The results, each in one line.
        subtitles: Below them.
        facts: Names and values of what is read first.
        sections: In their order.
        notices: What the reader must know of what is missing.
    """

    title: str
    verdicts: Sequence[str]
    subtitles: Sequence[str]
    facts: Sequence[tuple[str, str]]
    sections: Sequence[Section]
    notices: Sequence[str] = ()

    def html(self) -> str:
        """Return the page."""
        return _rendered("sections.html", vars(self))


def _rendered(template: str, values: Mapping[str, Any]) -> str:
    environment = Environment(
        loader=PackageLoader("dsse_ros.results.report", "."), autoescape=True,
        undefined=StrictUndefined, trim_blocks=False, keep_trailing_newline=True,
    )  # fmt: skip
    generator = f"dsse_ros {metadata.version('dsse_ros')}"
    return environment.get_template(template).render(values, generator=generator)
