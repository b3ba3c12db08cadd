# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whatever happens in whatever order, nothing moves against a person or a failsafe."""

from __future__ import annotations

import pytest
from interleavings import Interleaving

EVENTS = 14


@pytest.mark.parametrize("block", range(8))
def test_no_interleaving_arms_takes_off_or_moves_what_it_must_not(block: int) -> None:
    for seed in range(10 * block, 10 * block + 10):
        Interleaving(seed).run(EVENTS)
