# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A folder goes on with the same libraries and the same bytes only."""

from __future__ import annotations

import json
from pathlib import Path
from shutil import copy
from typing import Any

import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.results.campaign import config, provenance
from dsse_ros.results.campaign.chunks import MANIFEST, Results
from dsse_ros.results.campaign.config import Campaign

V2: dict[str, Any] = {
    "scenarios": [{"rules": "v2", "grid_size": 9, "num_drones": 2, "timestep_limit": 20}]
}


def flying(model: Path) -> Campaign:
    """Return a campaign of a model."""
    options = {"model": str(model)}
    planners = ["greedy", {"planner": "onnx", "name": "mine", "options": options}]
    return Campaign.from_dict({**V2, "planners": planners})


def test_a_folder_does_not_go_on_with_another_model(tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    from dsse_ros.planners.onnx import SHIPPED

    model, out = tmp_path / "policy.onnx", tmp_path / "out"
    out.mkdir()
    copy(SHIPPED, model)
    with Results(out, flying(model)):
        pass
    Results(out, flying(model)).__exit__()
    other = onnx.load(model)
    other.doc_string = "trained for longer"
    onnx.save(other, model)
    with pytest.raises(FieldError, match="a campaign with different files: model of mine; "):
        Results(out, flying(model))


def test_the_model_of_the_package_is_in_the_digest() -> None:
    pytest.importorskip("onnxruntime")
    files = Campaign.from_dict({**V2, "planners": ["onnx", "greedy"]}).definition["files"]
    assert list(files) == ["model of onnx"] and len(files["model of onnx"]) == 64


@pytest.mark.parametrize("library", ["numpy", "numba", "dsse_ros"])
def test_a_folder_does_not_go_on_with_another_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    values = {**V2, "planners": ["greedy"]}
    with Results(tmp_path, Campaign.from_dict(values)):
        pass
    here = provenance.versions(["greedy"])
    monkeypatch.setattr(config, "versions", lambda planners: {**here, library: "0.0.1"})
    text = f"with different versions: {library} 0.0.1 in place of {here[library]}; "
    with pytest.raises(FieldError, match=text):
        Results(tmp_path, Campaign.from_dict(values))


def test_libraries_count_where_a_planner_needs_them() -> None:
    assert set(provenance.versions(["greedy"])) == {"dsse_ros", "numpy", "numba"}
    assert "ortools" in provenance.versions(["greedy", "route"])
    assert "onnxruntime" in provenance.versions(["onnx"])


def test_a_folder_of_an_earlier_version_is_of_another_campaign(tmp_path: Path) -> None:
    campaign = Campaign.from_dict({**V2, "planners": ["greedy"]})
    there = {"digest": "of earlier", **campaign.definition}
    del there["versions"]
    (tmp_path / MANIFEST).write_text(json.dumps(there))
    with pytest.raises(FieldError, match="a campaign with different versions; "):
        Results(tmp_path, campaign)
