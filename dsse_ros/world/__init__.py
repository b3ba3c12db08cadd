# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is searched, and by what: the scenario, drift, persons, sensors and kinds of drones."""
