# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make soak`: the promises of reliability, kept for long; the tests keep each for a short time."""
