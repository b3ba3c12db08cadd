# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A ROS domain per module."""

import os

from rig import ENVIRONMENT, rig_of_module  # noqa: F401

os.environ.update(ENVIRONMENT)
