# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the wrappers of DSSE 1.1.9 were seen to hand out (test/oracles)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

FILE = Path(__file__).parent.parent / "oracles" / "data" / "v2_wrappers.npz"


def read() -> tuple[dict[str, Any], list[tuple[dict[str, Any], dict[str, np.ndarray]]]]:
    """Return `meta`, and each script with its arrays by name."""
    with np.load(FILE) as stored:
        meta = json.loads(str(stored["meta"]))
        arrays = {name: stored[name] for name in stored.files if name != "meta"}
    episodes: list[dict[str, np.ndarray]] = [{} for _ in meta["scripts"]]
    for name, array in arrays.items():
        number, _, own = name.partition("/")
        episodes[int(number)][own] = array
    return meta, list(zip(meta["scripts"], episodes, strict=True))


META, EPISODES = read()
