# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`CoverageDroneSwarmSearch` of DSSE 1.1.9 over `SearchEnv` with the profile coverage."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.base.fields import Spec
from dsse_ros.base.whole_files import write_whole
from dsse_ros.compat.published import Cell, DroneData, Infos
from dsse_ros.compat.search import NAMES
from dsse_ros.compat.swarm import SwarmEnv
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario import Scenario

Observations = dict[str, tuple[Cell, NDArray[np.float64]]]


class CoverageMatrix:
    """The remaining probability: a visit removes that of its cell. It is read-only."""

    def __init__(self, search: SearchEnv) -> None:
        coverage = search.world.coverage
        assert coverage is not None
        self._maps = coverage.poc.view(), coverage.left[0]
        for values in self._maps:
            values.setflags(write=False)

    @property
    def original_map(self) -> NDArray[np.float64]:
        """The matrix without any visits, (G, G) float64 as [y, x]."""
        return self._maps[0]

    @property
    def probability_map(self) -> NDArray[np.float64]:
        """The matrix (G, G) float64 as [y, x]; visits change it."""
        return self._maps[1]

    def get_matrix(self) -> NDArray[np.float64]:
        """Return the matrix (G, G) float64 as [y, x]; visits change it."""
        return self.probability_map

    def get_map_size(self) -> int:
        """Return G."""
        return len(self.original_map)

    def save_state(self, output_path: str) -> None:
        """Write the matrix without any visits to a .npy file."""
        write_whole(Path(output_path), lambda file: np.save(file, self.original_map))


class CoverageDroneSwarmSearch(SwarmEnv):
    """The coverage task of DSSE 1.1.9 (PettingZoo parallel API).

    An observation is the agent's cell (x, y) and the remaining probability over its maximum, (G, G)
    float64 as [y, x]; all 0 once nothing is left. The matrix comes from a file, `.npy`, CSV
    or GeoTIFF: particles of an ocean model are not simulated here.

    Raises:
        ValueError: If an argument is not allowed, or there is no `prob_matrix_path`.
    """

    metadata = {"name": "DroneSwarmSearchCPP"}
    _names = {
        **NAMES,
        "drone_probability_of_detection": "probability_of_detection",
        "prob_matrix_path": "probability_matrix",
    }
    reward_scheme = {
        "default": -0.2,
        "exceed_timestep": 0.0,
        "search_cell": 1.0,
        "done": 60,
        "reward_poc": 45.0,
    }

    def __init__(
        self,
        render_mode: str = "ansi",
        render_grid: bool = True,
        render_gradient: bool = True,
        timestep_limit: int = 100,
        disaster_position: tuple[float, float] = (-24.04, -46.17),
        drone_amount: int = 1,
        drone_speed: float = 10,
        drone_probability_of_detection: float = 0.9,
        pre_render_time: float = 10,
        prob_matrix_path: str | None = None,
        particle_amount: int = 50_000,
        particle_radius: float = 800,
        num_particle_to_filter_as_noise: int = 1,
        start_time: Any = None,
        grid_cell_size: float = 130,
    ) -> None:
        if not isinstance(prob_matrix_path, str):
            raise ValueError(
                "prob_matrix_path must be a .npy, CSV or GeoTIFF file, because no ocean model runs "
                f"here, got {prob_matrix_path!r}"
            )
        self.reward_scheme = dict(self.reward_scheme)
        self._set_up(
            render_mode,
            lambda: Scenario.from_dict(
                {
                    "probability_matrix": prob_matrix_path,
                    "timestep_limit": timestep_limit,
                    "num_drones": drone_amount,
                    "drone_speed": drone_speed,
                    "probability_of_detection": drone_probability_of_detection,
                    "cell_size": grid_cell_size,
                }
            ),
        )
        columns, rows = self._search.world.grid_size
        if columns != rows:
            raise ValueError(f"prob_matrix_path must be of a square matrix, got {columns} x {rows}")
        self.grid_size = self.probability_matrix.get_map_size()
        drone = DroneData(drone_amount, drone_speed, drone_probability_of_detection)
        self._publish(drone, grid_cell_size, timestep_limit)
        self.disaster_position = disaster_position
        g = self.grid_size
        self.observation_spaces = dict.fromkeys(
            self.possible_agents,
            spaces.Tuple((spaces.MultiDiscrete([g, g]), spaces.Box(0, 1, (g, g), np.float64))),
        )
        self._keep_spaces()

    def _rules(self) -> Rules:
        rewards, matrix = self.reward_scheme, self._matrix
        scale = done = 1.0
        if matrix is not None:
            # The step scales both by the cells to cover, and the other by the drones.
            cells = self._cells_to_cover
            scale = rewards["reward_poc"] / cells
            done = rewards["done"] / (cells / self._search.world.num_drones)
        return profile(
            "coverage",
            move=rewards["default"],
            leave_grid=rewards["default"],
            time_out=rewards["exceed_timestep"],
            cover=rewards["search_cell"],
            cover_scale=scale,
            cover_all=done,
            cover_all_bonus=done,
        )

    def _make(self) -> None:
        self._matrix: CoverageMatrix | None = None
        super()._make()
        self._matrix = CoverageMatrix(self._search)

    @property
    def probability_matrix(self) -> CoverageMatrix:
        """The remaining probability."""
        assert self._matrix is not None
        return self._matrix

    @property
    def all_states(self) -> frozenset[Cell]:
        """All cells (x, y)."""
        line = range(self.grid_size)
        return frozenset((x, y) for x in line for y in line)

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Start a new mission.

        Args:
            seed: Nothing is random here.
            options: `drones_positions`.

        Raises:
            ValueError: If an option is not allowed.
        """
        self._start(None, {"drones_positions": (options or {}).get("drones_positions")})
        cells = self._cells_to_cover
        self.reward_scheme["done"] = cells / len(self.agents)
        self.reward_scheme["reward_poc"] = cells
        observations = self.create_observations()
        self._show()
        return observations, self._infos()

    def _settings(self) -> tuple[Any, ...]:
        return (self.drone.pod, *self.agents, *super()._settings())

    def _infos(self) -> Infos:
        metrics = {
            name: values[0].item() for name, values in self._search.world.coverage_metrics().items()
        }
        info = {
            "is_completed": not self.not_seen_states,
            "coverage_rate": metrics["coverage_rate"],
            "repeated_coverage": metrics["repeated_coverage"],
            "accumulated_pos": metrics["pos"],
        }
        return {agent: info for agent in self.agents}

    @property
    def _cells_to_cover(self) -> int:
        return int(np.count_nonzero(self.probability_matrix.original_map))

    @property
    def seen_states(self) -> frozenset[Cell]:
        """Cells (x, y) that are covered."""
        return _cells_where(
            self.probability_matrix.original_map > self.probability_matrix.probability_map
        )

    @property
    def not_seen_states(self) -> frozenset[Cell]:
        """Cells (x, y) left to cover."""
        return _cells_where(self.probability_matrix.probability_map > 0)

    @property
    def repeated_coverage(self) -> int:
        """Number of visits of cells that were already covered; it can be set."""
        return int(self._records["repeated"][0])

    @repeated_coverage.setter
    def repeated_coverage(self, value: int) -> None:
        self._records["repeated"] = Spec("int", "", low=0).check("repeated_coverage", value)

    @property
    def cumm_pos(self) -> float:
        """Probability of the covered cells times the probability of detection; it can be set."""
        return float(self._records["pos"][0])

    @cumm_pos.setter
    def cumm_pos(self, value: float) -> None:
        self._records["pos"] = Spec("float", "").check("cumm_pos", value)

    @property
    def _records(self) -> NDArray[np.void]:
        coverage = self._search.world.coverage
        assert coverage is not None
        return coverage.records

    @property
    def probability(self) -> NDArray[np.float64]:
        """The matrix as agents observe it, (G, G) as [y, x]."""
        matrix = self.probability_matrix.get_matrix()
        return matrix / (matrix.max() or 1.0)

    def save_matrix(self, path: str) -> None:
        """Write the matrix without any visits to a .npy file."""
        self.probability_matrix.save_state(path)


def _cells_where(where: NDArray[np.bool_]) -> frozenset[Cell]:
    return frozenset((x, y) for y, x in np.argwhere(where).tolist())
