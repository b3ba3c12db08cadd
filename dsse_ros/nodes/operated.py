# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The interface of a simulation that services operate."""

from __future__ import annotations

from typing import Any, Protocol

from builtin_interfaces.msg import Time

from dsse_ros.mission.mission import Mission
from dsse_ros.nodes.settings import SimSettings
from msg_adapters.frames import GridFrame


class Operated(Protocol):
    """A simulation as a node.

    Attributes:
        mission: The current mission.
        frame: The frame of its grid.
        settings: Settings of the node.
        stopped: Whether it was stopped, and has not continued since.
    """

    mission: Mission
    frame: GridFrame
    settings: SimSettings
    stopped: bool

    @property
    def paused(self) -> bool:
        """Whether the mission is paused."""

    def set_paused(self, paused: bool) -> None:
        """Pause the mission, or continue it."""

    def try_step(self) -> str:
        """Do one step if that is allowed; returns why not, empty if it did."""

    def reset(self, seed: int | None = None) -> None:
        """Start a new mission with this seed, by default the parameter's."""

    def restart(self) -> None:
        """Start a new mission and restart mission time, as if the node had restarted."""

    def restart_time(self) -> None:
        """Restart mission time at the current step."""

    def stop(self) -> None:
        """Restart, and pause the mission at its start."""

    def stamp(self) -> Time:
        """Return the time of the last step, for every message about it."""

    def create_service(self, srv_type: Any, srv_name: str, callback: Any) -> Any:
        """Offer a service, see `rclpy.node.Node`."""
