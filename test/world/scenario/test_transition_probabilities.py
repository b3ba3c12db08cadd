# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A Markov chain comes from any kind of file, and what is none gets one clear line."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chains import matrix_of, uneven_chain
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.scenario.transition_probabilities import TransitionProbabilities

CHAIN = uneven_chain(4)
RULES = profile("paper", person_motion="markov_chain")
# As the matrix has them: a step that would leave the grid stays.
INNER = CHAIN.copy()
for _row, _col, _step in np.ndindex(INNER.shape):
    if not (0 <= _row + _step // 3 - 1 < 4 and 0 <= _col + _step % 3 - 1 < 4):
        INNER[_row, _col, 4] += INNER[_row, _col, _step]
        INNER[_row, _col, _step] = 0.0


def probabilities(given: Any) -> NDArray[np.float64]:
    """The probabilities in a scenario with this value of the field."""
    found = Scenario(transition_probabilities=given).transition_probabilities
    assert found is not None
    return found.values


def saved(folder: Path, kind: str) -> Path:
    """The chain as a file of this kind."""
    path = folder / f"chain.{'npz' if kind.startswith('cs') else 'npy'}"
    if kind == "steps":
        np.save(path, INNER)
    elif kind == "dense":
        np.save(path, matrix_of(CHAIN))
    else:
        sparse = pytest.importorskip("scipy.sparse")
        sparse.save_npz(path, sparse.csr_matrix(matrix_of(CHAIN)).asformat(kind))
    return path


@pytest.mark.parametrize("kind", ["steps", "dense", "csr", "csc"])
def test_each_kind_of_file_gives_the_same_chain(kind: str, tmp_path: Path) -> None:
    found = probabilities(saved(tmp_path, kind))
    np.testing.assert_allclose(found, INNER, rtol=0, atol=1e-15)
    assert not found.flags.writeable


def test_an_array_and_its_file_are_the_same_chain_and_set_the_size_of_the_grid(
    tmp_path: Path,
) -> None:
    of_file = Scenario(transition_probabilities=saved(tmp_path, "steps"))
    assert of_file == Scenario(transition_probabilities=INNER.tolist())
    assert of_file.resolve(RULES).grid_size == (4, 4)
    assert parallel_env(of_file, rules=RULES).scenario.grid_size == (4, 4)


def test_the_path_in_a_scenario_s_file_starts_from_its_folder(tmp_path: Path) -> None:
    saved(tmp_path, "steps")
    file = tmp_path / "scenario.yaml"
    file.write_text("transition_probabilities: chain.npy\n")
    assert Scenario.from_yaml(file) == Scenario(transition_probabilities=INNER)
    assert Scenario.from_dict({"transition_probabilities": ""}).transition_probabilities is None


def test_a_chain_comes_back_from_its_path_and_digest_while_the_file_is_the_same(
    tmp_path: Path,
) -> None:
    path = saved(tmp_path, "steps")
    stated = Scenario(transition_probabilities=path)
    assert stated.transition_probabilities is not None
    reference = stated.transition_probabilities.to_json()
    assert Scenario(transition_probabilities=reference) == stated
    np.save(path, uneven_chain(4, seed=1))
    line = f"^transition_probabilities must be {str(path)!r} with the SHA-256 .*, got a file"
    with pytest.raises(FieldError, match=line):
        Scenario(transition_probabilities=reference)


def changed(cell: tuple[int, int, int], value: float) -> NDArray[np.float64]:
    """The chain with another value of a step (row, col, number)."""
    chain = INNER.copy()
    chain[cell] = value
    return chain


def moved(value: float) -> NDArray[np.float64]:
    """The matrix of a chain that stays, but for a move from cell [3, 0] to [0, 1]."""
    matrix = np.eye(16)
    matrix[3, 3], matrix[3, 4] = 1.0 - value, value
    return matrix


@pytest.mark.parametrize(
    ("given", "line"),
    [
        (changed((1, 2, 3), -0.5), "be >= 0 in each cell, got -0.5 in cell [2, 1]"),
        (changed((1, 2, 3), np.nan), "be >= 0 in each cell, got nan in cell [2, 1]"),
        (changed((0, 3, 4), np.inf), "sum to 1 within 1e-09 in each cell, got inf in cell [3, 0]"),
        (0.5 * INNER, "sum to 1 within 1e-09 in each cell, got 0.5 in cell [0, 0]"),
        (
            moved(0.25),
            "be 0 for moves of more than one cell along an axis, got 0.25 from cell [3, 0] to "
            "[0, 1]",
        ),
        (INNER[:, :, :5], "be an array (R, C, 9) or"),
        (np.eye(15), "be an array (R, C, 9) or"),
        (np.zeros((0, 0, 9)), "be an array (R, C, 9) or"),
        (np.zeros((0, 0)), "be an array (R, C, 9) or"),
        (INNER.astype(str), "be an array (R, C, 9) or"),
        (INNER.astype(complex), "be an array (R, C, 9) or"),
        (1.0, "be an array (R, C, 9) or"),
        ({}, "be an array (R, C, 9) or"),
        ("chain.txt", "be an array (R, C, 9) or"),
        ("missing.npy", "be an array (R, C, 9) or"),
        ("missing.npz", "be an array (R, C, 9) or"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_no_chain_is_refused_in_one_line(given: Any, line: str) -> None:
    with pytest.raises(
        FieldError, match=f"^transition_probabilities must {re.escape(line)}"
    ) as refusal:
        Scenario(transition_probabilities=given)
    assert "\n" not in str(refusal.value) and ", got " in str(refusal.value)


def test_a_chain_of_another_size_or_motion_is_refused() -> None:
    scenario = Scenario(transition_probabilities=INNER, grid_size=5)
    with pytest.raises(FieldError, match=r"must have 5 x 5 cells.* got an array of 4 x 4$"):
        scenario.resolve(RULES)
    for motion in ("window", "random_walk", "constant_drift"):
        line = f"^transition_probabilities must .* markov_chain, got {motion}$"
        with pytest.raises(FieldError, match=line):
            Scenario(transition_probabilities=INNER).resolve(profile("paper", person_motion=motion))


def header_of(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    """The header of an array in NumPy's format."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": dtype, "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


def archive(**parts: bytes) -> bytes:
    """A compressed sparse matrix of 4 x 4 cells, with other parts."""
    numbers = np.arange(16)
    arrays = {"data": np.ones(16), "indices": numbers, "indptr": np.arange(17)}
    file = io.BytesIO()
    np.savez_compressed(file, shape=np.array([16, 16]), format=np.array(b"csr"), **arrays)  # type: ignore[arg-type]
    contents = {}
    with zipfile.ZipFile(file) as stored:
        contents = {name: stored.read(name) for name in stored.namelist()}
    contents |= {f"{name}.npy": content for name, content in parts.items()}
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as stored:
        for name, content in contents.items():
            stored.writestr(name, content)
    return file.getvalue()


def array(values: Any) -> bytes:
    """An array in NumPy's format."""
    file = io.BytesIO()
    np.save(file, np.asarray(values))
    return file.getvalue()


def test_a_sparse_matrix_needs_no_scipy(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(archive())
    stays = probabilities(tmp_path / "a.npz")
    assert stays.shape == (4, 4, 9) and (stays[:, :, 4] == 1.0).all() and stays.sum() == 16


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.npy", b""),
        ("a.npy", header_of((10_000, 10_000, 9))),
        ("a.npy", header_of((1_001, 1_001, 9))),
        ("a.npy", header_of((3_136, 3_136))),
        ("a.npy", header_of((900, 900, 9)) + bytes(800)),
        ("a.npy", header_of((4, 4, 9), "|O")),
        ("a.npz", b"PK"),
        ("a.npz", archive()[:-50]),
        ("a.npz", archive(data=header_of((10**10,)))),
        ("a.npz", archive(indices=header_of((10**10,), "<i8"))),
        ("a.npz", archive(format=header_of((), "<U100000000"))),
        ("a.npz", archive(shape=header_of((10**9,), "<i8"))),
        ("a.npz", archive(shape=array([10**8, 10**8]))),
        ("a.npz", archive(shape=array([16, 25]))),
        ("a.npz", archive(shape=array([15, 15]))),
        ("a.npz", archive(shape=array([0, 0]))),
        ("a.npz", archive(format=array("dia"))),
        ("a.npz", archive(indices=array(np.full(16, 16)))),
        ("a.npz", archive(indices=array(np.full(16, -1)))),
        ("a.npz", archive(indptr=array(np.arange(17)[::-1]))),
        ("a.npz", archive(indptr=array(np.arange(18)))),
        ("a.npz", archive(indptr=array(np.arange(1, 18)))),
        ("a.npz", archive(data=array(np.ones(17)))),
        ("a.npz", archive(data=array(np.array(["1"] * 16)))),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_file_that_is_no_chain_is_refused_before_there_is_memory_for_it(
    name: str, content: bytes, tmp_path: Path, little_memory: Any
) -> None:
    (tmp_path / name).write_bytes(content)
    with (
        little_memory(),
        pytest.raises(FieldError, match="^transition_probabilities must be an array") as refusal,
    ):
        Scenario(transition_probabilities=tmp_path / name)
    assert "\n" not in str(refusal.value)


def test_what_has_another_shape_or_is_no_matrix_is_refused_for_that(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match=r": its shape is \(4, 4, 8\)$"):
        TransitionProbabilities.read(np.full((4, 4, 8), 1 / 8))
    np.save(flat := tmp_path / "flat.npy", np.full(144, 1 / 9))
    with pytest.raises(FieldError, match=r": its shape is \(144,\)$"):
        TransitionProbabilities.read(flat)
    np.savez(dense := tmp_path / "dense.npz", np.eye(4))
    with pytest.raises(FieldError, match="it is no sparse matrix of SciPy"):
        TransitionProbabilities.read(dense)
