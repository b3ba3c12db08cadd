# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The networks that `examples/train.py` trains, on the features `foveated.Foveated`."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from dsse_ros.training.foveated import FEATURES


def layer(inputs: int, outputs: int, gain: float) -> nn.Linear:
    """Return a layer with orthogonal weights."""
    linear = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(linear.weight, gain)
    nn.init.zeros_(linear.bias)
    return linear


class Actor(nn.Module):
    """Scores the actions of a drone.

    Args:
        actions: A.
        width: Units of a layer.
    """

    def __init__(self, actions: int, width: int) -> None:
        super().__init__()
        self.hidden = nn.Sequential(
            layer(FEATURES, width, 2**0.5), nn.ReLU(), layer(width, width, 2**0.5), nn.ReLU()
        )
        self.scores = layer(width, actions, 0.01)

    def forward(self, features: Tensor) -> Tensor:
        """Return the scores (..., A) float32 of the actions, from features (..., F)."""
        hidden = self.hidden(features)
        # Half precision would round the probabilities of actions.
        with torch.autocast(features.device.type, enabled=False):
            scores: Tensor = self.scores(hidden.float())
        return scores


class Critic(nn.Module):
    """Estimates what is to come for each drone, from the features of all.

    Args:
        width: Units of a layer.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.of_drone = nn.Sequential(layer(FEATURES, width, 2**0.5), nn.ReLU())
        self.own, self.swarm = layer(width, width, 1.0), layer(width, width, 1.0)
        self.value = layer(width, 1, 0.1)

    def forward(self, features: Tensor, there: Tensor) -> Tensor:
        """Return values (..., N) float32.

        Args:
            features: (..., N, F).
            there: (..., N) bool, the drones in the search.
        """
        own = self.of_drone(features) * there[..., None]
        hidden = torch.relu(self.own(own) + self.swarm(own.mean(-2, keepdim=True)))
        with torch.autocast(features.device.type, enabled=False):
            value: Tensor = self.value(hidden.float())[..., 0]
        return value
