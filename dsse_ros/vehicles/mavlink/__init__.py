# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""MAVLink messages, and the links that carry them."""
