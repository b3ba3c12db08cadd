# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of ROS 2 from plain values and back, in pure functions, and the table of topics."""
