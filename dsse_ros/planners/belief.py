# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners that remember where drones have searched: they decide on a belief, not on the map.

The rules alone determine the map that drones observe. These planners know the rules and the
scenario, so they know the map in advance. From an observation they use the drones' cells, and from
their own commands they know which searches have failed. If the observed map differs from the
expected one, they learn the drift from it.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.avoidance import approach
from dsse_ros.planners.beam_search import BeamSearch, steps_planned
from dsse_ros.planners.masking import is_returning, is_under_way, masked_moves
from dsse_ros.planners.matching import best_pairs
from dsse_ros.planners.options import BeamOptions, BeliefOptions
from dsse_ros.planners.planner import (
    Cell,
    DecisionPoint,
    DrawsNothing,
    Infos,
    Observations,
    Planning,
    Plans,
    Search,
    Tactic,
    TacticFactory,
    cells_of,
    probability_of,
)
from dsse_ros.search.belief.belief import Forecast
from dsse_ros.search.belief.drift_estimate import FIRST_OBSERVED, DriftEstimate
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief
from dsse_ros.search.belief.forecasts import forecast_for, is_ensemble
from dsse_ros.search.belief.protocol import TargetBelief, TargetForecast
from dsse_ros.search.step.cell_tracks import Draw
from dsse_ros.search.step.looks import Looked, looks_of
from dsse_ros.world.scenario.actions import ActionSet, connected_components
from dsse_ros.world.scenario.fault_fields import hold_up
from dsse_ros.world.scenario.probable_cells import datum_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.scenario.swarm import Swarm, number_of

DRIFT_SAMPLES = 16
"""Angles of the persons' own drift in the belief of a tactic; one more costs as much as the first.
"""
CLOSENESS = 0.7
"""Factor of `GreedyOnBelief` on the probability of a cell for each move to it."""


class GreedyOnBelief(DrawsNothing):
    """Sends each drone to a likely cell near it, a different one for each drone.

    Among the remaining drones and cells, the tactic matches the pair with the greatest probability
    times `CLOSENESS` to the power of the distance. A drone searches where it is if its next cell
    is another drone's present or already chosen cell.

    Args:
        forecast: Forecast of the mission.
        seed: Makes no difference.
    """

    def __init__(self, forecast: TargetForecast, *, seed: int = 0) -> None:
        self._swarm = Swarm.of_scenario(forecast.scenario, forecast.rules)

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the cell that each drone goes to; see `Tactic`."""
        actions = self._swarm.actions_of(at.agents)
        return approach(actions, at.present, self._goals(actions, at.present, at.belief.poc()))

    def _goals(
        self, actions: Sequence[ActionSet], present: Sequence[Cell], likely: NDArray[np.float64]
    ) -> list[Cell]:
        """Return a goal for each drone."""
        grid = GridShape.of(likely)
        away = np.stack(
            [
                able.distances(cell, grid, as_if_open=True)
                for able, cell in zip(actions, present, strict=True)
            ]
        )
        worth = likely * CLOSENESS**away
        for drones, component in connected_components(actions, present):
            if component is not None:
                worth[drones] = np.where(component, worth[drones], -1.0)
        goals = list(present)
        # Drones that are left without a cell are not observed in the area.
        for drone, row, col in best_pairs(worth):
            goals[drone] = (col, row)
        return goals


class Forecasts:
    """Makes the forecasts that beliefs need.

    It keeps two for later missions: the first, and the one with the drift that was learned last.

    Args:
        rules: The rules of the search.
        horizon: Of the forecasts.
        drift_samples: Of the forecasts.
    """

    def __init__(self, rules: Rules, horizon: int, drift_samples: int) -> None:
        self._rules = rules
        self._horizon, self._drift_samples = horizon, drift_samples
        self._kept: list[TargetForecast] = []

    def __call__(self, scenario: ResolvedScenario) -> TargetForecast:
        """Return the forecast of a scenario."""
        for forecast in self._kept:
            if forecast.scenario == scenario:
                return forecast
        forecast = forecast_for(
            scenario,
            self._rules,
            horizon=self._horizon,
            drift_samples=self._drift_samples,
            draw=Draw.PLANNING,
        )
        before = self._kept[-1] if self._kept else None
        if isinstance(forecast, Forecast) and isinstance(before, Forecast):
            # A forecast with a learned drift predicts the maps observed so far.
            forecast.take_over(before)
        self._kept = [*self._kept[:1], forecast]
        return forecast


class BeliefPlanner:
    """Keeps the belief of a mission and commands what a tactic chooses; a `Planner`.

    A drone whose action takes several steps is under way meanwhile. The tactic plans for it again
    in each of them, from the cell in which it arrives.

    The planner restarts if it recognizes a new mission: the step number is not greater than the
    last one. Without step numbers, it recognizes one by a drone that is not where its command could
    have led, or by cells and a map equal to those of the first observation.

    Args:
        search: The rules and the scenario.
        new_tactic: Makes the tactic of a mission, which chooses the drones' next cells.
        seed: Seed of the tactic.
        horizon: Steps that the tactic looks ahead.
        drift_samples: Angles of the persons' own drift, see `Forecast`.
        learn_drift: Whether to learn the drift if the observed map is not the expected one. The
            planner does not learn it if drones observe the belief instead of the map
            (`Search.observed`), if no drift explains the maps, or if persons follow an ensemble.
        living: Whether only persons who are still alive count, see `EnsembleBelief.of_living`.

    Attributes:
        belief: The belief at the last observation, None before the first. Its drift is
            `belief.forecast.scenario.vector`.
        forecasts: Planners with the same tactic that decide in turn, step by step, may share one.
        drawn: See `Shareable`.

    Raises:
        ValueError: If search or a straight move is missing in the rules.
    """

    def __init__(
        self,
        search: Search,
        new_tactic: TacticFactory,
        *,
        seed: int = 0,
        horizon: int = 0,
        drift_samples: int = DRIFT_SAMPLES,
        learn_drift: bool = True,
        living: bool = False,
    ) -> None:
        self._living = living
        self._search = search
        self._new_tactic = new_tactic
        self._seed = seed
        self.forecasts = Forecasts(search.rules, horizon, drift_samples)
        self._swarm = Swarm.of_scenario(search.scenario, search.rules).with_moves()
        self._may_be_held_up = self._swarm.may_be_under_way or hold_up(search.scenario)
        self._learn_drift = (
            learn_drift and search.observed == "map" and not is_ensemble(search.rules)
        )
        self._drift: DriftEstimate | None = None
        self._done: list[list[tuple[Looked, bool]]] = []
        self._forecast: TargetForecast | None = None
        self._tactic: Tactic | None = None
        self._commanded: dict[str, tuple[Cell, Cell]] = {}
        self._first: tuple[list[Cell], NDArray[np.float32]] | None = None
        self.belief: TargetBelief | None = None
        self.drawn = False

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        began_s = time.monotonic()
        agents, present = list(observations), cells_of(observations)
        step = self._step(infos[agents[0]])
        if self._is_new_mission(agents, present, probability_of(observations), step):
            self._start(present, probability_of(observations))
        else:
            self._follow(self._looked(dict(zip(agents, present, strict=True)), infos))
        assert self.belief is not None
        while step is not None and self.belief.step < step:
            # The planner does not know what the drones did in a step that it has not observed.
            self._follow([])
        if "belief" in infos[agents[0]]:
            self._take_over(infos[agents[0]]["belief"])
        self._observe_map(probability_of(observations))
        assert self._tactic is not None
        limit_s = infos[agents[0]].get("decision_time_s", math.inf)
        cells = dict(zip(agents, present, strict=True))
        ends = dict(cells)
        if steered := [agent for agent in agents if not is_returning(infos[agent])]:
            batteries = [infos[a]["battery"] for a in steered if "battery" in infos[a]]
            # A drone under way keeps to the move that it has begun, so it plans from its end.
            bound = {
                a: self._end_of_way(cells[a], infos[a]) for a in steered if is_under_way(infos[a])
            }
            here = [bound.get(a, cells[a]) for a in steered]
            belief = self.belief
            if self._living and isinstance(belief, EnsembleBelief):
                belief = belief.of_living()
            chosen = self._tactic(
                DecisionPoint(belief, steered, here, began_s + limit_s, batteries)
            )
            self.drawn = self.drawn or self._tactic.drawn
            ends |= dict(zip(steered, chosen, strict=True)) | bound
            if self._may_be_held_up:
                # A drone may fail to leave its cell.
                occupied = {cells[agent] for agent in steered}
                ends |= {agent: cells[agent] for agent in steered if ends[agent] in occupied}
        commands = masked_moves(cells, list(ends.values()), infos, self._swarm)
        self._commanded = {
            agent: (cell, self._swarm.actions.end(cell, commands[agent]))
            for agent, cell in cells.items()
        }
        return commands

    def plans(self) -> Plans:
        """See `Planning`; empty if the tactic has none."""
        return self._tactic.plans() if isinstance(self._tactic, Planning) else {}

    def _end_of_way(self, cell: Cell, info: Mapping[str, Any]) -> Cell:
        """Return the cell in which the action of a drone under way ends."""
        return self._swarm.actions.end(cell, int(np.argmax(info["action_mask"])))

    def copy(self) -> BeliefPlanner:
        """Return an independent copy in the same state; the forecasts are shared."""
        twin = copy.copy(self)
        twin._done = list(self._done)
        twin._drift = copy.deepcopy(self._drift)
        if self.belief is not None and self._tactic is not None:
            twin.belief, twin._tactic = self.belief.copy(), self._tactic.copy()
        return twin

    def with_seed(self, seed: int) -> BeliefPlanner:
        """Return a copy whose tactic draws with this seed."""
        twin = self.copy()
        twin._seed = seed
        if self._tactic is not None:
            twin._tactic = self._tactic.with_seed(seed)
        return twin

    def _step(self, info: Mapping[str, Any]) -> int | None:
        """Return the number of steps done, None if unknown."""
        step = info.get("step", self._search.steps_done)
        return None if step is None else int(step)

    def _is_new_mission(
        self,
        agents: Sequence[str],
        present: list[Cell],
        probability: NDArray[np.float32],
        step: int | None,
    ) -> bool:
        if self.belief is None or self._first is None:
            return True
        if step is not None:
            return step <= self.belief.step
        if not all(
            cell in self._commanded.get(agent, ())
            for agent, cell in zip(agents, present, strict=True)
        ):
            return True
        cells, first_map = self._first
        return self.belief.step > 0 and present == cells and np.array_equal(probability, first_map)

    def _follow(self, looks: list[tuple[Looked, bool]]) -> None:
        """Update the belief by one step, with each look and whether it found anyone."""
        assert self.belief is not None
        self._done.append(looks)
        self.belief.update([look for look, found in looks if not found])
        for look, found in looks:
            if found:
                self.belief.observe_find(look)
        self.belief.advance()

    def _take_over(self, belief: TargetBelief) -> None:
        """Go on from a belief of the present step that somebody else has computed."""
        assert self.belief is not None
        if belief.forecast is not self.belief.forecast:
            self._forecast = belief.forecast
            self._tactic = self._new_tactic(belief.forecast, seed=self._seed)
        self.belief, self._drift = belief.copy(), None

    def _observe_map(self, probability: NDArray[np.float32]) -> None:
        """Record the observed datum; learn the drift if the datum is not where it was expected."""
        assert self.belief is not None and self._forecast is not None
        steps = self._forecast.first_step + self.belief.step
        if self._drift is None or steps < FIRST_OBSERVED:
            return
        datum = datum_of(probability)
        self._drift.observe(steps, datum)
        if datum == self._forecast.most_probable(steps):
            return
        vector = self._drift.vector()
        if vector is None:
            self._drift = None
            return
        steps_before, self._done = self._done, []
        self._forecast_for(self._scenario.override(vector=vector).resolve(self._search.rules))
        for looks in steps_before:
            self._follow(looks)

    def _start(self, present: list[Cell], probability: NDArray[np.float32]) -> None:
        self._scenario = self._search.mission_scenario.resolve(self._search.rules)
        self._done = []
        self._looks = looks_of(self._scenario, self._search.rules)
        self._drift = None
        if self._learn_drift:
            self._drift = DriftEstimate(self._scenario, self._search.rules)
        self._forecast_for(self._scenario)
        self._first = present, probability.copy()

    def _forecast_for(self, scenario: ResolvedScenario) -> None:
        """Restart the belief and the tactic for a scenario."""
        self._forecast = forecast = self.forecasts(scenario)
        if self.belief is None or self.belief.forecast is not forecast:
            self.belief = forecast.belief()
        else:
            self.belief.reset()
        self._tactic = self._new_tactic(forecast, seed=self._seed)

    def _looked(self, present: Mapping[str, Cell], infos: Infos) -> list[tuple[Looked, bool]]:
        """Return the looks of the last step, and whether each has found a person.

        A reported find has not ended the mission, as other persons are missing. A drone has done
        the action in its info, else the commanded one. A drone that is no longer there was
        withdrawn and has done nothing. A drone that is not observed where its action leads has
        not done it or, if drones observe wrong positions, has done it in an unknown cell.
        """
        looked = []
        for agent, cell in present.items():
            if agent not in self._commanded:
                continue
            info, (before, end) = infos[agent], self._commanded[agent]
            actions = self._swarm.actions
            if "look" in info:
                action, *cell = info["look"]
            else:
                action = info.get("action", actions.action(before, end))
            if not 0 <= action < len(actions):
                continue
            if "look" not in info and cell != actions.end(before, action):
                continue
            finds = int(info.get("finds", info.get("found_person", False)))
            looks = self._looks.done(number_of(agent), action, cell)
            looked += [(look, bool(finds >> k & 1)) for k, look in enumerate(looks)]
        return looked


def make_belief(search: Search, options: BeamOptions, *, seed: int) -> BeliefPlanner:
    """Return the planner `belief`: beam search on the belief, with scenarios drawn by this seed.

    Raises:
        FieldError: If it is to fly a search plan.
    """
    if options.plan:
        raise FieldError(
            f"plan must be given with rules in metres, such as flight, got rules "
            f"{search.rules.profile}"
        )
    return BeliefPlanner(
        search, partial(BeamSearch, options=options), seed=seed, learn_drift=options.learn_drift,
        horizon=steps_planned(search.rules, options.horizon),
        living=options.living(search.scenario),
    )  # fmt: skip


def make_belief_greedy(search: Search, options: BeliefOptions, *, seed: int) -> BeliefPlanner:
    """Return the planner `belief_greedy`: each drone goes to a likely cell near it."""
    return BeliefPlanner(search, GreedyOnBelief, learn_drift=options.learn_drift)
