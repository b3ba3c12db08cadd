# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The files of a mission: definition, log, journal and snapshots."""
