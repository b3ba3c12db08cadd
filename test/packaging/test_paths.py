# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is written of the ways through the package is short enough and about files there are."""

from __future__ import annotations

import re

from tree import ROOT

MOST_FILES = 8
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
SECTION = TEXT.partition("\n## Paths\n")[2].partition("\n## ")[0]
LISTS = [re.findall(r"^\d+\. `([^`]+)`", part, re.MULTILINE) for part in SECTION.split("\n\n")]


def test_each_path_passes_few_files_and_none_twice() -> None:
    paths = [path for path in LISTS if path]
    assert len(paths) == 4
    for path in paths:
        assert len(set(path)) == len(path) <= MOST_FILES, path
        assert [name for name in path if not (ROOT / name).is_file()] == []
