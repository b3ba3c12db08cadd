# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The benchmark of a node gives it parameters that it has."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.lockstep import BELIEFS, _parameters
from dsse_ros.ros.nodes.settings import SHORT_NAMES, SIM_PARAMETERS


@pytest.mark.parametrize("name", list(BELIEFS))
def test_the_parameters_are_those_of_sim_node(name: str) -> None:
    arguments = _parameters(np.zeros((2, 2), np.int64), **BELIEFS[name])
    names = {part.split(":=")[0] for part in arguments if ":=" in part}
    assert names <= {*SIM_PARAMETERS, *SHORT_NAMES}
