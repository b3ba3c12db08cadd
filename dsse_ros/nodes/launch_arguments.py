# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arguments of the launch files, and the nodes' parameters from them; without launch or ROS.

`ros2 launch` may run in a Python without the dependencies of the nodes, so this module imports none
of them. Tests compare names, types, bounds, choices and defaults with those of the nodes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import yaml

from dsse_ros.runtime.ros_arguments import parameters_for
from msg_adapters.mission_items import FIRMWARES

Kind = Literal["bool", "int", "float", "str", "ints", "names"]

NODES = (
    "recorder", "sim_node", "planner_node", "mavlink_bridge", "foxglove_viewer", "rviz2",
)  # fmt: skip
"""The executables; each node has the name of its own."""


@dataclass(frozen=True)
class Argument:
    """One argument of a launch file.

    Attributes:
        kind: Type of its value; lists are written as in YAML, `[1, 2]`.
        doc: One sentence of help.
        default: As text; "" for the default of the node, or of a file of parameters.
        to: The executables that have it as a parameter.
        renamed: Its name as a parameter, by executable, if it differs.
        low, high: Bounds of a number, inclusive.
        choices: The allowed values of a text, empty for any.
    """

    kind: Kind
    doc: str
    default: str = ""
    to: tuple[str, ...] = ()
    renamed: Mapping[str, str] = dataclasses.field(default_factory=dict)
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()

    def allowed(self) -> str:
        """Return the allowed values as text."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        noun = {
            "bool": "true or false",
            "int": "an integer",
            "float": "a number",
            "str": "a text",
            "ints": "a list of integers, as [1, 2]",
            "names": "a list of texts, as [one, two]",
        }[self.kind]
        bounds = [
            f"{sign} {bound:g}"
            for sign, bound in ((">=", self.low), ("<=", self.high))
            if math.isfinite(bound)
        ]
        return " ".join([noun, " and ".join(bounds)]).strip()

    def value(self, name: str, text: str) -> Any:
        """Return the value of a text.

        Raises:
            ValueError: If it is not allowed; one line.
        """
        try:
            return self._convert(text)
        except ValueError:
            raise ValueError(f"{name}: {text!r} is not allowed; {self.allowed()}") from None

    def _convert(self, text: str) -> Any:
        match self.kind:
            case "bool":
                return {"true": True, "false": False}.get(text.lower()) or _false(text)
            case "int":
                return self._bounded(int(text))
            case "float":
                return self._bounded(float(text))
            case "str":
                if self.choices and text not in self.choices:
                    raise ValueError
                return text
            case "ints" | "names":
                items = _list(text)
                if self.kind == "names":
                    return [str(item) for item in items]
                return [self._bounded(_integer(item)) for item in items]

    def _bounded(self, value: Any) -> Any:
        if not self.low <= value <= self.high or not math.isfinite(value):
            raise ValueError
        return value


def _false(text: str) -> bool:
    if text.lower() != "false":
        raise ValueError
    return False


def _list(text: str) -> list[Any]:
    try:
        items = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ValueError from None
    items = items if isinstance(items, list) else [items]
    if not items:
        raise ValueError
    return items


def _integer(item: Any) -> int:
    if isinstance(item, bool) or not isinstance(item, int):
        raise ValueError
    return item


_SIM, _PLANNER, _BRIDGE = ("sim_node",), ("planner_node",), ("mavlink_bridge",)
_VIEWER = ("foxglove_viewer",)

MISSION: Mapping[str, Argument] = {
    "scenario": Argument("str", "YAML file, or name of a scenario of the package.", "santos", _SIM),
    "rules": Argument(
        "str", "Profile of the rules.", "paper", _SIM, choices=("paper", "v1", "v2", "coverage"),
    ),
    "planner": Argument(
        "str", "Which planner commands the drones, one of this package or of another.", "greedy",
        _PLANNER,
    ),
    "num_drones": Argument("int", "Number of drones; by default the scenario's.", "", _SIM, low=1,
        high=10**8,
    ),
    "seed": Argument(
        "int", "Seed of the map, the persons and the planner; by default drawn, and 0 for the "
        "planner; -1 is that too.", "", _SIM + _PLANNER, low=-1, high=2**62,
    ),
    "step_rate": Argument(
        "float", "Steps per second of wall time at most, 0 for no limit.", "5", _SIM,
        low=0, high=1e6,
    ),
    "auto_reset": Argument(
        "bool", "Whether a mission that is over is followed by one with the next seed.", "false",
        _SIM,
    ),
    "exit_at_end": Argument(
        "bool", "Whether the launch ends with the mission; by default not with auto_reset.",
        "true", _SIM,
    ),
    "record_file": Argument("str", "CSV file of the mission's steps.", "", _SIM),
    "map_frame": Argument("str", "Frame of the map and of the poses.", "map", _SIM),
    "frame_prefix": Argument("str", "Put in front of every frame, as in one/.", "", _SIM),
    "publish_clock": Argument(
        "bool", "Whether the simulation publishes /clock, which only one in a domain should.",
        "true", _SIM,
    ),
    "publish_belief": Argument(
        "bool", "Whether the simulation publishes the belief: where the persons are, after the "
        "searches so far.", "false", _SIM,
    ),
    "use_sim_time": Argument(
        "bool", "Whether planner and viewers take their time from /clock; by default if it is "
        "published.", "true", ("planner_node", "foxglove_viewer", "rviz2"),
    ),
    "params_file": Argument(
        "str", "File of parameters of any of the nodes; arguments that are given win over it."
    ),
    "namespace": Argument("str", "Namespace of all nodes."),
    "log_level": Argument(
        "str", "What the nodes log.", "info", choices=("debug", "info", "warn", "error", "fatal")
    ),
    "enclaves": Argument(
        "str", "Path of the nodes' security enclaves, such as /dsse_ros; by default all have that "
        "of the root."
    ),
    "record": Argument("bool", "Whether to record the mission to a bag.", "false"),
    "bag": Argument(
        "str", "MCAP file of the recording, a new one; by default with date and time in its name.",
        "", ("recorder",),
    ),
    "rviz": Argument("bool", "Whether to show the mission in RViz.", "false"),
    "viewer": Argument(
        "str", "Whether to serve the topics to Foxglove.", "none", choices=("none", "foxglove")
    ),
    "viewer_port": Argument(
        "int", "TCP port for Foxglove; by default 8765.", "", _VIEWER,
        renamed={"foxglove_viewer": "port"}, low=0, high=65535,
    ),
    "accept_commands": Argument(
        "bool", "Whether clients such as Foxglove may command drones and vehicles; any web page in "
        "a browser of this machine is one.", "false", _VIEWER,
    ),
}  # fmt: skip
"""The arguments of mission.launch.py."""

FLIGHT: Mapping[str, Argument] = {
    **MISSION,
    "scenario": dataclasses.replace(MISSION["scenario"], default="sitl"),
    "num_drones": dataclasses.replace(
        MISSION["num_drones"], doc="Number of drones and of vehicles; by default the files'.",
        to=_SIM + _BRIDGE, renamed={"mavlink_bridge": "num_vehicles"}, high=250,
    ),
    "step_rate": dataclasses.replace(MISSION["step_rate"], default="0"),
    "exit_at_end": dataclasses.replace(
        MISSION["exit_at_end"], to=_BRIDGE,
        doc="Whether the launch ends when every vehicle has done its end; by default not with "
        "auto_reset.",
    ),
    "bridge": Argument(
        "str", "File with the parameters of the bridge; by default mavlink_bridge.yml of the "
        "package.",
    ),
    "mode": Argument(
        "str", "What the vehicles fly: each step as it comes, the whole search as a mission, or "
        "nothing, and that is written to files.", "guided", _BRIDGE,
        choices=("guided", "mission", "export"),
    ),
    "connections": Argument(
        "names", "Where the vehicles are, drone0's first; by default the files'.", "", _BRIDGE
    ),
    "system_ids": Argument(
        "ints", "System ids of the vehicles; by default the files'.", "", _BRIDGE, low=1, high=255
    ),
    "autopilot": Argument(
        "str", "Which autopilots the vehicles have.", "ardupilot", _SIM + _BRIDGE,
        choices=tuple(FIRMWARES),
    ),
    "arm": Argument(
        "str", "Which searches clear vehicles to be armed: none, so that somebody else does it; "
        "the first one; or, in simulations only, each one.", "false", _BRIDGE,
        choices=("false", "true", "always"),
    ),
}  # fmt: skip
"""The arguments of flight.launch.py."""


@dataclass(frozen=True)
class Start:
    """How one node is started.

    Attributes:
        before: Parameters that files may override.
        files: Files of parameters; later files override earlier ones.
        after: Parameters that no file overrides.
        arguments: What follows the name of the executable.
    """

    before: Mapping[str, Any]
    files: Sequence[str]
    after: Mapping[str, Any]
    arguments: Sequence[str]


def starts(
    arguments: Mapping[str, Argument],
    texts: Mapping[str, str],
    given: Collection[str],
    share: str,
) -> dict[str, Start]:
    """Return how to start each node, by executable, in the order of their start.

    Args:
        arguments: `MISSION` or `FLIGHT`.
        texts: The text of each argument.
        given: The arguments that were given; the others have their defaults.
        share: The package's folder with config/ and rviz/.

    Raises:
        ValueError: If a value is not allowed; one line.
    """
    values = {
        name: one.value(name, texts[name]) if texts[name] or one.kind == "str" else None
        for name, one in arguments.items()
    }
    flight = arguments is FLIGHT
    files = {name: [values["params_file"]] if values["params_file"] else [] for name in NODES}
    if flight:
        shipped = f"{share}/config/mavlink_bridge.yml"
        files["mavlink_bridge"].insert(0, values["bridge"] or shipped)

    of_files = {
        executable: parameters_for(
            f"{values['namespace']}/{executable}",
            [one for file in files[executable] for one in ("--params-file", file)],
        )
        for executable in NODES
    }

    def in_force(name: str, executable: str) -> Any:
        """Return the value that a node will have: the last argument or file counts."""
        if name in given or name not in of_files[executable]:
            return values[name]
        return of_files[executable][name].value

    if "exit_at_end" not in given:
        values["exit_at_end"] = not in_force("auto_reset", "sim_node")
    if "use_sim_time" not in given:
        values["use_sim_time"] = in_force("publish_clock", "sim_node")

    def ros_arguments(executable: str) -> list[str]:
        """Return the arguments for the node's own logger and for its enclave."""
        ros = []
        if "log_level" in given:
            # Set the level of this logger only: the loggers of ROS itself log too much.
            logger = f"{values['namespace']}/{executable}".strip("/").replace("/", ".")
            ros += ["--log-level", f"{logger}:={values['log_level']}"]
        if values["enclaves"]:
            accepts = executable == "foxglove_viewer" and in_force("accept_commands", executable)
            # Through these nodes, people command drones.
            enclave = "operator" if accepts or executable == "rviz2" else executable
            ros += ["--enclave", f"{values['enclaves'].rstrip('/')}/{enclave}"]
        return ["--ros-args", *ros] if ros else []

    fixed_frame = "".join(in_force(name, "sim_node") for name in ("frame_prefix", "map_frame"))
    # Start the recorder first: it misses earlier messages that are not latched.
    executables = [
        *(["recorder"] if values["record"] else []),
        *("sim_node", "planner_node"),
        *(["mavlink_bridge"] if flight else []),
        *(["foxglove_viewer"] if values["viewer"] == "foxglove" else []),
    ]
    made = {}
    for executable in executables:
        before: dict[str, Any] = {}
        after: dict[str, Any] = {}
        for name, one in arguments.items():
            value = values[name]
            if executable in one.to and value is not None and (value != "" or name in given):
                parameter = one.renamed.get(executable, name)
                (after if name in given else before)[parameter] = value
        if executable == "planner_node" and after.get("seed") == -1:
            # The node does not accept -1, which draws a seed elsewhere.
            del after["seed"]
        if executable == "sim_node" and flight:
            waits = in_force("mode", "mavlink_bridge") == "guided"
            # In the other modes the vehicles start when the search is over.
            (before if waits else after)["wait_for_vehicles"] = waits
        made[executable] = Start(before, files[executable], after, ros_arguments(executable))
    if values["rviz"]:
        made["rviz2"] = Start(
            {"use_sim_time": values["use_sim_time"]},
            [],
            {},
            ["-d", f"{share}/rviz/mission.rviz", "-f", fixed_frame, *ros_arguments("rviz2")],
        )
    return made
