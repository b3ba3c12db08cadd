# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What services need of the simulation that they operate."""

from __future__ import annotations

from typing import Any, Protocol

from builtin_interfaces.msg import Time

from dsse_ros.mission.mission import Mission
from dsse_ros.nodes.settings import SimSettings
from msg_adapters.frames import GridFrame


class Operated(Protocol):
    """A simulation as a node.

    Attributes:
        mission: The mission under way.
        frame: Where its grid is.
        settings: Of the node.
        stopped: Whether it was stopped, and has not gone on.
    """

    mission: Mission
    frame: GridFrame
    settings: SimSettings
    stopped: bool

    @property
    def paused(self) -> bool:
        """Whether the mission is held."""

    def set_paused(self, paused: bool) -> None:
        """Hold the mission, or let it go on from where it was."""

    def try_step(self) -> str:
        """Do one step if that is allowed; returns why not, or nothing."""

    def reset(self, seed: int | None = None) -> None:
        """Start a new mission with this seed, by default the parameter's."""

    def restart(self) -> None:
        """Start a new mission and mission time anew, as if the node was started again."""

    def restart_time(self) -> None:
        """Start mission time anew, with the step that the mission is in."""

    def stop(self) -> None:
        """Restart, and hold the mission there."""

    def stamp(self) -> Time:
        """Return the time of the last step, for every message about it."""

    def create_service(self, srv_type: Any, srv_name: str, callback: Any) -> Any:
        """Offer a service, see `rclpy.node.Node`."""
