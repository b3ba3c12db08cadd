# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners that remember where was searched: they decide on a belief, not on the map.

The drones observe a map that the rules alone draw. These planners know the rules and the scenario,
so that they know the map in advance; of an observation they use the drones' cells, and from their
own commands they know what was searched in vain. Where the observed map is another one than they
expect, they learn the drift from it.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief import Forecast
from dsse_ros.belief.beliefs import forecast_for, is_ensemble
from dsse_ros.belief.drift_estimate import FIRST_OBSERVED, DriftEstimate
from dsse_ros.belief.protocol import TargetBelief, TargetForecast
from dsse_ros.planners.beam_search import BeamOptions, BeamSearch
from dsse_ros.planners.heeding import heed_masks, is_aloft
from dsse_ros.planners.planner import (
    AgentObservation,
    Cell,
    Search,
    cells_of,
    number_of,
    probability_of,
)
from dsse_ros.scenario.probable_cells import most_probable
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.step.looks import Looked, looks_of


class Tactic(Protocol):
    """Chooses on a belief where the drones of one mission go."""

    def __call__(
        self,
        belief: TargetBelief,
        agents: Sequence[Hashable],
        present: Sequence[Cell],
        deadline_s: float = math.inf,
        batteries: Sequence[float] = (),
    ) -> list[Cell]:
        """Return the cell that each drone goes to; its own one means that it searches it.

        Args:
            belief: What it chooses on.
            agents: The live drones.
            present: Their cells.
            deadline_s: When to answer with the best so far, on the clock of `time.monotonic`.
            batteries: What is in the batteries of the drones, percent; empty where they do not run
                down.
        """
        ...

    @property
    def drawn(self) -> bool:
        """Whether its seed has counted so far."""
        ...

    def copy(self) -> Tactic:
        """Return one that goes on by itself from here."""
        ...

    def with_seed(self, seed: int) -> Tactic:
        """Return a copy as if it had been started with this seed; it must not have drawn yet."""
        ...


class TacticFactory(Protocol):
    """Makes a tactic for each mission.

    Attributes:
        drift_samples: K of its forecasts, see `Forecast`.
    """

    @property
    def drift_samples(self) -> int: ...  # noqa: D102

    def horizon(self, rules: Rules) -> int:
        """Return how many steps it looks ahead."""
        ...

    def start(self, forecast: TargetForecast, seed: int) -> Tactic:
        """Return the tactic for a mission."""
        ...


class GreedyOnBelief:
    """Sends each drone to a cell that is likely and near, another one for each.

    Of all drones and cells that are left, the pair goes together whose probability times
    `closeness` to the power of the distance is greatest. A drone whose next cell is another
    drone's present or already chosen cell searches where it is.
    """

    drift_samples = 16
    closeness = 0.7
    drawn = False

    def horizon(self, rules: Rules) -> int:
        """Return 0: it looks at the present."""
        return 0

    def start(self, forecast: TargetForecast, seed: int) -> GreedyOnBelief:
        """Return the tactic for a mission; it draws nothing."""
        area = forecast.scenario.area_mask
        self._actions = forecast.rules.action_set.within(area).with_moves()
        return self

    def copy(self) -> GreedyOnBelief:
        """Return itself: it remembers nothing."""
        return self

    def with_seed(self, seed: int) -> GreedyOnBelief:
        """Return itself."""
        return self

    def __call__(
        self,
        belief: TargetBelief,
        agents: Sequence[Hashable],
        present: Sequence[Cell],
        deadline_s: float = math.inf,
        batteries: Sequence[float] = (),
    ) -> list[Cell]:
        """Return the cell that each drone goes to; see `Tactic`."""
        taken = set(present)
        ends = []
        for cell, goal in zip(present, self._goals(belief.poc(), present), strict=True):
            end = self._actions.towards(cell, goal)
            if end in taken:
                end = cell
            taken.add(end)
            ends.append(end)
        return ends

    def _goals(self, likely: NDArray[np.float64], present: Sequence[Cell]) -> list[Cell]:
        """Return a goal for each drone."""
        size = len(likely)
        line = np.arange(size)
        away = np.abs(line - np.array(present)[..., None])
        across, down = away[:, 0, None, :], away[:, 1, :, None]
        moves = np.maximum(across, down) if self._actions.diagonal else across + down
        worth = likely * self.closeness**moves
        for drones, water in self._actions.by_water(present):
            if water is not None:
                worth[drones] = np.where(water, worth[drones], -1.0)
        goals = list(present)
        for _ in range(min(len(present), size * size)):
            drone, row, col = np.unravel_index(int(np.argmax(worth)), worth.shape)
            goals[drone] = (int(col), int(row))
            worth[drone] = -1.0
            worth[:, row, col] = -1.0
        return goals


class Forecasts:
    """Makes the forecasts that beliefs need.

    It keeps two for the missions to come: the first, and that of the drift that was last learned.

    Args:
        rules: The rules of the search.
        tactic: Says how they are made.
    """

    def __init__(self, rules: Rules, tactic: TacticFactory) -> None:
        self._rules = rules
        self._tactic = tactic
        self._kept: list[TargetForecast] = []

    def __call__(self, scenario: ResolvedScenario) -> TargetForecast:
        """Return the forecast of a scenario."""
        for forecast in self._kept:
            if forecast.scenario == scenario:
                return forecast
        made = forecast_for(
            scenario,
            self._rules,
            horizon=self._tactic.horizon(self._rules),
            drift_samples=self._tactic.drift_samples,
        )
        before = self._kept[-1] if self._kept else None
        if isinstance(made, Forecast) and isinstance(before, Forecast):
            # With a learned drift the map was what is now expected, until the last step.
            made.take_over(before)
        self._kept = [*self._kept[:1], made]
        return made


class BeliefPlanner:
    """Keeps the belief of a mission and commands what a tactic chooses; a `Planner`.

    Its tactic plans as if each drone got to the next cell in a step. A drone that is slower than
    others is under way for some steps, and planned for again in each of them.

    A new mission makes it start anew: a step of it that is not later than the last one, or, where
    no step is given, drones that are not where they can be or everything as at the start.

    Args:
        search: What it may know: rules and scenario.
        tactic: Chooses.
        seed: Of what the tactic draws.
        learn_drift: Whether it learns the drift when the observed map is not the expected one. It
            does not where the belief is observed instead of the map (`Search.observed`), nor once
            no drift explains the maps, nor where persons follow an ensemble.

    Attributes:
        belief: The belief at the last observation, None before the first; the drift it is made with
            is `belief.forecast.scenario.vector`.
        forecasts: Planners with one tactic that decide in turn, step by step, may share theirs.
        drawn: See `SharedPlanner`.

    Raises:
        ValueError: If search or a straight move is missing in the rules.
    """

    def __init__(
        self, search: Search, tactic: TacticFactory, *, seed: int = 0, learn_drift: bool = True
    ) -> None:
        self._search = search
        self._factory = tactic
        self._seed = seed
        self.forecasts = Forecasts(search.rules, tactic)
        self._actions = search.rules.action_set.with_moves()
        self._may_be_held_up = search.scenario.may_be_held_up
        self._has_slower_drones = search.scenario.has_slower_drones
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

    def __call__(
        self,
        observations: Mapping[str, AgentObservation],
        infos: Mapping[str, Mapping[str, Any]],
    ) -> dict[str, int]:
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
            # Nothing is known of what was done in a step that was not observed.
            self._follow([])
        self._observe_map(probability_of(observations))
        assert self._tactic is not None
        limit_s = infos[agents[0]].get("decision_time_s", math.inf)
        cells = dict(zip(agents, present, strict=True))
        ends = dict(cells)
        if steered := [agent for agent in agents if not is_aloft(infos[agent])]:
            batteries = [infos[a]["battery"] for a in steered if "battery" in infos[a]]
            chosen = self._tactic(
                self.belief, steered, [cells[a] for a in steered], began_s + limit_s, batteries
            )
            self.drawn = self.drawn or self._tactic.drawn
            ends |= zip(steered, chosen, strict=True)
            if self._may_be_held_up:
                # What a drone is about to leave may not get free.
                occupied = {cells[agent] for agent in steered}
                ends |= {agent: cells[agent] for agent in steered if ends[agent] in occupied}
        self._commanded = {agent: (cell, ends[agent]) for agent, cell in cells.items()}
        actions = {agent: self._actions.action(cell, ends[agent]) for agent, cell in cells.items()}
        return heed_masks(actions, cells, infos, self._actions, apart=self._has_slower_drones)

    def copy(self) -> BeliefPlanner:
        """Return one that goes on by itself from here; the forecasts are shared."""
        twin = copy.copy(self)
        twin._done = list(self._done)
        twin._drift = copy.deepcopy(self._drift)
        if self.belief is not None and self._tactic is not None:
            twin.belief, twin._tactic = self.belief.copy(), self._tactic.copy()
        return twin

    def with_seed(self, seed: int) -> BeliefPlanner:
        """Return a copy whose tactic draws by this seed."""
        twin = self.copy()
        twin._seed = seed
        if self._tactic is not None:
            twin._tactic = self._tactic.with_seed(seed)
        return twin

    def _step(self, info: Mapping[str, Any]) -> int | None:
        """Return the steps done, None if not known."""
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
        """Let the belief do one step with these looks, and whether each has found anyone."""
        assert self.belief is not None
        self._done.append(looks)
        self.belief.update([look for look, found in looks if not found])
        for look, found in looks:
            if found:
                self.belief.observe_find(look)
        self.belief.advance()

    def _observe_map(self, probability: NDArray[np.float32]) -> None:
        """Note where the datum is; learn the drift if it is not where it was expected."""
        assert self.belief is not None and self._forecast is not None
        steps = self._forecast.first_step + self.belief.step
        if self._drift is None or steps < FIRST_OBSERVED:
            return
        datum = most_probable(probability, 1)[0]
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
        """Start belief and tactic anew for a scenario."""
        self._forecast = forecast = self.forecasts(scenario)
        if self.belief is None or self.belief.forecast is not forecast:
            self.belief = forecast.belief()
        else:
            self.belief.reset()
        self._tactic = self._factory.start(self._forecast, self._seed)

    def _looked(
        self, present: Mapping[str, Cell], infos: Mapping[str, Mapping[str, Any]]
    ) -> list[tuple[Looked, bool]]:
        """Return the looks of the last step, and whether each has found a person.

        A find that is known has not ended the mission: there are others. What a drone has done is
        what its info says, else what it was commanded. One that is no longer there has done
        nothing: it was withdrawn. One that is observed elsewhere than its action leads to has not
        done it, or, where drones observe wrong positions, it is not known where.
        """
        looked = []
        for agent, cell in present.items():
            if agent not in self._commanded:
                continue
            info, (before, end) = infos[agent], self._commanded[agent]
            action = info.get("action", self._actions.action(before, end))
            if not 0 <= action < len(self._actions):
                continue
            dx, dy = self._actions.moves[action]
            if cell != (before[0] + dx, before[1] + dy):
                continue
            finds = int(info.get("finds", info.get("found_person", False)))
            looks = self._looks.done(number_of(agent), action, cell)
            looked += [(look, bool(finds >> k & 1)) for k, look in enumerate(looks)]
        return looked


class BeamOnBelief:
    """Makes `BeamSearch` for each mission.

    Args:
        options: How a plan is searched.
    """

    def __init__(self, options: BeamOptions) -> None:
        self._options = options
        self.drift_samples = options.drift_samples

    def horizon(self, rules: Rules) -> int:
        """Return how many steps it looks ahead."""
        horizon = self._options.completed(rules).horizon
        assert horizon is not None
        return horizon

    def start(self, forecast: TargetForecast, seed: int) -> BeamSearch:
        """Return the tactic for a mission."""
        return BeamSearch(forecast, self._options, seed=seed)


def make_belief(
    search: Search, *, seed: int = 0, learn_drift: bool = True, **options: Any
) -> BeliefPlanner:
    """Return the planner `belief`: beam search on the belief.

    Args:
        search: What it may know: rules and scenario.
        seed: Of the scenarios it draws.
        learn_drift: See `BeliefPlanner`.
        options: Fields of `BeamOptions`.
    """
    tactic = BeamOnBelief(BeamOptions(**options))
    return BeliefPlanner(search, tactic, seed=seed, learn_drift=learn_drift)


def make_belief_greedy(search: Search, *, seed: int = 0, learn_drift: bool = True) -> BeliefPlanner:
    """Return the planner `belief_greedy`: each drone goes to a likely cell near it.

    Args:
        search: What it may know: rules and scenario.
        seed: Not used, it draws nothing.
        learn_drift: See `BeliefPlanner`.
    """
    return BeliefPlanner(search, GreedyOnBelief(), seed=seed, learn_drift=learn_drift)
