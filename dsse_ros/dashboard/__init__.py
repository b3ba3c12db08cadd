# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The live page of missions: what it knows without ROS, what it shows, and who may see it."""
