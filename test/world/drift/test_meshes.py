# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Forecasts on unstructured meshes are interpolated in their triangles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import little_memory
from forecasts import HOURS, SPAN, START, START_S, axis, by_flow, written, xarray

from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.shore import Box
from dsse_ros.world.drift.velocity_pairs import Choice

PLACES = ((-24.1, -46.2, 1800.0), (-23.8, -45.8, 9000.0), (-24.24, -46.01, 17900.0))


def linear(lat: Any, lon: Any, hours: Any) -> Any:
    """A current to the east; interpolation is exact."""
    return 0.2 * (lat + 24) + 0.3 * (lon + 46) + 0.05 * hours


def of_fvcom(count: int = 4000, *, land: float = np.inf, turn: float = 0.0) -> Any:
    """A forecast of FVCOM at the centres of its triangles; land lies north of a latitude."""
    rng = np.random.default_rng(2)
    lat, lon = rng.uniform(-25, -23, count), rng.uniform(-47, -45, count)
    sea = lat < land
    lat, lon = lat[sea], lon[sea]
    east = linear(lat, lon, HOURS[:, None])[:, None] * np.array([1.0, 2.0])[:, None]
    about = {"units": "meters s-1"}
    variables = {
        name: (("time", "siglay", "nele"), (sign * east).astype(np.float32),
               {**about, "standard_name": f"{word}_sea_water_velocity"})
        for name, sign, word in (("u", 1, "eastward"), ("v", -1, "northward"))
    }  # fmt: skip
    return xarray.Dataset(
        variables,
        coords={
            "time": axis("time", HOURS, units=f"hours since {START}"),
            "latc": ("nele", lat, {"standard_name": "latitude", "units": "degrees_north"}),
            "lonc": ("nele", lon + turn, {"standard_name": "longitude", "units": "degrees_east"}),
            "siglay": (("siglay", "node"), np.repeat([[-0.1], [-0.5]], 9, axis=1),
                       {"standard_name": "ocean_sigma/general_coordinate", "positive": "up"}),
        },
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 360.0])
def test_a_mesh_is_interpolated_in_its_triangles(tmp_path: Path, turn: float) -> None:
    pytest.importorskip("cf_xarray.units")
    flow = read_forecast("current", written(of_fvcom(turn=turn), tmp_path), SPAN)
    for place in PLACES:
        wanted = linear(*place[:2], place[2] / 3600)
        assert by_flow(flow, place) == pytest.approx((wanted, -wanted), abs=1e-4)


PRODUCTS: dict[str, tuple[tuple[str, str], Choice]] = {
    # NOAA's STOFS-3D has the surface as fields of its own.
    "fields of the surface": (("uvel_surface", "vvel_surface"), Choice(units="m/s")),
    # SCHISM itself has layers from the bottom on, without a coordinate.
    "layers": (
        ("horizontalVelX", "horizontalVelY"),
        Choice(units="m/s", select={"nSCHISM_vgrid_layers": 1}),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("product", PRODUCTS)
def test_the_surface_of_schism_is_read_at_its_nodes(tmp_path: Path, product: str) -> None:
    names, choice = PRODUCTS[product]
    node, layers = "nSCHISM_hgrid_node", "nSCHISM_vgrid_layers"
    dataset = of_fvcom().isel(siglay=[1, 0]).drop_vars("siglay")
    dataset = dataset.rename(nele=node, siglay=layers, latc="SCHISM_hgrid_node_y",
                             lonc="SCHISM_hgrid_node_x")  # fmt: skip
    dataset = dataset.rename(dict(zip(("u", "v"), names, strict=True)))
    if not choice.select:
        dataset = dataset.isel({layers: 1})
    for name in names:
        dataset[name].attrs = {"mesh": "SCHISM_hgrid", "data_horizontal_center": "node"}
    flow = read_forecast("current", written(dataset, tmp_path), SPAN, choice)
    for place in PLACES:
        wanted = linear(*place[:2], place[2] / 3600)
        assert by_flow(flow, place) == pytest.approx((wanted, -wanted), abs=1e-4)


@pytest.mark.slow
def test_a_place_off_the_mesh_has_no_value(tmp_path: Path) -> None:
    pytest.importorskip("cf_xarray.units")
    dataset = of_fvcom(land=-23.95)
    # A few points beyond the land must not be joined with the others.
    file = written(dataset, tmp_path)
    flow = read_forecast("current", file, SPAN, gap_cells=0)
    assert np.isnan(by_flow(flow, (-23.8, -46.0, 9000.0))).all()
    assert np.isfinite(by_flow(flow, (-24.1, -46.0, 9000.0))).all()
    assert "has a gap there" in flow.why_none(-23.8, -46.0, START_S + 3600, START_S + 7200)


REFUSED: dict[str, tuple[Any, str]] = {
    "elsewhere": (lambda: of_fvcom(land=-24.9), "file must cover latitude within -24.2500 to -23."),
    "one place": (
        lambda: of_fvcom().assign_coords(
            latc=("nele", np.full(4000, -24.0), {"units": "degrees_north"}),
            lonc=("nele", np.full(4000, -46.0), {"units": "degrees_east"}),
        ),
        "mesh must have latitudes and longitudes that differ",
    ),
    "layers without a meaning": (
        lambda: of_fvcom().drop_vars("siglay").rename(siglay="layers"),
        "u must have one layers, got 2; choose by select: {layers: ...}",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_mesh_that_does_not_fit_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    make, message = REFUSED[name]
    with little_memory(), pytest.raises(ValueError) as error:
        read_forecast("current", written(make(), tmp_path), SPAN)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_too_many_points_in_the_area_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "mesh.nc"
    xarray.Dataset(
        {name: (("time", "node"), np.zeros((2, 600_000), np.float32), {"units": "m s-1"})
         for name in ("uo", "vo")},
        coords={
            "time": axis("time", [0.0, 9.0], units=f"hours since {START}"),
            "lat": ("node", np.linspace(-24, -23.9, 600_000)),
            "lon": ("node", np.full(600_000, -46.0)),
        },
    ).to_netcdf(file)  # fmt: skip
    span = SPAN._replace(box=Box(-24, -23.9, -46.1, -45.9))
    with pytest.raises(ValueError, match="mesh must have at most 500000 points in the area, got 6"):
        read_forecast("current", file, span)
