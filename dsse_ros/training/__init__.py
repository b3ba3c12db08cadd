# SPDX-License-Identifier: Apache-2.0
"""Policies trained with Stable-Baselines3 on PyTorch (extra `train`)."""
