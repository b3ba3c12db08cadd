# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whatever happens in whatever order, nothing moves against a person or a failsafe."""

from __future__ import annotations

import pytest
from interleavings import Interleaving

EVENTS = 14


@pytest.mark.parametrize(
    "block", [0, *(pytest.param(block, marks=pytest.mark.slow) for block in range(1, 4))]
)
def test_no_interleaving_arms_takes_off_or_moves_what_it_must_not(block: int) -> None:
    # `make soak` runs thousands more.
    for seed in range(4 * block, 4 * block + 4):
        Interleaving(seed).run(EVENTS)
