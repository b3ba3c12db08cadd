# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each drone of each world as a slot, so that learning libraries can train one shared policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.space import check_integers
from dsse_ros.search.environments.vector_env import (
    RESET_MASK,
    Observations,
    VectorEnv,
)
from dsse_ros.search.environments.wrappers import FLATTENED, Encoding
from dsse_ros.search.step.constants import NO_ACTION


class Transition(NamedTuple):
    """A step of B worlds.

    Attributes:
        env: The worlds.
        before: Observations before the step.
        cells: (B, N, 2) int64, the true cells (x, y) of the drones after their actions, from which
            they looked.
        actions: (B, N) int8, the actions that the drones did, by the rules' numbers; -1 for
            nothing. With faults they may differ from the commands.
        after: Observations after the step, before any world is reset.
        over: (B,) bool, the worlds whose mission the step ended.
        terminal: (B, N) bool, the drones whose search the step ended, except by the time limit:
            they have no future reward.
    """

    env: VectorEnv
    before: Observations
    cells: NDArray[np.int64]
    actions: NDArray[np.int8]
    after: Observations
    over: NDArray[np.bool_]
    terminal: NDArray[np.bool_]


Reward = Callable[[Transition], NDArray[np.float64]]
"""Computes the rewards (B, N) of a step."""


class SlotStep(NamedTuple):
    """Result of a step in S = B N slots and B worlds.

    Attributes:
        observations: (S, ...) float32; where a mission has ended, those of the world's next one.
        rewards: (S,) float64.
        terminated: (S,) bool, by the rules.
        truncated: (S,) bool, by the rules; some rules set both flags at every end.
        out_of_time: (S,) bool, the drones whose search ended in this step at the time limit. Their
            future rewards count, see Pardo et al., "Time limits in reinforcement learning", 2018.
        action_masks: (S, A) int8, those of `observations`.
        final_observations: (S, ...) float32; where a mission has ended, those of its end.
        over: (B,) bool, the worlds whose mission has ended.
        found: (B,) bool, the worlds in which every person was found.
        steps: (B,) int64, steps done in the mission that this step belongs to.
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
    """Return the probability (B, N) that each drone's looks find; looks at one cell share it.

    Count only the looks that the drones made, from the cells in which they made them.

    With the belief as observation, their sum is the expected number of finds in the step: a dense
    reward without the luck of an actual find. With several persons it uses their mean POD. With
    particles it is of those observed, and POS of others, see `cell_tracks.Draw`.
    """
    env, probability = step.env, step.before["probability"]
    grid, looks = env.world.grid_size, env.world.looks
    worlds, drones = step.actions.shape
    of_all = looks._replace(kind=np.tile(looks.kind, worlds))
    slots, rows, looked = of_all.at(step.actions.ravel(), step.cells.reshape(-1, 2))
    seen = ((looked >= 0) & (looked < grid)).all(axis=1)
    slots, looked, pods = slots[seen], looked[seen], looks.pods[rows[seen]].mean(axis=1)
    place = (slots // drones * grid.rows + looked[:, 1]) * grid.columns + looked[:, 0]
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
    mission is over keeps its slot, which is terminated or truncated in every step, with reward 0
    and action 0 as the only valid action.

    Args:
        env: The batch; must not be lazy.
        encoding: Observation of a drone; its space is a `Box`.
        reward: Reward function; by default the rewards of the rules.

    Attributes:
        env: As given.
        num_slots: S.
        num_actions: A.
        single_observation_space: Of one slot.
        acting: (S,) bool, the slots whose drones act on the last observation: those still in the
            search, with time left.

    Raises:
        FieldError: If the batch is lazy or in metres, or the space of the encoding is not a `Box`.
    """

    def __init__(
        self, env: VectorEnv, encoding: Encoding = FLATTENED, reward: Reward | None = None
    ) -> None:
        if env.lazy:
            raise FieldError("lazy must be false with slots, got true")
        if env.rules.in_metres:
            raise FieldError(
                "space must be cells with slots, whose actions are numbers, got 'metres'; "
                "JointVectorEnv and SuperSuit take drones in metres"
            )
        self.env = env
        self._encoding, self._reward = encoding, reward
        self._drones = env.world.num_drones
        self.num_slots = env.num_envs * self._drones
        self.num_actions = len(env.rules.actions)
        space = encoding.space(self._drones, env.world.grid_size, env.rules.margin)
        if not isinstance(space, spaces.Box):
            raise FieldError(
                "encoding must have observations of a Box with slots, got those of a "
                f"{type(space).__name__}"
            )
        self.single_observation_space = spaces.Box(
            space.low.astype(np.float32), space.high.astype(np.float32), dtype=np.float32
        )
        self._observations: Observations = {}
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
        return self._encoded(), self._masks(infos)

    def step(self, actions: NDArray[Any]) -> SlotStep:
        """Advance every world by one step.

        Args:
            actions: (S,) integers from 0 to A - 1; those of slots that are out have no effect.

        Raises:
            FieldError: If an action is not allowed; the missions stay as they are.
        """
        joint = self._joint_action(actions)
        before, out = self._observations, self._out
        self._observations, rewards, terminated, truncated, infos = self.env.step(joint)
        over = infos["over"]
        ended = (terminated | truncated) & ~out
        out_of_time = ended & self.env.out_of_time(infos)[:, None]
        if not self.env.rules.both_flags:
            out_of_time &= ~terminated
        if self._reward is not None:
            did = joint if self.env.world.faults is None else infos["action"]
            did = np.where(self.acting.reshape(out.shape), did, np.int8(NO_ACTION))
            after, terminal = self._observations, ended & ~out_of_time
            drones = self.env.world.drones
            cells = np.stack([drones["x"], drones["y"]], axis=-1)
            rewards = self._reward(Transition(self.env, before, cells, did, after, over, terminal))
        rewards = np.where(out, 0.0, rewards)
        self._out = (terminated | truncated) & ~over[:, None]
        ends, now = None, infos
        if over.any():
            ends = self._encoded(over)
            self._observations, now = self.env.reset(options={RESET_MASK: over})
        self._note_acting(now)
        observed = self._encoded()
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
        """Return the actions of the slots as those of the worlds (B, N)."""
        numbers = check_integers("actions", actions, (self.num_slots,))
        wrong = (numbers < 0) | (numbers >= self.num_actions)
        if wrong.any():
            raise FieldError(
                f"actions must be from 0 to {self.num_actions - 1}, got {numbers[wrong][0]}"
            )
        return numbers.reshape(self._out.shape).astype(np.int8)

    def _note_acting(self, infos: Mapping[str, NDArray[Any]]) -> None:
        """Record which drones act next, from the infos of the last observation."""
        last = self.env.rules.last_acting_step(self.env.scenario.timestep_limit)
        self.acting = (~self._out & (infos["step"] < last)[:, None]).ravel()

    def _masks(self, infos: Mapping[str, NDArray[Any]]) -> NDArray[np.int8]:
        masks: NDArray[np.int8] = infos["action_mask"].reshape(self.num_slots, -1)
        masks[self._out.ravel()] = np.arange(self.num_actions) == 0
        return masks

    def _encoded(self, which: Any = slice(None)) -> NDArray[np.float32]:
        """Return the observations of all slots, or of the slots of some worlds."""
        positions, probability = (
            self._observations[name][which] for name in ("positions", "probability")
        )
        encoded = self._encoding.encode(positions, probability)
        return np.asarray(encoded.reshape(-1, *encoded.shape[2:]), np.float32)
