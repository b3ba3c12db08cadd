# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How nodes end: at once, in peace and with code 0, whatever they are doing."""

from __future__ import annotations

from signal import SIG_IGN, SIGHUP, SIGINT, SIGTERM, getsignal

import pytest
from rig import Process, Rig, Sim

Flight = tuple[Sim, Process]

SIGNALS = {
    "int": [SIGINT],
    "term": [SIGTERM],
    # Where nohup has started the tests, it has the nodes ignore it too.
    **({} if getsignal(SIGHUP) is SIG_IGN else {"hup": [SIGHUP]}),
    "int_int": [SIGINT, SIGINT],
    "term_int_term": [SIGTERM, SIGINT, SIGTERM],
}


@pytest.fixture(scope="module")
def flights(rig: Rig) -> dict[str, Flight]:
    """A simulation and a planner at work for each case, in a namespace of its name."""
    simulation = {
        "num_drones": 20,
        "grid_size": 20,
        "probability_of_detection": 0.0,
        "timestep_limit": 10**6,
        "step_rate": 50.0,
        "seed": 0,
    }
    pairs = {
        name: [
            rig.start(node, parameters, "-r", f"__ns:=/{name}")
            for node, parameters in (("sim_node", simulation), ("planner_node", {}))
        ]
        for name in SIGNALS
    }
    return {name: (Sim(rig, sim, f"/{name}"), planner) for name, (sim, planner) in pairs.items()}


@pytest.mark.parametrize("name", SIGNALS)
def test_a_signal_ends_a_node_at_work_in_peace(
    rig: Rig, flights: dict[str, Flight], name: str
) -> None:
    sim, planner = flights[name]
    seen = sim.step_number
    rig.until(lambda: sim.step_number > seen, "a step")
    for process in (sim.process, planner):
        process.signal(*SIGNALS[name])
    for process in (sim.process, planner):
        assert process.wait() == 0, process.output
        for word in ("Traceback", "FATAL", "Error", "terminate called"):
            assert word not in process.output, process.output
