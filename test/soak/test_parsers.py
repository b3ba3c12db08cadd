# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bytes of all kinds into every parser; slow references beside world and scheduler."""

from __future__ import annotations

from pathlib import Path

import pytest
from promises import keep

from soak.parsers import PARSERS


@pytest.mark.parametrize("name", PARSERS)
def test_a_parser_reads_damaged_bytes_or_refuses_them_on_one_line(
    name: str, tmp_path: Path
) -> None:
    keep("fuzzing", f"fuzz_{name}", tmp_path)


@pytest.mark.parametrize("name", ["world", "scheduler", "controller"])
def test_whatever_happens_all_is_as_in_the_plain_reference(name: str, tmp_path: Path) -> None:
    keep("stateful", f"stateful_{name}", tmp_path)
