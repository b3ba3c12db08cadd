# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Opens the page in a browser, from outside the page's own process, which gives way to others."""

from __future__ import annotations

import os
import webbrowser


def open_browser(url: str) -> bool:
    """Open a page in a browser, if there is a display; returns whether it was."""
    # Without one, a browser for terminals would take this one.
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    return webbrowser.open(url)
