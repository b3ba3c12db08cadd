# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One mission after the other without ROS: commands, the time of the steps, the log."""
