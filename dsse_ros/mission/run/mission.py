# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The mission of `sim_node`, without ROS: the world, its commands, time and report."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.result import Rejected
from dsse_ros.mission.files.mission_snapshots import check_mission, possible_in
from dsse_ros.mission.live.beliefs import beliefs_of
from dsse_ros.mission.run.collided import nobody_left
from dsse_ros.mission.run.command_buffer import CommandBuffer
from dsse_ros.mission.run.mission_space import space_of
from dsse_ros.mission.vehicles.flown import Flown, yaw_of_heading
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief
from dsse_ros.search.environments.metres_drones import reported_wind
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import LOST

Place = tuple[float, float]
"""(col, row); fractions lie between cells."""
Velocity = tuple[float, float]
"""To the east and to the north, m/s."""

END_NS = 2**31 * 10**9
"""First mission time that does not fit into a message's stamp."""


@dataclass(frozen=True)
class StepResult:
    """Result of a step; all arrays are in the order of the agents.

    Attributes:
        step: Steps done, 0 right after a reset.
        stamp_ns: Mission time in nanoseconds, at least one step, because a stamp of 0 means "no
            time" in ROS. It never runs backwards.
        cells: (N, 2) int64 (col, row), as the drones observe them.
        actions: (N,) int8, actions that the drones did, `NO_ACTION` for nothing.
        commands: (N,) int8, commanded actions; equal to `actions` without faults.
        rewards: (N,) float64.
        terminated, truncated, found, held: (N,) bool.
        probabilities: (N,) float64, probability of the cell of each drone that searched, on the map
            before the step; 0 for the others.
        conditions: (N,) of `fault_kernels.CONDITIONS`, None without faults.
        flown: What the drones flew in metres, None if they move from cell to cell.
    """

    step: int
    stamp_ns: int
    cells: NDArray[np.int64]
    actions: NDArray[np.int8]
    commands: NDArray[np.int8]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    found: NDArray[np.bool_]
    held: NDArray[np.bool_]
    probabilities: NDArray[np.float64]
    conditions: NDArray[np.void] | None
    flown: Flown | None = None

    @property
    def places(self) -> NDArray[Any]:
        """(N, 2) (col, row) of the drones; in metres, fractions lie between cells."""
        return self.cells if self.flown is None else self.flown.places

    @property
    def yaws(self) -> list[float]:
        """(N,) where the drones point, radians from east to north; over cells all to the east."""
        if self.flown is None:
            return [0.0] * len(self.cells)
        return [yaw_of_heading(heading) for heading in self.flown.flights["heading"].tolist()]


HISTORY_DTYPE = np.dtype(
    [("reward", "<f8"), ("col", "<i2"), ("row", "<i2"), ("action", "i1"), ("terminated", "u1"),
     ("truncated", "u1"), ("found", "u1"), ("held", "u1")]
)  # fmt: skip
"""Record of a drone per step, packed, because a mission may have millions of steps.

In metres it also has `place`, (col, row) with fractions."""

_PLACE = ("place", "<f8", (2,))
_OF_RESULT = ("actions", "commands", "held", "probabilities")
_OF_FLOWN = ("actions", "paths", "looked")
"""Arrays of `Flown` that a snapshot has beside the world."""
_OF_MISSION = ("seed", "number", "aborted", "tracks", "lost", "_stamp_ns")


class Mission:
    """Successive searches on one environment, on cells or in metres.

    Args:
        env: The environment.
        seed: Seed of the first mission.
        belief: Whether a belief follows the mission. Without one, a search for persons has no
            `pos`; the coverage task has no belief.

    Attributes:
        env: The environment.
        space: What actions and goals are, on cells or in metres.
        commands: The commands of the drones.
        seed: Seed of the current mission.
        number: Missions started so far, 1 for the first.
        result: The last step's result.
        aborted: Whether the mission was aborted because commands were missing.
        tracks: For each drone, its places without consecutive repeats.
        lost: The lost drones, in the order of their losses.
        beliefs: The belief that follows the mission, None if none does.
        belief_map: Its map, None until it is needed, and after a change.
    """

    def __init__(self, env: SearchEnv, seed: int, *, belief: bool = True) -> None:
        self.env = env
        self.beliefs = beliefs_of(env.world) if belief else None
        self.belief_map: NDArray[np.float32] | None = None
        self.space = space_of(env)
        self.commands = CommandBuffer(self.space)
        in_metres = env.world.metres is not None
        self._history_dtype = np.dtype([*HISTORY_DTYPE.descr, *[_PLACE] * in_metres])
        self.seed = seed
        self.number = 0
        self.aborted = False
        self.tracks: list[list[Place]] = []
        self.lost: list[int] = []
        self._begun: NDArray[Any] | None = None
        self._next_wind_mps: Velocity | None = None
        self._past = bytearray()
        self._step_ns = max(round(env.scenario.step_duration_s * 1e9), 1)
        self._stamp_ns = 0
        self.result = self.reset(seed)

    def reset(self, seed: int) -> StepResult:
        """Start a new mission; mission time continues, or restarts every 34 years.

        In metres it begins in the scenario's wind.
        """
        self._next_wind_mps = None
        if self.env.world.metres is not None:
            self.env.world.set_wind(None)
        self.env.reset(seed=seed)
        if self.beliefs is not None:
            self.beliefs.reset()
        if self._stamp_ns > END_NS // 2:
            self._stamp_ns = 0
        self.seed = seed
        self.number += 1
        self.aborted, self._begun = False, None
        self.commands.clear()
        count = self.env.world.num_drones
        self.tracks = [[] for _ in range(count)]
        self.lost = []
        self._past.clear()
        nobody = np.zeros(count, bool)
        nothing = np.full(count, NO_ACTION, np.int8)
        self.result = self._result(nothing, nothing, nobody, np.zeros(count))
        return self.result

    def restart_time(self) -> None:
        """Restart mission time; the last step becomes its first."""
        self._stamp_ns = self._step_ns
        self.result = replace(self.result, stamp_ns=self._stamp_ns)

    @property
    def done(self) -> bool:
        """Whether the mission needs a reset before the next step."""
        return self.aborted or not self.live or self._stamp_ns + self._step_ns >= END_NS

    @property
    def steps(self) -> int:
        """Steps done within the limit, without the extra step at which time is out."""
        return min(self.result.step, int(self.env.scenario.timestep_limit or 0))

    @property
    def history(self) -> NDArray[Any]:
        """Every step so far, (step + 1, N), see `HISTORY_DTYPE`; row 0 is the start."""
        return np.vstack([self._rows_before(), self._packed(self.result)])

    def _rows_before(self) -> NDArray[Any]:
        """Return the history (step, N) without the last result, which may still change."""
        return np.frombuffer(bytes(self._past), self._history_dtype).reshape(-1, len(self.tracks))

    @property
    def all_lost(self) -> bool:
        """Whether every drone was lost: the next mission would lose them again."""
        return len(self.lost) == len(self.tracks)

    @property
    def outcome(self) -> str:
        """How the mission ended, "" while it continues."""
        if not self.done:
            return ""
        if self.aborted:
            return "aborted"
        if not self.env.scenario.has_persons and self.env.world.worlds["num_missing"][0] == 0:
            return "found: contact confirmed"
        result, rules, names = self.result, self.env.rules, self.env.possible_agents
        if rules.covers and self.env.world.worlds["num_missing"][0] == 0:
            return "all covered"
        all_found = rules.ends_together or self.env.world.persons[0]["found"].all()
        if all_found and result.found.any():
            return f"found by {', '.join(names[i] for i in np.flatnonzero(result.found))}"
        limit = rules.last_step(self.env.scenario.timestep_limit)
        # A mission whose stamps run out leaves drones in flight.
        if self.live or result.step > limit:
            return "out of time"
        if self.all_lost or not rules.ends_together:
            return nobody_left(names, self.history, collide=rules.collisions)
        return f"{', '.join(names[i] for i in np.flatnonzero(result.terminated))} terminated"

    @property
    def live(self) -> list[int]:
        """The drones in flight, none once the search has ended."""
        world = self.env.world
        if world.worlds["done"][0]:
            return []
        live: list[int] = np.flatnonzero(world.drones["alive"][0]).tolist()
        return live

    @property
    def pos(self) -> float | None:
        """Cumulative probability of success of the searches so far, None without a belief.

        This is the prior probability, regardless of the outcomes, that searches like these find the
        person, in the true cells of the drones; with several persons, the expected share found. See
        `belief.Belief`. In the coverage task it is `pos` of `coverage_task.Coverage`.
        """
        if self.beliefs is not None:
            return float(self.beliefs.pos[0])
        return self.coverage.get("pos")

    @property
    def pos_alive(self) -> float | None:
        """As `pos`, to find the person alive; None without `Incident.survival`."""
        alive = None if self.beliefs is None else self.beliefs.pos_alive
        return None if alive is None else float(alive[0])

    @property
    def coverage(self) -> dict[str, float]:
        """The metrics of the coverage task by name, see `coverage_task.Coverage`; else empty."""
        metrics = self.env.world.coverage_metrics()
        return {name: float(values[0]) for name, values in metrics.items()}

    def prepare_belief(self) -> None:
        """Compute the belief's tables, so that the first mission is as fast as later ones."""
        if self.beliefs is not None:
            self.beliefs.prepare()

    def belief(self) -> NDArray[np.float32]:
        """Return the probability of containment of the persons not found, (R, C) as [y, x].

        It is updated in the true cells of the drones, not the observed ones.

        Raises:
            ValueError: If no belief follows the mission.
        """
        if self.beliefs is None:
            raise ValueError("no belief follows the mission")
        if self.belief_map is None:
            self.belief_map = self.beliefs.write()[0]
        return self.belief_map

    def particles(self) -> tuple[NDArray[np.float32], NDArray[np.float64]] | None:
        """Return positions and weights of the belief, see `EnsembleBelief.particles`.

        None if the persons do not follow an ensemble, or no belief follows the mission.
        """
        belief = self._belief_of_ensemble()
        return None if belief is None else belief.particles()

    @property
    def poc_outside(self) -> float | None:
        """Probability of containment outside the grid and the area; None as in `particles`."""
        belief = self._belief_of_ensemble()
        return None if belief is None else belief.outside

    @property
    def object_shares(self) -> dict[str, float]:
        """Probability of each possible object of the incident; none if there is only one."""
        belief = self._belief_of_ensemble()
        return {} if belief is None else belief.object_shares

    def _belief_of_ensemble(self) -> EnsembleBelief | None:
        return None if self.beliefs is None else self.beliefs.of_ensemble(0)

    @property
    def missing(self) -> list[int]:
        """The drones in flight without a command; none once the step has begun."""
        if self._begun is not None:
            return []
        return self.commands.missing(self.live, self.result.cells)

    def refuse(self, drone: int | None = None) -> Rejected | None:
        """Return why a command for this drone, or for all, is refused now; None if it is not."""
        if self.done:
            return Rejected("mission_over", "the mission is over; call ~/reset for a new one")
        if drone is not None and not self.env.world.drones["alive"][0, drone]:
            return Rejected("drone_terminated", f"drone{drone} is terminated; it takes no commands")
        return None

    def command_all(self, actions: Sequence[Any]) -> None:
        """Set the next action of every drone in flight; None is no command."""
        for drone in self.live:
            if actions[drone] is not None:
                self.commands.set_action(drone, actions[drone])

    def send(self, drone: int, where: Any) -> Rejected | None:
        """Send a drone to a goal, see `MissionSpace.goal`; return why it cannot go there."""
        refused = self.space.refuse_goal(drone, where)
        if refused is None:
            self.commands.set_goal(drone, where)
        return refused

    def abort(self) -> None:
        """End the mission without another step."""
        self.aborted = True

    def lose(self, drone: int) -> bool:
        """Take out a drone whose vehicle has dropped out; return whether it was in flight.

        The drone counts as terminated from now on, in the last result too.
        """
        if self.done or not self.env.withdraw(drone):
            return False
        self.lost.append(drone)
        self.result = replace(self.result, terminated=self._terminated())
        return True

    def set_battery(self, drone: int, share: float) -> None:
        """Set the battery charge of a drone's vehicle, 1 when full; NaN changes nothing.

        If batteries run down, the next step starts from this charge.
        """
        faults = self.env.world.faults
        if faults is not None and math.isfinite(share):
            faults.set_battery(drone, 100.0 * share)

    @property
    def fallen(self) -> list[int]:
        """The drones lost by a simulated fault."""
        conditions = self.result.conditions
        if conditions is None:
            return []
        fallen: list[int] = np.flatnonzero(conditions["status"] == LOST).tolist()
        return fallen

    @property
    def begun(self) -> bool:
        """Whether the next step has begun: its commands do not change any more."""
        return self._begun is not None

    def begin(self, missing_action: str) -> NDArray[Any]:
        """Take the commands (N, ...) of the next step, which `advance` does; see there."""
        self._begun = self.commands.take(self.live, self.result.cells, missing_action)
        return self._begun

    def actions_of(self, joint: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return what the drones do in the next step, without doing it.

        Args:
            joint: (N, ...) their commands.

        Returns:
            (N, ...) the actions that they begin or continue, `NO_ACTION` for nothing; (N,) whether
            they continue them.
        """
        faults = self.env.world.faults
        if faults is None:
            return joint, np.zeros(len(joint), bool)
        return faults.begun(self.env.world.batch, joint)

    def set_work(self, work: NDArray[np.int8]) -> None:
        """Set what the vehicles still have to do for the next step, see `Faults.set_work`."""
        if self.env.world.faults is not None:
            self.env.world.faults.set_work(work)

    def set_viewpoints(self, viewpoints: NDArray[np.void]) -> None:
        """Set the viewpoints of drones on cells in the next step, (N,) of `VIEWPOINTS`."""
        if self.env.world.viewpoints is not None:
            self.env.world.viewpoints.preset(viewpoints)

    def ways(self, actions: NDArray[Any] | None) -> NDArray[np.float64]:
        """Return where actions (N, ...) lead without doing them, (N, P, 2) (col, row).

        None has the drones stay. In metres these are the points of their paths, with fractions; on
        cells P is 1, and a drone that may not enter a cell stays in its own.
        """
        return self.space.ways(actions, self.live)

    def set_flown(self, drone: int, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> None:
        """Have a drone in metres fly in the next step what its vehicle has flown.

        Args:
            drone: The drone.
            path: (K + 1, 2), see `MetresDrones.preset`.
            looked: (K + 1,).

        Raises:
            ValueError: If there are more or fewer points than in a path of the mission.
        """
        metres = self.env.world.metres
        if metres is None:
            return
        points = metres.paths.shape[2]
        if len(path) != points:
            raise ValueError(f"path must be {points} points, got {len(path)}")
        metres.preset(drone, path, looked)

    def report_wind(self, wind_mps: Velocity) -> None:
        """Take the wind that vehicles in metres report; a step that has begun ends as planned.

        Raises:
            FieldError: If it is not slower than the drones.
        """
        metres = self.env.world.metres
        if metres is None:
            return
        reported_wind(wind_mps, metres.airframes, metres.wind.step_s)
        if self.begun:
            self._next_wind_mps = wind_mps
        else:
            self.env.world.set_wind(wind_mps)

    def advance(self, missing_action: str) -> StepResult:
        """Do one step with the given commands; drones without one follow `missing_action`."""
        world = self.env.world
        live = world.drones["alive"][0].copy()
        missing = self.missing if missing_action == "hold" else []
        joint = self.begin(missing_action) if self._begun is None else self._begun
        joint = self.space.apply(joint, self.live)
        self._begun = None
        probabilities, faults = self._probabilities(), world.faults
        if self.beliefs is not None:
            self.beliefs.before_step(joint[None])
        self.env.advance(joint)
        if self.beliefs is not None:
            self.beliefs.after_step()
        self._past += self._packed(self.result).tobytes()
        done = joint if faults is None else faults.applied[0].copy()
        held = live & self.space.held(joint, missing)
        searching = live & (done == self.env.rules.action_set.search)
        self.result = self._result(done, joint, held, np.where(searching, probabilities, 0.0))
        self.commands.after_step()
        if self._next_wind_mps is not None:
            self.env.world.set_wind(self._next_wind_mps)
            self._next_wind_mps = None
        return self.result

    def snapshot(self, *, past: bool = True) -> Snapshot:
        """Return the complete mission, or all of it but history, tracks and belief."""
        of_world, result = self.env.snapshot(), self.result
        arrays = {name: getattr(result, name) for name in _OF_RESULT}
        extra = {name: getattr(self, name) for name in _OF_MISSION if past or name != "tracks"}
        extra["commands"] = self.commands.state()
        if self.env.world.metres is not None:
            extra["wind"] = list(self.env.world.metres.wind_mps)
            of_flown = {name: getattr(result.flown, name).copy() for name in _OF_FLOWN}
        else:
            of_flown = {}
        return Snapshot(
            of_world.identity,
            {
                **of_world.arrays,
                **{f"result_{name}": a.copy() for name, a in arrays.items()},
                **({"history": self._rows_before()} if past else {}),
                **(self.beliefs.arrays() if past and self.beliefs is not None else {}),
                **{f"result_{name}_m": array for name, array in of_flown.items()},
            },
            # The conversion through JSON makes a deep copy.
            json.loads(json.dumps(extra)),
        )

    def restore(self, snapshot: Snapshot) -> StepResult:
        """Continue from a snapshot, bit for bit; commands for its next step must be given again.

        Raises:
            SnapshotError: If it is not of a mission, or of another scenario or other rules, or its
                mission is impossible; the current mission stays as it is.
        """
        extra, arrays = snapshot.extra, snapshot.arrays
        if not {*_OF_MISSION, "commands"} <= extra.keys() or "history" not in arrays:
            raise SnapshotError("the snapshot is of a world, not of a mission")
        check_mission(snapshot, self.snapshot(), possible_in(self.env))
        if self.beliefs is None:
            self.env.restore(snapshot)
        else:
            self.beliefs.check(snapshot)
            before = replace(self.env.snapshot(), extra={})
            before.arrays.update(self.beliefs.arrays())
            self.env.restore(snapshot)
            try:
                self.beliefs.restore(snapshot)
            except (FieldError, SnapshotError) as error:
                self.env.restore(before)
                self.beliefs.restore(before)
                raise SnapshotError(str(error)) from None
        for name in _OF_MISSION:
            setattr(self, name, extra[name])
        self.tracks = [[(col, row) for col, row in track] for track in extra["tracks"]]
        self.commands.restore(extra["commands"])
        self._past = bytearray(arrays["history"].tobytes())
        self._begun, self._next_wind_mps = None, None
        metres = self.env.world.metres
        if metres is not None:
            self.env.world.set_wind(tuple(extra["wind"]))
            for name in _OF_FLOWN:
                getattr(metres, name)[0] = arrays[f"result_{name}_m"]
        self._stamp_ns -= self._step_ns
        self.result = self._result(*(arrays[f"result_{name}"] for name in _OF_RESULT))
        return self.result

    def _terminated(self) -> NDArray[np.bool_]:
        """Return the terminated drones (N,); lost drones count before the step that flags them."""
        terminated, _ = self.env.flags
        terminated[self.lost] = True
        return terminated

    def _probabilities(self) -> NDArray[np.float64]:
        """Return the probability of each drone's cell, the true one, 0 outside the grid."""
        drones, grid = self.env.world.drones[0], self.env.world.grid_size
        cells = np.stack([drones["x"], drones["y"]], axis=1)
        inside: NDArray[np.bool_] = np.all((cells >= 0) & (cells < grid), axis=1)
        col, row = np.where(inside[:, None], cells, 0).T
        return np.where(inside, self.env.probability[row, col], 0.0).astype(float)

    def _result(
        self,
        actions: NDArray[np.int8],
        commands: NDArray[np.int8],
        held: NDArray[np.bool_],
        probabilities: NDArray[np.float64],
    ) -> StepResult:
        world = self.env.world
        self.belief_map = None
        self._stamp_ns += self._step_ns
        cells = self.env.positions
        _, truncated = self.env.flags
        flown = None if world.metres is None else Flown.of_flights(world.metres)
        self._extend_tracks(cells, flown)
        return StepResult(
            step=int(world.worlds["t"][0]),
            stamp_ns=self._stamp_ns,
            cells=cells,
            actions=actions,
            commands=commands,
            rewards=world.rewards[0].copy(),
            terminated=self._terminated(),
            truncated=truncated,
            found=world.found[0].copy(),
            held=held,
            probabilities=probabilities,
            conditions=None if world.faults is None else world.faults.conditions[0].copy(),
            flown=flown,
        )

    def _extend_tracks(self, cells: NDArray[np.int64], flown: Flown | None) -> None:
        """Add what the drones did in the last step to their tracks."""
        places = cells if flown is None else flown.places
        for drone, (track, (col, row)) in enumerate(zip(self.tracks, places.tolist(), strict=True)):
            if track and track[-1] == (col, row):
                continue
            if track and flown is not None:
                between = flown.paths[drone, 1:-1] / self.env.scenario.cell_size - 0.5
                track += map(tuple, between.tolist())
            track.append((col, row))

    def _packed(self, result: StepResult) -> NDArray[Any]:
        """Return the history's record of a step, (N,)."""
        row = np.zeros(len(result.cells), self._history_dtype)
        row["col"], row["row"] = result.cells.T
        row["action"], row["reward"] = result.actions, result.rewards
        for flag in ("terminated", "truncated", "found", "held"):
            row[flag] = getattr(result, flag)
        if result.flown is not None:
            row["place"] = result.places
        return row
