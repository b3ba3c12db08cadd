# SPDX-License-Identifier: Apache-2.0
"""`python -m soak.table` prints the table of promises with the figures of the last soak."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).resolve().parents[1] / "benchmarks" / "results" / "soak.json"


def table(results: dict[str, Any]) -> str:
    """Return the results of `make soak` as a table in Markdown."""
    lines = ["| Promise | What came out | When, at load |", "| --- | --- | --- |"]
    for one in results.values():
        form = " (short form)" if one["quick"] else ""
        when = f"{one['date'][:10]}, {one['load_before']:g}{form}"
        lines.append(f"| {one['promise']} | {one['says']} | {when} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(table(json.loads(RESULTS.read_text(encoding="utf-8"))))
