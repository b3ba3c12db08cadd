# SPDX-License-Identifier: Apache-2.0
"""A trained policy as the ONNX file that the planner `onnx` flies."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import onnx
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor, nn

from dsse_ros.planners.onnx import METADATA
from dsse_ros.training.foveated import Foveated


class Scores(nn.Module):
    """The scores of the actions, of a policy that was trained on the encoding `FOVEATED`.

    Args:
        policy: What was trained.
    """

    def __init__(self, policy: ActorCriticPolicy) -> None:
        super().__init__()
        self._foveated = Foveated()
        self._hidden = policy.mlp_extractor.policy_net
        self._scores = policy.action_net

    def forward(self, positions: Tensor, probability: Tensor) -> Tensor:
        """Return scores (K, A), see `Foveated`."""
        scores: Tensor = self._scores(self._hidden(self._foveated(positions, probability)))
        return scores


def export(
    policy: ActorCriticPolicy, path: Path, metadata: Mapping[str, Any], *, grid: int, drones: int
) -> None:
    """Write a policy as ONNX.

    Args:
        policy: What was trained.
        path: Of the file.
        metadata: What it is for, see `dsse_ros.planners.onnx`.
        grid: G of an example; others fit too.
        drones: M of an example; others fit too.
    """
    device = policy.device
    scores = Scores(policy).eval()
    example = (
        torch.rand(2, 2 * drones, device=device), torch.rand(2, grid, grid, device=device)
    )  # fmt: skip
    dynamic = {
        "positions": {0: "drones", 1: "coordinates"},
        "probability": {0: "drones", 1: "rows", 2: "columns"},
        "scores": {0: "drones"},
    }
    torch.onnx.export(
        scores, example, str(path), input_names=["positions", "probability"],
        output_names=["scores"], dynamic_axes=dynamic, opset_version=17, dynamo=False,
    )  # fmt: skip
    model = onnx.load(path)
    onnx.helper.set_model_props(model, {METADATA: json.dumps(dict(metadata))})
    onnx.save(model, path)
