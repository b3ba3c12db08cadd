# SPDX-License-Identifier: Apache-2.0
"""The programs around the nodes, and where every executable begins."""
