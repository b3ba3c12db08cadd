# SPDX-License-Identifier: Apache-2.0
"""One mission after the other without ROS: commands, the time of the steps, the log."""
