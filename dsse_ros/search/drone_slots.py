# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each drone of each world as a slot of its own: what learning libraries train one policy on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.scenario.fields import FieldError
from dsse_ros.search.vector_env import RESET_MASK, Observations, VectorEnv, check_integers
from dsse_ros.search.world import HOLD
from dsse_ros.search.wrappers import FLATTENED, Encoding


class Transition(NamedTuple):
    """A step of B worlds.

    Attributes:
        env: The worlds.
        before: Observations before it.
        cells: (B, N, 2) int64, where the drones were before it as (x, y), whatever they observe.
        actions: (B, N) int8, what the drones did, numbers of the rules; -1 for nothing. With
            faults that may be another thing than they were commanded.
        after: Observations after it, before any world is reset.
        over: (B,) bool, the worlds whose mission it has ended.
        terminal: (B, N) bool, the drones whose search it has ended, but for those whose time is
            out: for them nothing comes after it.
    """

    env: VectorEnv
    before: Observations
    cells: NDArray[np.int64]
    actions: NDArray[np.int8]
    after: Observations
    over: NDArray[np.bool_]
    terminal: NDArray[np.bool_]


Reward = Callable[[Transition], NDArray[np.float64]]
"""From a step to rewards (B, N)."""


class SlotStep(NamedTuple):
    """What a step has come to in S = B N slots and B worlds.

    Attributes:
        observations: (S, ...) float32; where a world's mission has ended, those of its next one.
        rewards: (S,) float64.
        terminated: (S,) bool, as the rules flag it.
        truncated: (S,) bool, likewise; some rules set both at every end.
        out_of_time: (S,) bool, the drones whose search this step has ended because time is out:
            what was to come counts for them, see Pardo et al., "Time limits in reinforcement
            learning", 2018.
        action_masks: (S, A) int8, those of `observations`.
        final_observations: (S, ...) float32, those at the ends of missions too.
        over: (B,) bool, the worlds whose mission has ended.
        found: (B,) bool, those in which every person was found.
        steps: (B,) int64, steps of the mission that this step was one of.
    """

    observations: NDArray[np.float32]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    out_of_time: NDArray[np.bool_]
    action_masks: NDArray[np.int8]
    final_observations: NDArray[np.float32]
    over: NDArray[np.bool_]
    found: NDArray[np.bool_]
    steps: NDArray[np.int64]


def searched_probability(step: Transition) -> NDArray[np.float64]:
    """Return the probability (B, N) that each drone's looks find; those at one cell share it.

    Looks that were done count, from the cells that they were done in.

    With the belief as observation their sum is what the step is expected to find, whether it does
    or not: a dense reward without the chance of a find. Several persons count with their mean.
    """
    env, probability = step.env, step.before["probability"]
    grid, looks = probability.shape[-1], env.world.looks
    worlds, drones = step.actions.shape
    moves = np.array([*env.rules.action_set.moves, (0, 0)])
    ends = step.cells + moves[np.where(step.actions < len(moves) - 1, step.actions, -1)]
    inside = ((ends >= 0) & (ends < grid)).all(axis=-1, keepdims=True)
    cells = np.where(inside, ends, step.cells).reshape(-1, 2)
    of_all = looks._replace(kind=np.tile(looks.kind, worlds))
    slots, rows, looked = of_all.at(step.actions.ravel(), cells)
    seen = ((looked >= 0) & (looked < grid)).all(axis=1)
    slots, looked, pods = slots[seen], looked[seen], looks.pods[rows[seen]].mean(axis=1)
    place = (slots // drones * grid + looked[:, 1]) * grid + looked[:, 0]
    places, of_place = np.unique(place, return_inverse=True)
    missed, all_pods = np.ones(len(places)), np.bincount(of_place, pods, len(places))
    np.multiply.at(missed, of_place, 1.0 - pods)
    found = probability.reshape(-1)[places] * (1.0 - missed) / np.maximum(all_pods, 1e-300)
    shares = np.zeros(worlds * drones)
    np.add.at(shares, slots, pods * found[of_place])
    return shares.reshape(worlds, drones)


class DroneSlots:
    """A batch of searches whose drones are slots: slot b N + n is drone n of world b.

    A world whose mission has ended is reset in the same step. A drone that is out before its
    mission is over stays a slot that is terminated or truncated in every step, with reward 0, and
    action 0 alone is allowed to it.

    Args:
        env: The batch; not a lazy one.
        encoding: What a drone observes. Where `encode` returns a tuple, its second part is
            (..., N, A), the actions of the rules that the numbers of each slot stand for. Its space
            is a `Box`.
        reward: What it is rewarded for, by default as the rules say.

    Attributes:
        env: As given.
        num_slots: S.
        num_actions: A.
        single_observation_space: Of one slot.
        acting: (S,) bool, the slots whose drones act upon the last observation: those that are
            still in the search, and have time left.
        order: (S, A), the actions of the rules that the numbers of each slot stand for at the last
            observation; None for the same.

    Raises:
        FieldError: If the batch is lazy, or an observation is no array.
    """

    def __init__(
        self, env: VectorEnv, encoding: Encoding = FLATTENED, reward: Reward | None = None
    ) -> None:
        if env.lazy:
            raise FieldError("lazy: true is not allowed with slots")
        self.env = env
        self._encoding, self._reward = encoding, reward
        self._drones = env.world.num_drones
        self.num_slots = env.num_envs * self._drones
        self.num_actions = len(env.rules.actions)
        space = encoding.space(self._drones, env.world.grid_size, env.rules.margin)
        if not isinstance(space, spaces.Box):
            raise FieldError(
                f"encoding: observations of a {type(space).__name__} are not allowed with slots; "
                "those of a Box"
            )
        self.single_observation_space = spaces.Box(
            space.low.astype(np.float32), space.high.astype(np.float32), dtype=np.float32
        )
        self._observations: Observations = {}
        self.order: NDArray[np.int64] | None = None
        self._out = np.zeros((env.num_envs, self._drones), np.bool_)
        self.acting = np.zeros(self.num_slots, np.bool_)

    def reset(self, seed: Any = None) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
        """Start a new mission in every world, see `VectorEnv.reset`.

        Returns:
            Observations (S, ...) and action masks (S, A).
        """
        self._observations, infos = self.env.reset(seed)
        self._out[:] = False
        self._note_acting(infos)
        encoded, self.order = self._encoded()
        return encoded, self._masks(infos)

    def step(self, actions: NDArray[Any]) -> SlotStep:
        """Advance every world by one step.

        Args:
            actions: (S,) integers from 0 to A - 1; those of slots that are out do not count.

        Raises:
            FieldError: If they are not; the missions stay as they are.
        """
        joint = self._joint_action(actions)
        before, out = self._observations, self._out
        drones = self.env.world.drones
        cells = np.stack([drones["x"], drones["y"]], axis=-1)
        self._observations, rewards, terminated, truncated, infos = self.env.step(joint)
        over = infos["over"]
        ended = (terminated | truncated) & ~out
        out_of_time = ended & self.env.out_of_time(infos)[:, None]
        if not self.env.rules.both_flags:
            out_of_time &= ~terminated
        if self._reward is not None:
            did = joint if self.env.world.faults is None else infos["action"]
            did = np.where(self.acting.reshape(out.shape), did, np.int8(HOLD))
            after, terminal = self._observations, ended & ~out_of_time
            rewards = self._reward(Transition(self.env, before, cells, did, after, over, terminal))
        rewards = np.where(out, 0.0, rewards)
        self._out = (terminated | truncated) & ~over[:, None]
        ends, now = None, infos
        if over.any():
            ends, _ = self._encoded(over)
            self._observations, now = self.env.reset(options={RESET_MASK: over})
        self._note_acting(now)
        observed, self.order = self._encoded()
        final = observed
        if ends is not None:
            final = observed.copy()
            final[np.repeat(over, self._drones)] = ends
        return SlotStep(
            observed, rewards.ravel(), terminated.ravel(), truncated.ravel(), out_of_time.ravel(),
            self._masks(now), final, over, infos["Found"], infos["step"],
        )  # fmt: skip

    def close(self) -> None:
        """End the batch's threads."""
        self.env.close()

    def _joint_action(self, actions: NDArray[Any]) -> NDArray[np.int8]:
        """Return the actions of the rules (B, N) that the numbers of the slots stand for.

        Raises:
            FieldError: If a number stands for none.
        """
        numbers = check_integers("actions", actions, (self.num_slots,))
        wrong = (numbers < 0) | (numbers >= self.num_actions)
        if wrong.any():
            raise FieldError(
                f"actions: {numbers[wrong][0]} is not allowed; from 0 to {self.num_actions - 1}"
            )
        if self.order is not None:
            numbers = np.take_along_axis(self.order, numbers[:, None].astype(np.int64), axis=1)
        return numbers.reshape(self._out.shape).astype(np.int8)

    def _note_acting(self, infos: Mapping[str, NDArray[Any]]) -> None:
        """Note which drones act next, by the infos of what they observe."""
        rules = self.env.rules
        in_time = rules.time_out_acts | (infos["step"] < self.env.last_step)
        self.acting = (~self._out & in_time[:, None]).ravel()

    def _masks(self, infos: Mapping[str, NDArray[Any]]) -> NDArray[np.int8]:
        masks: NDArray[np.int8] = infos["action_mask"].reshape(self.num_slots, -1)
        if self.order is not None:
            masks = np.take_along_axis(masks, self.order, axis=1)
        masks[self._out.ravel()] = np.arange(self.num_actions) == 0
        return masks

    def _encoded(
        self, which: Any = slice(None)
    ) -> tuple[NDArray[np.float32], NDArray[np.int64] | None]:
        """Return the observations of all slots, or of those of some worlds, and their actions."""
        positions, probability = (
            self._observations[name][which] for name in ("positions", "probability")
        )
        encoded, order = self._encoding.encode(positions, probability), None
        if isinstance(encoded, tuple):
            encoded, order = encoded
            order = order.reshape(-1, self.num_actions)
        return encoded.reshape(-1, *encoded.shape[2:]).astype(np.float32, copy=False), order
