# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make soak`: the reliability promises in long runs; the tests check each in a short run."""
