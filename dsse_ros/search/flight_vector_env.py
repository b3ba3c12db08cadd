# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many searches in metres at once as arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.scenario.fields import FieldError
from dsse_ros.search.flight_env import action_space, state_space, states_of
from dsse_ros.search.vector_env import Observations, VectorEnv
from dsse_ros.search.world import HOLD


class FlightVectorEnv(VectorEnv):
    """A `VectorEnv` whose drones fly in metres.

    Actions are (B, N, 2) from -1 to 1, turns and speeds, see `step.flight_paths`. Observations have
    `states` (B, N, 5) float32, see `flight_env.STATE`, in place of `positions`. Infos have no
    `action_mask`, and `path` (B, N, K + 1, 2) float64, see `FlightEnv`.
    """

    def _checked(self, actions: Any) -> NDArray[np.int8]:
        """Store the actions; return those of a search on cells, which do nothing.

        Raises:
            FieldError: If they are not numbers from -1 to 1 of this shape.
        """
        assert self.world.flight is not None
        shape = (*self._shape, 2)
        try:
            taken = np.asarray(actions, np.float64)
        except (TypeError, ValueError):
            taken = np.empty(0)
        if taken.shape != shape:
            raise FieldError(f"actions must be numbers {shape}, turns and speeds")
        acting = self.world.drones["alive"] & ~self.world.worlds["done"][:, None]
        # This form of the comparison also refuses NaN.
        wrong = ~(np.abs(taken) <= 1.0) & acting[..., None]
        if wrong.any():
            raise FieldError(f"actions must be from -1 to 1, got {taken[wrong][0]:g}")
        self.world.flight.actions[:] = taken
        return np.full(self._shape, HOLD, np.int8)

    def _observations(
        self, positions: NDArray[np.int64], maps: NDArray[np.float32]
    ) -> Observations:
        return {"states": states_of(self.world), "probability": self._lazy or maps}

    def _infos(self, masks: NDArray[np.int8]) -> dict[str, NDArray[Any]]:
        assert self.world.flight is not None
        infos = super()._infos(masks)
        del infos["action_mask"], infos["_action_mask"]
        paths = {"path": self.world.flight.paths.copy()}
        return infos | paths | {"_path": np.ones(self.num_envs, np.bool_)}

    def single_spaces(self) -> tuple[spaces.Dict, spaces.Space[Any]]:
        """See `VectorEnv`."""
        drones = self.world.num_drones
        state, probability = state_space(self.world.grid_size)
        return (
            spaces.Dict(states=_repeated(state, drones), probability=probability),
            _repeated(action_space(), drones),
        )


def _repeated(space: Any, count: int) -> spaces.Box:
    low, high = (np.repeat(bound[None], count, axis=0) for bound in (space.low, space.high))
    return spaces.Box(low, high, dtype=space.dtype)
