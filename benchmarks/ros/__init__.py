# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Programs of the lockstep benchmark: the peer of `sim_node`, and a substitute for `sim_node`."""
