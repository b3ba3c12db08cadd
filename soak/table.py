# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`python -m soak.table` writes the figures of the last soak into QUALITY_DECLARATION.md.

Without that page, it prints them.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from soak import ROOT

RESULTS = ROOT / "benchmarks" / "results" / "soak.json"
PAGE = ROOT / "QUALITY_DECLARATION.md"
BEGIN, END = "<!-- promises: begin -->\n", "<!-- promises: end -->\n"


def table(results: dict[str, Any]) -> str:
    """Return the results of `make soak` as a table in Markdown."""
    lines = ["| Promise | Result |", "| --- | --- |"]
    for row in results.values():
        form = " (short form)" if row["quick"] else ""
        lines.append(f"| {row['promise']} | {row['says']}{form} |")
    return "\n".join(lines) + "\n"


def stated(page: str) -> str:
    """Return the text between the markers of a page."""
    return page.partition(BEGIN)[2].partition(END)[0]


def filled(page: str, results: dict[str, Any]) -> str:
    """Return a page with the table between its markers."""
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + table(results) + END + rest.partition(END)[2]


def main() -> None:
    """Write the table, or print it."""
    results = json.loads(RESULTS.read_text(encoding="utf-8"))
    if PAGE.exists():
        PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), results), encoding="utf-8")
    else:
        sys.stdout.write(table(results))


if __name__ == "__main__":
    main()
