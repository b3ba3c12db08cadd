# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A live search: its truth comes from outside, and its belief follows from a journal of inputs."""
