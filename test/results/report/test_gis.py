# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the GIS files of a mission, read by other software than that which wrote them."""

from __future__ import annotations

import csv
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from flights import SCENARIO, Log, environment, fly
from numpy.typing import NDArray

from dsse_ros.mission.run.mission import Mission
from dsse_ros.results.report.gis import GisMission, gis_mission
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import follow_belief, forecast_for, views
from dsse_ros.world.scenario.geodesy import cell_to_geodetic

pytest.importorskip("gpxpy")
pytest.importorskip("shapely")
pytest.importorskip("rasterio")
from dsse_ros.cli.export_gis import write_files  # noqa: E402
from dsse_ros.results.report.gpx import gpx_text  # noqa: E402
from dsse_ros.results.report.kml import kml_text  # noqa: E402

POD = 0.7
GPX = {"": "http://www.topografix.com/GPX/1/1"}
KML = {"": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}


class KeepingLog(Log):
    """Keeps what the mission itself knew after each step."""

    beliefs: list[NDArray[np.float32]]
    searches: NDArray[np.int64]

    def write(self, mission: Mission) -> None:
        super().write(mission)
        if mission.result.step == 0:
            self.beliefs, self.searches = [], np.zeros((9, 9), np.int64)
        self.beliefs.append(mission.belief().copy())
        # In the step after the time limit, no drone acts.
        acted = mission.result.step <= SCENARIO["timestep_limit"]
        searching = (mission.result.actions == mission.env.rules.action_set.search) & acted
        for col, row in mission.result.cells[searching].tolist():
            self.searches[row, col] += 1


@dataclass
class Exported:
    """A mission, its files and what is known of it.

    Attributes:
        mission: What was written.
        folder: Folder of the files.
        log: What the mission knew.
        rows: Rows of its CSV by drone.
    """

    mission: GisMission
    folder: Path
    log: KeepingLog
    rows: dict[str, list[dict[str, str]]]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    folder = tmp_path_factory.mktemp("gis")
    env = environment(origin_alt=12.0)
    log = KeepingLog(folder / "mission.csv", env)
    fly(env, log, seeds=(3,))
    (record,) = read_csv(folder / "mission.csv")
    last = len(record.steps) - 1
    forecast = forecast_for(record, None)
    assert forecast is not None
    _, beliefs = follow_belief(record, forecast, (0, last))
    shown = {
        k: replace(view, probability=beliefs[k]) for k, view in views(record, (0, last)).items()
    }
    mission = gis_mission(record, shown)
    write_files(folder, mission)
    rows: dict[str, list[dict[str, str]]] = {}
    with (folder / "mission.csv").open() as file:
        for row in csv.DictReader(file):
            rows.setdefault(row["agent"], []).append(row)
    return Exported(mission, folder, log, rows)


def expected_pod(exported: Exported) -> NDArray[np.float32]:
    return (1 - (1 - POD) ** exported.log.searches).astype(np.float32)


def test_the_geotiffs_have_the_belief_and_the_pod_of_the_searches_of_each_cell(
    exported: Exported,
) -> None:
    import rasterio

    assert exported.log.searches.max() > 1
    with rasterio.open(exported.folder / "poc.tif") as raster:
        assert raster.descriptions == ("POC after step 0", "POC after step 15")
        assert raster.read(1) == pytest.approx(exported.log.beliefs[0], abs=1e-7)
        assert raster.read(2) == pytest.approx(exported.log.beliefs[-1], abs=1e-7)
    with rasterio.open(exported.folder / "pod.tif") as raster:
        assert not raster.read(1).any()
        assert raster.read(2) == pytest.approx(expected_pod(exported), abs=1e-6)


def test_the_tracks_are_those_of_the_log_point_by_point(exported: Exported) -> None:
    tracks = ET.parse(exported.folder / "tracks.gpx").getroot().findall("trk", GPX)
    lines = ET.parse(exported.folder / "mission.kml").getroot().findall(".//LineString", KML)
    assert len(tracks) == len(lines) == 3
    for n, (track, line) in enumerate(zip(tracks, lines, strict=True)):
        name, rows = f"drone{n}", exported.rows[f"drone{n}"]
        logged = [(float(row["lat_deg"]), float(row["lon_deg"])) for row in rows]
        assert track.findtext("name", "", GPX) == name
        points = track.findall("trkseg/trkpt", GPX)
        read = [(float(point.get("lat", "")), float(point.get("lon", ""))) for point in points]
        assert np.array(read) == pytest.approx(np.array(logged), abs=1e-9)
        assert {point.findtext("ele", "", GPX) for point in points} == {"120.0"}
        assert not track.findall(".//time", GPX)
        coordinates = [text.split(",") for text in line.findtext("coordinates", "", KML).split()]
        read = [(float(lat), float(lon)) for lon, lat, _ in coordinates]
        assert np.array(read) == pytest.approx(np.array(logged), abs=1e-9)


def test_the_kml_has_each_cell_with_its_poc_its_pod_and_its_corners(exported: Exported) -> None:
    folder = ET.parse(exported.folder / "mission.kml").getroot().findall(".//Folder", KML)[1]
    assert folder.findtext("name", "", KML) == "POC and POD after step 15"
    poc, pod = np.zeros((2, 9, 9))
    for mark in folder.findall("Placemark", KML):
        col, row = map(int, mark.findtext("name", "", KML).strip("()").split(","))
        data = {
            datum.get("name"): float(datum.findtext("value", "", KML))
            for datum in mark.findall(".//Data", KML)
        }
        poc[row, col], pod[row, col] = data["poc"], data["pod"]
        text = mark.findtext(".//coordinates", "", KML)
        lon, lat = np.array([[float(x) for x in place.split(",")[:2]] for place in text.split()]).T
        sides = np.array([(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5)])
        expected = cell_to_geodetic(exported.mission.frame, *((col, row) + sides).T, 0.0)
        off = np.subtract(
            pymap3d.geodetic2ecef(lat, lon, 12.0), pymap3d.geodetic2ecef(*expected[:2], 12.0)
        )
        assert np.linalg.norm(off, axis=0).max() < 0.01
    assert poc == pytest.approx(exported.log.beliefs[-1], abs=1e-7)
    assert pod == pytest.approx(expected_pod(exported), abs=1e-6)


def test_gdal_reads_the_same_tracks_and_cells(exported: Exported) -> None:
    read = pytest.importorskip("pyogrio.raw").read
    shapely = pytest.importorskip("shapely")
    tracks = exported.mission.tracks.values()
    expected = [(point.lon_deg, point.lat_deg) for points in tracks for point in points]
    gpx, kml = exported.folder / "tracks.gpx", exported.folder / "mission.kml"
    for path, layer in ((gpx, "track_points"), (kml, "Tracks")):
        geometry = shapely.from_wkb(read(path, layer=layer)[2])
        assert shapely.get_coordinates(geometry) == pytest.approx(np.array(expected), abs=1e-9)
    meta, _, _, columns = read(kml, layer="POC and POD after step 15")
    fields = dict(zip(meta["fields"].tolist(), columns, strict=True))
    last = exported.mission.maps[-1]
    for name, poc, pod in zip(fields["Name"], fields["poc"], fields["pod"], strict=True):
        col, row = map(int, name.strip("()").split(","))
        assert (float(poc), float(pod)) == (last.poc[row, col], last.pod[row, col])
    assert len(fields["Name"]) == np.count_nonzero((last.poc > 0) | (last.pod > 0)) > 9


def test_the_same_mission_gives_the_same_bytes(exported: Exported, tmp_path: Path) -> None:
    for path in write_files(tmp_path, exported.mission):
        assert path.read_bytes() == (exported.folder / path.name).read_bytes()


def test_points_have_times_if_the_scenario_has_a_date(exported: Exported, tmp_path: Path) -> None:
    begin = datetime.fromisoformat("2026-01-17T14:00:00+00:00")
    tracks = {
        name: tuple(
            replace(point, time=begin + timedelta(seconds=13 * k)) for k, point in enumerate(points)
        )
        for name, points in exported.mission.tracks.items()
    }
    write_files(tmp_path, replace(exported.mission, tracks=tracks))
    root = ET.parse(tmp_path / "tracks.gpx").getroot()
    of_track = root.findall("trk", GPX)[0].findall(".//time", GPX)
    read = [datetime.fromisoformat((time.text or "").replace("Z", "+00:00")) for time in of_track]
    assert read == [track.time for track in tracks["drone0"]]
    track = ET.parse(tmp_path / "mission.kml").getroot().findall(".//gx:Track", KML)[0]
    when = [datetime.fromisoformat(time.text or "") for time in track.findall("when", KML)]
    assert when == read and len(track.findall("gx:coord", KML)) == len(read)


def test_a_large_grid_has_no_cells_in_the_kml(exported: Exported) -> None:
    large = replace(exported.mission, frame=replace(exported.mission.frame, grid_size=101))
    assert "<Polygon" in kml_text(exported.mission) and "<Polygon" not in kml_text(large)


def test_a_covered_grid_has_cells_without_poc(exported: Exported) -> None:
    (*_, last) = exported.mission.maps
    covered = replace(last, poc=np.zeros_like(last.poc))
    text = kml_text(replace(exported.mission, maps=(covered,)))
    assert text.count("<Polygon") == np.count_nonzero(last.pod)


ORDER = (
    "name", "TimeStamp", "styleUrl", "Style", "ExtendedData", "altitudeMode", "when", "gx:coord",
    "coordinates", "outerBoundaryIs", "innerBoundaryIs", "LineString", "gx:Track", "Point",
    "Polygon", "MultiGeometry",
)  # fmt: skip
"""Elements in the order in which the schemas of KML 2.2 have them, before folders and marks."""


def check_schema(root: ET.Element) -> None:
    """Check what the schemas of KML 2.2 say of order and identifiers."""
    ids = [element.attrib["id"] for element in root.iter() if "id" in element.attrib]
    assert len(ids) == len(set(ids)) and all(name[0].isalpha() for name in ids)
    assert {one.text for one in root.findall(".//styleUrl", KML)} <= {
        f"#{number}" for number in ids
    }
    names = {f"{{{url}}}": f"{prefix}:" if prefix else "" for prefix, url in KML.items()}
    for parent in root.iter():
        tags = [re.sub(r"{.*}", lambda match: names[match[0]], element.tag) for element in parent]
        ranks = [ORDER.index(tag) if tag in ORDER else len(ORDER) for tag in tags]
        assert ranks == sorted(ranks), tags


def moved(mission: GisMission, lon_deg: float) -> GisMission:
    """A mission with its origin at another longitude, and a date."""
    turn = lon_deg - mission.frame.origin_lon_deg
    begin = datetime.fromisoformat("2026-01-17T14:00:00+00:00")
    tracks = {
        name: tuple(
            replace(point, lon_deg=(point.lon_deg + turn + 180) % 360 - 180,
                    time=begin + timedelta(seconds=step))
            for step, point in enumerate(points)
        )
        for name, points in mission.tracks.items()
    }  # fmt: skip
    return replace(mission, tracks=tracks, frame=replace(mission.frame, origin_lon_deg=lon_deg))


def cell_areas(root: ET.Element) -> list[float]:
    """Areas of the cells in square degrees, each within the bounds of longitude."""
    import shapely

    areas = []
    for mark in root.findall(".//Placemark[ExtendedData]", KML):
        rings = [ring.text or "" for ring in mark.findall(".//coordinates", KML)]
        parts = [
            shapely.Polygon(np.fromstring(r.replace(",", " "), sep=" ").reshape(-1, 2))
            for r in rings
        ]
        assert all(-180 <= part.bounds[0] <= part.bounds[2] <= 180 for part in parts)
        areas.append(sum(part.area for part in parts))
    return areas


def test_tracks_and_cells_are_cut_at_the_antimeridian(exported: Exported) -> None:
    here, there = (
        ET.fromstring(kml_text(moved(exported.mission, lon))) for lon in (10.0, 179.9955)
    )
    for root in (here, there):
        check_schema(root)
    assert cell_areas(there) == pytest.approx(cell_areas(here), rel=1e-5)
    assert there.findall(".//Placemark[ExtendedData]/MultiGeometry", KML)
    uncut, cut = ([*file.iter(f"{{{KML['gx']}}}Track")] for file in (here, there))
    assert len(cut) > len(uncut) == 3
    for track in cut:
        lons = [
            float((coordinate.text or "").split()[0])
            for coordinate in track.findall("gx:coord", KML)
        ]
        assert np.ptp(lons) < 0.02 and len(lons) == len(track.findall("when", KML))
    text = gpx_text(moved(exported.mission, 179.9955).tracks)
    segments = ET.fromstring(text).findall(".//trkseg", GPX)
    assert len(segments) == len(cut)
    for segment in segments:
        lons = [float(point.attrib["lon"]) for point in segment]
        assert np.ptp(lons) < 0.02 and -180 <= min(lons) <= max(lons) < 180
