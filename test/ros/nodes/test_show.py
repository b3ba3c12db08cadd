# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`show`: a table of the steps, whenever it starts and wherever its output goes."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest
from rig import ENVIRONMENT, LATCHED, TIMEOUT_S, Process, Rig
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

SMALL = {"num_drones": 2, "grid_size": 8, "probability_of_detection": 0.0, "seed": 3}
RIGHT = 1


def rows(show: Process) -> list[list[str]]:
    """Return the printed lines as words, without what is logged."""
    return [line.split() for line in show.output.splitlines() if not line.startswith("[")]


def steps(show: Process) -> list[str]:
    """Return the first word of each printed line."""
    return [row[0] for row in rows(show)]


@pytest.mark.slow
def test_it_waits_for_a_simulation_and_shows_each_step_at_once(rig: Rig) -> None:
    show = rig.start("show", {}, "-r", "__ns:=/early")
    waits = "waiting for a simulation: nothing on /early/agents, /early/step_report yet"
    rig.until(lambda: waits in show.output, "what it waits for")
    sim = rig.sim(SMALL, namespace="/early")
    rig.until(lambda: len(rows(show)) == 3, "the first step")
    title, header, begin = rows(show)
    assert " ".join(title).endswith(": 2 drones, 8 x 8 cells, seed 3")
    assert header == ["step", "time", "reward", "drone0", "drone1"]
    assert begin == ["0", "0:00", "0.0", "0,0", "-", "1,0", "-"]
    for step in (1, 2):
        sim.fly(RIGHT, RIGHT)
        rig.until(lambda step=step: steps(show)[-1] == str(step), "the next step")
        assert rows(show)[-1].count("right") == 2
    show.stop()
    sim.process.stop()


@pytest.mark.slow
def test_a_late_joiner_is_shown_all_steps_so_far_and_both_missions(rig: Rig) -> None:
    sim = rig.sim(SMALL | {"timestep_limit": 3}, namespace="/late")
    while sim.flying:
        sim.fly(RIGHT, RIGHT)
    last = sim.step_number
    sim.reset()
    show = rig.start("show", {}, "-r", "__ns:=/late")
    first = ["mission", "step", *map(str, range(last + 1)), "mission"]
    expected = [*first, "mission", "step", "0"]
    rig.until(lambda: len(steps(show)) == len(expected), "two missions")
    assert steps(show) == expected
    show.stop()
    sim.process.stop()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("topic", "message"), [("agents", String(data="{")), ("step_report", PointCloud2(height=3))]
)
def test_a_message_that_is_none_is_refused_and_the_table_goes_on(
    rig: Rig, topic: str, message: Any
) -> None:
    sim = rig.sim(SMALL, namespace=f"/bad_{topic}")
    show = rig.start("show", {}, "-r", f"__ns:=/bad_{topic}")
    rig.until(lambda: len(rows(show)) == 3, "the first step")
    rig.talk(type(message), sim.topic(topic), LATCHED).publish(message)
    rig.until(lambda: f"show]: {topic}: " in show.output, "the refusal")
    sim.joint(RIGHT, RIGHT, step=0, mission=1)
    rig.until(lambda: steps(show)[-1] == "1", "the next step")
    assert "defect" not in show.output
    show.stop()
    sim.process.stop()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "code", "log"),
    [("/dev/full", 3, "standard output: No space left on device"), ("", 0, "")],
    ids=["full disk", "closed pipe"],
)
def test_it_ends_with_its_output(rig: Rig, path: str, code: int, log: str) -> None:
    sim = rig.sim(SMALL, namespace="/output")
    if path:
        output = os.open(path, os.O_WRONLY)
    else:
        # Nobody reads from it.
        reader, output = os.pipe()
        os.close(reader)
    child = subprocess.run(
        [sys.executable, "-c", "from dsse_ros.cli.start import show; raise SystemExit(show())",
         "--ros-args", "-r", "__ns:=/output"],
        env=os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(rig.domain)},
        stdout=output, stderr=subprocess.PIPE, text=True, timeout=TIMEOUT_S,
    )  # fmt: skip
    os.close(output)
    assert child.returncode == code
    assert child.stderr.rstrip().endswith(log) and len(child.stderr.splitlines()) == bool(log)
    sim.process.stop()
