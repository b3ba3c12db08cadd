# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is searched, by which rules: fields that are checked, and their files."""
