# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Worlds of a million cells, and worlds that are refused before memory is allocated."""

from __future__ import annotations

import resource

from soak.rigs import domain, resident_bytes
from soak.row import Figures, Row, Run, zero

ADDRESS_SPACE = 4 << 30
"""Bytes that a node may allocate when it refuses a world; the worlds below need more."""


def huge_worlds(run: Run) -> Figures:
    """Fly a mission on 1000 x 1000 cells, and request worlds beyond the limit."""
    steps = run.size(100, 3)
    refused = 0
    beyond = (
        {"grid_size": 10_000},
        {"grid_size": 1001, "max_cells": 1_000_000},
        {"zone_size": 1_300_000.0, "cell_size": 130.0},
        {"grid_size": 8, "max_cells": 63},
    )
    with domain(run.folder) as rig:
        sim = rig.sim({"grid_size": 1000, "num_drones": 4, "vector": [0.1, 0.2], "seed": 1})
        for _ in run.each(range(steps), "steps"):
            sim.fly(4, 4, 4, 4)
        done, memory = sim.step_number, resident_bytes(sim.process.child.pid)
        for parameters in beyond:
            process = rig.start("sim_node", parameters)
            resource.prlimit(process.child.pid, resource.RLIMIT_AS, (ADDRESS_SPACE,) * 2)
            line = process.output.splitlines()[-1:] if process.wait() == 2 else []
            refused += bool(line and "grid_size" in line[0] and "grid_size must" in line[0])
    return {
        "steps": done,
        "steps_missing": steps - done,
        "memory_mib": memory / 2**20,
        "beyond": len(beyond),
        "beyond_taken": len(beyond) - refused,
    }


ROWS = (
    Row(
        "huge_worlds",
        "1000 x 1000 cells work; a world over the configured cap is refused before memory is "
        "asked for",
        huge_worlds,
        "{steps} steps of 1000 x 1000 cells in {memory_mib:.0f} MiB; {beyond_taken} of {beyond} "
        "worlds beyond the cap taken",
        zero("steps_missing", "beyond_taken"),
    ),
)
