# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One mission without ROS: its run, its files, its vehicles, live inputs and recordings."""
