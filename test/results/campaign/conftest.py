# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Without what the extra `campaign` brings, there are no campaigns to test."""

from __future__ import annotations

import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("scipy")
