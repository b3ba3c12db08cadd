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
from torch import Tensor, nn
from torch.export import Dim

from dsse_ros.base.whole_files import whole_file
from dsse_ros.planners.onnx import METADATA
from dsse_ros.training import foveated
from dsse_ros.training.foveated import Drones, Foveated
from dsse_ros.training.networks import Actor

INPUTS = ("positions", "probability", "number", "drift", "time", "spread", "dispersion_inc")


class Scores(nn.Module):
    """The action scores of a policy trained on `Foveated`, from the inputs of the planner `onnx`.

    The search is turned so that it drifts between right and down, as those in training, and the
    scores are turned back.

    Args:
        actor: The trained policy.
        names: Names of the actions.
    """

    def __init__(self, actor: Actor, names: Sequence[str]) -> None:
        super().__init__()
        self._foveated, self._actor = Foveated(), actor
        self.register_buffer("_order", foveated.order_of_actions(names))

    def forward(
        self, positions: Tensor, probability: Tensor, number: Tensor, drift: Tensor,
        time: Tensor, spread: Tensor, growth: Tensor,
    ) -> Tensor:  # fmt: skip
        """Return scores (K, A) for K drones; see `dsse_ros.planners.onnx` for the inputs."""
        edge = probability.shape[-1] - 1
        turn = foveated.turn_of(drift)
        cells = torch.round(positions * edge).unflatten(1, (-1, 2))
        cells = foveated.turned_cells(cells, turn, edge)
        belief = foveated.turned_map(probability, turn)
        belief = belief / belief.sum(dim=(1, 2), keepdim=True).clamp(min=1e-30)
        case = torch.cat([drift, time, spread, growth], dim=1)
        order = torch.arange(cells.shape[1], device=cells.device)[None, None]
        # Its own cell was swapped with the first: those with lower numbers come first.
        own = number[:, :, None]
        ranks = torch.stack([(order > 0) & (order <= own), order > own], dim=2)
        drones = Drones(cells[:, :1], cells, ranks)
        features = self._foveated(drones, belief, foveated.turned_case(case, turn))
        return torch.gather(self._actor(features[:, 0]), 1, self._order[turn])


def export(
    actor: Actor, path: Path, metadata: Mapping[str, Any], *, grid: int = 40, drones: int = 4
) -> None:
    """Write a policy as ONNX.

    Args:
        actor: The policy.
        path: Path of the file.
        metadata: Properties of the model, see `dsse_ros.planners.onnx`.
        grid: G of the example; the model takes other sizes too.
        drones: M of the example; the model takes other numbers too.
    """
    scores = Scores(actor, metadata["actions"]).cpu().eval()
    example = (
        torch.rand(3, 2 * drones), torch.rand(3, grid, grid), torch.zeros(3, 1), torch.rand(3, 2),
        torch.rand(3, 1), torch.rand(3, 2), torch.rand(3, 1),
    )  # fmt: skip
    drones_to_act, all_drones, side = Dim("drones"), Dim("all_drones"), Dim("side")
    shapes = [{0: drones_to_act} for _ in INPUTS]
    shapes[0] |= {1: 2 * all_drones}
    shapes[1] |= {1: side, 2: side}
    torch.onnx.export(
        scores, example, path, input_names=list(INPUTS), output_names=["scores"],
        dynamic_shapes=tuple(shapes), external_data=False, verbose=False,
    )  # fmt: skip
    model = onnx.load(path)
    # onnxruntime 1.17 reads no later version.
    model.ir_version = min(model.ir_version, 9)
    onnx.helper.set_model_props(model, {METADATA: json.dumps(dict(metadata))})
    with whole_file(Path(path)) as part:
        onnx.save(model, part)
