# SPDX-License-Identifier: Apache-2.0
"""Puts the soak where these tests can import it, after whatever is installed."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2]))
