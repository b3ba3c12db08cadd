# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contents of a picture of a world: its past and its present state."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.picture.mission_view import MissionView, ending
from dsse_ros.search.environments.metres_drones import strips_of
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.looks import likely_cells, waits
from dsse_ros.world.scenario.sea_state import sea_state
from dsse_ros.world.targets import sea_map


class MissionHistory:
    """The tracks and searches of a world, a batch of one, from now on.

    In the coverage task a visit is a search. Call `before_step` and `after_step` around each step
    of the world.

    Args:
        world: The world to follow.

    Attributes:
        searches: See `MissionView`.
        waits: See `MissionView`.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._cells = [self._now()]
        self._paths: list[NDArray[np.float64]] = []
        self._looked: list[NDArray[np.bool_]] = [np.zeros((world.num_drones, 0), bool)]
        self._doing = np.full(world.num_drones, NO_ACTION)
        self.searches, self.waits = np.zeros((2, *world.grid_size.matrix), np.int32)
        self._likely = np.ones(world.grid_size.matrix, bool)

    def before_step(self, actions: NDArray[np.int8], probability: NDArray[np.float32]) -> None:
        """Record the drones' actions before the step.

        Args:
            actions: (N,) int8, the actions of the step.
            probability: (R, C), what the drones observe before it.
        """
        world = self._world
        if world.coverage is None:
            self._likely = likely_cells(probability)
        self._doing[:] = np.where(world.acting(), actions, NO_ACTION)

    def after_step(self) -> None:
        """Add the step."""
        world = self._world
        if world.faults is not None:
            self._doing = np.where(self._doing == NO_ACTION, NO_ACTION, world.faults.applied[0])
        self._cells.append(self._now())
        if world.metres is not None:
            self._paths.append(world.metres.paths[0].copy())
            self._looked.append(world.metres.looked[0, :, 1:].copy())
            return
        searching = self._doing == world.rules.action_set.search
        if world.coverage is not None:
            drones = np.flatnonzero(searching | (self._cells[-1] != self._cells[-2]).any(axis=1))
            looked = self._cells[-1][drones]
        else:
            drones, _, looked = world.looks_done(self._doing)
        on_grid = ((looked >= 0) & (looked < world.grid_size)).all(axis=1)
        drones, looked = drones[on_grid], looked[on_grid]
        waiting = waits(searching, drones, looked, self._likely)
        for count, cells in (
            (self.searches, looked[~waiting[drones]]),
            (self.waits, self._cells[-1][waiting]),
        ):
            np.add.at(count, (cells[:, 1], cells[:, 0]), 1)

    @property
    def tracks(self) -> NDArray[Any]:
        """(N, K, 2) cells of each drone, from its start to its present cell.

        In metres they are the places on its paths, float64, the centre of cell (0, 0) at (0, 0).
        """
        if not self._paths:
            return np.stack(self._cells, axis=1)
        paths = np.stack(self._paths, axis=1)[:, :, 1:] / self._world.scenario.cell_size - 0.5
        return np.concatenate([self._cells[0][:, None], paths.reshape(len(paths), -1, 2)], axis=1)

    @property
    def looked(self) -> NDArray[np.bool_]:
        """(N, K - 1) whether the drones in metres looked on each leg of their tracks."""
        return np.concatenate(self._looked, axis=1)

    def _now(self) -> NDArray[Any]:
        if self._world.metres is not None:
            return self._world.metres.in_cells()[0]
        drones = self._world.drones[0]
        return np.stack([drones["x"], drones["y"]], axis=1)


def view_of(
    world: World, probability: NDArray[np.float32], past: MissionHistory, pos: float | None
) -> MissionView:
    """Return the contents of a picture of a world, a batch of one.

    Args:
        world: The world.
        probability: (R, C) float32, its map, or the belief.
        past: Its past.
        pos: Cumulative probability of success, None if the probability is not a belief.
    """
    covered = {key: float(values[0]) for key, values in world.coverage_metrics().items()}
    s, now, persons = world.scenario, world.worlds[0], world.persons[0]
    circle = None
    if world.rules.circle and not covered and world.ensemble is None:
        circle = (float(now["circle_x"]), float(now["circle_y"]), float(sea_map.radius(now)))
    in_metres: dict[str, Any] = {}
    if world.metres is not None:
        in_metres = {
            "legs": world.metres.paths.shape[2] - 1,
            "looked": past.looked,
            "headings": world.metres.states[0]["heading"].copy(),
            "strips_m": strips_of(s),
        }
    return MissionView(
        probability=probability,
        tracks=past.tracks,
        **in_metres,
        # Drones stay in the air when the last find or the time limit ends the mission.
        alive=world.drones["alive"][0] | world.truncated[0] | (now["num_missing"] == 0),
        persons=np.stack([persons["x"], persons["y"]], axis=1),
        found=persons["found"].copy(),
        datum=None if covered else (int(now["datum_x"]), int(now["datum_y"])),
        step=int(now["t"]),
        timestep_limit=s.timestep_limit,
        cell_size_m=s.cell_size,
        title=s.name,
        pos=covered.get("pos", pos),
        coverage_rate=covered.get("coverage_rate"),
        belief=pos is not None,
        area=s.area_mask,
        searches=past.searches.copy(),
        waits=past.waits.copy(),
        circle=circle,
        origin=(s.origin_lat, s.origin_lon, s.origin_alt),
        step_s=s.step_duration_s,
        sea=sea_state(s, int(now["t"])),
        ending=_ending(world) if now["done"] else "",
    )


def _ending(world: World) -> str:
    now = world.worlds[0]
    return ending(
        int(now["t"]),
        [f"drone{i}" for i in np.flatnonzero(world.found[0])],
        persons=world.scenario.person_amount,
        covered=world.coverage is not None and now["num_missing"] == 0,
        out_of_time=bool(world.truncated.any()),
    )
