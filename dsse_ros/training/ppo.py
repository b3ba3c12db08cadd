# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Proximal policy optimization (Schulman et al., 2017) of the exact mean time to the find.

See `lockstep`: each step costs 1, and what is to come counts by 1 - p, the probability that the
step does not find the person. All drones share the policy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from dsse_ros.training.cuda_graph import GraphedFunction
from dsse_ros.training.foveated import FEATURES, Foveated, of_all
from dsse_ros.training.lockstep import ACTIONS, LIMIT, Searches
from dsse_ros.training.networks import Actor, Critic

STEPS_PER_VALUE = 10.0
"""Values are in units of so many steps."""
OWN_FIND = 10.0
"""Steps that a find by the drone itself saves it, as long as drones do not share everything."""
NEAR = 0.5
"""Steps that a cell on the way to the belief saves, paid back at the end; see `nearness`."""


@dataclass(frozen=True)
class Settings:
    """How to learn; the defaults are for a GPU.

    Attributes:
        worlds: Searches in lockstep.
        epochs: Passes over the steps of an update.
        batches: Parts of a pass.
        rate: Step size at first; it falls to 0.
        entropy: Weight of the entropy at first; it falls to 0.
        trace: Decay of what later steps add to an advantage.
        clip: Change of an action's probability that still counts.
    """

    worlds: int = 8192
    epochs: int = 3
    batches: int = 50
    rate: float = 6e-4
    entropy: float = 0.01
    trace: float = 0.95
    clip: float = 0.2


class Rollouts(NamedTuple):
    """The missions of an update: T steps of B searches with N drones.

    Attributes:
        features: (T, B, N, F).
        allowed: (T, B, N, A) bool.
        actions: (T, B, N) int64.
        log_p: (T, B, N), of the actions.
        values: (T, B, N).
        shares: (T, B, N), probability of a find by each drone, see `lockstep.Searches.step`.
        near: (T, B, N), see `nearness`.
        missing: (T, B, 1), probability that the steps before have found nothing.
        there: (T, B, N) bool, the drones in the search.
    """

    features: Tensor
    allowed: Tensor
    actions: Tensor
    log_p: Tensor
    values: Tensor
    shares: Tensor
    near: Tensor
    missing: Tensor
    there: Tensor


def room_for(worlds: int, drones: int, device: torch.device) -> Rollouts:
    """Return memory for the missions of an update."""

    def empty(*shape: int, dtype: torch.dtype = torch.float32) -> Tensor:
        return torch.empty(LIMIT, worlds, *shape, dtype=dtype, device=device)

    half = torch.bfloat16 if device.type == "cuda" else torch.float32
    return Rollouts(
        empty(drones, FEATURES, dtype=half), empty(drones, len(ACTIONS), dtype=torch.bool),
        empty(drones, dtype=torch.int64), empty(drones), empty(drones), empty(drones),
        empty(drones), empty(1), empty(drones, dtype=torch.bool),
    )  # fmt: skip


def nearness(cells: Tensor, there: Tensor, belief: Tensor) -> Tensor:
    """Return (B, N): 0 within 5 cells of the belief's middle, the less the further away.

    As a potential it changes no optimum (Ng, Harada and Russell, "Policy invariance under reward
    transformations", 1999).
    """
    line = torch.arange(belief.shape[-1], dtype=torch.float32, device=belief.device)
    middle = torch.stack([belief.sum(1) @ line, belief.sum(2) @ line], dim=-1)
    away = (cells - middle[:, None]).abs().amax(-1)
    return -NEAR * (away - 5).clamp(min=0) * there


class Learner:
    """A policy, and what improves it.

    Args:
        width: Units of a layer.
        settings: How to learn.
        device: Where.
    """

    def __init__(self, width: int, settings: Settings, device: torch.device) -> None:
        self.settings, self.device = settings, device
        self.eye = Foveated()
        self.actor = Actor(len(ACTIONS), width).to(device)
        self.critic = Critic(width).to(device)
        self.networks = nn.ModuleList([self.actor, self.critic])
        gpu = device.type == "cuda"
        rate = torch.tensor(settings.rate, device=device)
        self.optimizer = torch.optim.Adam(
            self.networks.parameters(), rate, eps=1e-5, fused=gpu, capturable=gpu
        )
        self._decide, self._improve = GraphedFunction(self._draw), GraphedFunction(self._descend)

    def half(self) -> torch.autocast:
        """Return the context of products in half precision, on a GPU."""
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda")

    def fly(self, searches: Searches, rollouts: Rollouts, worlds: slice) -> None:
        """Fly missions with drawn actions; write them to the columns `worlds`."""
        for t in range(LIMIT):
            cells, there, allowed = searches.cells, searches.there, searches.masks()
            missing = searches.missing[:, None]
            features, actions, log_p, values, near = self._decide(
                cells, there, searches.belief, searches.case(), allowed
            )
            shares = searches.step(actions)
            step = Rollouts(features, allowed, actions, log_p, values, shares, near, missing, there)
            for room, part in zip(rollouts, step, strict=True):
                room[t, worlds] = part

    def _draw(
        self, cells: Tensor, there: Tensor, belief: Tensor, case: Tensor, allowed: Tensor
    ) -> tuple[Tensor, ...]:
        """Draw actions; return what `Rollouts` has of them."""
        with torch.no_grad():
            features = self.features(cells, there, belief, case)
            with self.half():
                scores, values = self.actor(features), self.critic(features, there)
            log_p = _among(scores, allowed).log_softmax(-1)
            # The greatest of Gumbel draws is a draw from the softmax.
            actions = (log_p - torch.empty_like(log_p).exponential_().log()).argmax(-1)
            chosen = log_p.gather(-1, actions[..., None])[..., 0]
        return features, actions, chosen, values, nearness(cells, there, belief)

    def features(self, cells: Tensor, there: Tensor, belief: Tensor, case: Tensor) -> Tensor:
        """Return what the drones see, (B, N, F); 0 for those not in the search."""
        seen: Tensor = self.eye(of_all(cells), belief, case)
        return seen * there[..., None]

    def best(self, searches: Searches) -> Tensor:
        """Return the best actions (B, N)."""
        cells, there, allowed = searches.cells, searches.there, searches.masks()
        with torch.no_grad():
            scores = self.actor(self.features(cells, there, searches.belief, searches.case()))
        return _among(scores, allowed).argmax(-1)

    def mean_steps(self, searches: Searches) -> Tensor:
        """Return the mean steps (B,) of missions with the best actions."""
        total = torch.zeros_like(searches.missing)
        for _ in range(LIMIT):
            total += searches.missing
            searches.step(self.best(searches))
        return total

    def learn(self, rollouts: Rollouts, left: float, shared: float) -> dict[str, float]:
        """Improve the policy; return figures of how it goes.

        Args:
            rollouts: The missions.
            left: Share of the training that is left.
            shared: Share of a find that counts for all drones alike.
        """
        settings, there = self.settings, rollouts.there
        for group in self.optimizer.param_groups:
            group["lr"].fill_(settings.rate * max(left, 0.02))
        advantages = self.advantages(rollouts, shared)
        returns = advantages + rollouts.values
        # Late steps are rarely reached, but with their true weight the policy would learn nothing.
        weights = rollouts.missing.clamp(min=1e-3).sqrt() * (rollouts.missing > 1e-5) * there
        weights /= weights.mean()
        advantages -= (weights * advantages).mean()
        advantages /= (weights * advantages.square()).mean().sqrt() + 1e-4
        data = [
            part.flatten(0, 1)
            for part in (
                rollouts.features, rollouts.allowed, rollouts.actions, rollouts.log_p, advantages,
                returns, weights, there,
            )
        ]  # fmt: skip
        figures = torch.zeros(3, device=self.device)
        entropy_weight = torch.tensor(settings.entropy * left, device=self.device)
        count = LIMIT * settings.worlds
        for _ in range(settings.epochs):
            order = torch.randperm(count, device=self.device)
            for rows in order.tensor_split(settings.batches):
                figures += self._improve(*(part[rows] for part in data), entropy_weight)
        figures /= settings.epochs * settings.batches
        return dict(zip(("entropy", "value_loss", "clipped"), figures.tolist(), strict=True))

    def advantages(self, rollouts: Rollouts, shared: float) -> Tensor:
        """Return the advantages (T, B, N) of the actions."""
        p = rollouts.shares.sum(-1, keepdim=True).clamp(max=1.0)
        drones = rollouts.there.sum(-1, keepdim=True)
        own = OWN_FIND * (drones * rollouts.shares - p)
        cost = (1 - shared) * own - 1
        to_come = rollouts.values + rollouts.near / STEPS_PER_VALUE
        after = torch.cat([to_come[1:], torch.zeros_like(to_come[:1])])
        surprise = cost / STEPS_PER_VALUE + (1 - p) * after - to_come
        out, later = torch.empty_like(surprise), torch.zeros_like(surprise[0])
        for t in reversed(range(LIMIT)):
            later = surprise[t] + self.settings.trace * (1 - p[t]) * later
            out[t] = later
        return out

    def _descend(self, *part: Tensor) -> Tensor:
        """Take a step on part of the missions, see `learn`."""
        features, allowed, actions, log_p_before, advantages, returns, weights, there = part[:-1]
        of_entropy = part[-1]
        with self.half():
            scores = _among(self.actor(features), allowed)
            values = self.critic(features, there)
        log_ps = scores.log_softmax(-1)
        log_p = log_ps.gather(-1, actions[..., None])[..., 0]
        entropy = -(log_ps.exp() * log_ps.clamp(min=-1e4)).sum(-1)
        ratio = (log_p - log_p_before).exp()
        clip = self.settings.clip
        gain = torch.minimum(ratio * advantages, ratio.clamp(1 - clip, 1 + clip) * advantages)
        missed = (values - returns).square()
        loss = (weights * (0.5 * missed - gain - of_entropy * entropy)).mean()
        self.optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.networks.parameters(), 0.5)
        self.optimizer.step()
        clipped = ((ratio - 1).abs() > clip).float()
        return torch.stack(
            [(weights * values).mean() for values in (entropy, missed, clipped)]
        ).detach()


def _among(scores: Tensor, allowed: Tensor) -> Tensor:
    return scores.masked_fill(~allowed, -1e9)
