# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The environment of the nodes."""

import os

from rig import ENVIRONMENT

os.environ.update(ENVIRONMENT)
