# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The display of pygame, which scripts for DSSE record."""

from __future__ import annotations

import importlib
from typing import Any

from dsse_ros.picture.rendering import FigureRenderer, MissionView


class PygameWindow:
    """Shows a mission on the display of pygame, which the script must have installed.

    Events are left to the script.

    Args:
        fps: Maximum number of pictures per second.
    """

    def __init__(self, fps: float) -> None:
        self._pygame: Any = importlib.import_module("pygame")
        self._pygame.init()
        self._renderer = FigureRenderer()
        self._fps, self._clock = fps, self._pygame.time.Clock()

    def show(self, view: MissionView) -> None:
        """Wait for the next frame's time and draw the mission on the display."""
        self._clock.tick(self._fps)
        frame = self._renderer.rgb_array(view).swapaxes(0, 1)
        display = self._pygame.display
        screen = display.get_surface()
        if screen is None or screen.get_size() != frame.shape[:2]:
            screen = display.set_mode(frame.shape[:2])
        self._pygame.surfarray.blit_array(screen, frame)
        display.flip()
        self._pygame.event.pump()

    def close(self) -> None:
        """Close the display."""
        self._pygame.display.quit()
