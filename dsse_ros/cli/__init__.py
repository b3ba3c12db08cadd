# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The programs besides the nodes, and the entry points of all executables."""
