# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page on the architecture is short, and the files that it names exist."""

from __future__ import annotations

import re

from tree import ROOT

MAX_FILES = 8
MAX_LINES = 110
"""Two printed pages."""
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PATHS = [
    re.findall(r"`([\w/]+\.py)`", line)
    for line in TEXT.partition("\n## Paths\n")[2].splitlines()
    if line.startswith("| ")
][2:]


def test_each_path_has_few_files_and_none_twice() -> None:
    assert len(PATHS) == 5
    for path in PATHS:
        assert 2 <= len(set(path)) == len(path) <= MAX_FILES, path


def test_each_file_of_the_page_exists() -> None:
    names = re.findall(r"`([\w/]+/\w+\.py)`", TEXT)
    assert [name for name in names if not (ROOT / name).is_file()] == []


def test_the_architecture_fits_on_two_pages() -> None:
    assert len(TEXT.splitlines()) <= MAX_LINES
