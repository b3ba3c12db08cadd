# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Runs the autopilot: `python test/vehicles/control/autopilot`, or `-m autopilot` beside it."""

import os
import sys
from pathlib import Path

# pymavlink reads this when it is imported.
os.environ["MAVLINK20"] = "1"
if not __package__:
    sys.path[0] = str(Path(__file__).resolve().parent.parent)

from autopilot.main import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
