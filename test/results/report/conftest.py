# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A browser."""

from browsers import browser  # noqa: F401
