# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common parts of the nodes: arguments, parameters, QoS, timers, signals."""
