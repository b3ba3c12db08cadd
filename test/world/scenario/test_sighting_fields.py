# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An incident may have been seen at a point, in an area, on a voyage or on a bearing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.results.search_plan.action_plan import last_seen
from dsse_ros.world.drift.sightings import SeenRaster, Voyage
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.scenario.sea_state import sea_state
from dsse_ros.world.scenario.sighting_fields import read_seen

TIME = {"time": ["2026-01-17T10:00Z", "2026-01-17T12:00:01Z"]}
AREA = {"area": [[-24.0, -46.0], [-24.0, -45.9], [-23.9, -45.9]], **TIME}
VOYAGE = {
    "voyage": [{"lat": -24.0, "lon": -46.0}, {"lat": -24.1, "lon": -46.0, "radius": 500}],
    "departure": "2026-01-17T09:00Z", "speed": 2.5, "radius": 200, "time_error": 30, "weight": 2,
}  # fmt: skip
BEARING = {
    "lat": -24.0, "lon": -46.1, "bearing": 80, "bearing_error": 5, "range": [500, 4000],
    "time": "2026-01-17T11:00Z",
}  # fmt: skip
POINT = {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}
ALL = [POINT, AREA, VOYAGE, BEARING]
FIELDS = {"object": "PIW-1", "search_start": "2026-01-17T14:00Z"}


def test_all_kinds_begin_a_search_and_an_equal_incident_names_no_file() -> None:
    incident = Incident.read({**FIELDS, "seen": ALL, "current": {"toward": 90, "speed": 0.1}})
    sent = json.loads(json.dumps(incident.to_json(), allow_nan=False))
    assert Incident.may_be_sent(sent)
    assert Incident.read(sent) == incident and hash(Incident.read(sent)) == hash(incident)
    scenario = Scenario(incident=sent, particles=500, timestep_limit=60).resolve(profile("sea"))
    assert scenario.incident is not None and scenario.incident.grid_summary is not None
    assert scenario.incident.grid_summary.inside > 0.98
    seen = sea_state(scenario, 0).sightings
    assert [one.label for one in seen] == [
        "LKP 13:00Z, 20%", "area 10:00Z to 12:00Z, 20%", "voyage 08:30Z to 10:43Z, 40%",
        "bearing 080° 11:00Z, 20%",
    ]  # fmt: skip
    assert [len(one.lines) for one in seen] == [0, 1, 1, 1]
    assert last_seen(incident.sightings[2]).startswith("voyage           from 24-00.000S 046-00.0")


def test_a_vessel_with_a_speed_sails_from_its_departure() -> None:
    (voyage,) = read_seen(VOYAGE)
    assert isinstance(voyage, Voyage)
    start, end = voyage.way_points
    # A tenth of a degree of latitude is 11 076 m there.
    assert end.time_s - start.time_s == pytest.approx(11_076 / 2.5, abs=2)
    assert (start.radius_m, end.radius_m, voyage.last_s) == (200, 500, end.time_s + 1800)


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_a_raster_on_the_earth_keeps_its_probabilities(tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    from rasterio.transform import from_origin

    values = np.arange(12.0, dtype=np.float32).reshape(3, 4)
    for crs, transform in (
        ("EPSG:4326", from_origin(-46.0, -24.0, 0.01, 0.01)),
        ("EPSG:32723", from_origin(360_000, 7_345_000, 1000, 1000)),
    ):
        profile_of = {"driver": "GTiff", "width": 4, "height": 3, "count": 1, "dtype": "float32"}
        path = tmp_path / f"{crs[5:]}.tif"
        with rasterio.open(path, "w", crs=crs, transform=transform, **profile_of) as file:
            file.write(values, 1)
        (seen,) = read_seen({"raster": path.name, **TIME}, str(tmp_path))
        assert isinstance(seen, SeenRaster)
        assert seen.weights.sum() == pytest.approx(66, rel=0.05)
        south, north, west, east = seen.south_deg, seen.north_deg, seen.west_deg, seen.east_deg
        assert -24.2 < south < north < -23.9 and -46.5 < west < east < -45.9
        incident = Incident.read({**FIELDS, "seen": {"raster": str(path), **TIME}})
        assert Incident.read(incident.to_json()) == incident
        assert not Incident.may_be_sent({**FIELDS, "seen": {"raster": str(path), **TIME}})
    (tmp_path / "none.tif").write_bytes(b"II*\0")
    with pytest.raises(FieldError, match=r"seen\[0\].raster must be a GeoTIFF file of probabil"):
        read_seen({"raster": "none.tif", **TIME}, str(tmp_path))


def test_polygons_that_overlap_count_once() -> None:
    ring = [[-46.0, -24.0], [-45.9, -24.0], [-45.9, -23.9], [-46.0, -23.9], [-46.0, -24.0]]
    twice = {"type": "MultiPolygon", "coordinates": [[ring], [ring]]}
    (once,) = read_seen({**AREA, "area": {"type": "Polygon", "coordinates": [ring]}})
    assert read_seen({**AREA, "area": twice})[0].area_m2 == pytest.approx(once.area_m2)


@pytest.mark.parametrize(
    ("seen", "message"),
    [
        ({**AREA, "voyage": []}, "must have at most one of area, raster, voyage, bearing, got"),
        ({**AREA, "radius": 3}, "'radius' is not a field of incident.seen[0]"),
        ({**AREA, "area": "none.kmz"}, "incident.seen[0].area must be a GeoJSON file"),
        ({**AREA, "time": None}, "incident.seen[0].time must be given"),
        ({**AREA, "time": TIME["time"][::-1]}, "incident.seen[0].time must be [first, last]"),
        ({**AREA, "time": TIME["time"][:1]}, "incident.seen[0].time must be a time or two"),
        ({**AREA, "raster": 3}, "must have at most one of"),
        ({"raster": 3, **TIME}, "incident.seen[0].raster must be a mapping"),
        ({"raster": {"south": 1}, **TIME}, "incident.seen[0].raster must be a GeoTIFF file"),
        ({**VOYAGE, "voyage": VOYAGE["voyage"][:1]}, "must be a list of 2 to 1000 way points"),
        ({**VOYAGE, "speed": 0}, "incident.seen[0].speed must be a finite number > 0"),
        ({**VOYAGE, "departure": None}, "incident.seen[0] must have both speed and departure"),
        ({"voyage": VOYAGE["voyage"]}, "voyage[0].time must be given, or speed and departure"),
        ({**VOYAGE, "leg_weights": [1, 2]}, "incident.seen[0].leg_weights must be 1 numbers >= 0"),
        (
            {**VOYAGE, "voyage": [*VOYAGE["voyage"], VOYAGE["voyage"][1]]},
            "incident.seen[0].voyage[2] must be later than the way point before it",
        ),
        (
            {**VOYAGE, "voyage": [*VOYAGE["voyage"], {"lat": -30.0, "lon": -46.0}]},
            "incident.seen[0] must be at most 500 km from the search at -24, -46, got -30, -46",
        ),
        ({**BEARING, "bearing": 361}, "incident.seen[0].bearing must be a finite number >= 0"),
        ({**BEARING, "bearing_error": None}, "incident.seen[0].bearing_error must be given"),
        ({**BEARING, "range": [4000, 500]}, "incident.seen[0].range must be [least, greatest]"),
        ({**BEARING, "range": 4000}, "incident.seen[0].range must be [least, greatest]"),
    ],
)  # fmt: skip
def test_what_is_not_allowed_is_refused_in_a_line(seen: dict[str, Any], message: str) -> None:
    with pytest.raises(FieldError) as error:
        Incident.read({**FIELDS, "seen": seen})
    assert message in str(error.value) and "\n" not in str(error.value)


def test_sightings_come_from_csv_and_geojson_and_positions_in_minutes(tmp_path: Path) -> None:
    (tmp_path / "seen.csv").write_text(
        "position,time,radius\n24 00 S 46 00 W,2026-01-17T13:00Z,300\n\n"
    )
    stated = {**FIELDS, "seen": "seen.csv"}
    assert not Incident.may_be_sent(stated)
    wanted = Incident.read({**FIELDS, "seen": POINT})
    assert Incident.read(stated, str(tmp_path)) == wanted
    by_minutes = {**POINT, "lat": "24 00 S", "lon": "046-00.0W"}
    assert Incident.read({**FIELDS, "seen": by_minutes}) == wanted
    line = {"type": "LineString", "coordinates": [[-46.0, -24.0], [-46.0, -24.1]]}
    times = ["2026-01-17T09:00Z", "2026-01-17T10:00Z"]
    polygon = {"type": "Polygon", "coordinates": [[[-46, -24], [-45.9, -24], [-45.9, -23.9]]]}
    polygon["coordinates"][0].append(polygon["coordinates"][0][0])
    features = [
        {"geometry": {"type": "Point", "coordinates": [-46.0, -24.0, 0]}, "properties": POINT},
        {"geometry": line, "properties": {"times": times, "radius": 200, "name": "Ana"}},
        {"geometry": polygon, "properties": TIME},
    ]
    path = tmp_path / "seen.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    point, voyage, area = read_seen(str(path))
    assert (point,) == read_seen(POINT) and isinstance(voyage, Voyage) and voyage.radius_m == 200
    assert area == read_seen({**AREA, "area": polygon})[0]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "lat,long\n1,2\n", "first, got 'long'"),
        ("a.csv", "lat,lon\n1,2,3\n", "incident.seen: line 2 must have one cell a column"),
        ("a.csv", "lat,lon,time,radius\n1,2,2026-01-17T13:00Z,far\n", "radius must be a finite"),
        ("a.csv", "", "must have a row of the columns"),
        ("a.csv", "lat,lon\n", "incident.seen must be a list of sightings, or a CSV"),
        ("a.json", '{"type": "Feature", "geometry": null}', "feature 1 must be a Point"),
        ("a.json", "[", "incident.seen"),
        ("a.json", "[]", "incident.seen must be a .json file of sightings"),
        ("a.txt", "", "or a file of them, .csv, .geojson, .json, got"),
    ],
)
def test_files_of_something_else_are_refused_in_a_line(
    name: str, text: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FieldError) as error:
        read_seen(name, str(tmp_path))
    assert message in str(error.value) and "\n" not in str(error.value)
