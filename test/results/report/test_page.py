# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of a report, its figures and its tables; what the program makes of its input."""

from __future__ import annotations

import base64
import csv
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from flights import SCENARIO, Log, environment, fly
from PIL import Image

from dsse_ros.cli.report import main
from dsse_ros.results.report import texts
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.metrics import METRICS, metrics
from dsse_ros.results.report.record import chosen_steps
from dsse_ros.results.report.texts import duration


class Elements(HTMLParser):
    """The elements of a page.

    Attributes:
        found: Name and attributes of each.
        text: Of the page, without its style.
    """

    def __init__(self, html: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str]]] = []
        self.text = ""
        self._style = False
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, {name: value or "" for name, value in attrs}))
        self._style = tag == "style"

    def handle_endtag(self, tag: str) -> None:
        self._style = False

    def handle_data(self, data: str) -> None:
        self.text += "" if self._style else data

    def of(self, tag: str) -> list[dict[str, str]]:
        """Return the attributes of the elements of a name."""
        return [attributes for name, attributes in self.found if name == tag]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three missions of two persons, the last one cut off; their scenario is beside them."""
    path = tmp_path_factory.mktemp("flown") / "mission.csv"
    scenario = {**SCENARIO, "person_amount": 2}
    env = environment(person_amount=2)
    fly(env, Log(path, env), seeds=(1, 2, 3), steps=2)
    fields = {**scenario, "person_initial_position": [4, 4]}
    fields["drones_positions"] = [[3, 4], [4, 3], [5, 5]]
    path.with_name("scenario.yaml").write_text(yaml.safe_dump(fields))
    return path


@pytest.fixture(scope="module")
def report(log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the last complete one, with two maps."""
    out = tmp_path_factory.mktemp("report")
    scenario = str(log.with_name("scenario.yaml"))
    assert main([str(log), "--scenario", scenario, "--out", str(out), "--steps", "0", "2"]) == 0
    return out


@pytest.mark.slow
def test_the_page_is_one_file_that_asks_for_nothing_else(report: Path) -> None:
    html = (report / "report.html").read_text()
    page = Elements(html)
    addresses = [
        address
        for _, attributes in page.found
        for name in ("src", "srcset", "href", "action", "data", "poster")
        if (address := attributes.get(name))
    ]
    assert len(addresses) > 5
    assert [address[:40] for address in addresses if not address.startswith("data:")] == []
    assert not {"script", "iframe", "object", "embed"} & {name for name, _ in page.found}
    assert "url(" not in html and "@import" not in html


def test_the_page_can_be_read_without_seeing_it(report: Path) -> None:
    page = Elements((report / "report.html").read_text())
    assert page.of("html") == [{"lang": "en"}]
    # The label beside a symbol of the legend says what it is.
    images = [image for image in page.of("img") if image["alt"]]
    assert len(images) == 6
    assert all(len(image["alt"]) > 30 for image in images)
    assert len(page.of("figcaption")) == len(images)
    assert len(page.of("caption")) == len(page.of("table")) == 3
    assert all(cell["scope"] in ("row", "col") for cell in page.of("th"))


def test_a_name_is_text_and_no_markup(report: Path) -> None:
    html = (report / "report.html").read_text()
    assert "<h1>A test &amp; its &lt;name&gt;</h1>" in html
    assert Elements(html).of("name") == []


def test_the_page_has_every_metric_and_every_mission(report: Path, log: Path) -> None:
    text = Elements((report / "report.html").read_text()).text
    for metric in METRICS:
        assert metric.label in text and metric.meaning in text
    assert "Mission 2 of mission.csv" in text and "cut off" in text
    with (report / "missions.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["complete"] for row in rows] == ["1", "1", "0"]
    for row, record in zip(rows, read_csv(log), strict=True):
        for name, value in metrics(record).items():
            assert row[name] == "" if value is None else float(row[name]) == value


def test_the_page_begins_with_one_line_that_says_how_the_mission_ended(report: Path) -> None:
    page = Elements((report / "report.html").read_text())
    (verdict,) = [paragraph for paragraph in page.of("p") if paragraph.get("class") == "verdict"]
    assert verdict
    assert re.search(
        r"Persons? (found by drone\d.* after .* s|not found).*\. Searches like these find "
        r"\d+\.\d% of the persons on average \(POS\)\.", page.text,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("stated", "pos", "line"),
    [
        ("found by drone1 after 4 min 7 s", 0.551,
         "Person found by drone1 after 4 min 7 s. Searches like these find the person in 55.1% of "
         "missions (POS)."),
        ("not found, out of time", None, "Person not found, out of time."),
    ],
)  # fmt: skip
def test_the_line_on_top_says_who_found_whom_when_and_how_likely_that_was(
    stated: str, pos: float | None, line: str, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = read_csv(log)[0]
    resolved = replace(record, scenario=environment().scenario)
    monkeypatch.setattr(texts, "outcome", lambda _: stated)
    assert texts.verdict(resolved, pos) == line


def test_all_maps_share_one_legend(report: Path) -> None:
    page = Elements((report / "report.html").read_text())
    (legend,) = [items for items in page.of("ul") if items["class"] == "legend"]
    assert legend["aria-label"] == "Legend of the maps"
    symbols = [image for image in page.of("img") if not image["alt"]]
    assert len(symbols) == len(page.of("li")) > 4
    for meaning in ("drone with its number", "start of a drone", "person at sea"):
        assert page.text.count(meaning) == 1


def test_each_figure_is_light_on_light_pages_and_dark_on_dark_ones(report: Path) -> None:
    page = Elements((report / "report.html").read_text())
    dark = [source["srcset"] for source in page.of("source")]
    light = [image["src"] for image in page.of("img")]
    assert {source["media"] for source in page.of("source")} == {"(prefers-color-scheme: dark)"}
    assert len(dark) == len(light)
    for kind, papers in (("png", ((255, 255, 255), (23, 27, 33))), ("svg", ("#ffffff", "#171b21"))):
        for addresses, paper in zip((light, dark), papers, strict=True):
            shown = [base64.b64decode(address.partition(",")[2]) for address in addresses
                     if address.startswith(f"data:image/{kind}")]  # fmt: skip
            assert len(shown) > 1
            for content in shown:
                if kind == "png":
                    with Image.open(io.BytesIO(content)) as image:
                        assert image.convert("RGB").getpixel((2, 2)) == paper
                elif len(content) > 10_000:
                    assert f"fill: {paper}" in content.decode()


def test_figures_are_files_too(report: Path) -> None:
    html = (report / "report.html").read_text()
    names = ["effort", "legend", "map_step_0", "map_step_2", "progress", "tracks", "work"]
    assert sorted(path.name for path in (report / "figures").iterdir()) == sorted(
        f"{name}.{kind}" for name in names for kind in ("png", "svg")
    )
    for name in names:
        png, svg = ((report / "figures" / f"{name}.{kind}").read_bytes() for kind in ("png", "svg"))
        assert png.startswith(b"\x89PNG")
        assert ElementTree.fromstring(svg).tag == "{http://www.w3.org/2000/svg}svg"
        shown = png if name.startswith("map") else svg
        assert (base64.b64encode(shown).decode() in html) == (name != "legend")


@pytest.mark.slow
def test_the_same_input_gives_the_same_bytes(report: Path, log: Path, tmp_path: Path) -> None:
    scenario = str(log.with_name("scenario.yaml"))
    arguments = [str(log), "--scenario", scenario, "--out", str(tmp_path), "--steps", "0", "2"]
    assert main(arguments) == 0
    names = [path.relative_to(report) for path in sorted(report.rglob("*.*"))]
    assert len(names) == 20
    for name in names:
        assert (report / name).read_bytes() == (tmp_path / name).read_bytes(), name


@pytest.mark.slow
def test_a_mission_of_one_step_on_a_large_grid_has_a_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fields = {"grid_size": 1000, "num_drones": 2, "cell_size": 100.0, "timestep_limit": 20}
    env = environment(**fields, drones_positions=None)
    fly(env, Log(tmp_path / "mission.csv", env), steps=0)
    (tmp_path / "scenario.yaml").write_text(
        yaml.safe_dump({**fields, "sigma": 2.0, "person_initial_position": [4, 4]})
    )
    out = tmp_path / "out"
    arguments = ["--scenario", str(tmp_path / "scenario.yaml"), "--out", str(out)]
    assert main([str(tmp_path / "mission.csv"), *arguments]) == 0
    printed = capsys.readouterr()
    # The bar is for terminals.
    assert printed.out == f"{out / 'report.html'}\n" and "figure" not in printed.err
    text = Elements((out / "report.html").read_text()).text
    assert "The mission was cut off: the record ends after step 0 with 2 drones in flight" in text
    assert "not computed on grids of more than 50 cells" in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.csv"], "report: file: 'nothing.csv': No such file or directory"),
        ([__file__], "is neither the CSV of a mission nor a bag (MCAP)"),
        (["LOG", "--mission", "7"], "report: mission must be one of the file (1, 2, 3), got 7"),
        (["LOG", "--steps", "99"], "report: steps must be recorded steps, 0 to "),
        (["LOG", "--scenario", "atlantis"], "mission 1: scenario: 'atlantis' is not a file"),
        (
            ["LOG", "--scenario", "santos"],
            "mission 1: scenario: 20 x 20 cells of 130 m do not have the recorded",
        ),
        (["LOG", "--out", "LOG"], "must be a folder, got a file"),
    ],
)
def test_wrong_input_gets_one_line(
    arguments: list[str],
    says: str,
    log: Path,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([str(log) if part == "LOG" else part for part in arguments]) == 2
    printed = capsys.readouterr()
    assert says in printed.err and printed.err.count("\n") == 1 and printed.out == ""
    assert list(tmp_path.iterdir()) == []


def test_maps_are_drawn_of_start_and_end_and_some_steps_between(log: Path) -> None:
    record = read_csv(log)[1]
    last = len(record.steps) - 1
    chosen = chosen_steps(record, [])
    assert chosen[0] == 0 and chosen[-1] == last and len(chosen) == min(6, last + 1)
    assert chosen_steps(record, [2, 0, 2]) == [0, 2]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0 s"), (59.6, "1 min 0 s"), (247, "4 min 7 s"), (7325, "2 h 2 min 5 s")],
)
def test_times_are_read_as_people_say_them(seconds: float, text: str) -> None:
    assert duration(seconds) == text
