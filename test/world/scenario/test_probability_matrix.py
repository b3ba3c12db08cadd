# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A probability matrix comes from any kind of file, and what is none gets one clear line."""

from __future__ import annotations

import io
import os
import re
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.frames import cell_centre
from dsse_ros.world.scenario.geodesy import surface_to_geodetic
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

RULES = profile("coverage")
# What rasterio does with its own dependencies.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
MATRIX = np.arange(16.0).reshape(4, 4) + 0.125
PLACE: dict[str, Any] = {"origin_lat": -24.04, "origin_lon": -46.17, "cell_size": 130.0}


def write_tiff(path: Path, matrix: NDArray[Any], **options: Any) -> Path:
    """Write a matrix as GeoTIFF."""
    rasterio = pytest.importorskip("rasterio")
    rows, cols = matrix.shape
    with rasterio.open(
        path, "w", driver="GTiff", height=rows, width=cols, count=1, dtype=matrix.dtype, **options
    ) as file:
        file.write(matrix, 1)
    return path


def georeference(shift_cells: float = 0.0) -> dict[str, Any]:
    """Where the grid of `PLACE` lies, in degrees, moved to the east."""
    rasterio = pytest.importorskip("rasterio")
    origin = (PLACE["origin_lat"], PLACE["origin_lon"], 0.0)
    ends = (cell_centre(GridShape.square(4), 130.0, col, row) for col, row in ((0, 0), (3, 3)))
    (north, west), (south, east) = (surface_to_geodetic(origin, *end) for end in ends)
    across, down = (east - west) / 3, (north - south) / 3
    west += shift_cells * across
    corner = (west - across / 2, north + down / 2)
    return {
        "crs": "EPSG:4326",
        "transform": rasterio.transform.from_origin(*corner, across, down),
    }


def saved(folder: Path, kind: str) -> Path:
    """`MATRIX` as a file of this kind."""
    path = folder / f"matrix.{kind}"
    if kind == "npy":
        np.save(path, MATRIX)
    elif kind == "csv":
        np.savetxt(path, MATRIX, fmt="%.17g", delimiter=",")
    else:
        write_tiff(path, MATRIX, **georeference())
    return path


@pytest.mark.parametrize("kind", ["npy", "csv", "tif", "tiff"])
def test_each_kind_of_file_gives_the_same_map(kind: str, tmp_path: Path) -> None:
    path = saved(tmp_path, kind)
    env = parallel_env(rules="coverage", probability_matrix=path, **PLACE)
    assert env.scenario.grid_size == (4, 4)
    observed = env.reset()[0]["drone0"][1]
    np.testing.assert_array_equal(observed, (MATRIX / MATRIX.sum()).astype(np.float32))
    of_array = Scenario(probability_matrix=MATRIX.tolist())
    assert of_array.probability_matrix is not None
    assert env.scenario.probability_matrix is not None
    assert env.scenario.probability_matrix == of_array.probability_matrix


def test_the_path_in_a_scenario_s_file_starts_from_its_folder(tmp_path: Path) -> None:
    saved(tmp_path, "npy")
    file = tmp_path / "scenario.yaml"
    file.write_text("probability_matrix: matrix.npy\n")
    np.testing.assert_array_equal(Scenario.from_yaml(file).probability_matrix.values, MATRIX)  # type: ignore[union-attr]
    assert Scenario.from_dict({"probability_matrix": ""}).probability_matrix is None


def test_a_tiff_s_cells_without_data_count_as_zero(tmp_path: Path) -> None:
    matrix = MATRIX.astype(np.float32)
    matrix[1, 2] = -9999.0
    path = write_tiff(tmp_path / "matrix.tif", matrix, nodata=-9999.0, **georeference())
    found = Scenario(probability_matrix=path).probability_matrix
    assert found is not None and found.values[1, 2] == 0.0


@pytest.mark.parametrize(("south_up", "east_left"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("with_crs", [True, False])
def test_a_tiff_is_never_upside_down(
    tmp_path: Path, south_up: bool, east_left: bool, with_crs: bool
) -> None:
    rasterio = pytest.importorskip("rasterio")
    about = georeference()
    place = about["transform"]
    stored = MATRIX[:: -1 if south_up else 1, :: -1 if east_left else 1]
    corner = place * (4 if east_left else 0, 4 if south_up else 0)
    across, down = -place.a if east_left else place.a, -place.e if south_up else place.e
    about["transform"] = rasterio.Affine(across, 0, corner[0], 0, down, corner[1])
    if not with_crs:
        del about["crs"]
    path = write_tiff(tmp_path / "matrix.tif", stored, **about)
    scenario = Scenario(probability_matrix=path, **PLACE)
    scenario.resolve(RULES)
    assert scenario.probability_matrix is not None
    np.testing.assert_array_equal(scenario.probability_matrix.values, MATRIX)


def test_a_tiff_that_is_turned_on_no_earth_or_off_it_is_refused(tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    about = georeference()
    turned = {"transform": about["transform"] * rasterio.Affine.rotation(20)}
    path = write_tiff(tmp_path / "turned.tif", MATRIX, **turned)
    with pytest.raises(FieldError, match="probability_matrix must have its rows from west to east"):
        Scenario(probability_matrix=path)
    about["crs"] = "+proj=geos +h=35785831 +lon_0=-75 +sweep=x"
    about["transform"] = rasterio.transform.from_bounds(-5.4e6, -5.4e6, 5.4e6, 5.4e6, 4, 4)
    path = write_tiff(tmp_path / "off.tif", MATRIX, **about)
    with pytest.raises(FieldError, match="must have its corners on the Earth, got '"):
        Scenario(probability_matrix=path)


LAYOUTS = {
    "a zone of UTM": ("EPSG:32723", 25.0, 0.0),
    "coarse cells of degrees": ("EPSG:4326", 4e-3, 0.0),
    "rows from the south": ("EPSG:32723", 25.0, 180.0),
    "a turned raster": ("EPSG:32723", 60.0, 30.0),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_raster_of_any_layout_is_resampled_with_its_sum(tmp_path: Path, layout: str) -> None:
    rasterio = pytest.importorskip("rasterio")
    from rasterio.warp import transform

    crs, cell, turned = LAYOUTS[layout]
    middle = surface_to_geodetic((PLACE["origin_lat"], PLACE["origin_lon"], 0.0), 2600.0, 2600.0)
    (x,), (y,) = transform("EPSG:4326", crs, [middle[1]], [middle[0]])
    matrix = np.random.default_rng(1).random((7, 12)) ** 2
    place = (
        rasterio.Affine.translation(x, y) * rasterio.Affine.rotation(turned)
        * rasterio.Affine.scale(cell, -cell) * rasterio.Affine.translation(-6, -3.5)
    )  # fmt: skip
    path = write_tiff(tmp_path / "matrix.tif", matrix, crs=crs, transform=place)
    scenario = Scenario(probability_matrix=path, grid_size=40, **PLACE)
    found = scenario.resolve(RULES).probability_matrix
    assert found is not None and found.values.shape == (40, 40)
    assert found.values.sum() == pytest.approx(matrix.sum(), rel=1e-9)
    # The mean place stays, too.
    rows, cols = np.indices(matrix.shape) + 0.5
    lon, lat = transform(crs, "EPSG:4326", *(axis.ravel() for axis in place * (cols, rows)))
    wanted = np.average([lat, lon], axis=1, weights=matrix.ravel())
    row, col = np.indices((40, 40))
    places = surface_to_geodetic(
        (PLACE["origin_lat"], PLACE["origin_lon"], 0.0),
        *cell_centre(GridShape.square(40), 130.0, col, row),
    )
    mean = [np.average(axis, weights=found.values) for axis in places]
    assert mean == pytest.approx(wanted.tolist(), abs=3e-5)
    # The scenario of a log has the file, and gives the same map.
    again = Scenario.from_dict({"probability_matrix": scenario.probability_matrix.to_json(),  # type: ignore[union-attr]
                                "grid_size": 40, **PLACE}).resolve(RULES)  # fmt: skip
    np.testing.assert_array_equal(again.probability_matrix.values, found.values)  # type: ignore[union-attr]
    assert Scenario(probability_matrix=path, **PLACE).grid_of(RULES)[0] == (12, 7)


def test_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    (tmp_path / "matrix.csv").write_bytes(b"\xef\xbb\xbf1,2\n3,4\n")
    found = Scenario(probability_matrix=tmp_path / "matrix.csv").probability_matrix
    assert found is not None and found.values.tolist() == [[1, 2], [3, 4]]


def test_a_tiff_partly_off_the_grid_is_logged_and_one_elsewhere_refused(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_tiff(tmp_path / "matrix.tif", MATRIX, **georeference(2.0))
    found = Scenario(probability_matrix=path, **PLACE).resolve(RULES).probability_matrix
    assert found is not None
    np.testing.assert_allclose(found.values[:, 2:], MATRIX[:, :2], rtol=0.01)
    assert "probability_matrix: 56.6 % of '" in caplog.text
    path = write_tiff(tmp_path / "elsewhere.tif", MATRIX, **georeference(50.0))
    with pytest.raises(FieldError, match="must be on the grid of .*, got '.* elsewhere"):
        Scenario(probability_matrix=path, **PLACE).resolve(RULES)


def test_without_rasterio_a_tiff_is_refused_with_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "matrix.tif").write_bytes(b"II*\x00")
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(FieldError, match=r"needs rasterio; .* -m pip install '.*\[geotiff\]'$"):
        Scenario(probability_matrix=tmp_path / "matrix.tif")


@pytest.mark.parametrize(
    "matrix",
    [
        [[0.0]],
        [[-1.0, 2.0], [0.0, 0.0]],
        [[np.nan]],
        [[np.inf]],
        [1.0],
        [[1.0, 2.0], [3.0]],
        [],
        [["a"]],
        [[1j]],
        7,
        {},
        {"content": "AAAAAAAA8D8=", "corners": None},
        {"path": "", "sha256": ""},
    ],
)
def test_what_is_no_matrix_is_refused_in_one_line(matrix: Any) -> None:
    with pytest.raises(FieldError, match=r"^probability_matrix must be .*, got ") as refusal:
        Scenario(probability_matrix=matrix)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.npy", b"", "a.npy"),
        ("a.npy", b"\x93NUMPY\x01\x00", "a.npy"),
        ("a.csv", b"1,2\n3\n", "a.csv"),
        ("a.csv", b"1,x\n3,4\n", "a.csv"),
        ("a.csv", b"\xff\xfe", "a.csv"),
        ("a.tif", b"no tiff", "a.tif"),
        ("a.txt", b"1", "a.txt"),
        ("a.npy", None, "No such file or directory"),
        ("a.tif", None, "No such file or directory"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(
    name: str, content: bytes | None, text: str, tmp_path: Path
) -> None:
    if name == "a.tif":
        pytest.importorskip("rasterio")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(FieldError, match=re.escape(text)) as refusal:
        Scenario(probability_matrix=tmp_path / name)
    assert str(refusal.value).startswith("probability_matrix must be a matrix of finite")
    assert "\n" not in str(refusal.value)


def test_a_matrix_comes_back_from_its_path_and_digest_while_the_file_is_the_same(
    tmp_path: Path,
) -> None:
    path = saved(tmp_path, "npy")
    matrix = Scenario(probability_matrix=path).probability_matrix
    assert (
        matrix is not None
        and Scenario(probability_matrix=matrix.to_json()).probability_matrix == matrix
    )
    np.save(path, MATRIX + 1)
    with pytest.raises(FieldError, match=f"must be {str(path)!r} with the SHA-256 .*, got a file"):
        Scenario(probability_matrix=matrix.to_json())
    path.unlink()
    with pytest.raises(FieldError, match=f"got {str(path)!r}: No such file"):
        Scenario(probability_matrix=matrix.to_json())


@pytest.mark.parametrize("field", ["probability_matrix", "transition_probabilities"])
@pytest.mark.parametrize("suffix", ["npy", "npz", "csv", "tif"])
def test_what_is_no_regular_file_is_never_opened(tmp_path: Path, field: str, suffix: str) -> None:
    pipe = tmp_path / f"pipe.{suffix}"
    os.mkfifo(pipe)
    (tmp_path / f"folder.{suffix}").mkdir()
    (tmp_path / f"device.{suffix}").symlink_to("/dev/zero")
    for name in ("pipe", "folder", "device"):
        path = tmp_path / f"{name}.{suffix}"
        for source in (path, {"path": str(path), "sha256": "0" * 64}):
            with pytest.raises(FieldError, match=rf"^{field} must be a regular file, got '{path}'"):
                Scenario(**{field: source})


def test_a_matrix_of_another_size_or_task_is_refused() -> None:
    scenario = Scenario(probability_matrix=MATRIX, grid_size=5)
    with pytest.raises(FieldError, match=r"must have 5 x 5 cells.* got an array of 4 x 4$"):
        scenario.resolve(RULES)
    for name in ("paper", "v1", "v2"):
        with pytest.raises(
            FieldError, match=rf"^probability_matrix must .* got .* in rules {name}$"
        ):
            Scenario(probability_matrix=MATRIX).resolve(profile(name))


def test_a_matrix_with_nothing_in_the_area_is_refused() -> None:
    matrix = np.zeros((20, 20))
    matrix[0, 0] = 1.0
    square = [[-24.035, -46.165], [-24.035, -46.15], [-24.02, -46.15], [-24.02, -46.165]]
    with pytest.raises(FieldError, match=r"^cover_min_probability must .* cell of the area, got "):
        parallel_env(rules="coverage", probability_matrix=matrix, area=square, **PLACE)


def header_of(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    """The header of an array in NumPy's format."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": dtype, "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.npy", header_of((100_000, 100_000))),
        ("a.npy", header_of((9_000, 9_000)) + bytes(800)),
        ("a.npy", header_of((10_001, 10_001), "|u1")),
        ("a.npy", header_of((5_000, 5_000), "<U100")),
        ("a.npy", header_of((10**8,))),
        ("a.npy", header_of((10**30, 10**30))),
        ("a.npy", header_of((-9, -9)) + bytes(648)),
        ("a.csv", b"1," * 3_000_000 + b"1"),
        ("a.csv", b"1\n" * 10_001),
        ("a.csv", b"1,1\n" + b"1\n" * 100_000),
        ("a.csv", b"1" * 200_000),
        ("a.csv", b'"' + b"1\n" * 200_000),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_file_of_a_larger_matrix_is_refused_before_there_is_memory_for_it(
    name: str, content: bytes, tmp_path: Path, little_memory: Any
) -> None:
    (tmp_path / name).write_bytes(content)
    del content
    with (
        little_memory(),
        pytest.raises(FieldError, match="must be a matrix .* at most 10000 a side"),
    ):
        Scenario(probability_matrix=tmp_path / name)


@pytest.mark.parametrize("block", [16, 60_000])
def test_a_tiff_is_looked_at_before_it_is_read(
    block: int, tmp_path: Path, little_memory: Any
) -> None:
    rasterio = pytest.importorskip("rasterio")
    side = 12_000 if block == 16 else 16
    profile_of_it: dict[str, Any] = {
        "driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "uint8",
        "sparse_ok": True, "tiled": True, "blockxsize": block, "blockysize": block,
        "compress": "deflate",
    }  # fmt: skip
    path = tmp_path / "a.tif"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path, "w", **profile_of_it):
            pass
    assert path.stat().st_size < 10_000_000
    with little_memory(), pytest.raises(FieldError, match="must be a matrix"):
        Scenario(probability_matrix=path)


FAULTS = {
    "separator": ("1;2\n3;4\n", "line 1 has '1;2'; values are separated by commas, not by ';'"),
    "blank": ("1 2\n3 4\n", "line 1 has '1 2'; values are separated by commas, not by ' '"),
    "header": ("a,b\n1,2\n", "line 1 has 'a'"),
    "ragged": ("1,2\n3\n", "line 2 has 1 values, the first one 2"),
    "nan": ("1,2\nnan,4\n", "row 2, column 1 is nan"),
    "infinite": ("1,2\n3,inf\n", "row 2, column 2 is inf"),
    "negative": ("1,-2\n3,4\n", "row 1, column 2 is -2"),
    "zero": ("0,0\n0,0\n", "all its values are 0"),
    "empty": ("", "it has 1 axes, not two"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_of_a_matrix_is_named_with_its_place(fault: str, tmp_path: Path) -> None:
    text, cause = FAULTS[fault]
    path = tmp_path / "matrix.csv"
    path.write_text(text)
    with pytest.raises(FieldError, match=re.escape(cause)) as refusal:
        Scenario(probability_matrix=path)
    assert "\n" not in str(refusal.value)
    path = tmp_path / "matrix.dat"
    path.write_text("1")
    with pytest.raises(FieldError, match=r": its name ends in '\.dat'$"):
        Scenario(probability_matrix=path)
