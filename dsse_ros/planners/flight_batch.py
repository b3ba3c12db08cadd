# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Batches of missions in metres with any planner."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.batch import MissionBatch
from dsse_ros.search.flight_env import STRAIGHT_ON, flight_action_of, states_of
from dsse_ros.search.flights import Flights
from dsse_ros.search.observation import Started, agent_infos
from dsse_ros.search.world import HOLD


class FlightBatch(MissionBatch):
    """A `MissionBatch` whose drones fly by a turn and a speed; see `FlightEnv`."""

    @property
    def _flights(self) -> Flights:
        assert self.world.flight is not None
        return self.world.flight

    def observe(self, mission: int, last: Mapping[int, Any]) -> Started:
        """See `MissionBatch`."""
        world, drones = self.world, self.world.drones[mission]
        live = np.flatnonzero(~(drones["terminated"] | drones["truncated"])).tolist()
        names, states = [self._names[n] for n in live], states_of(world)[mission]
        observations: Any = {
            name: (states[n], self._probability) for name, n in zip(names, live, strict=True)
        }
        columns = world.info_columns(mission, live)
        columns["path"] = [self._flights.paths[mission, n].copy() for n in live]
        columns["step"] = [self._step] * len(live)
        return observations, agent_infos(names, False, None, columns)

    def action_of(self, agent: str, actions: Mapping[str, Any]) -> Any:
        """See `MissionBatch`."""
        return flight_action_of(agent, actions)

    def nothing(self) -> NDArray[Any]:
        """Return the actions (M, N, 2) of drones that fly straight on."""
        return np.tile(np.array(STRAIGHT_ON), (*self.world.drones.shape, 1))

    def fly(self, joint: NDArray[Any]) -> NDArray[np.float64]:
        """See `MissionBatch`."""
        self._flights.actions[:] = joint
        self.world.step(np.full(self.world.drones.shape, HOLD, np.int8))
        pieces = np.diff(self._flights.paths, axis=2)
        far: NDArray[np.float64] = np.hypot(pieces[..., 0], pieces[..., 1]).sum(axis=2)
        return far / self.world.scenario.cell_size
