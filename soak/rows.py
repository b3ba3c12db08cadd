# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""All rows of the table of promises, in the order in which they are measured."""

from __future__ import annotations

from soak import (
    clocks,
    custody,
    endurance,
    files,
    fleet,
    fuzzing,
    hostile,
    huge,
    kills,
    late_joiner,
    parameters,
    pos,
    start_stop,
    stateful,
    traffic,
)
from soak.row import Row

ROWS: dict[str, Row] = {
    row.name: row
    for module in (
        traffic,
        late_joiner,
        kills,
        start_stop,
        clocks,
        files,
        huge,
        hostile,
        parameters,
        stateful,
        pos,
        custody,
        fuzzing,
        fleet,
        endurance,
    )
    for row in module.ROWS
}
