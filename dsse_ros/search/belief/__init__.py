# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Beliefs: the posterior probability of where the persons are."""
