# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is written of the ways through the package is short and about files that are there."""

from __future__ import annotations

import re

from tree import ROOT

MOST_FILES = 8
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
SECTION = TEXT.partition("\n## Paths\n")[2].partition("\n## ")[0]
FILES = TEXT.partition("\n## Where to find what\n")[2].partition("\n## ")[0]
LISTS = [re.findall(r"^\d+\. `([^`]+)`", part, re.MULTILINE) for part in SECTION.split("\n\n")]


def test_each_path_passes_few_files_and_none_twice() -> None:
    paths = [path for path in LISTS if path]
    assert len(paths) == 4
    for path in paths:
        assert len(set(path)) == len(path) <= MOST_FILES, path
        assert [name for name in path if not (ROOT / name).is_file()] == []


def test_each_file_is_where_its_row_says() -> None:
    rows = [line for line in FILES.splitlines() if line.startswith("| ")][2:]
    missing = []
    for row in rows:
        names = re.findall(r"`([\w./]+)`", row)
        folders = {ROOT / name for name in names if (ROOT / name).is_dir()}
        folders |= {(ROOT / name).parent for name in names if "/" in name}
        files = [name for name in names if name.endswith((".py", ".js", ".xml"))]
        missing += [
            (name, row)
            for name in files
            if not any((folder / name).is_file() for folder in (ROOT, *folders))
        ]
    assert len(rows) > 50
    assert missing == []
