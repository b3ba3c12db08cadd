# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every node is made of: arguments, parameters, QoS, timers, signals."""
