# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Trains an agent by the cross-entropy method: a policy of four weights, on many searches at once.

The agent observes the belief: where the person can still be, after the searches so far. It scores
the cells that it can be in after each action by how much probability is near and far around them,
and weighs that against searching at once. Run `python examples/train.py`; it takes a minute.
"""

import numpy as np

from dsse_ros.search import ACTION_VECTORS, vector_env

SCENARIO = {"scenario": "config/santos.yaml", "num_drones": 1, "timestep_limit": 60}
GENERATIONS, POLICIES, ELITE, MISSIONS = 12, 24, 6, 24
REACHES = (1.5, 6.0)
"""Cells: how far probability is felt."""


class Searches:
    """A batch of searches in which groups of worlds follow policies of their own."""

    def __init__(self, policies: int, missions: int) -> None:
        self.policies, self.missions = policies, missions
        self.batch = vector_env(policies * missions, observe="belief", **SCENARIO)
        self.limit = self.batch.scenario.timestep_limit
        actions = self.batch.rules.actions
        self.search = actions.index("search")
        # x to the east, y to the south; a search stays where it is.
        self.moves = np.array([ACTION_VECTORS[name] for name in actions])
        size = self.batch.scenario.grid_size
        y, x = np.divmod(np.arange(size * size), size)
        distance = np.hypot(x - x[:, None], y - y[:, None])
        self.kernels = [np.exp(-distance / reach).astype(np.float32) for reach in REACHES]

    def features(self, observations: dict) -> np.ndarray:
        """Return (B, A, 4): probability near and far about each action's cell, and of a search."""
        belief = observations["probability"]
        worlds, size = len(belief), belief.shape[1]
        cells = np.clip(observations["positions"] + self.moves, 0, size - 1)
        index = cells[..., 1] * size + cells[..., 0]
        flat = belief.reshape(worlds, -1)
        features = np.zeros((worlds, len(self.moves), 4))
        for i, kernel in enumerate(self.kernels):
            features[..., i] = np.log(np.take_along_axis(flat @ kernel, index, 1) + 1e-9)
        here = flat[np.arange(worlds), index[:, self.search]]
        features[:, self.search, 2] = np.log(here / flat.max(1) + 1e-9)
        features[:, self.search, 3] = 1.0
        return features

    def mean_steps(self, weights: np.ndarray, seed: int) -> np.ndarray:
        """Return the mean steps (P,) of policies (P, 4) on the same missions; not found is 60."""
        of_world = np.repeat(weights, self.missions, axis=0)
        seeds = [seed + mission for _ in range(self.policies) for mission in range(self.missions)]
        observations, infos = self.batch.reset(seed=seeds)
        steps = np.full(len(of_world), self.limit)
        going = np.ones(len(of_world), bool)
        for step in range(1, self.limit + 1):
            scores = np.einsum("baf,bf->ba", self.features(observations), of_world)
            scores[infos["action_mask"][:, 0] == 0] = -np.inf
            actions = scores.argmax(1).astype(np.int8)[:, None]
            observations, _, _, _, infos = self.batch.step(actions)
            steps[going & infos["Found"]] = step
            # A world that is done starts anew: its first mission counts.
            going &= ~infos["over"]
            if not going.any():
                break
        return steps.reshape(self.policies, self.missions).mean(1)


def train(
    generations: int = GENERATIONS, policies: int = POLICIES, missions: int = MISSIONS
) -> np.ndarray:
    """Return the weights (4,) that the best policies have gathered about."""
    generator = np.random.default_rng(1)
    searches = Searches(policies, missions)
    mean, spread = np.zeros(4), np.full(4, 2.0)
    for generation in range(generations):
        weights = mean + spread * generator.standard_normal((policies, 4))
        steps = searches.mean_steps(weights, seed=generation * missions)
        elite = weights[np.argsort(steps)[: min(ELITE, policies)]]
        mean, spread = elite.mean(0), elite.std(0) + 0.05
        print(
            f"generation {generation + 1:2d}: best {steps.min():.1f} steps, mean {steps.mean():.1f}"
        )
    return mean


if __name__ == "__main__":
    learned = train()
    print("weights", learned.round(2))
    # Missions that were not trained on.
    print(f"unseen missions: {Searches(1, 500).mean_steps(learned[None], seed=10**6)[0]:.1f} steps")
