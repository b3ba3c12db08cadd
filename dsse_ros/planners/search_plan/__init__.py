# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A rectangle, a pattern and times for every unit of a search, by the POS of all of them."""
