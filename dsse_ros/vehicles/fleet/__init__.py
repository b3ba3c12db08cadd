# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles that follow a search, without ROS: consent, custody, orders, fence and separation."""
