# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planners in metres: `belief`, `greedy` and the search patterns.

Their observations and infos are those of `SearchEnv`.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.matching import best_pairs
from dsse_ros.planners.metres_patterns import (
    Datum,
    Layout,
    TrackGuidance,
    tracks_along,
    tracks_of,
)
from dsse_ros.planners.metres_plans import MetresPlans, MetresSwarm
from dsse_ros.planners.options import BeamOptions, Options, PatternOptions
from dsse_ros.planners.planner import DrawsNothing, Infos, Plans, Search
from dsse_ros.planners.search_plan.plan_file import PlannedUnit, read_plan
from dsse_ros.planners.search_plan.plan_in_mission import PlanInMission
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief, EnsembleForecast, PathsFlown
from dsse_ros.search.belief.weighing import weigh
from dsse_ros.search.environments.metres_drones import detectors_of_kinds, strips_of, wind_of
from dsse_ros.search.step.cell_tracks import Draw
from dsse_ros.search.step.metres_paths import MOTION_STATES, airframes_of, pieces_of, shares_of
from dsse_ros.search.step.metres_steering import steer
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.scenario.swarm import number_of

if TYPE_CHECKING:
    from typing_extensions import Self

Floats = NDArray[np.float64]
Observations: TypeAlias = Mapping[str, Any]
"""A state and a map by live agent, see `SearchEnv`."""
Actions: TypeAlias = dict[str, NDArray[np.float32]]
"""A turn and a speed by agent, (2,) each from -1 to 1."""

TOLERANCE = 1 / 8
"""Greatest distance of a drone that can hover from its track, in track spacings."""
CLOSENESS = 0.7
"""Factor on the probability of a cell for each step's flight to it."""


def swarm_of(scenario: ResolvedScenario) -> MetresSwarm:
    """Return the drones of a scenario, and where they fly."""
    area = np.ones(scenario.grid_size.matrix, np.bool_)
    return MetresSwarm(
        airframes_of(scenario.kinds),
        detectors_of_kinds(scenario),
        np.array(scenario.kind_of, np.int64),
        wind_of(scenario),
        scenario.grid_size.extent(scenario.cell_size),
        area if scenario.area_mask is None else np.ascontiguousarray(scenario.area_mask),
    )


def _paths_flown(swarm: MetresSwarm, observations: Observations, infos: Infos) -> PathsFlown:
    """Return what the drones flew in the last step."""
    numbers = [number_of(agent) for agent in observations]
    of_each = [infos[agent] for agent in observations]
    points, count = len(of_each[0]["path"]), len(swarm.kinds)
    paths, looked = np.zeros((count, points, 2)), np.zeros((count, points), np.bool_)
    flown, found = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    paths[numbers], flown[numbers] = [info["path"] for info in of_each], True
    found[numbers] = [bool(info.get("finds", info.get("found_person"))) for info in of_each]
    by_vehicles = "looked" in of_each[0]
    if by_vehicles:
        looked[numbers] = [info["looked"] for info in of_each]
    return PathsFlown(
        swarm.detectors, swarm.kinds, paths, flown, found, looked if by_vehicles else None
    )


def flights_of(observations: Observations, swarm: MetresSwarm) -> NDArray[np.void]:
    """Return the state of each observed drone, (N,) of `MOTION_STATES`."""
    flights = np.zeros(len(observations), MOTION_STATES)
    for flight, (agent, (state, _)) in zip(flights, observations.items(), strict=True):
        east, south, heading_east, heading_north, speed = np.asarray(state, np.float64)
        cruise = swarm.airframes[swarm.kinds[number_of(agent)]]["cruise"]
        flight["east"], flight["south"] = east * swarm.extent.width, south * swarm.extent.height
        flight["heading"], flight["speed"] = math.atan2(heading_east, heading_north), speed * cruise
    return flights


class MetresPlanner:
    """Keeps the steps of a mission and turns what a subclass wants into actions; a `Planner`.

    It restarts if it recognizes a new mission: the step number is not greater than the last one.

    Args:
        search: The rules and the scenario.
        seed: Seed of the draws.

    Attributes:
        drawn: See `Shareable`.
    """

    drawn = False

    def __init__(self, search: Search, *, seed: int = 0) -> None:
        self._search, self._seed = search, seed
        self._step = -1

    def __call__(self, observations: Observations, infos: Infos) -> Actions:
        """Return the turn and the speed of every observed drone; see `Planner`."""
        if not observations:
            return {}
        info = infos[next(iter(observations))]
        step = info.get("step", self._search.steps_done)
        step = self._step + 1 if step is None else int(step)
        begins = step <= self._step or self._step < 0
        if begins:
            self._scenario = self._search.mission_scenario.resolve(self._search.rules)
            self._swarm = swarm_of(self._scenario)
        self._fly_in(info.get("wind"))
        if begins:
            self._start(observations, step)
        else:
            self._learn(observations, infos, step)
        self._step = step
        return {
            agent: np.array(action, np.float32)
            for agent, action in self._decide(observations, infos).items()
        }

    def plans(self) -> Plans:
        """See `Planning`."""
        return {
            agent: ahead / self._scenario.cell_size - 0.5 for agent, ahead in self._ahead().items()
        }

    def copy(self) -> Self:
        """Return an independent copy in the same state."""
        return copy.copy(self)

    def with_seed(self, seed: int) -> Self:
        """Return a copy that draws with this seed."""
        twin = self.copy()
        twin._seed = seed
        return twin

    @property
    def _steps_left(self) -> int:
        return max(self._scenario.timestep_limit - self._step, 1)

    def _fly_in(self, wind_mps: tuple[float, float] | None) -> None:
        """Plan in this wind from now on, see `SearchEnv`; None for the last one."""
        if wind_mps is not None:
            east, north = wind_mps
            wind = self._swarm.wind._replace(east=east, south=-north)
            self._swarm = self._swarm._replace(wind=wind)

    def _start(self, observations: Observations, step: int) -> None:
        """Begin a mission that is observed for the first time after these steps."""

    def _learn(self, observations: Observations, infos: Infos, step: int) -> None:
        """Learn from what has happened since the last observation."""

    def _decide(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return the action of each drone."""
        raise NotImplementedError

    def _ahead(self) -> dict[str, Floats]:
        """Return where the drones will be, in turn, (M, 2) each, metres to the east and south."""
        raise NotImplementedError

    def _shares(self, observations: Observations, chosen: Floats) -> dict[str, Any]:
        """Return turns in radians and airspeeds, (N, 2), as actions."""
        swarm, actions = self._swarm, {}
        for agent, (turn, speed) in zip(observations, chosen.tolist(), strict=True):
            airframe = swarm.airframes[swarm.kinds[number_of(agent)]]
            actions[agent] = shares_of(airframe, turn, speed, swarm.wind.step_s)
        return actions

    def _airframes(self, observations: Observations) -> NDArray[np.void]:
        """Return how each drone flies, (N,) of `AIRFRAMES`."""
        kinds = self._swarm.kinds[[number_of(agent) for agent in observations]]
        return self._swarm.airframes[kinds]


class MetresBelief(MetresPlanner):
    """The planner `belief` in metres: keeps a belief, and plans on it; see `MetresPlans`.

    With a search plan, drones that fly its units follow their tracks. The others plan as if persons
    whom its units will find were not there. What other units have searched counts as their times
    pass; in a live search, as it is reported.

    Args:
        search: The rules and the scenario.
        options: Options of the beam search.
        seed: Seed of the scenarios drawn.

    Attributes:
        belief: The belief at the last observation, None before the first.

    Raises:
        FieldError: If the search plan is not for this search.
    """

    def __init__(self, search: Search, options: BeamOptions, *, seed: int = 0) -> None:
        super().__init__(search, seed=seed)
        self._options, self._living = options, options.living(search.scenario)
        self._units: list[PlannedUnit] = []
        self._live = False
        if options.plan:
            self._units = read_plan(options.plan, search.scenario.resolve(search.rules))
        self.belief: EnsembleBelief | None = None
        self._paths: dict[str, Floats] = {}

    def copy(self) -> Self:
        """Return an independent copy in the same state; the forecast is shared."""
        twin = super().copy()
        if self.belief is not None:
            twin.belief, twin._plans = self.belief.copy(), self._plans.copy()
        return twin

    def with_seed(self, seed: int) -> Self:
        """Return a copy whose plans draw with this seed."""
        twin = super().with_seed(seed)
        if self.belief is not None:
            twin._plans = self._plans.with_seed(seed)
        return twin

    def forecasts(self, scenario: ResolvedScenario) -> EnsembleForecast:
        """Return the forecast of a scenario, see `OnBelief`."""
        return EnsembleForecast(scenario, self._search.rules, draw=Draw.PLANNING)

    def _start(self, observations: Observations, step: int) -> None:
        if self._options.plan:
            self._units = read_plan(self._options.plan, self._scenario)
        self._live = False
        self._take_over(self.forecasts(self._scenario).belief())
        self._skip(step)

    def _take_over(self, belief: EnsembleBelief) -> None:
        """Go on from a belief."""
        before, self.belief = self.belief, belief.copy()
        if before is not None and before.forecast is belief.forecast:
            return
        self._plan = PlanInMission(self._units, belief.forecast)
        positions = belief.forecast.tracks.particles_m
        assert positions is not None
        multiplier = float(np.mean(self._scenario.person_pod_multipliers))
        self._plans = MetresPlans(
            self._swarm, positions, self._options, multiplier=multiplier, seed=self._seed,
            appearances=belief.forecast.appearances,
        )  # fmt: skip

    def _ahead(self) -> dict[str, Floats]:
        return self._paths

    def _skip(self, step: int) -> None:
        """Let the steps pass in which nobody knows what the drones did."""
        assert self.belief is not None
        while self.belief.step < step:
            self._advance()

    def _advance(self) -> None:
        """Advance the belief by a step, in which other units of the plan have searched."""
        assert self.belief is not None
        if self._units and not self._live:
            begins_s, step_s = self._time_s(self.belief.step), self._swarm.wind.step_s
            missed = self._plan.missed_by_others(begins_s, begins_s + step_s)
            weigh(self.belief, missed, searched=True)
        self.belief.advance()

    def _time_s(self, step: int) -> float:
        """Return the time after so many steps."""
        return step * self._swarm.wind.step_s

    def _learn(self, observations: Observations, infos: Infos, step: int) -> None:
        assert self.belief is not None
        if step == self._step + 1:
            self.belief.update_in_passing(_paths_flown(self._swarm, observations, infos))
        self._skip(step)

    def _decide(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        swarm, began_s = self._swarm, time.monotonic()
        info = infos[next(iter(observations))]
        if "belief" in info:
            self._live = True
            self._take_over(info["belief"])
        assert self.belief is not None
        limit_s = info.get("decision_time_s", math.inf)
        numbers = [number_of(agent) for agent in observations]
        flights, live = (
            np.zeros(len(swarm.kinds), MOTION_STATES),
            np.zeros(len(swarm.kinds), np.bool_),
        )
        flights[numbers], live[numbers] = flights_of(observations, swarm), True
        flown = [number for number in numbers if number in self._plan.ways]
        live[flown] = False
        paths, actions = self._follow(flights, flown)
        if live.any():
            belief = self.belief.of_living() if self._living else self.belief
            weights = belief.of_missing().sum(axis=0)
            if self._units:
                weights = weights * self._plan.left(self._time_s(self.belief.step))
            planned = self._plans(
                flights,
                weights,
                self.belief.forecast.first_step + self.belief.step,
                self._steps_left,
                wind=swarm.wind,
                live=live,
                deadline_s=began_s + limit_s,
            )
            self.drawn = True
            for number in np.flatnonzero(live).tolist():
                paths[number], actions[number] = planned.paths[number, 1:], planned.actions[number]
        self._paths = {agent: paths[number_of(agent)] for agent in observations}
        return {agent: actions[number_of(agent)] for agent in observations}

    def _follow(
        self, flights: NDArray[np.void], numbers: list[int]
    ) -> tuple[dict[int, Floats], dict[int, Any]]:
        """Return the paths to come and the actions of drones that fly units of the plan.

        Each flies straight to where its unit is at the end of the step.
        """
        swarm = self._swarm
        if not numbers:
            return {}, {}
        assert self.belief is not None
        after_s, ends_s = map(self._time_s, (self.belief.step + 1, self._scenario.timestep_limit))
        ways = [self._plan.ways[number] for number in numbers]
        airframes = swarm.airframes[swarm.kinds[numbers]]
        goals = np.stack([way.places_at(np.array(after_s)) for way in ways])
        path = np.empty((pieces_of(airframes, swarm.wind.step_s) + 1, 2))
        chosen = steer(airframes, swarm.wind, swarm.extent, flights[numbers], goals, True, path)
        paths, actions = {}, {}
        for number, way, goal, airframe, (turn, speed) in zip(
            numbers, ways, goals, airframes, chosen.tolist(), strict=True
        ):
            paths[number] = np.vstack([goal, way.between(after_s, ends_s).points])
            actions[number] = np.array(shares_of(airframe, turn, speed, swarm.wind.step_s))
        return paths, actions


def goals_on_map(
    probability: NDArray[np.floating],  # type: ignore[type-arg]
    flights: NDArray[np.void],
    cell_m: float,
    legs_m: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the centre of a cell for each drone, (N, 2), metres to the east and to the south.

    Among the remaining drones and cells, the pair is matched with the greatest probability times
    `CLOSENESS` to the power of the distance. A drone without a cell flies to the grid's middle.

    Args:
        probability: (R, C) as [row, col].
        flights: (N,) of `metres_paths.MOTION_STATES`.
        cell_m: Side of a cell.
        legs_m: (N,) float64, the flight of a step.
    """
    grid = GridShape.of(probability)
    easts, souths = ((np.arange(size) + 0.5) * cell_m for size in grid)
    east = easts - flights["east"][:, None, None]
    south = souths[:, None] - flights["south"][:, None, None]
    worth = probability * CLOSENESS ** (np.hypot(east, south) / legs_m[:, None, None])
    goals = np.tile(np.array(grid.extent(cell_m)) / 2, (len(flights), 1))
    # A cell without probability is none to fly to.
    worth[worth <= 0.0] = -1.0
    for drone, row, col in best_pairs(worth):
        goals[drone] = easts[col], souths[row]
    return goals


class MetresGreedy(DrawsNothing, MetresPlanner):
    """The planner `greedy` in metres: each drone flies to a likely cell near it.

    See `goals_on_map` for the cells.
    """

    def __init__(self, search: Search, options: Options, *, seed: int = 0) -> None:
        MetresPlanner.__init__(self, search, seed=seed)
        self._goals: dict[str, Floats] = {}

    def _ahead(self) -> dict[str, Floats]:
        return self._goals

    def _decide(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        flights, airframes = flights_of(observations, self._swarm), self._airframes(observations)
        _, probability = next(iter(observations.values()))
        wind = self._swarm.wind
        goals = goals_on_map(
            np.where(self._swarm.area, probability, 0.0), flights, self._scenario.cell_size,
            airframes["cruise"] * wind.step_s,
        )  # fmt: skip
        self._goals = dict(zip(observations, goals[:, None], strict=True))
        path = np.empty((pieces_of(airframes, wind.step_s) + 1, 2))
        chosen = steer(airframes, wind, self._swarm.extent, flights, goals, False, path)
        return self._shares(observations, chosen)


class MetresPattern(DrawsNothing, MetresPlanner):
    """A search pattern in metres, about a datum that drifts; see `metres_patterns`.

    Args:
        search: The rules and the scenario.
        options: Of the pattern; without any, it covers as much as the drones can search.
        name: A key of `metres_patterns.LAYOUTS`.
        seed: Makes no difference.
    """

    def __init__(self, search: Search, options: Options, *, name: str, seed: int = 0) -> None:
        MetresPlanner.__init__(self, search, seed=seed)
        self._name, self._options = name, options
        self._guidance: TrackGuidance | None = None

    def copy(self) -> Self:
        """Return an independent copy in the same state."""
        twin = MetresPlanner.copy(self)
        if self._guidance is not None:
            twin._guidance = self._guidance.copy()
        return twin

    def _start(self, observations: Observations, step: int) -> None:
        self._numbers = {agent: k for k, agent in enumerate(observations)}
        self._begun = step
        airframes, flights = self._airframes(observations), flights_of(observations, self._swarm)
        starts = np.stack([flights["east"], flights["south"]], axis=1)
        datum = self._datum(step)
        spacing = min(strips_of(self._scenario))
        time_s = (self._scenario.timestep_limit - step) * self._swarm.wind.step_s
        layout = Layout(
            len(flights), spacing, float(airframes["cruise"].min()) * time_s, self._swarm.extent,
            datum.covariance,
        )  # fmt: skip
        pattern = self._options.pattern if isinstance(self._options, PatternOptions) else None
        if pattern is None:
            tracks = tracks_of(self._name, datum, layout, starts, airframes["cruise"])
        else:
            tracks = tracks_along(pattern, datum, layout, starts, airframes["cruise"])
        self._guidance = TrackGuidance(
            tracks, datum, airframes, self._swarm.wind, self._swarm.extent, TOLERANCE * spacing
        )

    def _datum(self, step: int) -> Datum:
        """Return the mean of the persons' particles, or the given cell, and their drift."""
        scenario, rules = self._scenario, self._search.rules
        forecast = EnsembleForecast(scenario, rules, draw=Draw.PLANNING)
        positions, weights = forecast.tracks.particles_m, forecast.weights
        assert positions is not None
        left = scenario.timestep_limit - step
        rows = [forecast.row(forecast.first_step + step + k) for k in (0, left // 2, left)]
        known = np.isfinite(positions[rows]).all(axis=(0, 2)) & (weights > 0.0)
        share = weights[known] / weights[known].sum()
        begin, middle, end = positions[rows][:, known].astype(np.float64)
        drift = share @ (end - begin) / (left * scenario.step_duration_s)
        mean = share @ begin
        away = middle - share @ middle
        if isinstance(self._options, PatternOptions) and self._options.datum is not None:
            mean = (np.array(self._options.datum) + 0.5) * scenario.cell_size
        return Datum(mean, drift, (away * share[:, None]).T @ away)

    def _ahead(self) -> dict[str, Floats]:
        if self._guidance is None:
            return {}
        ahead = self._guidance.ahead(self._step - self._begun, self._steps_left)
        return {agent: ahead[n] for agent, n in self._numbers.items() if agent in self._observed}

    def _decide(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        assert self._guidance is not None
        self._observed = frozenset(observations)
        numbers = np.array([self._numbers[agent] for agent in observations])
        chosen = self._guidance(
            flights_of(observations, self._swarm), self._step - self._begun, numbers,
            wind=self._swarm.wind,
        )  # fmt: skip
        return self._shares(observations, chosen)
