# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Joint paths of searchers that detect a moving target with the greatest probability.

They show how far the plans of `belief` are from the best ones. See `search` for the method.
"""
