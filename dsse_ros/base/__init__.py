# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What knows nothing of the search: compilation, checked fields, files, small helpers."""
