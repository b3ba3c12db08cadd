# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Policies trained elsewhere: neural networks in ONNX files, run by onnxruntime (extra `onnx`).

A model has any of these inputs, all float32 with the drones as the first axis:

| Input | Shape | What it is |
| --- | --- | --- |
| `position` | (N, 2) | each drone's cell (x, y) over G - 1 |
| `positions` | (N, 2M) | cells of all M drones over G - 1, its own swapped with the first |
| `number` | (N, 1) | each drone's number, from 0 |
| `probability` | (N, G, G) | the map [y, x] over its maximum, a square, see `encode` |
| `action_mask` | (N, A) | 0 where a move would leave the grid or the area |
| `drift` | (N, 2) | mean drift of the map (x, y), cells per step |
| `time` | (N, 1) | steps done over the time limit |
| `spread` | (N, 2) | standard deviation of the map along x and y, cells |
| `dispersion_inc` | (N, 1) | its growth, cells per step |

The last four come from the scenario; a drift that was learned from the maps replaces its drift. In
`positions`, a drone that is out of the search keeps its last cell. The first output is (N, A):
a score of each action. A drone does the action with the highest score among those that its mask
allows. The metadata `dsse_ros` of the file is a JSON object with `actions` (their names by number),
`rules` (the name of the profile). It has `grid_size` and `num_drones` if the model fits one size
only, and `pod`, the lowest and highest POD of a look, if it was tried on these only. With
`"observe": "belief"`, `probability` is the belief: if drones observe the map, the planner keeps its
own belief. With `"avoid_collisions": true`, the planner never sends a drone into another one's
cell: a drone that has to give way searches where it is.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.base.json_reader import read_json
from dsse_ros.planners.avoidance import resolve_actions
from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.masking import apply_masks
from dsse_ros.planners.mission_watch import MissionWatch
from dsse_ros.planners.options import OnnxOptions
from dsse_ros.planners.planner import (
    Cell,
    DecisionPoint,
    DrawsNothing,
    Infos,
    Observations,
    Planner,
    Search,
    cells_of,
    probability_of,
)
from dsse_ros.search.belief.protocol import TargetForecast
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES
from dsse_ros.search.environments.wrappers import own_first
from dsse_ros.search.step.constants import area_of, constants_of
from dsse_ros.search.step.looks import searches_of
from dsse_ros.search.step.masks import mask_table
from dsse_ros.world.scenario.actions import ActionSet
from dsse_ros.world.scenario.env_options import OBSERVED
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import SPECS, ResolvedScenario
from dsse_ros.world.scenario.swarm import Swarm

try:
    import onnxruntime
except ImportError as error:
    raise ImportError(f"{error}; {pip_install('onnx')}") from error

SHIPPED = Path(__file__).parents[1] / "models" / "v2.onnx"
"""The model of this package."""

METADATA = "dsse_ros"
"""Key of the file's metadata."""

INPUTS = (
    "position", "positions", "number", "probability", "action_mask",
    "drift", "time", "spread", "dispersion_inc",
)  # fmt: skip
"""Inputs that a model may have."""


class Policy:
    """The policy of a model in one mission.

    Args:
        session: The model.
        apart: The actions of the search, to keep drones out of one another's cells; else None.
    """

    def __init__(
        self, session: onnxruntime.InferenceSession, apart: ActionSet | None = None
    ) -> None:
        self._session, self._apart = session, apart
        self._inputs = [tensor.name for tensor in session.get_inputs()]
        # Cells of all drones, including those out of the search.
        self._cells: dict[Hashable, Cell] = {}

    def copy(self) -> Policy:
        """Return an independent copy in the same state; the model is shared."""
        twin = copy.copy(self)
        twin._cells = dict(self._cells)
        return twin

    def forget(self) -> None:
        """Forget the drones of the last mission."""
        self._cells = {}

    def __deepcopy__(self, memo: dict[int, Any]) -> Policy:
        return self.copy()

    def actions(
        self,
        present: Mapping[Any, Cell],
        probability: NDArray[np.float32],
        masks: NDArray[np.int8],
        known: Mapping[str, Sequence[float]],
    ) -> list[int]:
        """Return the allowed action with the highest score for every live drone.

        A drone that has to give way searches where it is.

        Args:
            present: Cells of the live drones.
            probability: (R, C), the map [y, x].
            masks: (N, A), action masks of the live drones.
            known: What is known of the scenario, see `known_of`.
        """
        self._cells.update(present)
        names = list(self._cells)
        numbers = [names.index(name) for name in present]
        inputs = encode(list(self._cells.values()), numbers, probability, masks, known)
        scores = np.asarray(self._session.run(None, {k: inputs[k] for k in self._inputs})[0])
        if scores.shape != masks.shape:
            raise ValueError(
                f"model must give scores {masks.shape}, one per drone and action, got "
                f"{scores.shape}"
            )
        # A mask that allows nothing counts as no mask.
        barred = (masks == 0) & masks.any(axis=1, keepdims=True)
        best: list[int] = np.where(barred, -np.inf, scores).argmax(axis=1).tolist()
        if self._apart is None:
            return best
        return resolve_actions(self._apart, list(present.values()), best)


class OnnxPlanner(DrawsNothing):
    """Flies a policy on the drones' observations.

    Args:
        policy: The policy.
        search: The rules and the scenario.
        swarm: What the drones can do, to keep them apart if some may be under way; None for
            a policy that does not.
    """

    def __init__(self, policy: Policy, search: Search, swarm: Swarm | None = None) -> None:
        self._policy, self._search, self._swarm = policy, search, swarm
        self._watch = MissionWatch(search)
        # Of the mission, where neither the search nor the infos count them.
        self._calls = 0

    def copy(self) -> OnnxPlanner:
        """Return an independent copy in the same state; the model is shared."""
        twin = copy.copy(self)
        twin._watch, twin._policy = self._watch.copy(), self._policy.copy()
        return twin

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every drone, see `Planner`."""
        if not observations:
            return {}
        if self._watch.is_new(observations, infos):
            self._policy.forget()
            self._calls = 0
        present = dict(zip(observations, cells_of(observations), strict=True))
        masks = np.stack([infos[name]["action_mask"] for name in observations])
        step = infos[next(iter(observations))].get("step", self._search.steps_done)
        scenario = self._search.mission_scenario.resolve(self._search.rules)
        known = known_of(scenario, self._search.rules, self._calls if step is None else int(step))
        self._calls += 1
        chosen = self._policy.actions(present, probability_of(observations), masks, known)
        actions = dict(zip(observations, chosen, strict=True))
        if self._swarm is None or not self._swarm.may_be_under_way:
            return actions
        return apply_masks(actions, present, infos, self._swarm)


class OnnxOnBelief(DrawsNothing):
    """Flies a policy on a belief; a `Tactic`.

    Args:
        forecast: Forecast of the mission.
        new_policy: Makes the policy.
        seed: Makes no difference.
    """

    def __init__(
        self, forecast: TargetForecast, new_policy: Callable[[], Policy], *, seed: int = 0
    ) -> None:
        scenario, rules = forecast.scenario, forecast.rules
        self._policy, self._swarm = new_policy(), Swarm.of_scenario(scenario, rules)
        self._known = partial(known_of, scenario, rules)
        self._masks = mask_table(constants_of(scenario, rules), area_of(scenario)[0])
        self._able = np.array([actions.able for actions in self._swarm.of_kinds], np.int8)

    def copy(self) -> OnnxOnBelief:
        """Return an independent copy in the same state; the model is shared."""
        twin = copy.copy(self)
        twin._policy = self._policy.copy()
        return twin

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the cell that each drone goes to; see `Tactic`."""
        belief, agents, present, *_ = at
        kinds = [self._swarm.kind_of(agent) for agent in agents]
        masks = np.stack([self._masks[row][col] for col, row in present]) * self._able[kinds]
        probability = belief.poc().astype(np.float32)
        cells, known = dict(zip(agents, present, strict=True)), self._known(belief.step)
        chosen = self._policy.actions(cells, probability, masks, known)
        return self._swarm.actions.ends(present, chosen)


def known_of(scenario: ResolvedScenario, rules: Rules, step: int) -> dict[str, Sequence[float]]:
    """Return what a scenario says of the map after so many steps of the mission, by input."""
    map_steps = scenario.pre_search_steps + rules.reset_sea_steps + step
    growth = scenario.dispersion_inc
    grown = max(map_steps - 1, 0) * growth
    return {
        "drift": scenario.drift,
        "time": (step / scenario.timestep_limit,),
        "spread": (scenario.sigma_x + grown, scenario.sigma_y + grown),
        "dispersion_inc": (growth,),
    }


def encode(
    cells: Sequence[Cell],
    numbers: Sequence[int],
    probability: NDArray[np.float32],
    masks: NDArray[np.int8],
    known: Mapping[str, Sequence[float]],
) -> dict[str, NDArray[np.float32]]:
    """Return the inputs of a model for some of the drones.

    Args:
        cells: (col, row) of all M drones.
        numbers: The N drones to act.
        probability: (R, C), the map [y, x]. Models see a square: on another grid it has as many
            cells a side as the longer side, with nothing beyond the grid.
        masks: (N, A), action masks of the N drones.
        known: What is known of the scenario, see `known_of`.
    """
    grid = GridShape.of(probability)
    beyond = ((0, grid.longer - grid.rows), (0, grid.longer - grid.columns))
    probability = np.pad(probability, beyond)
    places = np.asarray(cells, np.float32) / max(grid.longer - 1, 1)
    likely = probability / max(float(probability.max()), float(np.finfo(np.float32).tiny))
    own = np.asarray(numbers)
    inputs = {
        "position": places[own],
        "positions": own_first(places)[own].reshape(len(own), -1),
        "number": own[:, np.newaxis],
        "probability": np.repeat(likely[np.newaxis], len(own), axis=0),
        "action_mask": masks,
        **{name: np.tile(value, (len(own), 1)) for name, value in known.items()},
    }
    return {name: np.ascontiguousarray(value, np.float32) for name, value in inputs.items()}


def read_model(model: str = "") -> onnxruntime.InferenceSession:
    """Return the model in an ONNX file, by default that of this package.

    Raises:
        FieldError: If the file is missing or unreadable, or the model has an unknown input.
    """
    path = Path(model).expanduser() if model else SHIPPED
    if not path.is_file():
        raise FieldError(f"model must be an ONNX file, got {shown(model)}: no such file")
    options = onnxruntime.SessionOptions()
    # One thread: the same sums in the same order on any machine, and all other cores stay free.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(str(path), options, ["CPUExecutionProvider"])
    except Exception as error:  # The exception classes of onnxruntime are not public.
        reason = reason_of(error)
        raise FieldError(f"model must be an ONNX file, got {shown(model)}: {reason}") from None
    unknown = [tensor.name for tensor in session.get_inputs() if tensor.name not in INPUTS]
    if unknown:
        raise FieldError(
            f"model must have inputs among {', '.join(INPUTS)}, got {shown(unknown[0])}"
        )
    return session


def make_onnx(search: Search, options: OnnxOptions, *, seed: int) -> Planner:
    """Return the planner of a model; the seed makes no difference.

    Raises:
        FieldError: If the model cannot be read, or does not fit the search.
    """
    session = read_model(options.model)
    stated = _metadata(session.get_modelmeta().custom_metadata_map, search)
    swarm = Swarm.of_scenario(search.scenario, search.rules) if stated["avoid_collisions"] else None
    new_policy = partial(Policy, session, None if swarm is None else swarm.actions)
    if stated["observe"] == "belief" and search.observed == "map":
        # As many drift samples as in environments that observe the belief.
        return BeliefPlanner(
            search, partial(OnnxOnBelief, new_policy=new_policy), drift_samples=DRIFT_SAMPLES
        )
    return OnnxPlanner(new_policy(), search, swarm)


def _metadata(metadata: Mapping[str, str], search: Search) -> dict[str, Any]:
    """Return the metadata of a model, with `observe` set to `map` or `belief`.

    Raises:
        FieldError: If the metadata is missing, or does not fit the search.
    """
    try:
        stated = read_json(metadata[METADATA], METADATA)
        actions, rules = list(stated["actions"]), stated["rules"]
    except (KeyError, TypeError, ValueError):
        raise FieldError(
            f"model: metadata {METADATA!r} must be a JSON object with actions and rules, got none"
        ) from None
    scenario = search.scenario.resolve(search.rules)
    of_search = {
        "actions": list(search.rules.actions),
        "rules": search.rules.profile,
        "num_drones": scenario.num_drones,
    }
    of_model = {"avoid_collisions": False, **stated, "actions": actions, "rules": rules}
    observed = str(OBSERVED.check("model: observe", of_model.get("observe", search.observed)))
    if observed == "map":
        of_search["observe"] = search.observed
    if "grid_size" in of_model:
        shape = SPECS["grid_size"].check("model: grid_size", of_model["grid_size"])
        of_search["grid_size"], of_model["grid_size"] = list(scenario.grid_size), list(shape)
    for name, value in of_search.items():
        if of_model.get(name, value) != value:
            raise FieldError(
                f"model must have {name} {value!r}, as the search has, got {shown(of_model[name])}"
            )
    _check_pods(of_model.get("pod"), scenario, search.rules)
    return {**of_model, "observe": observed}


def _check_pods(stated: object, scenario: ResolvedScenario, rules: Rules) -> None:
    """Raise unless every POD of a search is in the range of a model; None for any POD.

    Raises:
        FieldError: If a POD is outside, or the range is not one.
    """
    if stated is None:
        return
    try:
        low, high = map(float, stated)  # type: ignore[call-overload]
    except (TypeError, ValueError):
        raise FieldError(
            f"model: pod must be the lowest and highest POD, got {shown(stated)}"
        ) from None
    pods = [pod for _, of_persons in searches_of(scenario, rules, [(0, 0)]) for pod in of_persons]
    for pod in pods:
        if not low <= pod <= high:
            raise FieldError(
                f"model is for a POD of {low:g} to {high:g}, got {pod:g}; "
                "the planner belief takes any"
            )
