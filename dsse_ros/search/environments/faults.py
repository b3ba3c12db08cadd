# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Faults and drone kinds of B worlds: they make drones deviate from their commands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.overloads import Specialized
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.environments.ways_home import ways_home
from dsse_ros.search.step import fault_kernels
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import (
    ABILITIES,
    ACTING,
    CONDITIONS,
    FAULT_CONSTANTS,
    STATUSES,
    FaultArrays,
)
from dsse_ros.search.step.looks import Looks
from dsse_ros.search.step.world_state import Batch
from dsse_ros.world.scenario.action_times import action_times_of_kinds
from dsse_ros.world.scenario.fault_fields import faults_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.scenario.searcher_fields import endurance_steps


def abilities_of(scenario: ResolvedScenario, rules: Rules, looks: Looks) -> NDArray[np.void]:
    """Return the abilities of the drones, (N,) of `fault_kernels.ABILITIES`."""
    kinds, count = scenario.kinds, len(rules.actions)
    of_kinds = np.zeros(len(kinds), ABILITIES)
    for k, times in enumerate(action_times_of_kinds(scenario, rules)):
        of_kinds["share"][k, :count] = times.shares
        of_kinds["takes"][k, :count] = times.takes
        of_kinds["after"][k, :count] = times.after
        of_kinds["binding"][k] = times.binding
        of_kinds["endurance"][k] = endurance_steps(kinds[k], scenario.step_duration_s)
    of_kinds["vehicle_timed"] = rules.vehicle_timed_actions
    if scenario.has_persons:
        rates = false_alarms(scenario, looks)
        of_kinds["false_alarms"][:, : rates.shape[1]] = rates
    return of_kinds[list(scenario.kind_of)]


def has_limits(abilities: NDArray[np.void], num_actions: int) -> bool:
    """Return whether a drone may be under way, lacks an action, or has an endurance."""
    cannot = abilities["share"][:, :num_actions] == 0
    return bool((abilities["binding"] | (abilities["endurance"] > 0) | cannot.any(axis=1)).any())


def fault_constants(scenario: ResolvedScenario, *, has_limits: bool) -> NDArray[np.void]:
    """Return the faults for the kernels, (1,) of `fault_kernels.FAULT_CONSTANTS`."""
    constants = np.zeros(1, FAULT_CONSTANTS)
    for name in set(FAULT_CONSTANTS.names or ()) - {"battery", "has_limits"}:
        constants[name] = getattr(scenario, name)
    constants["battery"] = scenario.battery_move > 0
    constants["has_limits"] = has_limits
    return constants


def false_alarms(scenario: ResolvedScenario, looks: Looks) -> NDArray[np.float64]:
    """Return the probability (K, A) that an action's unsuccessful looks raise a false alarm.

    False alarms of the sensor and of the scenario's fault are independent.
    """
    rates, fault = looks.false_alarms, scenario.false_alarm_rate
    together = np.where(rates > 0.0, 1.0 - (1.0 - rates) * (1.0 - fault), fault)
    return np.where(looks.counts > 0, together, 0.0)


class Faults:
    """The faults in the worlds of a `World`, and the abilities of its drones.

    Attributes:
        conditions: (B, N) of `fault_kernels.CONDITIONS`.
        applied: (B, N) int8, actions the drones did in the last step, `NO_ACTION` for nothing.
        arrays: All of these for the kernels.
        has_battery: Whether batteries run down.
        is_noisy: Whether observed positions differ from the true ones.
    """

    def __init__(
        self,
        scenario: ResolvedScenario,
        rules: Rules,
        num_worlds: int,
        abilities: NDArray[np.void],
    ) -> None:
        shape = (num_worlds, scenario.num_drones)
        limited = has_limits(abilities, len(rules.actions))
        losses = np.empty(scenario.num_drones, np.int64)
        losses[:] = scenario.loss_steps
        self.conditions = np.zeros(shape, CONDITIONS)
        self.applied = np.full(shape, NO_ACTION, np.int8)
        none = (scenario.num_drones, 0, 0)
        self.arrays = FaultArrays(
            faults=fault_constants(scenario, has_limits=limited),
            abilities=abilities,
            conditions=self.conditions,
            losses=losses,
            home_steps=np.zeros(none, np.int32),
            home_actions=np.zeros(none, np.int8),
            applied=self.applied,
        )
        self._before = Specialized(fault_kernels.before_step)
        self._after = Specialized(fault_kernels.after_step)
        self._restrict = Specialized(fault_kernels.restrict_masks)
        self.has_battery = scenario.battery_move > 0
        self.is_noisy = scenario.position_noise > 0
        self._actions = rules.action_set
        self._shares = abilities["share"][:, : len(rules.actions)].tolist()
        self._grid = scenario.grid_size
        self._homes: list[tuple[int, int]] = []

    @classmethod
    def of_scenario(
        cls, scenario: ResolvedScenario, rules: Rules, num_worlds: int, looks: Looks
    ) -> Faults | None:
        """Return the faults of a scenario, or None if it has none and its drones have no limits.

        In metres there are none, see `MetresDrones`.

        Args:
            scenario: The scenario.
            rules: The rules.
            num_worlds: B.
            looks: The looks of the drones.
        """
        if rules.in_metres:
            return None
        abilities = abilities_of(scenario, rules, looks)
        limited = has_limits(abilities, len(rules.actions)) or bool(looks.false_alarms.any())
        if not (limited or faults_of(scenario)):
            return None
        return cls(scenario, rules, num_worlds, abilities)

    def place(self, batch: Batch) -> None:
        """Make the drones' start cells their homes; all worlds have the same ones."""
        homes: list[tuple[int, int]] = [(x, y) for x, y in batch.entities.start_cells[0].tolist()]
        if self.has_battery and homes != self._homes:
            self._homes = homes
            area = batch.sea.area
            ways = ways_home(self._actions, area, self._grid, homes, self._shares)
            self.arrays = self.arrays._replace(home_steps=ways.steps, home_actions=ways.actions)

    def reset(self, batch: Batch, which: NDArray[np.bool_]) -> None:
        """Begin the missions of the worlds with which[b], (B,) bool."""
        self.place(batch)
        fault_kernels.start_conditions(batch, self.arrays, which, 0, len(which))

    def check(self, snapshot: Snapshot, grid: GridShape) -> None:
        """Raise if a snapshot of this shape would make the kernels read beyond their arrays.

        Raises:
            SnapshotError: If it would.
        """
        conditions, starts = snapshot.arrays["conditions"], snapshot.arrays["starts"]
        status, heading = conditions["status"], conditions["heading"]
        if not ((status >= 0) & (status < len(STATUSES))).all():
            raise SnapshotError("the snapshot is damaged: the status of a drone is unknown")
        if not ((heading >= NO_ACTION) & (heading < len(self._actions))).all():
            raise SnapshotError("the snapshot is damaged: the heading of a drone is not an action")
        if not ((starts >= 0) & (starts < grid)).all():
            raise SnapshotError("the snapshot is damaged: the start of a drone is off the grid")

    def restore(self, batch: Batch) -> None:
        """Continue from the restored conditions and starts of a snapshot."""
        self.place(batch)
        self.applied[:] = self.conditions["applied"]

    def wrap(self, batch: Batch, step: Callable[..., None]) -> Callable[..., None]:
        """Wrap a step with the faults; the wrapper takes commands in place of actions."""

        def step_with_faults(
            commands: NDArray[np.int8], maps: NDArray[np.float32], first: int, last: int
        ) -> None:
            self._before(batch, self.arrays, commands, first, last)
            step(self.applied, maps, first, last)
            self._after(batch, self.arrays, first, last)

        return step_with_faults

    def restrict(
        self, batch: Batch, masks: NDArray[np.int8], first: int = 0, last: int | None = None
    ) -> NDArray[np.int8]:
        """Clear the actions that drones cannot do or return home after in masks (B, N, A)."""
        last = len(batch.worlds) if last is None else last
        self._restrict(batch, self.arrays, masks, first, last)
        return masks

    def set_battery(self, drone: int, percent: float) -> None:
        """Set the charge of a drone of the first world; without batteries, do nothing."""
        if self.has_battery:
            self.conditions["battery"][0, drone] = percent

    def set_work(self, work: NDArray[np.int8]) -> None:
        """Set the work that the vehicles of the first world have left, (N,) of `WORKS`.

        It counts in the next step, with `vehicle_timed_actions`.
        """
        self.conditions["work"][0] = work

    def begun(
        self, batch: Batch, commands: NDArray[np.int8]
    ) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
        """Return the actions of the drones of the first world in the next step, without a step.

        Args:
            batch: The worlds.
            commands: (N,) int8, their commands.

        Returns:
            (N,) the actions that they begin, complete or continue, `NO_ACTION` for nothing; (N,)
            whether they have begun them in an earlier step.
        """
        conditions = self.conditions.copy()
        entities = batch.entities._replace(drones=batch.entities.drones.copy())
        conditions["work"] = ACTING
        arrays = self.arrays._replace(conditions=conditions, applied=self.applied.copy())
        batch = batch._replace(worlds=batch.worlds.copy(), entities=entities)
        self._before(batch, arrays, np.ascontiguousarray(commands[None], np.int8), 0, 1)
        before, applied = self.conditions["heading"][0], arrays.applied[0]
        actions = np.where(applied == NO_ACTION, conditions["heading"][0], applied)
        return actions, (before != NO_ACTION) & (before == actions)

    def positions(self) -> NDArray[np.int64]:
        """Return the observed positions of the drones, (B, N, 2) as (x, y), a view."""
        numbers: NDArray[np.int64] = self.conditions.view(np.int64)
        return numbers.reshape(*self.conditions.shape, -1)[..., :2]

    def batch_infos(self, which: Any = slice(None)) -> dict[str, NDArray[Any]]:
        """Return the infos that faults, or limits of a drone's kind, add, by default (B, N) each.

        `status` is a number in `fault_kernels.STATUSES`; `action` is the drone's action in the last
        step, -1 for nothing; `battery` is in percent, present if batteries run down.

        Args:
            which: Index of the drones.
        """
        names = {"status": "status", "action": "applied"}
        if self.has_battery:
            names["battery"] = "battery"
        return {name: self.conditions[field][which].copy() for name, field in names.items()}

    def infos(self, world: int, drones: Sequence[int]) -> dict[str, list[Any]]:
        """Return the same for some drones of a world, with the name of `status`."""
        infos = {key: values.tolist() for key, values in self.batch_infos((world, drones)).items()}
        return {**infos, "status": [STATUSES[number] for number in infos["status"]]}
