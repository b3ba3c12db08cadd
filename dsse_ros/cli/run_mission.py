# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make sim`: one mission from start to end, `sim_node` and `planner_node` as two processes.

It watches the topics like any subscriber, stops both nodes at the end of the mission, and writes a
summary, a picture, the CSV of the steps and, if requested, a movie.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import html
import json
import os
import re
import socket
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib.figure  # noqa: F401  Fail before the mission if it is missing.
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Float64MultiArray, String
from tqdm import tqdm

from dsse_ros.base.fields import FieldError, specs
from dsse_ros.base.private_files import open_private
from dsse_ros.cli.command_line import DEFAULT_SCENARIO, Parser, make_folder, search_of
from dsse_ros.cli.node_process import MissionFailed, check_running, process, ros_for, working
from dsse_ros.mission.live.planned_searches import PlannedSearches
from dsse_ros.picture.movie import check_movie, save_movie
from dsse_ros.picture.rendering import MissionView, save_picture
from dsse_ros.planners.search_plan.plan_file import read_plan
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import mission_views
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.results.report.texts import summary
from dsse_ros.ros.nodes.settings import (
    PROFILE,
    SCENARIO_FILE,
    SHORT_NAMES,
    SIM_PARAMETERS,
    PlannerSettings,
    SimSettings,
)
from dsse_ros.ros.nodes.sim_parameters import draw_run_id
from dsse_ros.ros.runtime.exit_codes import fail
from dsse_ros.ros.runtime.interrupts import Stop, on_signals
from dsse_ros.ros.runtime.qos import offered, requested
from dsse_ros.ros.runtime.ros_arguments import OF_EVERY_NODE, pairs
from dsse_ros.ros.runtime.run_node import init_ros, leave_ros, spinning
from dsse_ros.screens.dashboard.settings import DashboardSettings
from dsse_ros.world.scenario.rules import AUTO, Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from msg_adapters.images import image_to_probability
from msg_adapters.pos import pos_from_message
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message

SILENCE_S = 60.0
"""Wall time without a step, a running compiler or other progress after which the mission has
failed."""
_SIM_NAMES = (*SIM_PARAMETERS, *SHORT_NAMES, *OF_EVERY_NODE)
_PLANNER_NAMES = (*specs(PlannerSettings), *OF_EVERY_NODE)
_DASHBOARD_NAMES = (*specs(DashboardSettings), *OF_EVERY_NODE)
RATE, VIEW_RATE = 20.0, 3.0
"""Maximum steps per second, without and with the page: people follow three."""


class Watcher(Node):
    """Follows a mission over its topics.

    Args:
        run_id: Run of the simulation to follow.
        belief: Whether the belief is published too.
        pos: Whether the probability of success is published too.

    Attributes:
        foreign: Whether another simulation has published a report.
        step: Steps done, -1 before the first report.
        num_active: Drones in flight.
        done: Whether the mission is over and all messages of its last step have arrived.
        probability: The last belief (R, C), or the last map if no belief is published.
    """

    def __init__(self, run_id: int, *, belief: bool, pos: bool) -> None:
        super().__init__("watcher")
        self._run_id = run_id
        self._has_pos = pos
        self.foreign = False
        self.step = -1
        self.num_active = 0
        self.probability: NDArray[np.float32] | None = None
        self._pos: float | None = None
        self._pos_step = -1
        self._map_stamp = -1
        self._report_stamp = -1
        topics: dict[str, Callable[[Any], None]] = {
            "belief" if belief else "probability": self._on_map,
            "step_report": self._on_report,
            "probability_of_success": self._on_pos,
        }
        for topic, take in topics.items():
            kind, qos = requested(topic, "run_mission")
            self.create_subscription(kind, topic, take, qos)
        kind, qos = offered("live/searched", "run_mission")
        self._searched = self.create_publisher(kind, "live/searched", qos)

    @property
    def done(self) -> bool:
        """Whether no drone is in flight, and the map and the POS of that step have arrived too."""
        if self.step < 0 or self.num_active > 0 or self._map_stamp != self._report_stamp:
            return False
        return self._pos_step == self.step or not self._has_pos

    def report(self, searches: list[dict[str, Any]]) -> None:
        """Publish what others have searched; nobody but a live search listens."""
        for search in searches:
            self._searched.publish(String(data=json.dumps(search)))

    def _on_map(self, message: Image) -> None:
        self.probability = image_to_probability(message)
        self._map_stamp = to_nanoseconds(message.header.stamp)

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        if report["run_id"][0] != self._run_id:
            self.foreign = True
            return
        down = (report["terminated"] | report["truncated"]).astype(bool)
        self.step = int(report["step"][0])
        self.num_active = int((~down).sum())
        self._report_stamp = to_nanoseconds(message.header.stamp)

    def _on_pos(self, message: Float64MultiArray) -> None:
        run_id, _, step, pos = pos_from_message(message)
        if run_id == self._run_id:
            self._pos_step, self._pos = step, pos

    def line(self) -> str:
        """Return the state of the search for the progress line."""
        if self.probability is None:
            return "waiting for the first map"
        row, col = np.unravel_index(int(self.probability.argmax()), self.probability.shape)
        best = float(self.probability[row, col])
        active = f"{self.num_active} drones" if self.num_active else "over"
        success = "" if self._pos is None else f", POS {self._pos:.1%}"
        return f"best cell ({col}, {row}) {best:.1%}, {active}{success}"


@contextlib.contextmanager
def live_page(
    arguments: argparse.Namespace, stop: Stop
) -> Iterator[subprocess.Popen[bytes] | None]:
    """Show the mission in the browser if requested; yields the process of the page.

    Raises:
        MissionFailed: If there is no page within `SILENCE_S`.
        KeyboardInterrupt: If a signal has come.
    """
    if not arguments.view:
        yield None
        return
    log: Path = arguments.out / "dashboard.log"
    ros = ros_for("dashboard", _DASHBOARD_NAMES, arguments.ros)
    parameters: dict[str, Any] = {}
    if not any(value.startswith("port:=") for _, value in pairs(ros)):
        try:
            socket.create_server(("127.0.0.1", DashboardSettings().port)).close()
        except OSError:
            parameters["port"] = 0
    with process("dashboard", parameters, log, ros) as page:
        deadline_s = time.monotonic() + SILENCE_S
        while not (served := re.search(r"page at (\S+)", log.read_text(errors="replace"))):
            if stop.wanted:
                raise KeyboardInterrupt
            check_running(page, "dashboard", log)
            if time.monotonic() > deadline_s:
                raise MissionFailed(f"no page within {SILENCE_S:g} s; see {log}")
            time.sleep(0.05)
        print(f"page at {served[1]}", flush=True)
        # Without a display, a text browser would take over the terminal.
        leads = arguments.out / "page.html"
        if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            open_browser(served[1], leads)
        try:
            yield page
        finally:
            leads.unlink(missing_ok=True)


def open_browser(address: str, file: Path) -> None:
    """Open a page by a private file that leads to it.

    Everybody on the machine can see the arguments of a process, such as an address with a token.
    """
    with open_private(file) as page:
        meta = f'<meta http-equiv="refresh" content="0;url={html.escape(address)}">'
        page.write(f"<!doctype html>{meta}".encode())
    webbrowser.open(file.resolve().as_uri())


def stay(page: subprocess.Popen[bytes], stop: Stop) -> None:
    """Keep a page until Ctrl-C, if somebody at a terminal watches."""
    if sys.stdin.isatty():
        print("Page and simulation stay until Ctrl-C; Reset starts another mission.", flush=True)
        while not stop.wanted and page.poll() is None:
            time.sleep(0.05)


def shows_belief(arguments: argparse.Namespace, scenario: ResolvedScenario, rules: Rules) -> bool:
    """Return whether a belief follows the mission and is shown instead of the map."""
    settings = SimSettings(compute_pos=arguments.compute_pos)
    return not rules.covers and settings.has_belief(scenario.grid_size)


class _Progress:
    """The progress line of a mission, and the reasons to end it.

    Args:
        sim_log: Log of `sim_node`.
    """

    def __init__(self, watcher: Watcher, steps: int, stop: Stop, sim_log: Path) -> None:
        self._watcher = watcher
        self._stop = stop
        self._sim_log = sim_log
        self.bar = tqdm(
            total=steps, unit="step", file=sys.stdout, dynamic_ncols=True,
            mininterval=0.1 if sys.stdout.isatty() else 2.0, desc="starting sim_node",
            bar_format="step {n_fmt}/{total_fmt} |{bar:20}| {elapsed} {desc}",
        )  # fmt: skip
        self._last_step_s = time.monotonic()
        self._work = ""

    def check(self, name: str, child: subprocess.Popen[bytes], log: Path) -> None:
        """Show what a process has done.

        Raises:
            MissionFailed: If the process has ended, nothing happens, or another mission runs.
            KeyboardInterrupt: If a signal has come.
        """
        watcher, bar = self._watcher, self.bar
        if self._stop.wanted:
            raise KeyboardInterrupt
        check_running(child, name, log)
        if watcher.step > bar.n:
            self._last_step_s = time.monotonic()
            bar.set_description_str(watcher.line(), refresh=False)
            # The step that detects the timeout is one more than the limit.
            bar.update(min(watcher.step, bar.total) - bar.n)
        work, before = working(log), self._work
        self._work = work
        if work and (work != before or work.startswith("compiling")):
            # A single function may take the compiler long; everything else must go on.
            self._last_step_s = time.monotonic()
            bar.set_description_str(work, refresh=False)
            # Its timer moves too.
            bar.update(0)
        if time.monotonic() - self._last_step_s > SILENCE_S:
            during = f" during {work!r}" if work else ""
            raise MissionFailed(f"no progress within {SILENCE_S:g} s{during}; see {self._sim_log}")
        if watcher.foreign or watcher.count_publishers("step_report") > 1:
            raise MissionFailed("another mission uses this ROS_DOMAIN_ID; choose a different one")

    def finish(self) -> None:
        """Show the end of the mission; closing the bar shows it."""
        self.bar.set_description_str(self._watcher.line(), refresh=False)
        self.bar.close()


def _sim_parameters(
    arguments: argparse.Namespace, path: Path, rules: Rules, run_id: int, belief: bool
) -> dict[str, object]:
    """Return the parameters of `sim_node`."""
    sim = {
        SCENARIO_FILE: str(path), PROFILE: rules.profile, "seed": arguments.seed, "run_id": run_id,
        "step_rate": float(arguments.rate), "record_file": str(arguments.out / "mission.csv"),
        "publish_belief": belief,
    }  # fmt: skip
    if arguments.num_drones is not None:
        sim["scenario.num_drones"] = arguments.num_drones
    return sim


def _planner_parameters(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the parameters of `planner_node`."""
    planner = {"planner": arguments.planner, "seed": arguments.seed, "model": arguments.model or ""}
    if arguments.planner_options:
        planner["planner_options"] = list(arguments.planner_options)
    return planner


def fly(
    arguments: argparse.Namespace,
    path: Path,
    scenario: ResolvedScenario,
    rules: Rules,
    stop: Stop,
    at_end: Callable[[], None],
    searches: PlannedSearches,
) -> None:
    """Run the mission to its end, with a progress line.

    Args:
        at_end: Called at the end, while the nodes still run.
        searches: What others search, which a live search is told when it is over.

    Raises:
        MissionFailed: If a process ends early or nothing happens for `SILENCE_S`.
        KeyboardInterrupt: If a signal has come.
    """
    belief = shows_belief(arguments, scenario, rules)
    # Without it, the latched report of another mission would pass for one of this mission.
    run_id = draw_run_id(SimSettings(run_id=arguments.run_id))
    sim = _sim_parameters(arguments, path, rules, run_id, belief)
    planner = _planner_parameters(arguments)
    sim_ros = ros_for("sim_node", _SIM_NAMES, arguments.ros)
    planner_ros = ros_for("planner_node", _PLANNER_NAMES, arguments.ros)
    sim_log, planner_log = arguments.out / "sim_node.log", arguments.out / "planner_node.log"
    watcher = Watcher(run_id, belief=belief, pos=belief or rules.covers)
    progress = _Progress(watcher, scenario.timestep_limit, stop, sim_log)
    with (
        spinning(watcher) as executor,
        progress.bar,
        process("sim_node", sim, sim_log, sim_ros) as sim_process,
    ):
        # Start the planner once the watcher receives messages, so that it misses no step.
        while watcher.step < 0:
            executor.spin_once(timeout_sec=0.1)
            progress.check("sim_node", sim_process, sim_log)
        with process("planner_node", planner, planner_log, planner_ros) as planner_process:
            while not watcher.done:
                executor.spin_once(timeout_sec=0.1)
                watcher.report(searches.over(watcher.step * scenario.step_duration_s))
                progress.check("planner_node", planner_process, planner_log)
                check_running(sim_process, "sim_node", sim_log)
            progress.finish()
            at_end()


def draw(record: RecordedMission, arguments: argparse.Namespace) -> dict[str, Path]:
    """Draw the mission; return the written files, none if it cannot be flown again.

    Raises:
        OSError: If a file cannot be written.
    """
    views = mission_views(record, belief=shows_belief(arguments, record.scenario, record.rules))
    written = {"picture": arguments.out / "mission.png"}
    last: list[MissionView] = []

    def noted() -> Iterator[MissionView]:
        for view in views:
            last[:] = [view]
            yield view

    try:
        if arguments.movie is not None:
            save_movie(noted(), arguments.movie, total=len(record.steps))
            written["movie"] = arguments.movie
        else:
            collections.deque(noted(), maxlen=0)
    except ValueError as error:
        fail("run_mission", f"no picture: {error}")
        return {}
    save_picture(last[0], written["picture"])
    return written


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(
        prog="run_mission",
        description="Fly one mission: sim_node and planner_node as two processes.",
    )
    parser.add_search(DEFAULT_SCENARIO)
    rate = f"maximum steps/s, 0 for no limit (default: {RATE:g}, with --view {VIEW_RATE:g})"
    parser.add("--rate", type=float, help=rate)
    parser.add("--out", type=Path, default=Path("out"), help="folder of the results")
    parser.add("--movie", type=Path, help="also write a movie of the mission, .gif or .mp4")
    parser.add("--view", action="store_true", help="show the mission live in the browser")
    of_plan = "fly the plan.json of a search plan, with rules flight"
    parser.add("--plan", type=Path, metavar="FILE", help=of_plan)
    parser.set_defaults(compute_pos="auto", run_id=-1)
    of_sim = {"step_rate": "rate", "compute_pos": "compute_pos", "run_id": "run_id"}
    arguments = parser.parse_with_ros(
        argv,
        {name: (option, specs(SimSettings)[name]) for name, option in of_sim.items()},
        {*_SIM_NAMES, *_PLANNER_NAMES, *_DASHBOARD_NAMES},
    )
    if arguments.rate is None:
        arguments.rate = VIEW_RATE if arguments.view else RATE
    if arguments.plan is not None:
        if arguments.rules == AUTO:
            arguments.rules = "flight"
        # As YAML, whatever characters the path has.
        path = json.dumps(str(arguments.plan.resolve()))
        arguments.planner_options = [*arguments.planner_options, f"plan={path}"]
    return arguments


def main(argv: list[str] | None = None) -> int:
    """Run one mission; return 0 at its end, found or not, 2 for bad input, 1 if it failed."""
    arguments = parse(argv)
    try:
        specs(SimSettings)["step_rate"].check("rate", arguments.rate)
        path, scenario, rules = search_of(arguments)
        units = [] if arguments.plan is None else read_plan(arguments.plan, scenario)
        make_folder("out", arguments.out)
        if arguments.movie is not None:
            check_movie(arguments.movie)
            make_folder("movie", arguments.movie.parent)
    except FieldError as error:
        return fail("run_mission", error)
    stop = Stop()
    # An exception between the start of a node and its `finally` would leave the node running.
    on_signals(stop)
    try:
        init_ros(["run_mission", "--ros-args", *arguments.ros])
        with live_page(arguments, stop) as page:

            def at_end() -> None:
                record = read_csv(arguments.out / "mission.csv")[-1]
                written = draw(record, arguments)
                print(summary(record))
                for name, file in {**written, "steps": arguments.out / "mission.csv"}.items():
                    print(f"  {name:<20} {file}")
                if page is not None:
                    stay(page, stop)

            fly(arguments, path, scenario, rules, stop, at_end, PlannedSearches(units, scenario))
    except FieldError as error:
        return fail("run_mission", error)
    except MissionFailed as error:
        fail("run_mission", error)
        return 1
    except OSError as error:
        # For example a folder instead of a file, or a full disk.
        fail("run_mission", f"out: {error.filename or str(arguments.out)!r}: {error.strerror}")
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        leave_ros()
    return 0


if __name__ == "__main__":
    sys.exit(main())
