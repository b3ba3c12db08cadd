# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Export of a trained policy as an ONNX file for the planner `onnx`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import onnx
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor, nn
from torch.export import Dim

from dsse_ros.planners.onnx import METADATA
from dsse_ros.training.foveated import Foveated, order_of_actions


class Scores(nn.Module):
    """The action scores of a policy trained on the encoding `foveated`.

    Args:
        policy: The trained policy.
        names: Names of the actions.
    """

    def __init__(self, policy: ActorCriticPolicy, names: Sequence[str]) -> None:
        super().__init__()
        self._foveated = Foveated()
        # Number of each action of the rules in turned windows, by turn.
        numbers = torch.from_numpy(order_of_actions(names)).argsort(dim=1)
        self.register_buffer("_numbers", numbers)
        self._hidden = policy.mlp_extractor.policy_net
        self._scores = policy.action_net

    def forward(self, positions: Tensor, probability: Tensor, number: Tensor) -> Tensor:
        """Return scores (K, A), see `Foveated`."""
        features, turns = self._foveated(positions, probability, number)
        return torch.gather(self._scores(self._hidden(features)), 1, self._numbers[turns])


def export(
    policy: ActorCriticPolicy, path: Path, metadata: Mapping[str, Any], *, grid: int, drones: int
) -> None:
    """Write a policy as ONNX.

    Args:
        policy: The trained policy.
        path: Path of the file.
        metadata: Properties of the model, see `dsse_ros.planners.onnx`.
        grid: G of the example; the model takes other sizes too.
        drones: M of the example; the model takes other numbers too.
    """
    scores = Scores(policy, metadata["actions"]).eval()
    example = torch.rand(3, 2 * drones), torch.rand(3, grid, grid), torch.zeros(3, 1)
    drones_to_act, all_drones, side = Dim("drones"), Dim("all_drones"), Dim("side")
    torch.onnx.export(
        scores, example, path,
        input_names=["positions", "probability", "number"], output_names=["scores"],
        dynamic_shapes=(
            {0: drones_to_act, 1: 2 * all_drones},
            {0: drones_to_act, 1: side, 2: side},
            {0: drones_to_act},
        ),
        external_data=False, verbose=False,
    )  # fmt: skip
    model = onnx.load(path)
    # onnxruntime 1.17 reads no later version.
    model.ir_version = min(model.ir_version, 9)
    onnx.helper.set_model_props(model, {METADATA: json.dumps(dict(metadata))})
    onnx.save(model, path)
