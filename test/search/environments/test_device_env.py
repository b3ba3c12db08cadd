# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A batch on a CUDA device has the missions of the batch on the CPU."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from device_cases import CASES, compare
from numba import cuda

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import vector_env
from dsse_ros.search.environments.joint_vector_env import JointVectorEnv

# A few worlds leave most of a GPU idle.
pytestmark = pytest.mark.filterwarnings("ignore:.*under-utilization")

BELIEF = {"observe": "belief"}
HERE = Path(__file__).parent
SIMULATED = ("v2", "coverage", "faults", "belief-v2")
"""The others have the same types of arguments."""


@pytest.mark.slow
def test_simulated_threads_play_the_missions_of_the_cpu() -> None:
    """Numba's simulator calls the kernels' functions as they are compiled for the CPU."""
    done = subprocess.run(
        [sys.executable, str(HERE / "device_cases.py"), *SIMULATED],
        env=os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.stdout.split() == list(SIMULATED), done.stderr


def test_without_a_gpu_the_device_is_refused_in_one_line() -> None:
    if cuda.is_available():
        pytest.skip("has a CUDA device")
    with pytest.raises(FieldError, match="device must be cpu, as Numba finds no GPU") as refused:
        vector_env(2, device="cuda")
    assert "\n" not in str(refused.value)


def test_an_unknown_device_is_refused() -> None:
    with pytest.raises(FieldError, match="device must be one of cpu, cuda, got 'gpu'"):
        vector_env(2, device="gpu")


@pytest.mark.gpu
@pytest.mark.parametrize("name", CASES)
def test_a_device_plays_the_missions_of_the_cpu(name: str) -> None:
    compare(name, 300, 120, exact=False)


@pytest.mark.gpu
def test_what_a_device_does_not_do_is_refused_in_one_line() -> None:
    refusals: tuple[tuple[str, dict[str, Any]], ...] = (
        ("device must be cpu where drones fly in metres, got 'cuda'", {"rules": "flight"}),
        ("threads must be 1 with device cuda, got 2", {"threads": 2}),
        ("observe must be map with device cuda with rules sea", {"rules": "sea", **BELIEF}),
        ("observe must be map with device cuda with 2 persons", {"person_amount": 2, **BELIEF}),
        ("grid_size must be smaller, or the steps fewer", {"grid_size": 100, **BELIEF}),
    )
    for refused, fields in refusals:
        with pytest.raises(FieldError, match=refused):
            vector_env(2, device="cuda", **fields)
    with pytest.raises(FieldError, match="device must be cpu with Gymnasium's interface"):
        JointVectorEnv(vector_env(2, device="cuda"))


@pytest.mark.gpu
def test_an_action_that_the_rules_do_not_allow_is_refused_once_the_device_has_seen_it() -> None:
    batch = vector_env(3, device="cuda", rules="v2", lazy=True)
    batch.reset(seed=1)
    with pytest.raises(FieldError, match="actions must be integers"):
        batch.step(np.zeros((3, 2), np.int8))
    batch.step(np.full(batch.worlds.shape, 99))
    with pytest.raises(FieldError, match="or -1 for nothing, got 99 in an earlier step"):
        batch.synchronize()
    batch.step(np.full(batch.worlds.shape, 0))
    batch.synchronize()


@pytest.mark.gpu
def test_pytorch_and_jax_take_the_arrays_without_a_copy() -> None:
    torch, jnp = pytest.importorskip("torch"), pytest.importorskip("jax.numpy")
    batch = vector_env(64, device="cuda", rules="v2")
    batch.reset(seed=1)
    actions = torch.zeros(batch.worlds.shape, dtype=torch.int64, device="cuda")
    observations, rewards, terminated, truncated, infos = batch.step(actions)
    batch.synchronize()
    arrays: dict[str, Any] = {**observations, **infos, "rewards": rewards, "ended": terminated}
    for name, array in arrays.items():
        address, _ = array.__cuda_array_interface__["data"]
        assert torch.as_tensor(array, device="cuda").data_ptr() == address, name
        if array.dtype.itemsize < 8:
            # Without its option for 64 bits, JAX converts.
            assert jnp.asarray(array).unsafe_buffer_pointer() == address, name
        assert np.array_equal(torch.as_tensor(array, device="cuda").cpu(), np.asarray(array))


@pytest.mark.gpu
def test_arrays_stay_as_they_are_while_somebody_holds_them() -> None:
    torch = pytest.importorskip("torch")
    batch = vector_env(8, device="cuda", rules="v2")
    observations, _ = batch.reset(seed=1)
    held = torch.as_tensor(observations["probability"], device="cuda")
    before = held.clone()
    del observations
    for _ in range(10):
        batch.step(np.zeros(batch.worlds.shape, np.int8))
    assert torch.equal(held, before)
