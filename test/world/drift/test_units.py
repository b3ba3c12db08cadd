# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Units of speed are read as files spell them, or refused."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
from forecasts import PLACES, SPAN, by_flow, by_xarray, pair, written, xarray

from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.netcdf import Unfit
from dsse_ros.world.drift.units import metres_per_second
from dsse_ros.world.drift.velocity_pairs import Choice

pytest.importorskip("cf_xarray.units")


def of(units: str) -> object:
    return xarray.DataArray(1.0, attrs={"units": units}, name="uo")


KNOT = 1852 / 3600
SPELLINGS = (
    "m s-1", "m/s", "m s**-1", "m s^-1", "m.s-1", "meter second-1", "m/sec", "meters s-1",
    "metre/sec", "mps", "METERS/SECOND", " m  s-1 ",
)  # fmt: skip


@pytest.mark.parametrize(
    ("units", "factor"),
    [
        *dict.fromkeys(SPELLINGS, 1.0).items(),
        ("cm/s", 0.01), ("cm s-1", 0.01), ("mm/s", 0.001), ("km/h", 1 / 3.6),
        ("knots", KNOT), ("kt", KNOT), ("knot", KNOT),
    ],
)  # fmt: skip
def test_a_speed_is_brought_to_metres_per_second(units: str, factor: float) -> None:
    assert metres_per_second(of(units)) == pytest.approx(factor)


@pytest.mark.parametrize("units", ["kg", "m", "1", "m s-2", "fortnights", "{", "m s{-1}", "Pa"])
def test_what_is_no_speed_is_refused(units: str) -> None:
    with pytest.raises(Unfit, match="^uo must be a speed, got units "):
        metres_per_second(of(units))


def test_loading_the_units_logs_nothing(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        metres_per_second(of("kt"))
    assert not caplog.records


def test_units_are_stated_where_a_file_has_none(tmp_path: Path) -> None:
    file = written(pair("current", ("uo", "vo"), units=None), tmp_path)
    with pytest.raises(ValueError, match="uo has no units; state units, such as m/s"):
        read_forecast("current", file, SPAN)
    flow = read_forecast("current", file, SPAN, Choice(units="cm/s"))
    wanted = [0.01 * speed for speed in by_xarray(file, ("uo", "vo"), PLACES[0])]
    assert by_flow(flow, PLACES[0]) == pytest.approx(wanted, abs=1e-5)
