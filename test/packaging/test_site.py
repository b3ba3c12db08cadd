# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The documentation site, the runner of the commands on its pages, and the examples they show."""

from __future__ import annotations

import csv
import json
import re
import runpy
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest
from tree import by_name, files

ROOT = Path(__file__).resolve().parents[2]
# `docs/check.py` imports nothing but the standard library.
CHECK: dict[str, Any] = runpy.run_path(str(ROOT / "docs" / "check.py"))


def commands(text: str) -> list[tuple[int, str, str, str]]:
    """Blocks of a page with this text: line, commands, how they are run, and what goes with it."""
    return [
        (block.line, block.code, block.how, block.text)
        for block in CHECK["blocks"]("page.md", text)
    ]


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "dummy", "-c", "docs",
         "-d", tmp_path / "doctrees", ".", tmp_path / "site"],
        cwd=ROOT, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_every_page_of_docs_is_in_the_side_bar() -> None:
    pytest.importorskip("sphinx")
    conf = runpy.run_path(str(ROOT / "docs" / "conf.py"))
    pages = [name for names in conf["NAVIGATION"].values() for name in names]
    assert len(pages) == len(set(pages))
    written = {
        name.rpartition(".")[0] for name in by_name(files())
        if name.startswith("docs/") and name.endswith((".md", ".rst"))
    }  # fmt: skip
    assert written - {conf["root_doc"]} <= set(pages)


def test_the_first_page_links_to_every_tutorial_guide_and_reference() -> None:
    pytest.importorskip("sphinx")
    conf = runpy.run_path(str(ROOT / "docs" / "conf.py"))
    text = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    linked = {f"docs/{target}" for target in re.findall(r"\]\((\S+?)\.(?:md|rst)\)", text)}
    for part in ("Tutorials", "Guides", "Reference"):
        assert set(conf["NAVIGATION"][part]) <= linked


def test_every_block_of_commands_is_run_or_says_why_not() -> None:
    found = CHECK["all_blocks"]()
    assert {"README.md", "docs/install.md", "docs/tutorials/first_mission.md"} <= {
        block.page for block in found if block.how != "skip"
    }
    assert all(block.text for block in found if block.how == "skip")


def test_blocks_are_found_with_their_comments() -> None:
    text = textwrap.dedent("""\
        ```sh
        one
        ```
        <!-- docs-check: background -->
        ```sh
        two
        ```

        1. In a list:

           <!-- docs-check: until it is over -->
           ```sh
           three
           ```
        <!-- docs-check: skip, needs a ship -->
        ```sh
        four
        ```
        ```text
        five
        ```
        """)
    assert commands(text) == [
        (2, "one\n", "", ""),
        (6, "two\n", "background", ""),
        (13, "   three\n", "until", "it is over"),
        (17, "four\n", "skip", "needs a ship"),
    ]


@pytest.mark.parametrize("comment", ["skip", "until", "background, why", "perhaps"])
def test_a_comment_that_is_none_is_refused(comment: str) -> None:
    with pytest.raises(ValueError, match=r"page\.md"):
        commands(f"<!-- docs-check: {comment} -->\n```sh\ntrue\n```\n")


def test_a_block_fails_if_what_runs_beside_it_does(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("it is over", encoding="utf-8")
    block = CHECK["Block"]("page.md", 1, "", "until", "it is over")
    for command, why in (("true", ""), ("false", f"exit code 1, see {log}")):
        with subprocess.Popen([command]) as beside:
            beside.wait()
            assert CHECK["wait_for"](block, [(beside, log)] * 2) == why


def test_every_choice_of_pages_begins_with_the_block_that_makes_the_environment() -> None:
    chosen = CHECK["chosen_blocks"](["docs/ros.md"])
    assert chosen[0].code == "make sim\n"
    assert {block.page for block in chosen[1:]} == {"docs/ros.md"}
    with pytest.raises(ValueError, match=r"docs/rso\.md: a page with commands is one of CONTRIB"):
        CHECK["chosen_blocks"](["docs/rso.md"])


def test_the_cpp_on_the_page_is_in_the_example() -> None:
    source = (ROOT / "examples/cpp_planner/src/cpp_planner.cpp").read_text(encoding="utf-8")
    lines = [line.strip() for line in source.splitlines()]
    page = (ROOT / "docs/tutorials/cpp_planner.md").read_text(encoding="utf-8")
    shown = [block.split("```")[0] for block in page.split("```cpp\n")[1:]]
    assert shown
    for block in shown:
        part = [line.strip() for line in block.splitlines()]
        assert any(lines[i : i + len(part)] == part for i in range(len(lines))), block


def test_the_page_states_the_evaluation_and_the_curve_that_come_with_the_model() -> None:
    models = ROOT / "dsse_ros" / "models"
    card = json.loads((models / "v2.json").read_text(encoding="utf-8"))
    page = (ROOT / "docs/tutorials/training.md").read_text(encoding="utf-8")
    for planner, measured in card["evaluation"]["value_low_high"].items():
        (found, low, high), (mean, below, above) = (
            measured[name] for name in ("found_percent", "mean_steps")
        )
        median = measured["median_steps"][0]
        row = (
            f"| `{planner}` | {found:.2f} ({low:.2f} to {high:.2f}) "
            f"| {mean:.2f} ({below:.2f} to {above:.2f}) | {median:g} |"
        )
        assert row in page
    with (models / "v2_curve.csv").open(encoding="utf-8") as file:
        steps = [int(row["drone_steps"]) for row in csv.DictReader(file)]
    assert card["training"]["drone_steps"] in steps and steps == sorted(steps)
