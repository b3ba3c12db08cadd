# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Options of the planners that plan ahead: a small part of the time, and the same promises."""

from __future__ import annotations

from typing import Any

BEAM: dict[str, Any] = {"samples": 256, "width": 4, "horizon": 5}
LITTLE_EFFORT: dict[str, dict[str, Any]] = {
    "belief": BEAM,
}
"""By planner; the others have no such options."""
