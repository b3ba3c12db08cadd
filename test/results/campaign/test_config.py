# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A campaign's file is checked before anything is played."""

from __future__ import annotations

import dataclasses
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError, specs
from dsse_ros.results.campaign.config import Campaign, CampaignSettings, PlannerEntry
from dsse_ros.results.campaign.engines import ENGINES

ROOT = Path(__file__).resolve().parents[3]
SMALL: dict[str, Any] = {
    "planners": ["greedy"],
    "scenarios": [{"grid_size": 8, "sigma": 2, "timestep_limit": 20}],
    "missions": 10,
    "chunk": 4,
}


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({**SMALL, "mission": 3}, "'mission' is not a field of a campaign; did you mean missions?"),
        ({**SMALL, "missions": 0}, "missions must be an integer >= 1 .*, got 0"),
        ({**SMALL, "engine": "dask"}, "engine must be one of local, ray, got 'dask'"),
        ({**SMALL, "confidence": 95}, "confidence must be .*, got 95"),
        ({**SMALL, "pos_at_s": [60, -1]}, r"pos_at_s must be .*, got \[60, -1\]"),
        ({**SMALL, "planners": []}, r"planners must be a list of one or more, got \[\]"),
        ({**SMALL, "planners": ["gredy"]}, r"planners\[0\]: planner must be .*, got 'gredy'"),
        ({**SMALL, "planners": ["sweep", "sweep"]}, r"planners\[1\]: name must be unique"),
        ({**SMALL, "planners": [{"seed": 1}]}, r"planners\[0\]: 'seed' is not a field of a plann"),
        ({**SMALL, "planners": [{"name": "x"}]}, r"planners\[0\]: planner is missing"),
        (
            {**SMALL, "planners": [{"planner": "greedy", "options": {"width": 3}}]},
            r"planners: 'greedy' in scenarios\[0\] 'paper_8': .*width",
        ),
        ({**SMALL, "scenarios": ["nowhere"]}, r"scenarios\[0\]: scenario: 'nowhere' is not a file"),
        ({**SMALL, "scenarios": [{"rules": "v3"}]}, r"scenarios\[0\]: rules must be .*, got 'v3'"),
        ({**SMALL, "scenarios": [{"grid_siz": 8}]}, r"scenarios\[0\]: 'grid_siz' is not a field"),
        ([], "a campaign must be a mapping"),
    ],
)
def test_what_is_not_allowed_gets_one_clear_line(values: Any, text: str) -> None:
    with pytest.raises(FieldError, match=text) as refused:
        Campaign.from_dict(values)
    assert "\n" not in str(refused.value)


def test_the_example_is_allowed() -> None:
    campaign = Campaign.from_yaml(ROOT / "examples" / "campaign.yaml")
    assert len(campaign.planners) * len(campaign.cases) * campaign.settings.missions == sum(
        chunk.count for chunk in campaign.chunks()
    )


def test_every_engine_may_be_named() -> None:
    assert specs(CampaignSettings)["engine"].choices == tuple(ENGINES)


def test_only_what_decides_the_results_makes_another_campaign() -> None:
    campaign = Campaign.from_dict(SMALL)
    for changed in ({"engine": "ray"}, {"workers": 3}, {"confidence": 0.9}, {"name": "other"}):
        assert Campaign.from_dict({**SMALL, **changed}).digest == campaign.digest
    scenario = {**SMALL["scenarios"][0], "cell_size": 99}
    for changed in ({"seed": 1}, {"scenarios": [scenario]}, {"planners": ["sweep"]}):
        assert Campaign.from_dict({**SMALL, **changed}).digest != campaign.digest


MINUTES = 1500
"""Length of a table of wind; of longer arrays than 1000, NumPy prints the ends only."""


def wind_with_a_gust(path: Path, at: int) -> Path:
    start = datetime(2026, 1, 17, 12, tzinfo=timezone.utc)
    times = [start + timedelta(minutes=n) for n in range(MINUTES)]
    rows = [f"{time.isoformat()},{9 if n == at else 5},270" for n, time in enumerate(times)]
    path.write_text("\n".join(["time,speed_mps,from", *rows]) + "\n")
    return path


@given(at=st.lists(st.integers(0, MINUTES - 1), min_size=2, max_size=2, unique=True))
@settings(max_examples=10)
def test_two_winds_are_two_campaigns_wherever_they_differ(
    at: list[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("winds")
    incident = {
        "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
        "seen": {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z"},
    }  # fmt: skip
    digests = []
    for number, gust in enumerate((*at, at[0])):
        wind = {"file": str(wind_with_a_gust(folder / f"{number}.csv", gust))}
        # A grid that was laid does not depend on the wind.
        summary = {"begins_s": 1768658400.0, "inside": 1.0, "stranded": 0.0}
        case = {"incident": {**incident, "wind": wind, "grid_summary": summary}, "grid_size": 20}
        digests.append(Campaign.from_dict({**SMALL, "scenarios": [case]}).digest)
    assert digests[0] == digests[2] != digests[1]


def test_two_arrays_are_two_options_and_what_json_lacks_is_refused() -> None:
    campaign, digests = Campaign.from_dict(SMALL), []
    for place in (3, 700, 700):
        cells = np.zeros(2000)
        cells[place] = 1.0
        entry = PlannerEntry("greedy", options={"cells": cells})
        digests.append(dataclasses.replace(campaign, planners=(entry,)).digest)
    assert digests[0] != digests[1] == digests[2]
    with pytest.raises(FieldError, match="^option width must be a number, .*, got <object"):
        PlannerEntry("greedy", options={"width": object()})


def test_paths_start_from_the_folder_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "bay.yaml").write_text("{grid_size: 9, name: The bay}\n")
    (tmp_path / "campaign.yaml").write_text("{planners: [sweep], scenarios: [bay.yaml]}\n")
    assert Campaign.from_yaml(tmp_path / "campaign.yaml").cases[0].name == "The bay"


def test_a_chain_in_the_folder_of_the_file_is_part_of_the_definition(tmp_path: Path) -> None:
    digests = []
    for step in (4, 5):
        np.save(tmp_path / "chain.npy", np.tile(np.eye(9)[step], (9, 9, 1)))
        (tmp_path / "campaign.yaml").write_text(
            "planners: [belief]\n"
            "scenarios: [{person_motion: markov_chain, transition_probabilities: chain.npy}]\n"
        )
        campaign = Campaign.from_yaml(tmp_path / "campaign.yaml")
        assert campaign.cases[0].scenario.grid_size == (9, 9)
        digests.append(campaign.digest)
    assert digests[0] != digests[1]
