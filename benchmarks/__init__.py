# SPDX-License-Identifier: Apache-2.0
"""Speed and memory beside the published packages and a C floor, and the published figures."""
