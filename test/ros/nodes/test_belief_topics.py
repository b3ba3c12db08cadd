# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Belief and POS of a mission: topics, diagnostics, record and environment agree."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid
from rig import LATCHED, RELIABLE, Rig, occupancy, stamp_ns
from sensor_msgs.msg import Image

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.ros.nodes.settings import SimSettings
from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.images import image_to_probability
from msg_adapters.occupancy import probability_to_occupancy

SEARCH, RIGHT = 4, 1
FIELDS: dict[str, Any] = {
    "grid_size": 9, "num_drones": 2, "person_initial_position": (3, 1), "vector": (0.1, 0.2),
    "drones_positions": ((0, 0), (4, 4)), "probability_of_detection": 0.3, "timestep_limit": 12,
}  # fmt: skip
SEED = 3


@pytest.mark.parametrize(
    ("name", "persons"),
    [("sea", {}), ("drift", {"person_motion": "constant_drift", "particles": 700})],
)
def test_topics_diagnostics_record_and_environment_agree(
    name: str, persons: dict[str, Any], rig: Rig, tmp_path: Path
) -> None:
    record = tmp_path / "mission.csv"
    fields = {
        **FIELDS, **persons, "person_initial_position": [3, 1], "vector": [0.1, 0.2],
        "drones_positions": [0, 0, 4, 4],
    }  # fmt: skip
    sim = rig.sim(
        {**fields, "seed": SEED, "publish_belief": True, "record_file": str(record)},
        namespace=f"/{name}",
    )
    images = rig.listen(Image, f"/{name}/belief", LATCHED)
    grids = rig.listen(OccupancyGrid, f"/{name}/belief_grid", LATCHED)
    env = parallel_env(observe="belief", **FIELDS, **persons)
    env.reset(seed=SEED)
    wanted = [(0.0, env.probability)]
    while sim.flying:
        action = SEARCH if sim.step_number % 3 else RIGHT
        sim.fly(SEARCH, action)
        *_, infos = env.step({"drone0": SEARCH, "drone1": action})
        wanted.append((infos["drone0"]["pos"], env.probability))
        stamp = stamp_ns(sim.reports.last)
        rig.until(lambda stamp=stamp: images and stamp_ns(images.last) == stamp)  # type: ignore[misc]
        rig.until(lambda stamp=stamp: grids and stamp_ns(grids.last) == stamp)  # type: ignore[misc]
        assert np.array_equal(image_to_probability(images.last), env.probability)
        assert np.array_equal(
            occupancy(grids.last)[::-1], probability_to_occupancy(env.probability)
        )
    assert not env.agents and wanted[-1][0] > 0.0
    with record.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["agent"] == "drone0"]
    assert [float(row["pos"]) for row in rows] == [pos for pos, _ in wanted]

    def shown() -> str | None:
        for status in rig.first(DiagnosticArray, "/diagnostics", RELIABLE).status:
            if status.name == f"dsse_ros: {name}/sim_node":
                return {pair.key: pair.value for pair in status.values}["pos"]
        return None

    rig.until(lambda: shown() == f"{wanted[-1][0]:.6f}")


def test_no_belief_is_computed_where_none_is_wanted(rig: Rig, tmp_path: Path) -> None:
    record = tmp_path / "mission.csv"
    sim = rig.sim(
        {"grid_size": 9, "compute_pos": "never", "record_file": str(record)}, namespace="/plain"
    )
    sim.fly(SEARCH)
    assert "/plain/belief" not in dict(rig.node.get_topic_names_and_types())
    with record.open(newline="") as file:
        assert {row["pos"] for row in csv.DictReader(file)} == {""}


@pytest.mark.parametrize("grid_size", [50, 51])
def test_large_grids_have_a_belief_where_it_is_asked_for(grid_size: int) -> None:
    assert SimSettings().has_belief(GridShape.square(grid_size)) == (grid_size == 50)
    assert SimSettings(publish_belief=True).has_belief(GridShape.square(grid_size))
    assert SimSettings(compute_pos="always").has_belief(GridShape.square(grid_size))
    assert not SimSettings(compute_pos="never").has_belief(GridShape.square(grid_size))
