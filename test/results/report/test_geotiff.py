# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of matrices over the grid as GeoTIFF."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import cell_to_geodetic
from dsse_ros.world.scenario.probability_matrix import ProbabilityMatrix

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import xy  # noqa: E402
from rasterio.warp import transform  # noqa: E402

from dsse_ros.results.report.geotiff import write_geotiff  # noqa: E402


def a_matrix(size: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).random((size, size), np.float32)


@st.composite
def frames(draw: st.DrawFn) -> GridFrame:
    """Grids of up to 60 km, anywhere on Earth where people live."""
    size = draw(st.integers(1, 120))
    return GridFrame(
        grid_size=size,
        cell_size_m=draw(st.floats(1, 500)),
        origin_lat_deg=draw(st.floats(-85, 85)),
        origin_lon_deg=draw(st.floats(-180, 180)),
        origin_alt_m=draw(st.floats(-100, 3000)),
        alt_m=100.0,
    )


@pytest.mark.slow
@given(frames())
def test_cells_are_within_a_centimetre_of_their_place(
    tmp_path_factory: pytest.TempPathFactory, frame: GridFrame
) -> None:
    path = tmp_path_factory.getbasetemp() / "placed.tif"
    write_geotiff(path, frame, {"of": a_matrix(frame.grid_size.columns)})
    edges = np.linspace(0, frame.grid_size.columns, 5)
    row, col = (edges_of.ravel() for edges_of in np.meshgrid(edges, edges))
    with rasterio.open(path) as raster:
        x, y = xy(raster.transform, row, col, offset="ul")
        lon, lat = transform(raster.crs, "EPSG:4326", x, y)
    alt_m = frame.origin_alt_m
    expected_lat, expected_lon, _ = cell_to_geodetic(frame, col - 0.5, row - 0.5, 0.0)
    placed = pymap3d.geodetic2ecef(np.array(lat), np.array(lon), alt_m)
    expected = pymap3d.geodetic2ecef(expected_lat, expected_lon, alt_m)
    assert np.linalg.norm(np.subtract(placed, expected), axis=0).max() < 0.01


FRAME = GridFrame(
    grid_size=12, cell_size_m=130.0, origin_lat_deg=-24.04, origin_lon_deg=-46.17,
    origin_alt_m=5.0, alt_m=120.0,
)  # fmt: skip


BANDS = {"first": a_matrix(12, 1), "second": a_matrix(12, 2)}


def test_every_value_is_read_where_it_was_written(tmp_path: Path) -> None:
    write_geotiff(tmp_path / "two.tif", FRAME, BANDS)
    with rasterio.open(tmp_path / "two.tif") as raster:
        assert raster.descriptions == tuple(BANDS)
        assert np.array_equal(raster.read(), np.stack(list(BANDS.values())))


def test_tifffile_reads_the_same_values(tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile")
    write_geotiff(tmp_path / "two.tif", FRAME, BANDS)
    assert np.array_equal(tifffile.imread(tmp_path / "two.tif"), np.stack(list(BANDS.values())))


def test_a_scenario_takes_it_as_probability_matrix_of_its_grid(tmp_path: Path) -> None:
    path = tmp_path / "poc.tif"
    write_geotiff(path, FRAME, {"poc": a_matrix(12)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        matrix = ProbabilityMatrix.read(path)
    assert np.array_equal(matrix.values, a_matrix(12))
    on_grid = matrix.on_grid(GridShape.square(12), 130.0, (-24.04, -46.17, 5.0))
    assert np.array_equal(on_grid.values, matrix.values)


def test_a_folder_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        write_geotiff(tmp_path / "nowhere" / "a.tif", FRAME, {"poc": a_matrix(12)})
