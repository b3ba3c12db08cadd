# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Policies trained with Stable-Baselines3 on PyTorch (extra `train`)."""
