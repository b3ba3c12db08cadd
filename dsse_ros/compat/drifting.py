# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What drifts in a search of DSSE 1.1.9: its persons, and its map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import Spec
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.cell_checks import check_cell
from dsse_ros.world.scenario.scenario import SPECS

MULTIPLIER = Spec("float", "Factor on the probability of detection.", low=0)
_NUMBER = Spec("float", "")


class Drifting:
    """The drift of a person or of a map; it can be set, and counts from the next step.

    Attributes:
        _vector: Its vector.
        _relation: Number of steps in which it drifts by the vector.
    """

    _vector: tuple[float, float]
    _relation: float

    @property
    def _record(self) -> Any:
        """Its element of `motion.PERSONS` or `entities.WORLDS`."""
        raise NotImplementedError

    @property
    def inc_x(self) -> float:
        """Drift to the east that has not led to another cell yet, in cells."""
        return float(self._record["remainder_x"])

    @inc_x.setter
    def inc_x(self, value: float) -> None:
        self._record["remainder_x"] = _NUMBER.check("inc_x", value)

    @property
    def inc_y(self) -> float:
        """The same to the south."""
        return float(self._record["remainder_y"])

    @inc_y.setter
    def inc_y(self, value: float) -> None:
        self._record["remainder_y"] = _NUMBER.check("inc_y", value)

    @property
    def movement_vector(self) -> tuple[float, float]:
        """Its vector (x, y)."""
        return self._vector

    @movement_vector.setter
    def movement_vector(self, value: tuple[float, float]) -> None:
        self._vector = SPECS["vector"].check("movement_vector", value)
        self._drift()

    @property
    def time_step_relation(self) -> float:
        """Number of steps in which it drifts by the vector."""
        return self._relation

    @time_step_relation.setter
    def time_step_relation(self, value: float) -> None:
        self._relation = Spec("float", "", above=0).check("time_step_relation", value)
        self._drift()

    def _drift(self) -> None:
        self._record["drift_x"] = self._vector[0] / self._relation
        self._record["drift_y"] = self._vector[1] / self._relation


def relation_of(vector: tuple[float, float], time_step: float, cell_size: float) -> float:
    """Return the number of steps in which something drifts by its vector (DSSE 1.1.9)."""
    speed = math.hypot(*vector)
    return cell_size / speed / time_step if speed else math.inf


class Person(Drifting):
    """A person who has not been found yet.

    Args:
        index: Number of the person.
        world: The world.
        time_step: Duration of a step.
        cell_size: Side of a cell.
    """

    def __init__(self, index: int, world: World, time_step: float, cell_size: float) -> None:
        self._index, self._world = index, world
        # The drift per step is v |v| time_step / cell_size.
        x, y = float(self._record["drift_x"]), float(self._record["drift_y"])
        size = math.hypot(x, y)
        speed = math.sqrt(size * cell_size / time_step)
        self._vector = (x / size * speed, y / size * speed) if size else (0.0, 0.0)
        self._relation = relation_of(self._vector, time_step, cell_size)
        self._place = Spec("int", "", low=0, high=world.grid_size.columns - 1)

    @property
    def _record(self) -> Any:
        return self._world.persons[0, self._index]

    @property
    def index(self) -> int:
        """Number of the person."""
        return self._index

    @property
    def grid_size(self) -> int:
        """Cells along a side of the grid."""
        return self._world.grid_size.columns

    @property
    def x(self) -> int:
        """Column of the person's cell; it can be set."""
        return int(self._record["x"])

    @x.setter
    def x(self, value: int) -> None:
        self._record["x"] = self._place.check("x", value)

    @property
    def y(self) -> int:
        """Row of the person's cell; it can be set."""
        return int(self._record["y"])

    @y.setter
    def y(self, value: int) -> None:
        self._record["y"] = self._place.check("y", value)

    @property
    def mult(self) -> float:
        """Factor on the probability of detection; it can be set for this mission."""
        return float(self._record["pod_multiplier"])

    @mult.setter
    def mult(self, value: float) -> None:
        self._record["pod_multiplier"] = MULTIPLIER.check("mult", value)

    def get_position(self) -> tuple[int, int]:
        """Return the cell (x, y)."""
        return self.x, self.y

    def get_mult(self) -> float:
        """Return the factor on the probability of detection."""
        return self.mult

    def set_mult(self, mult: float) -> None:
        """Set the factor on the probability of detection for this mission.

        Raises:
            ValueError: If it is not a number >= 0.
        """
        self.mult = mult


class ProbabilityMatrix(Drifting):
    """The map of a search.

    Args:
        world: The world.
        time_step: Duration of a step.
    """

    def __init__(self, world: World, time_step: float = 1.0) -> None:
        self._world = world
        self._vector = float(self._record["vector_x"]), float(self._record["vector_y"])
        cell_size = float(world.constants["cell_size"][0])
        self._relation = relation_of(self._vector, time_step, cell_size)

    @property
    def _record(self) -> Any:
        return self._world.worlds[0]

    def get_matrix(self) -> NDArray[np.float32]:
        """Return the map (G, G) float32 as [y, x] of the last observation."""
        return self._world.maps[0]

    @property
    def map_prob(self) -> NDArray[np.float32]:
        """The map, see `get_matrix`."""
        return self._world.maps[0]

    @property
    def supposed_position(self) -> tuple[int, int]:
        """Cell of the datum as (row, column); it can be set, and counts from the next step."""
        return int(self._record["datum_y"]), int(self._record["datum_x"])

    @supposed_position.setter
    def supposed_position(self, cell: tuple[int, int]) -> None:
        row, col = SPECS["person_initial_position"].check("supposed_position", cell)
        check_cell("supposed_position", (row, col), self._world.grid_size)
        self._record["datum_y"], self._record["datum_x"] = row, col

    @property
    def map(self) -> Any:
        """The package's map before its division by the sum has no counterpart here."""
        raise AttributeError("map is missing here; map_prob is the map")

    @property
    def amplitude(self) -> int:
        """Value of that map at the datum, which has no effect on `map_prob`."""
        return 40

    @property
    def spacement_inc(self) -> float:
        """Growth of the spread per step, in cells."""
        return float(self._world.constants["dispersion_inc"][0])

    @property
    def spacement(self) -> float:
        """Spread of the map of the next step, in cells."""
        start = float(self._world.constants["sigma_x"][0])
        return start + int(self._record["map_steps"]) * self.spacement_inc
