# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where only a part of the grid is searched, drones, persons and probability stay in it."""

from __future__ import annotations

import functools
import json
import pickle
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from areas import CELL_M, ORIGIN, geojson_of, random_mask, scenario_of
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.snapshot import SnapshotError
from dsse_ros.world.scenario import area as area_module
from dsse_ros.world.scenario.area import Area, area_mask, runs_of
from dsse_ros.world.scenario.outline_faults import fault_of
from dsse_ros.world.scenario.rules import PROFILES, profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.targets.registry import MOTIONS

SQUARE = [[-24.035, -46.165], [-24.035, -46.15], [-24.02, -46.15], [-24.02, -46.165]]
PLACE = {"origin_lat": ORIGIN[0], "origin_lon": ORIGIN[1], "cell_size": CELL_M}
SEEDS = range(8)
STEPPING = [name for name, of in PROFILES.items() if of.person_motion in MOTIONS]
"""Profiles whose persons stay in the area, unlike the particles of an ensemble."""


def within(mask: NDArray[np.bool_], x: NDArray[Any], y: NDArray[Any], *, v1: bool) -> bool:
    """Whether all cells are in the area; where drones and persons may leave the grid, or off it."""
    inside = (x >= 0) & (y >= 0) & (x < len(mask)) & (y < len(mask))
    return (v1 or bool(inside.all())) and bool(mask[y[inside], x[inside]].all())


@pytest.mark.parametrize("seed", range(40))
def test_a_cell_is_in_the_area_if_its_centre_is_in_a_polygon(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = random_mask(rng, int(rng.integers(2, 15)))
    resolved = Scenario(area=geojson_of(mask), grid_size=len(mask), **PLACE).resolve(
        profile("paper").override(person_initial_position=tuple(np.argwhere(mask)[0, ::-1]))
    )
    found = resolved.area_mask
    np.testing.assert_array_equal(np.ones_like(mask) if found is None else found, mask)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rules", STEPPING)
def test_nothing_leaves_the_area_in_a_hundred_thousand_random_steps(rules: str, seed: int) -> None:
    """24 runs of 4200 steps, of 84 searches at once; actions are drawn without their masks."""
    rng = np.random.default_rng(seed)
    mask = random_mask(rng, int(rng.integers(4, 15)))
    fields = scenario_of(mask, rng, 4)
    around = np.array([(y, x) for x, y in [fields["person_initial_position"]]])
    near = (np.abs(np.argwhere(mask) - around) <= 2).all(axis=1).sum()
    amount = min(3, int(near))
    env = vector_env(84, fields, rules=rules, person_amount=amount)
    lazy = vector_env(84, fields, rules=rules, person_amount=amount, lazy=True)
    moves = env.rules.action_set.moves
    observed, infos = env.reset(seed=seed)
    lazy.reset(seed=seed)
    for _ in range(50):
        maps, positions = observed["probability"], observed["positions"]
        assert not maps[:, ~mask].any()
        total = maps.sum(axis=(1, 2))
        np.testing.assert_allclose(np.maximum(total, float(env.rules.covers)), 1.0, atol=1e-5)
        np.testing.assert_allclose(lazy.world.cells(*_all_cells(mask)), maps.reshape(84, -1))
        assert within(mask, positions[..., 0], positions[..., 1], v1=rules == "v1")
        persons = env.world.persons
        assert within(mask, persons["x"], persons["y"], v1=rules == "v1")
        worlds = env.world.worlds
        assert mask[worlds["datum_y"], worlds["datum_x"]].all()
        for a, (dx, dy) in enumerate(moves):
            to = np.pad(mask, 1)[1 + dy :, 1 + dx :]
            x, y = positions[..., 0], positions[..., 1]
            inside = (x >= 0) & (y >= 0) & (x < len(mask)) & (y < len(mask))
            allowed = infos["action_mask"][..., a]
            np.testing.assert_array_equal(allowed[inside], to[y[inside], x[inside]])
        actions = rng.integers(0, len(moves), positions.shape[:2])
        observed, *_, infos = env.step(actions)
        lazy.step(actions)


def _all_cells(mask: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    y, x = np.indices(mask.shape)
    return [np.tile(axis.ravel(), (84, 1)) for axis in (x, y)]


# What is to be covered is a map of persons who do not drift onto land.
@pytest.mark.parametrize("rules", [name for name in STEPPING if not PROFILES[name].covers])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_map_is_that_of_the_whole_grid_cut_to_the_area_and_normalised(
    rules: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    mask = random_mask(rng, 12)
    # A datum that stays where it is, so that it is the same in both.
    fields = scenario_of(mask, rng, 1) | {"vector": [0, 0], "sigma": 3.0}
    cut, uncut = (
        parallel_env({**fields, "area": area}, rules=rules) for area in (fields["area"], None)
    )
    cut.reset(seed=seed)
    uncut.reset(seed=seed)
    for _ in range(15):
        wanted = np.where(mask, uncut.probability, 0).astype(float)
        np.testing.assert_allclose(cut.probability, wanted / wanted.sum(), rtol=1e-5, atol=1e-9)
        for env in (cut, uncut):
            env.advance(np.array([env.rules.action_set.search]))


@pytest.mark.slow
@pytest.mark.parametrize("rules", [name for name, of in PROFILES.items() if of.actions])
def test_an_area_of_the_whole_grid_changes_nothing(rules: str) -> None:
    around = [[-25, -47], [-25, -45], [-23, -45], [-23, -47]]
    envs = [parallel_env(rules=rules, num_drones=3, area=area) for area in (around, None)]
    rng = np.random.default_rng(1)
    for env in envs:
        env.reset(seed=4)
    for _ in range(60):
        joint = rng.integers(0, len(envs[0].rules.actions), 3).astype(np.int8)
        for env in envs:
            env.advance(joint)
        first, second = (env.world for env in envs)
        assert first.state_bytes() == second.state_bytes()
        assert first.maps.tobytes() == second.maps.tobytes()


@pytest.mark.parametrize("rules", [name for name, of in PROFILES.items() if of.actions])
@pytest.mark.parametrize("seed", SEEDS)
def test_one_environment_and_the_batch_have_the_same_masks_and_maps(rules: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    fields = scenario_of(random_mask(rng, 9), rng, 3)
    single, batch = parallel_env(fields, rules=rules), vector_env(2, fields, rules=rules)
    single.reset(seed=seed)
    observed, infos = batch.reset(seed=seed)
    while single.agents:
        np.testing.assert_array_equal(single.action_masks(), infos["action_mask"][0])
        np.testing.assert_array_equal(single.probability, observed["probability"][0])
        joint = rng.integers(0, len(single.rules.actions), single.world.num_drones).astype(np.int8)
        single.advance(joint)
        observed, *_, infos = batch.step(np.stack([joint, joint]))


@pytest.mark.parametrize("rules", [name for name, of in PROFILES.items() if of.actions])
def test_a_snapshot_and_a_pickle_go_on_bit_for_bit(rules: str) -> None:
    rng = np.random.default_rng(5)
    fields = scenario_of(random_mask(rng, 9), rng, 3)
    env = parallel_env(fields, rules=rules)
    env.reset(seed=1)
    env.advance(np.zeros(env.world.num_drones, np.int8))
    restored, pickled = parallel_env(fields, rules=rules), pickle.loads(pickle.dumps(env))
    restored.restore(env.snapshot())
    for twin in (restored, pickled):
        assert twin.probability.tobytes() == env.probability.tobytes()
    for _ in range(10):
        joint = rng.integers(0, len(env.rules.actions), env.world.num_drones).astype(np.int8)
        for each in (env, restored, pickled):
            each.advance(joint)
        for twin in (restored, pickled):
            assert twin.world.state_bytes() == env.world.state_bytes()
            assert twin.probability.tobytes() == env.probability.tobytes()
            np.testing.assert_array_equal(twin.action_masks(), env.action_masks())


def test_a_snapshot_of_another_area_is_refused() -> None:
    env = parallel_env(area=SQUARE, grid_size=20, person_initial_position=(8, 8), **PLACE)
    other = parallel_env(grid_size=20, person_initial_position=(8, 8), **PLACE)
    env.reset(seed=1)
    with pytest.raises(SnapshotError, match="area"):
        other.restore(env.snapshot())


def test_a_drone_that_would_leave_the_area_is_treated_as_at_the_edge_of_the_grid() -> None:
    mask = np.ones((3, 3), bool)
    mask[1, 2] = False
    fields = {"area": geojson_of(mask), "grid_size": 3, "person_initial_position": (0, 0), **PLACE}
    for rules, reward, out in (("paper", -100000, True), ("v1", -100000, True), ("v2", 0, False)):
        env = parallel_env(fields, rules=rules, drones_positions=[(1, 1)])
        _, infos = env.reset(seed=0)
        right = env.rules.actions.index("right")
        assert infos["drone0"]["action_mask"][right] == 0
        _, rewards, terminated, _, _ = env.step({"drone0": right})
        assert (rewards["drone0"], terminated["drone0"]) == (reward, out)
        assert env.positions.tolist() == [[1, 1]]


def test_a_person_that_walks_blindly_stays_before_a_cell_outside_the_area() -> None:
    for masked, wanted in ((True, (7, 7)), (False, (6, 6))):
        mask = np.ones((9, 9), bool)
        mask[6, 6], mask[0, 0] = not masked, False
        fields = {"area": geojson_of(mask), "grid_size": 9, "vector": (0, 0), **PLACE}
        env = parallel_env(fields, rules="v1", person_initial_position=(2, 2))
        env.reset(seed=0)
        person = env.world.persons[0]
        person["x"] = person["y"] = 7
        assert not env.probability[6:, 6:].any()
        env.advance(np.array([-1], np.int8))
        assert (person["x"][0], person["y"][0]) == wanted


def test_drones_start_row_by_row_in_the_area() -> None:
    env = parallel_env(
        area=SQUARE, grid_size=20, num_drones=12, person_initial_position=(8, 8), **PLACE
    )
    mask = env.scenario.area_mask
    assert mask is not None
    wanted = np.argwhere(mask)[:12, ::-1]
    assert [list(cell) for cell in env.scenario.drones_positions] == wanted.tolist()


def test_runs_are_the_cells_of_a_mask_row_by_row() -> None:
    mask = np.array([[1, 1, 0, 1], [0, 0, 0, 0], [0, 1, 1, 1], [1, 0, 1, 0]], bool)
    wanted = [[0, 0, 1], [0, 3, 3], [2, 1, 3], [3, 0, 0], [3, 2, 2]]
    assert runs_of(mask).tolist() == wanted


def test_geojson_comes_back_from_its_text_and_from_a_file_beside_the_scenario(
    tmp_path: Path,
) -> None:
    area = Area.read(geojson_of(random_mask(np.random.default_rng(3), 12)))
    assert Area.read(area.to_text()) == area
    assert Scenario(area=area).override(area="").area is None
    feature = {"type": "Feature", "properties": {}, "geometry": json.loads(area.to_text())}
    collection = {"type": "FeatureCollection", "features": [feature]}
    (tmp_path / "shore.geojson").write_text(json.dumps(collection))
    (tmp_path / "scenario.yaml").write_text("area: shore.geojson\n")
    assert Scenario.from_yaml(tmp_path / "scenario.yaml").area == area
    (tmp_path / "scenario.yaml").write_text(f"area: {SQUARE}\n")
    assert Scenario.from_yaml(tmp_path / "scenario.yaml").area == Area.read(SQUARE)


def polygon(*rings: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": list(rings)}


RING = [[-46.4, -24.1], [-46.2, -24.1], [-46.2, -23.9], [-46.4, -23.9], [-46.4, -24.1]]


def collection_of(*geometries: Any) -> dict[str, Any]:
    features = [
        {"type": "Feature", "properties": {"title": f"F{number}"}, "geometry": geometry}
        for number, geometry in enumerate(geometries)
    ]
    return {"type": "FeatureCollection", "features": features}


def test_polygons_count_among_points_lines_and_null_geometries(
    caplog: pytest.LogCaptureFixture,
) -> None:
    polygon = {"type": "Polygon", "coordinates": [RING]}
    area = Area.read(polygon)
    line = {"type": "LineString", "coordinates": [[*point, 0, 9] for point in RING[:2]]}
    long = {"type": "Polygon", "coordinates": [[[*point, 0, 17e8] for point in RING]]}
    both = {"type": "GeometryCollection", "geometries": [POINT, polygon]}
    assert Area.read(collection_of(None, line, long)) == area
    assert "area: 1 geometries are not polygons and do not count" in caplog.text
    assert "area: feature 1 (F0) must have a geometry, got none" in caplog.text
    assert Area.read(both) == Area.read(collection_of(both)) == area
    with pytest.raises(FieldError, match=r"Self-intersection.* \(lon lat\) in feature 2 \(F1\)"):
        bow = [[lon, lat] for lat, lon in (*BOW, BOW[0])]
        Area.read(collection_of(polygon, {"type": "Polygon", "coordinates": [bow]}))


@pytest.mark.parametrize("empty", ["left out", None, {}, {"type": "Polygon", "coordinates": []}])
def test_a_feature_without_a_geometry_is_named_and_the_others_are_read(
    empty: Any, caplog: pytest.LogCaptureFixture
) -> None:
    polygon = {"type": "Polygon", "coordinates": [RING]}
    features = collection_of(polygon, empty, polygon)
    if empty == "left out":
        del features["features"][1]["geometry"]
    assert Area.read(features).polygons == 2 * Area.read(polygon).polygons
    assert "area: feature 2 (F1) must have a geometry, got none" in caplog.text
    with pytest.raises(FieldError, match="area must be a GeoJSON file"):
        Area.read({"type": "FeatureCollection", "features": features["features"][1:2]})


GPX = """<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">
<wpt lat="-24" lon="-46"/><trk>{}</trk></gpx>"""
KML = """<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><MultiGeometry>{}
</MultiGeometry></Placemark></Document></kml>"""


def gpx_of(*lines: Any) -> str:
    points = ["".join(f'<trkpt lat="{lat}" lon="{lon}"/>' for lon, lat in line) for line in lines]
    return GPX.format("".join(f"<trkseg>{line}</trkseg>" for line in points))


def kml_of(*lines: Any) -> str:
    texts = [" ".join(f"{lon},{lat},0" for lon, lat in line) for line in lines]
    point = "<Point><coordinates>-46,-24</coordinates></Point>"
    return KML.format(point + "".join(
        f"<LineString><coordinates>{text}</coordinates></LineString>" for text in texts
    ))  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "write"), [(".gpx", gpx_of), (".kml", kml_of)])
@pytest.mark.parametrize("lines", [(RING,), (RING[:3], RING[2:]), (RING, RING[:2])])
def test_tracks_and_parts_that_close_are_an_area(
    tmp_path: Path, suffix: str, write: Any, lines: Any
) -> None:
    pytest.importorskip("pyogrio")
    path = tmp_path / f"area{suffix}"
    path.write_text(write(*lines))
    found = [
        shapely.Polygon(area.polygons[0][0])
        for area in (Area.read(path), Area.read({"type": "Polygon", "coordinates": [RING]}))
    ]
    assert found[0].symmetric_difference(found[1]).area < 1e-9
    path.write_text(write(RING[:3]))
    with pytest.raises(FieldError, match="area must be a GeoJSON file"):
        Area.read(path)


def test_an_outline_may_reach_the_antimeridian_within_rounding() -> None:
    ring = [[179.0, -18], [180.00000000000014, -18], [180.00000000000014, -16], [179, -16]]
    area = Area.read({"type": "Polygon", "coordinates": [[*ring, ring[0]]]})
    assert max(lon for _, lon in area.polygons[0][0]) == 180.0
    far = [[lon + 1e-6, lat] for lon, lat in ring]
    with pytest.raises(FieldError, match="180, got -18 to -16 and 179.000001 to 180.000001"):
        Area.read({"type": "Polygon", "coordinates": [[*far, far[0]]]})


def test_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    polygon = {"type": "Polygon", "coordinates": [RING]}
    (tmp_path / "area.geojson").write_bytes(b"\xef\xbb\xbf" + json.dumps(polygon).encode())
    assert Area.read(tmp_path / "area.geojson") == Area.read(polygon)


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "driver", "crs"), [
    (".kml", "KML", "EPSG:4326"), (".gpx", "GPX", "EPSG:4326"),
    (".shp", "ESRI Shapefile", "EPSG:4326"), (".shp", "ESRI Shapefile", "EPSG:32723"),
    (".gpkg", "GPKG", "EPSG:4326"),
])  # fmt: skip
def test_a_file_of_another_program_is_an_area(
    tmp_path: Path, suffix: str, driver: str, crs: str
) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    shape = shapely.LineString(RING) if driver == "GPX" else shapely.Polygon(RING)
    if crs != "EPSG:4326":
        pyproj = pytest.importorskip("pyproj")
        to_metres = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
        shape = shapely.transform(shape, lambda xy: np.stack(to_metres.transform(*xy.T), axis=-1))
    path = tmp_path / f"area{suffix}"
    pyogrio.raw.write(
        path, shapely.to_wkb(np.array([shape])), field_data=[], fields=[], driver=driver, crs=crs,
        geometry_type=shape.geom_type, **({"layer": "routes"} if driver == "GPX" else {}),
    )  # fmt: skip
    read, wanted = Area.read(path), Area.read({"type": "Polygon", "coordinates": [RING]})
    found = [shapely.Polygon(area.polygons[0][0]) for area in (read, wanted)]
    assert found[0].symmetric_difference(found[1]).area < 1e-6
    path.write_bytes(b"nothing")
    with pytest.raises(FieldError, match="area must be a file that GDAL reads, got '.*area"):
        Area.read(path)


BOW = [[-24.035, -46.165], [-24.02, -46.15], [-24.035, -46.15], [-24.02, -46.165]]
POINT = {"type": "Point", "coordinates": [-46, -24]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("area", "error"),
    [
        (
            7,
            "a list of three or more [lat, lon], got 7",
        ),
        ([], "three or more"),
        (SQUARE[:2], "Too few points"),
        ({(0, 0), (0, 1), (1, 1)}, "three or more"),
        ([[1, 2, 3], [4, 5, 6], [7, 8, 9]], "three or more"),
        (
            [[91, 0], [0, 1], [1, 0]],
            "longitudes from -180 to 180, got 0 to 91",
        ),
        ([["a", 0], [0, 1], [1, 0]], "got [['a', 0], [0, 1], [1, 0]]"),
        ([[True, 0], [0, 1], [1, 0]], "got [[True, 0], [0, 1], [1, 0]]"),
        ([[float("nan"), 0], [0, 1], [1, 0]], "got [[nan, 0], [0, 1], [1, 0]]"),
        (
            POINT,
            "three or more [lat, lon], got {'type': 'Point'",
        ),
        ({"type": "Polygon"}, "Polygon"),
        ({"type": "Polygon", "coordinates": []}, "Polygon"),
        ({"type": "MultiPolygon", "coordinates": []}, "Polygon"),
        ({"type": "Polygon", "coordinates": 3}, "Polygon"),
        ({"type": "FeatureCollection", "features": []}, "Polygon"),
        ({"type": "GeometryCollection", "geometries": [POINT]}, "Polygon"),
        ({}, "Polygon"),
        ("nowhere.geojson", "got 'nowhere.geojson': No such file"),
        ("{no json", "got '{no json': not JSON: Expecting property name"),
        pytest.param(
            '{"type": "GeometryCollection", "geometries": [' * 200_000,
            "at most 64 objects and lists",
            id="nested",
        ),
        (BOW, "Self-intersection"),
        ([[0, 0], [0, 1], [0, 2]], "area must have outlines that do not cross or touch themselves"),
        ([[10, 10], [10, 11], [11, 11]], "the centre of a cell of the grid"),
    ],
)
def test_an_area_that_cannot_be_searched_is_refused_in_one_line(area: Any, error: str) -> None:
    with pytest.raises(FieldError, match=re.escape(error)) as refusal:
        parallel_env(area=area, grid_size=20)
    assert str(refusal.value).startswith("area must ") and "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("fields", "error"),
    [
        ({"person_initial_position": (0, 0)}, "person_initial_position must be one of"),
        ({"drones_positions": [(8, 8), (1, 1)]}, "cells of the area, got [1, 1]"),
        ({"num_drones": 200}, "num_drones must be at most 156, one per cell of the"),
    ],
)
def test_nobody_starts_outside_the_area(fields: dict[str, Any], error: str) -> None:
    given = {"area": SQUARE, "grid_size": 20, "person_initial_position": (8, 8), **PLACE}
    with pytest.raises(FieldError, match=re.escape(error)):
        parallel_env(given, **fields)
    options = {k: v for k, v in fields.items() if k != "num_drones"}
    if options:
        env = parallel_env(given, num_drones=len(options.get("drones_positions", [0])))
        with pytest.raises(FieldError, match=re.escape(error)):
            env.reset(options=options)


def test_persons_have_room_in_the_area_or_are_refused() -> None:
    mask = np.zeros((5, 5), bool)
    mask[2, 1:4] = True
    fields = {"area": geojson_of(mask), "grid_size": 5, "person_initial_position": (2, 2), **PLACE}
    env = parallel_env(fields, rules="v2", person_amount=3)
    for seed in range(20):
        env.reset(seed=seed)
        assert set(env.world.persons["x"][0].tolist()) <= {1, 2, 3}
    with pytest.raises(FieldError, match="person_amount must be at most 3, .* got 4"):
        parallel_env(fields, rules="v2", person_amount=4)


@pytest.mark.slow
def test_land_is_left_out_where_the_land_mask_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("roaring_landmask")
    # It takes seconds to load, and too much memory to be kept by a search.
    monkeypatch.setattr(area_module, "_land_mask", functools.cache(area_module._land_mask))
    sea, mountains = (-24.04, -46.36), (-23.80, -46.40)
    env = parallel_env(land=True, grid_size=40, origin_lat=sea[0], origin_lon=sea[1], cell_size=130)
    mask = env.scenario.area_mask
    assert mask is not None and mask[39, 0] and not mask[12, 36]
    with pytest.raises(FieldError, match="land must be false where the grid has no cell at sea"):
        parallel_env(land=True, origin_lat=mountains[0], origin_lon=mountains[1])
    # An island and a strait that a mask of 1 km does not have: Moela, and the Golden Gate.
    island = area_mask(None, True, GridShape.square(5), 130.0, (-24.0527, -46.2665, 0.0))
    assert island is not None and not island[2, 2] and island[0, 0]
    strait = area_mask(None, True, GridShape.square(1), 130.0, (37.8174, -122.4787, 0.0))
    assert strait is None


def test_without_the_land_mask_land_is_refused_with_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "roaring_landmask", None)
    with pytest.raises(
        FieldError, match=r"^land: roaring-landmask is missing; .* -m pip install .*land"
    ):
        parallel_env(land=True, grid_size=3)


@pytest.mark.slow
def test_a_large_grid_is_looked_at_in_parts(
    monkeypatch: pytest.MonkeyPatch, little_memory: Any
) -> None:
    ring = [(-24.05, -46.18), (-23.9, -46.1), (-23.95, -46.0)]
    complete = area_mask(Area.read(ring), False, GridShape.square(300), 30.0, (-24.04, -46.17, 0.0))
    monkeypatch.setattr("dsse_ros.world.scenario.area._BLOCK_CELLS", 7 * 300)
    area_mask.cache_clear()
    parts = area_mask(Area.read(ring), False, GridShape.square(300), 30.0, (-24.04, -46.17, 0.0))
    assert complete is not None and parts is not None and 0 < parts.sum() < 90_000
    np.testing.assert_array_equal(parts, complete)
    with pytest.raises(
        FieldError,
        match=r"a cell of the grid, -24\.03986 to -23\.95885 N and -46\.16985 to -46\.08167 E",
    ):
        area_mask(
            Area.read([(10, 10), (10, 11), (11, 11)]),
            False,
            GridShape.square(300),
            30.0,
            (-24.04, -46.17, 0.0),
        )
    monkeypatch.undo()
    with little_memory():
        area_mask(Area.read(ring), False, GridShape.square(2000), 4.0, (-24.04, -46.17, 0.0))


class Points(tuple[Any, ...]):
    """Polygons that count how often all their points are looked through."""

    looked_through = 0

    def __hash__(self) -> int:
        Points.looked_through += 1
        return super().__hash__()


def test_a_reset_does_not_look_through_the_points_of_the_area() -> None:
    area = Area.read([[-24.035, -46.165], [-24.035, -46.155], [-24.03, -46.16]])
    counted = Area(Points(area.polygons))
    env = parallel_env(
        area=counted, grid_size=20, origin_lat=-24.04, origin_lon=-46.17, num_drones=2,
        person_initial_position=(8, 13),
    )  # fmt: skip
    Points.looked_through = 0
    for seed in range(5):
        env.reset(seed=seed)
    assert Points.looked_through == 0
    assert counted == area and hash(counted) == hash(area)


TRIANGLE = [[-46.3, -24.0], [-46.2, -24.0], [-46.2, -23.9], [-46.3, -24.0]]


@pytest.mark.parametrize(
    ("geojson", "fault"),
    [
        (
            polygon([[None, None], *TRIANGLE[1:]]),
            "ring 0, point 0 must be finite numbers [lon, lat], got",
        ),
        (
            polygon([TRIANGLE[0], ["-46,2", "-24,0"], *TRIANGLE[2:]]),
            "ring 0, point 1 must be finite numbers",
        ),
        (polygon([TRIANGLE[0], [-46.2], *TRIANGLE[2:]]), "ring 0, point 1 must be .*, got [-46.2]"),
        (polygon(TRIANGLE, TRIANGLE[:3]), "ring 1 must have 4 or more points, got 3"),
        (
            polygon([*TRIANGLE[:3], TRIANGLE[2]]),
            "ring 0 must end at its first point, [-46.3, -24.0]",
        ),
        ({"type": "Polygon", "coordinates": TRIANGLE}, "ring 0, point 0 must be finite numbers"),
        ({"type": "Polygon"}, "coordinates must be a list of rings, got None"),
        ({"type": "Point", "coordinates": TRIANGLE[0]}, "it has no polygon, its type is 'Point'"),
        (
            {"type": "MultiPolygon", "coordinates": [[TRIANGLE], [[True]]]},
            "polygon 1, ring 0, point 0 must be finite numbers [lon, lat], got True",
        ),
        (
            {
                "type": "FeatureCollection",
                "features": [
                    {"type": "Feature", "properties": {}, "geometry": geometry}
                    for geometry in (polygon(TRIANGLE), polygon(TRIANGLE[:2]))
                ],
            },
            "feature 1, ring 0 must have 4 or more points, got 2",
        ),
        ([[-24.0, -46.3]], "it must have 3 or more points, got 1"),
        (
            [[-24.0, -46.3], [-24.0, -46.2], [-23.9]],
            "point 2 must be finite numbers [lat, lon], got",
        ),
    ],
)
def test_an_area_with_a_fault_is_refused_with_its_place_and_value(geojson: Any, fault: str) -> None:
    with pytest.raises(FieldError) as refusal:
        Area.read(geojson)
    *_, said = str(refusal.value).partition(", got ")
    assert all(part in said for part in fault.split(".*"))
    assert "\n" not in said


def test_what_has_no_fault_is_none() -> None:
    assert (
        fault_of(polygon(TRIANGLE))
        == fault_of([[-24.0, -46.3], [-24.0, -46.2], [-23.9, -46.2]])
        == ""
    )
