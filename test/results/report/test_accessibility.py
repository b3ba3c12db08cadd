# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pages of reports in a real browser, on phones and screens, in light and dark."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import violations
from flights import Log, environment, fly

from dsse_ros.cli.report import main
from dsse_ros.results.report.page import Illustration, Section, SectionPage, Table

pytestmark = pytest.mark.slow

PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c63f8cf"
    "c0f01f0005050201a6c1d2c90000000049454e44ae426082"
)
SVG = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 5"/>'


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A report of a mission, and a page in sections as that of a campaign."""
    folder = tmp_path_factory.mktemp("pages")
    env = environment()
    fly(env, Log(folder / "mission.csv", env), seeds=(1,))
    scenario = ["--scenario", str(folder / "scenario.yaml")]
    (folder / "scenario.yaml").write_text(_yaml(), encoding="utf-8")
    arguments = [str(folder / "mission.csv"), *scenario, "--steps", "2", "--out"]
    assert main([*arguments, str(folder / "report")]) == 0
    figure = Illustration("pos", "POS over time.", "Curves of the POS.", PIXEL, SVG, SVG)
    tables = [
        # Wider than a phone.
        Table(f"{caption} with intervals; summary.csv has all digits",
              ("Measure", "greedy", "belief_greedy", "sweep"),
              [("POS", *3 * ("50.0% [40.0%, 60.0%]",))])
        for caption in ("Estimates", "Differences")
    ]  # fmt: skip
    # Each case of a campaign has the same tables.
    sections = [
        Section(case, "Profile paper.", [figure, figure], tables) for case in ("santos", "kayak")
    ]
    campaign = SectionPage(
        "A campaign", ["greedy finds everyone in 50.0% of its missions."], ["100 missions."],
        [("Missions", "100")], sections,
    )  # fmt: skip
    (folder / "campaign.html").write_text(campaign.html(), encoding="utf-8")
    return {"report": folder / "report" / "report.html", "campaign": folder / "campaign.html"}


def _yaml() -> str:
    import yaml
    from flights import SCENARIO

    fields = {**SCENARIO, "person_initial_position": [4, 4]}
    return yaml.safe_dump({**fields, "drones_positions": [[3, 4], [4, 3], [5, 5]]})


@pytest.fixture(scope="module", params=["report", "campaign"])
def page(request: pytest.FixtureRequest, pages: dict[str, Path], browser: Any) -> Iterator[Any]:
    """Each of the pages, opened once."""
    context = browser.new_context(bypass_csp=True)
    opened = context.new_page()
    opened.goto(pages[request.param].as_uri())
    yield opened
    context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 768, 1440])
def test_all_fits_and_axe_finds_nothing(page: Any, width: int, scheme: str) -> None:
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": 900})
    assert page.evaluate("innerWidth") == width
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    cut = "[...document.querySelectorAll('figure')].filter((f) => f.scrollWidth > f.clientWidth)"
    assert page.evaluate(f"{cut}.length") == 0
    near = """[...document.querySelectorAll('.figures')].filter((figures) => {
        const below = figures.nextElementSibling, edge = figures.getBoundingClientRect().bottom;
        return below && below.getBoundingClientRect().top - edge < 8;
    }).length"""
    assert page.evaluate(near) == 0
    # However far a wide table is scrolled.
    page.evaluate("document.querySelectorAll('.scroll').forEach((one) => one.scrollLeft = 200)")
    for kept in ("caption span", "tbody th"):
        for place in page.locator(kept).all():
            box = place.bounding_box()
            assert box["x"] >= 0 and box["x"] + box["width"] <= width
    assert violations(page) == []
