# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Policies trained with PyTorch (extra `train`)."""

from dsse_ros.base.extras import pip_install

try:
    import torch  # noqa: F401
except ImportError as error:
    raise ImportError(f"{error}; {pip_install('train')}", name=error.name) from error
