# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros show`: prints the step reports as a table, live."""

from __future__ import annotations

import shutil
import sys
from collections import deque
from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from dsse_ros.mission.run.report_table import ReportTable
from dsse_ros.ros.nodes.settings import ShowSettings
from dsse_ros.ros.runtime import standard_streams
from dsse_ros.ros.runtime.qos import COMPLETE, read_settings
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.world.scenario.agents_inbox import AgentsInbox
from msg_adapters.step_report import step_report_from_message

_WITHOUT_TERMINAL = 100
"""Columns where the output is no terminal."""
_WAIT_S = 1.0
"""Wall time after which the node logs what it is waiting for."""


class ShowNode(AlarmNode):
    """Prints a line for each step, those before its start too, as far as the simulation has them.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("show")
        settings, endpoints = read_settings(self, ShowSettings)
        terminal = shutil.get_terminal_size((_WITHOUT_TERMINAL, 0)).columns
        self._table = ReportTable(settings.width or terminal)
        self._infos = AgentsInbox(with_definition=False)
        # Reports whose `agents` has not come yet.
        self._early: deque[NDArray[Any]] = deque(maxlen=COMPLETE.depth)
        self._printed = False
        self._waits_for = ""
        self._topics = [
            endpoints.subscription(topic, take).topic_name
            for topic, take in (("agents", self._on_agents), ("step_report", self._on_report))
        ]
        endpoints.check_all_used()
        self.alarms.make(self._log_waiting).repeat(_WAIT_S)

    def _on_agents(self, message: String) -> None:
        self._infos.take(message.data)
        early, self._early = self._early, deque(maxlen=COMPLETE.depth)
        for report in early:
            self._take(report)

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        if len(report):
            self._take(report)

    def _take(self, report: NDArray[Any]) -> None:
        info = self._infos.info_of(report)
        if info is None:
            self._early.append(report)
        elif not self.finished:
            self._print(self._table.lines(info, report))

    def _print(self, lines: Sequence[str]) -> None:
        self._printed = True
        print(*lines, sep="\n", end="\n" if lines else "", flush=True)
        # The reader of a pipe may leave, as `head` does.
        self.finished = standard_streams.left()

    def _log_waiting(self) -> None:
        """Log what the node is waiting for before its first line, if that has changed."""
        before, self._waits_for = self._waits_for, "" if self._printed else self._missing()
        if self._waits_for and self._waits_for != before:
            self.get_logger().info(f"waiting for {self._waits_for}")

    def _missing(self) -> str:
        came = (bool(self._infos) and not self._early, bool(self._early))
        silent = [topic for topic, is_here in zip(self._topics, came, strict=True) if not is_here]
        return f"a simulation: nothing on {', '.join(silent)} yet" if silent else ""


def main(argv: list[str] | None = None) -> int:
    """Run the node until its output or the process ends; returns the exit code, 2 for bad input."""
    return run_node("show", ShowNode, argv)


if __name__ == "__main__":
    sys.exit(main())
