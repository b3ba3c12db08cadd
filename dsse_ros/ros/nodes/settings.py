# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the nodes beyond the scenario and the rules, as checked fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dsse_ros.base.fields import FieldError, Spec, check_all, field, shown, specs
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.mission.run.command_buffer import MISSING_ACTIONS
from dsse_ros.planners.registry import DEFAULT_PLANNER, PLANNER_NAMES
from dsse_ros.vehicles.fleet.vehicle_time import FOLLOWED, VehicleTimeSettings
from dsse_ros.world.scenario.limits import LARGEST_GRID_CELLS, MAX_ID, MAX_SEED
from dsse_ros.world.scenario.rules import AUTO, PROFILES, Rules
from dsse_ros.world.scenario.scenario import Scenario

LARGEST_AUTO_GRID = 50
"""Cells a side of the largest grid whose missions have a belief without being asked for one."""


@dataclass(frozen=True, kw_only=True)
class SimSettings(VehicleTimeSettings):
    """Settings of `sim_node`.

    Raises:
        FieldError: If a value is not allowed.
    """

    max_cells: int = field(
        "int",
        "Maximum number of cells of a grid.",
        LARGEST_GRID_CELLS,
        low=1,
        high=10**8,
    )
    step_mode: str = field(
        "str",
        "What starts a step: all commands, time, or the service ~/step.",
        "lockstep",
        choices=("lockstep", "realtime", "manual"),
    )
    step_rate: float = field(
        "float",
        "Steps per second of wall time. Lockstep: at most, 0 for no limit. Realtime: exactly, 0 "
        "for real_time_factor / step duration.",
        0.0,
        low=0,
        high=1e6,
        unit="Hz",
    )
    command_timeout: float = field(
        "float",
        "Lockstep: wall time to wait for commands, 0 for no limit.",
        0.0,
        low=0,
        high=1e6,
        unit="s",
    )
    missing_action: str = field(
        "str",
        "What a drone without a command does.",
        "search",
        choices=MISSING_ACTIONS,
    )
    auto_reset: bool = field(
        "bool", "Whether the next mission, with the next seed, starts by itself.", False
    )
    exit_at_end: bool = field("bool", "Whether the node exits after the last mission.", False)
    real_time_factor: float = field(
        "float", "Realtime: simulated seconds per second of wall time.", 1.0, above=0, high=1e6
    )
    seed: int = field(
        "int", "Seed of the mission that a reset starts; -1 draws one.", -1, low=-1, high=MAX_SEED
    )
    run_id: int = field(
        "int",
        "Number of this run of the node, not 0; -1 draws one.",
        -1,
        low=-1,
        high=MAX_ID,
    )
    publish_clock: bool = field("bool", "Whether to publish /clock and use it for stamps.", True)
    map_frame: str = field("str", "Frame of the map and of the poses.", "map")
    frame_prefix: str = field("str", "Prefix of all frame names, such as a/.", "")
    grid_scaling: str = field(
        "str",
        "Scale of probability_grid.",
        "max",
        choices=("max", "linear", "log"),
    )
    reveal_person: bool = field("bool", "Whether markers show the persons.", False)
    publish_belief: bool = field(
        "bool",
        "Whether to publish belief and belief_grid.",
        False,
    )
    compute_pos: str = field(
        "str",
        "Whether to compute the POS; "
        f"auto: on grids of at most {LARGEST_AUTO_GRID**2} cells, or with publish_belief.",
        "auto",
        choices=("auto", "always", "never"),
    )
    odom_rate: float = field(
        "float",
        "Realtime: rate of the interpolated odometry.",
        10.0,
        above=0,
        high=1000,
        unit="Hz",
    )
    record_file: str = field("str", "CSV file of the mission's steps; empty for none.", "")
    snapshot_file: str = field("str", "File to save the mission in; empty for none.", "")
    snapshot_every: int = field(
        "int", "Steps between snapshots.", 100, low=1, high=10**9, unit="steps"
    )
    resume: bool = field("bool", "Whether to start from snapshot_file.", False)

    journal: str = field(
        "str", "MCAP file of a live search: its steps and inputs. Empty for none; one that exists "
        "is continued.", "",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_all(self)
        if self.journal and self.resume:
            raise FieldError("resume must be false with a journal")
        if self.run_id == 0:
            raise FieldError(f"run_id must be -1 or 1 to {MAX_ID}, got 0")
        if self.publish_belief and self.compute_pos == "never":
            raise FieldError("compute_pos must be auto or always with publish_belief, got 'never'")
        if not self.map_frame:
            raise FieldError("map_frame must be a name, got ''")
        for name in ("map_frame", "frame_prefix"):
            if getattr(self, name).startswith("/"):
                raise FieldError(
                    f"{name} must not begin with a slash, as in tf2, got "
                    f"{shown(getattr(self, name))}"
                )
        if self.resume and not self.snapshot_file:
            raise FieldError("resume must be false without snapshot_file, got true")

    def has_belief(self, grid: GridShape, *, live: bool = False) -> bool:
        """Return whether a belief follows a mission on a grid of this size.

        Args:
            grid: Its shape.
            live: Whether it is a live search.
        """
        if self.compute_pos == "auto":
            return self.publish_belief or live or grid.cells <= LARGEST_AUTO_GRID**2
        return self.compute_pos == "always"


_MODES = {"command_timeout": "lockstep", "odom_rate": "realtime", "real_time_factor": "realtime"}
"""The step mode in which a setting has an effect, for those that have one in one mode only."""


_OF_WALL_TIME = ("step_rate", "real_time_factor")
"""Settings of the time of steps that have no effect if the sea follows the clocks of vehicles."""


def without_effect(settings: SimSettings) -> list[str]:
    """Return a line for each setting that was changed and has no effect with the others."""
    usual, mode = SimSettings(), settings.step_mode
    changed = [name for name in vars(usual) if getattr(settings, name) != getattr(usual, name)]
    follows = settings.vehicle_time == FOLLOWED
    return [
        f"{name} has no effect with step_mode {mode}, only with {where}"
        for name, where in _MODES.items()
        if where != mode and name in changed
    ] + [
        f"{name} has no effect with vehicle_time followed"
        for name in _OF_WALL_TIME
        if follows and name in changed
    ]


RUN_TIME_SETTINGS = frozenset(
    {
        "step_mode", "step_rate", "command_timeout", "missing_action", "auto_reset", "exit_at_end",
        "real_time_factor", "seed", "grid_scaling", "reveal_person", "odom_rate",
        "acceptance_radius",
    }
)  # fmt: skip
"""Settings of `sim_node` that can change at run time; the others are read-only."""

SCENARIO_FILE, PROFILE = "scenario.file", "rules.profile"
_SCENARIO = {f"scenario.{name}": spec for name, spec in specs(Scenario).items()}
# If the scenario has the same field, its value counts.
# vehicle_time sets vehicle_timed_actions.
_ELSEWHERE = {*specs(Scenario), "vehicle_timed_actions"}
_RULES = {f"rules.{k}": v for k, v in specs(Rules).items() if k not in _ELSEWHERE}

SIM_PARAMETERS: Mapping[str, Spec] = {
    **specs(SimSettings),
    SCENARIO_FILE: Spec(
        "str", "YAML file, or name of a scenario of the package; empty for the defaults."
    ),
    **_SCENARIO,
    **_RULES,
    PROFILE: Spec(
        "str",
        "Profile of the rules; auto is sea with an incident, else paper.",
        choices=(AUTO, *PROFILES),
    ),  # fmt: skip
}
"""All parameters of `sim_node`: its settings, and the groups `scenario.` and `rules.`."""

SHORT_NAMES = {
    "scenario": SCENARIO_FILE,
    "rules": PROFILE,
    "num_drones": "scenario.num_drones",
    "truth": "scenario.truth",
}
"""Accepted too: the names of options and launch arguments."""

FULL_NAMES = {
    name.partition(".")[2]: name
    for name in (*_SCENARIO, *_RULES)
    if name not in SHORT_NAMES.values()
}
"""Names of the fields without their group; refused with the full name."""


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """Settings of `planner_node`.

    Raises:
        FieldError: If a value is not allowed.
    """

    planner: str = field("str", "Planner that commands the drones.", DEFAULT_PLANNER,
        choices=PLANNER_NAMES,
    )  # fmt: skip
    model: str = field(
        "str", "ONNX file of the planner onnx; empty for that of this package.", "",
    )  # fmt: skip
    planner_options: tuple[str, ...] = field(
        "names", "Options of the planner, such as horizon=10 for belief.", ()
    )
    seed: int = field("int", "Seed of the planner's random draws.", 0, low=0, high=MAX_SEED)
    resend_period: float = field(
        "float",
        "Wall time before an unanswered command is resent.",
        0.5,
        above=0,
        high=1e6,
        unit="s",
    )

    def __post_init__(self) -> None:
        check_all(self)


@dataclass(frozen=True, kw_only=True)
class ShowSettings:
    """Settings of `show`.

    Raises:
        FieldError: If a value is not allowed.
    """

    width: int = field(
        "int",
        "Columns of the table; 0 for those of the terminal, 100 without one.",
        0,
        low=0,
        high=10_000,
        unit="characters",
    )

    def __post_init__(self) -> None:
        check_all(self)


@dataclass(frozen=True, kw_only=True)
class RecorderSettings:
    """Settings of `recorder`.

    Raises:
        FieldError: If a value is not allowed.
    """

    bag: str = field(
        "str", "New MCAP file; by default named mission_ with date and time.", "",
    )  # fmt: skip
    exclude: tuple[str, ...] = field(
        "names", "Patterns of topics to leave out, such as */odom.", ()
    )

    def __post_init__(self) -> None:
        check_all(self)


@dataclass(frozen=True, kw_only=True)
class ViewerSettings:
    """Settings of `foxglove_viewer`.

    Raises:
        FieldError: If a value is not allowed.
    """

    host: str = field(
        "str", "Address to listen on; any other opens the topics to the network.", "127.0.0.1",
    )  # fmt: skip
    port: int = field("int", "TCP port, 0 for any free one.", 8765, low=0, high=65535)
    exclude: tuple[str, ...] = field(
        "names", "Patterns of topics to leave out, such as */odom.", ()
    )

    def __post_init__(self) -> None:
        check_all(self)
