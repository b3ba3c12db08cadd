# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The field of a scenario for an incident, and the fields that follow from it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.area import area_mask
from dsse_ros.scenario.battery_fields import FULL
from dsse_ros.scenario.fields import FieldError, field
from dsse_ros.scenario.incident import Incident
from dsse_ros.scenario.rules import AUTO, Rules
from dsse_ros.targets.registry import drifts_with_incident

if TYPE_CHECKING:
    from dsse_ros.scenario.scenario import Scenario

OF_INCIDENT = (
    "origin_lat", "origin_lon", "vector", "current_speed", "current_toward",
    "person_initial_position", "sigma", "sigma_x", "sigma_y", "dispersion_inc",
    "pre_search_minutes",
)  # fmt: skip
"""Fields that an incident determines or has no use for."""


@dataclass(frozen=True, kw_only=True)
class IncidentFields:
    """What is missing at sea."""

    incident: Incident | None = field(
        "given",
        "Object, sightings, wind and current, which give origin, grid, datum, drift and spread. "
        "In a parameter, JSON.",
        None,
        reader=Incident,
    )

    def rules_of(self, name: str) -> str:
        """Return the profile of this name; for auto, sea with an incident and else paper."""
        if not isinstance(name, str) or name != AUTO:
            return name
        return "paper" if self.incident is None else "sea"


def on_incident_grid(scenario: Scenario, rules: Rules) -> Scenario:
    """Return a scenario with the grid of its incident; the scenario itself if it has one already.

    Raises:
        FieldError: If other fields contradict the incident, or no grid fits it.
    """
    incident = scenario.incident
    if incident is None or incident.laid is not None:
        return scenario
    from dsse_ros.scenario.incident_grid import check_transit, lay_grid, nearest_cells

    if not drifts_with_incident(rules.person_motion):
        raise FieldError(f"incident must come with rules sea or flight, got {rules.profile}")
    for name in OF_INCIDENT:
        # An incident has no drift before the search anyway.
        nothing = 0.0 if name == "pre_search_minutes" else None
        if getattr(scenario, name) != nothing:
            raise FieldError(f"{name} must not be given with an incident, which determines it")
    cell, speeds = scenario.cell_m, scenario.speeds
    stated = None
    if scenario.grid_size is not None or scenario.zone_size is not None:
        stated = scenario.cells_along_side(rules, cell)
    grid = lay_grid(
        incident, cell_m=cell, alt_m=scenario.origin_alt, grid_size=stated,
        steps=scenario.timestep_limit or rules.timestep_limit, step_s=cell / max(speeds),
        speed_mps=min(speeds), seed=scenario.ensemble_seed,
    )  # fmt: skip
    if scenario.battery_move:
        steps = (FULL - scenario.battery_reserve) / scenario.battery_move
        check_transit(incident, grid.laid.begins_s, min(speeds), steps * cell / max(speeds))
    starts = scenario.drones_positions
    mask = area_mask(scenario.area, scenario.land, grid.grid_size, cell, grid.origin)
    if starts is None and incident.base is not None:
        count = scenario.num_drones or 1
        starts = nearest_cells(grid.origin, grid.grid_size, cell, incident.base, count, mask)
        # The check of num_drones refuses more drones than cells.
        starts = starts if len(starts) == count else None
    return dataclasses.replace(
        scenario, incident=dataclasses.replace(incident, laid=grid.laid),
        origin_lat=grid.origin[0], origin_lon=grid.origin[1], grid_size=grid.grid_size,
        zone_size=None, drones_positions=starts, vector=grid.vector,
        person_initial_position=_nearest_searched(grid.datum, mask),
        sigma_x=grid.sigma[0], sigma_y=grid.sigma[1],
    )  # fmt: skip


def _nearest_searched(cell: tuple[int, int], mask: NDArray[np.bool_] | None) -> tuple[int, int]:
    """Return the searched cell nearest to a cell (col, row)."""
    if mask is None:
        return cell
    rows, cols = np.nonzero(mask)
    nearest = int(np.argmin((cols - cell[0]) ** 2 + (rows - cell[1]) ** 2))
    return int(cols[nearest]), int(rows[nearest])
