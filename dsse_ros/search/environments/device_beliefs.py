# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The beliefs of B worlds on a CUDA device, each after the searches of its world."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import cuda

from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.belief.filters import DRIFT_SAMPLES
from dsse_ros.search.belief.forecasts import is_ensemble
from dsse_ros.search.belief.look_kernels import StepDone
from dsse_ros.search.belief.motion_kernels import ROW
from dsse_ros.search.environments import device_belief_kernels
from dsse_ros.search.environments.device_belief_kernels import DeviceLooks, DeviceMass, DeviceTables
from dsse_ros.search.environments.device_worlds import DeviceArray, DeviceWorlds
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.targets.motion import STEPS

SHARED_BYTES = 48 << 10
"""Shared memory of a block, which holds a layer of a belief."""


def check_belief(world: World) -> None:
    """Raise unless a device can follow what drones observe of this search.

    Raises:
        FieldError: If it cannot.
    """
    rules, scenario = world.rules, world.scenario
    noisy = world.faults is not None and world.faults.is_noisy
    reason = None
    if rules.covers or is_ensemble(rules):
        reason = f"with rules {rules.profile}"
    elif scenario.person_amount > 1:
        reason = f"with {scenario.person_amount} persons"
    elif noisy:
        reason = "with position_noise"
    if reason is not None:
        raise FieldError(f"observe must be map with device cuda {reason}, got 'belief'")


class DeviceBeliefs:
    """The posterior of each world after its searches, as `WorldBeliefs`, for a single person.

    Args:
        worlds: The worlds to follow.

    Attributes:
        tables: The tables for their missions, on the device.

    Raises:
        FieldError: If the device cannot follow them, see `check_belief`, or grid or forecast are
            too large.
    """

    def __init__(self, worlds: DeviceWorlds) -> None:
        check_belief(worlds.template)
        self._worlds = worlds
        self._scenario: ResolvedScenario | None = None
        self.place()
        entities = worlds.template.batch.entities
        most = worlds.template.num_drones * int(
            np.diff(entities.look_starts, axis=1).max(initial=0)
        )
        batch = worlds.num_worlds
        self._looks = DeviceLooks(
            cuda.device_array((batch, most, 2), np.int64),
            cuda.device_array((batch, most), np.int64),
            cuda.device_array((batch, 3), np.int64),
        )
        drifts, cells = self.tables.start.shape
        self._mass = DeviceMass(
            cuda.device_array((batch, drifts, cells)),
            cuda.device_array((batch, cells)),
            cuda.to_device(np.ones(batch)),
            cuda.to_device(np.zeros(batch)),
        )

    def place(self) -> None:
        """Compute the tables for the placed values of the worlds, if they have changed.

        Raises:
            FieldError: As the class.
        """
        world = self._worlds.template
        scenario = world.placed_scenario()
        if scenario == self._scenario:
            return
        forecast = Forecast(scenario, world.rules, drift_samples=DRIFT_SAMPLES)
        last = forecast.first_step + world.rules.last_step(scenario.timestep_limit)
        shared = 8 * forecast.padded.cells
        if len(forecast.moves.directions) <= last or shared > SHARED_BYTES:
            raise FieldError(
                "grid_size must be smaller, or the steps fewer, with observe belief and device "
                f"cuda, got {scenario.grid_size} and {scenario.timestep_limit}"
            )
        self._scenario = scenario
        self._padded = forecast.padded
        self.tables = self._make_tables(forecast, last)

    def _make_tables(self, forecast: Forecast, last: int) -> DeviceTables:
        forecast.prepare(last)
        device_belief_kernels.complete_steps(
            forecast.constants, forecast.sea, forecast.moves, np.empty(ROW)
        )
        own_drift = bool(forecast.constants["own_drift"][0])
        sources = np.zeros((STEPS, forecast.padded.cells) if own_drift else (1, 0), np.int16)
        if own_drift:
            device_belief_kernels.write_sources(forecast.constants, forecast.area, sources)
        arrays = DeviceTables(
            Belief(forecast).of_missing(), forecast.moves.chances, forecast.moves.tables,
            forecast.moves.directions, sources,
            np.ascontiguousarray(self._worlds.template.looks.pods[:, 0]),
            np.array([forecast.first_step]),
        )  # fmt: skip
        return DeviceTables(*map(cuda.to_device, arrays))

    def follow(self, steps: DeviceArray) -> None:
        """Update the beliefs of the worlds that stepped, (B,) bool."""
        worlds = self._worlds
        rules, faults = worlds.template.rules, worlds.faults
        # Faults can make drones deviate from commands; the actions that they did count.
        actions = worlds.actions if faults is None else faults.applied
        done = StepDone(worlds.batch, actions, worlds.before.alive, worlds.before.done)
        threads = device_belief_kernels.THREADS
        shared = 8 * max(self._padded.cells, threads)
        device_belief_kernels.follow[worlds.num_worlds, threads, 0, shared](
            done, self._mass, self.tables, self._looks, steps, self._padded.columns,
            bool(rules.one_find_per_search), self.tables.sources.size > 0,
        )  # fmt: skip

    def write(self, out: DeviceArray) -> None:
        """Write the probability of every cell to (B, R, C) float32, as [y, x]."""
        threads = device_belief_kernels.THREADS
        device_belief_kernels.write_beliefs[self._worlds.num_worlds, threads](self._mass, (out,))

    def pos(self) -> DeviceArray:
        """Return the POS of each mission, (B,) float64, a copy."""
        out: Any = cuda.device_array(self._worlds.num_worlds)
        out.copy_to_device(self._mass.pos)
        return out
