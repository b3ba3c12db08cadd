# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What compiled functions are made with: the compiler, draws, streaming writes."""
