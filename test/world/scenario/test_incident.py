# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An incident becomes a grid, an ensemble of particles and a search."""

from __future__ import annotations

import gc
import json
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.cell_tracks import poc_of_cells, tracks_of
from dsse_ros.search.step.looks import searches_of
from dsse_ros.world.drift.tracks import drift_steps
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import OF_INCIDENT, Scenario

KAYAK = Path(__file__).resolve().parents[3] / "config" / "kayak.yaml"
SEA = profile("sea")
SEEN = {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}
FIELDS: dict[str, Any] = {
    "object": "PIW-1",
    "seen": [SEEN],
    "search_start": "2026-01-17T14:00Z",
    "wind": {"from": 270, "speed": 8.0},
}


LAND = {
    "type": "Polygon",
    "coordinates": [[[-45.99, -25], [-45, -25], [-45, -23], [-45.99, -23], [-45.99, -25]]],
}


def scenario(**changes: Any) -> Scenario:
    return Scenario(incident={**FIELDS, **changes}, particles=2000, timestep_limit=60)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "hours", "wind", "shore"),
    [("PIW-1", 1, 8.0, False), ("SPORT-BOAT", 2, 12.0, False), ("SLDMB", 1, 0.0, False),
     ("PIW-1", 1, 8.0, True)],
)  # fmt: skip
def test_99_percent_of_the_particles_are_on_the_grid_while_the_search_lasts(
    key: str, hours: int, wind: float, shore: bool
) -> None:
    stated = scenario(
        object=key, search_start=f"2026-01-17T{13 + hours}:00Z",
        wind={"from": 270, "speed": wind, "error": 1.0}, current={"speed": 0.4, "toward": 30},
        **({"shore": LAND} if shore else {}),
    ).override(particles=20_000)  # fmt: skip
    resolved = stated.resolve(SEA)
    tracks = tracks_of(resolved, SEA)
    assert tracks is not None
    for cells in (tracks.particles, tracks.truth):
        inside = ((cells >= 0) & (cells < resolved.grid_size)).all(axis=2).mean(axis=1)
        assert inside.min() >= 0.99
    # The grid is no larger than this takes.
    assert (tracks.maps > 0).any(axis=0).mean() > 0.3


def test_the_belief_counts_no_probability_beyond_the_grid() -> None:
    belief = forecast_for(scenario().override(grid_size=10), SEA).belief()
    assert 0.1 < belief.outside < 0.9
    assert belief.poc().sum() + belief.outside == pytest.approx(1.0)


def test_persons_drift_by_the_same_law_with_other_draws() -> None:
    resolved = scenario().resolve(SEA)
    tracks = tracks_of(resolved, SEA)
    assert tracks is not None and not np.array_equal(tracks.truth, tracks.particles)
    for step in (0, -1):
        truth, belief = (c[step].astype(float) for c in (tracks.truth, tracks.particles))
        assert truth.mean(axis=0) == pytest.approx(belief.mean(axis=0), abs=0.5)
        assert truth.std(axis=0) == pytest.approx(belief.std(axis=0), rel=0.1)


def test_the_datum_drifts_with_the_particles() -> None:
    resolved = scenario().resolve(SEA)
    tracks = tracks_of(resolved, SEA)
    assert tracks is not None
    first, last = (tracks.particles[i].astype(float).mean(axis=0) for i in (0, 60))
    assert np.subtract(last, first) / 60 == pytest.approx(np.array(resolved.drift), abs=0.01)
    assert np.floor(first) == pytest.approx(resolved.person_initial_position, abs=1)


def test_drones_reach_the_grid_from_a_base_beyond_it_after_their_transit() -> None:
    near = scenario(base=[-24.0, -46.0]).override(num_drones=3).resolve(SEA)
    far = scenario(base=[-24.0, -46.2]).override(num_drones=3).resolve(SEA)
    assert near.incident.grid_summary.begins_s == near.incident.search_start_s
    transit_s = far.incident.grid_summary.begins_s - far.incident.search_start_s
    # 0.2 deg of longitude are 20.35 km, less half of the grid, at 10 m/s.
    half_m = far.grid_size.columns * far.cell_size / 2
    assert transit_s == pytest.approx((20_350 - half_m) / 10, abs=150)
    assert all(col == 0 for col, _ in far.drones_positions)
    assert len(set(far.drones_positions)) == 3


def test_a_base_beyond_the_battery_is_refused() -> None:
    # 0.2 degrees of longitude are 20 km; a charge of 80 % lasts 40 moves of 130 m.
    far = scenario(base=[-24.0, -46.2]).override(battery_move=2.0)
    with pytest.raises(FieldError, match="incident.base must be at most 9 min of flight from the"):
        far.resolve(SEA)


def test_a_resolved_incident_needs_no_file_and_lays_no_grid_again() -> None:
    resolved = Scenario.from_yaml(KAYAK).resolve(SEA)
    stated = resolved.incident.to_json()
    assert Incident.may_be_sent(stated)
    again = Incident.read(json.loads(json.dumps(stated, allow_nan=False)))
    assert again == resolved.incident and hash(again) == hash(resolved.incident)
    names = ("origin_lat", "origin_lon", "grid_size", "drones_positions", "vector")
    fields = {name: getattr(resolved, name) for name in names}
    twin = Scenario(incident=stated, **fields, timestep_limit=5).resolve(SEA)
    assert all(getattr(twin, name) == value for name, value in fields.items())


def test_another_altitude_lays_another_grid() -> None:
    resolved = scenario().resolve(SEA)
    higher = resolved.override(altitude=240.0).resolve(SEA)
    assert higher.cell_size == 260.0 and higher.grid_size < resolved.grid_size


@pytest.mark.slow
def test_the_kayak_is_searched_and_a_seed_gives_the_same_mission() -> None:
    world, twin = (World(Scenario.from_yaml(KAYAK), SEA, 2) for _ in range(2))
    for each in (world, twin):
        each.seed(5)
        each.reset()
        each.step(np.zeros(each.drones.shape, np.int8))
    assert world.state_bytes() == twin.state_bytes()
    assert world.maps[0].sum() > 0.99
    assert Scenario.from_yaml(KAYAK).rules_of("auto") == "sea"


def test_stranded_persons_lie_on_the_grid_and_stay_there() -> None:
    resolved = scenario(current={"toward": 90, "speed": 1.0}, shore=LAND).resolve(SEA)
    tracks = tracks_of(resolved, SEA)
    assert tracks is not None
    still = (tracks.particles[0] == tracks.particles[-1]).all(axis=1)
    assert still.mean() > 0.8
    assert ((tracks.particles >= 0) & (tracks.particles < resolved.grid_size)).all(
        axis=2
    ).mean() > 0.99


def cut_at_the_antimeridian(west: float, east: float) -> dict[str, Any]:
    """Return land between longitudes that may exceed 180, cut as RFC 7946 (3.1.9) has it."""
    parts = [(west, min(east, 180.0)), (max(west, 180.0), east)]
    return {
        "type": "MultiPolygon",
        "coordinates": [
            [[(lon - turn, lat) for lon, lat in ring]]
            for (low, high), turn in zip(parts, (0.0, 360.0), strict=True)
            if low < high
            for ring in [[(low, -25), (high, -25), (high, -23), (low, -23), (low, -25)]]
        ],
    }


def test_the_grid_of_an_incident_is_laid_once_and_forgotten_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    laid = []

    def drift(*arguments: Any, **options: Any) -> Any:
        laid.append(1)
        return drift_steps(*arguments, **options)

    monkeypatch.setattr("dsse_ros.world.drift.tracks.drift_steps", drift)
    first, equal = (scenario(jibing=0.031) for _ in range(2))
    for each in (first, first, equal):
        each.resolve(SEA)
    assert len(laid) == 1
    alive = weakref.ref(first.incident)
    del first, equal, each
    gc.collect()
    assert alive() is None


def stranded(lon: float, land: dict[str, Any]) -> float:
    """Return the share of objects seen at a longitude that land stops within half an hour."""
    current = {"toward": 90, "speed": 1.0}
    seen = {**SEEN, "lon": lon}
    incident = Incident.read({**FIELDS, "seen": [seen], "current": current, "shore": land})
    times = incident.search_start_s + np.array([0.0, 1800.0])
    tracks = incident.tracks(times, 2000, np.random.default_rng(0))
    return float(tracks.stranded[-1].mean())


@pytest.fixture(scope="module")
def elsewhere() -> float:
    """Share of objects that strand far from the antimeridian."""
    share = stranded(-46.0, cut_at_the_antimeridian(-45.943, -45.9))
    assert 0.2 < share < 0.8
    return share


@pytest.mark.slow
@pytest.mark.parametrize("turned", [0.0, 360.0], ids=["east", "west"])
@pytest.mark.parametrize("lon", [170.0, 179.93, 179.944, 179.98, 180.02, 185.0])
def test_objects_strand_across_the_antimeridian_as_elsewhere(
    lon: float, turned: float, elsewhere: float
) -> None:
    shore = cut_at_the_antimeridian(lon + 0.057, lon + 0.1)
    # Land in their lee and far away changes nothing.
    for west, east in ((lon - 0.1, lon - 0.05), (20.0, 21.0)):
        shore["coordinates"] += cut_at_the_antimeridian(west, east)["coordinates"]
    assert stranded(lon - turned, shore) == pytest.approx(elsewhere, abs=0.03)


def test_a_snapshot_of_an_incident_is_restored() -> None:
    env = parallel_env(scenario(), rules="sea")
    env.reset(seed=1)
    snapshot = env.snapshot()
    before = env.world.state_bytes()
    env.step(dict.fromkeys(env.agents, 0))
    env.restore(snapshot)
    assert env.world.state_bytes() == before


def test_a_snapshot_has_the_digest_of_a_flow_and_fits_no_other_flow() -> None:
    times = Incident.read(FIELDS).search_start_s + 3600.0 * np.arange(-2, 8)
    axes = {"lats_deg": np.linspace(-25, -23, 40), "lons_deg": np.linspace(-47, -45, 40)}

    def current(east_mps: float) -> dict[str, Any]:
        values = np.full(10 * 40 * 40, 0.2)
        values[8000] = east_mps
        return {
            "times_s": times.tolist(), "east_mps": values.tolist(),
            "north_mps": (0 * values).tolist(), "source": f"{east_mps}.nc",
            **{name: axis.tolist() for name, axis in axes.items()},
        }  # fmt: skip

    worlds = [World(scenario(current=current(east)), SEA) for east in (0.2, 0.2, 0.2001)]
    snapshot = worlds[0].snapshot()
    assert len(json.dumps(snapshot.identity)) < 10_000
    worlds[1].restore(Snapshot.from_bytes(snapshot.to_bytes()))
    with pytest.raises(SnapshotError, match="^the snapshot is of a different scenario: incident"):
        worlds[2].restore(snapshot)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"object": "PIW"}, "incident.object must be a class of leeway, got 'PIW'; did you mean"),
        ({"object": None}, "incident.object must be given"),
        ({"object": []}, "incident.object must be a class of leeway, or 1 to 16 of them"),
        ({"object": ["PIW-1"]}, "incident.object[0] must be a mapping"),
        ({"object": [{"weight": 1}]}, "incident.object[0].class must be"),
        (
            {"object": [{"class": "PIW-1"}, {"class": "kayac"}]},
            "incident.object[1].class must be a class of leeway, got 'kayac'; did you mean",
        ),
        ({"object": [{"class": "PIW-1", "weight": 0}]}, "incident.object[0].weight must be"),
        (
            {"object": [{"class": "PIW-1"}, {"class": "piw 1"}]},
            "incident.object[1].class must not be stated twice, got 'PIW-1'",
        ),
        ({"seen": []}, "incident.seen must be a list of sightings"),
        ({"seen": [{**SEEN, "lat": 91}]}, "incident.seen[0].lat"),
        ({"seen": [{**SEEN, "time": "noon"}]}, "incident.seen[0].time must be a time like"),
        ({"seen": [{**SEEN, "time": "2026-01-17"}]}, "incident.seen[0].time must be a time like"),
        (
            {"base": [-46.0, -24.0]},
            "incident.base must be at most 500 km from the search at -24, -46, got -46, -24 (the "
            "order is latitude, longitude), 3140 km away",
        ),
        ({"base": [24.0, 134.0]}, "incident.base must be at most 500 km from the search"),
        ({"base": [-24.0, -49.0]}, "incident.base must be at most 360 min of flight from the grid"),
        ({"seen": [{"lat": 1.0, "lon": 1.0}]}, "incident.seen[0].time must be given"),
        ({"search_start": "2026-01-17T12:00Z"}, "incident.search_start must not be before"),
        ({"base": 3}, "incident.base must be [lat, lon], or text such as"),
        ({"wind": {"toward": 3, "speed": 1}}, "'toward' is not a field of incident.wind"),
        ({"wind": {"speed": 1}}, "incident.wind must have speed and from, or a file"),
        (
            {"wind": {"file": "a.nc", "variables": ["u"]}},
            "incident.wind.variables must be two names, of the components to the east and to the",
        ),
        (
            {"wind": {"file": "a.csv", "gap_cells": 1}},
            "'gap_cells' is not a field of incident.wind with a table",
        ),
        ({"wind": {"file": "a.nc", "select": 3}}, "incident.wind.select must be a mapping"),
        ({"current": {"file": "none.csv"}}, "current 'none.csv': No such file"),
        ({"wind": {"times_s": [1, 0]}}, "incident.wind must have increasing axes"),
        ({"winds": {}}, "'winds' is not a field of the incident; did you mean wind?"),
        ({"shore": {"type": "Point"}}, "incident.shore must be a GeoJSON file of a Polygon"),
        ({"truth": {"object": "X"}}, "incident.truth.object must be a class of leeway, got 'X'"),
        (
            {"seen": [SEEN, {**SEEN, "lat": 30}]},
            "incident.seen[1] must be at most 500 km from the search at -24, -46, got 30, -46",
        ),
        ({"truth": {"seen": []}}, "'seen' is not a field of incident.truth"),
        ({"truth": {"wind": {"speed": 1}}}, "incident.truth.wind must have speed and from"),
    ],
)
def test_what_is_not_allowed_is_refused_in_a_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(FieldError) as error:
        scenario(**changes).resolve(SEA)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_a_grid_of_too_many_cells_is_refused() -> None:
    wide = scenario(seen=[SEEN, {**SEEN, "lat": -27}]).override(cell_size=20.0)
    with pytest.raises(FieldError, match="incident must have particles within 10000 cells of 20 m"):
        wide.resolve(SEA)


@pytest.mark.parametrize("value", ["kayak", 3, [], "{"])
def test_an_incident_is_a_mapping(value: Any) -> None:
    with pytest.raises(FieldError, match="incident must be a mapping of fields to values"):
        Scenario(incident=value)


def test_other_rules_and_fields_that_the_incident_determines_are_refused() -> None:
    with pytest.raises(FieldError, match="incident must come with rules sea or flight, got paper"):
        scenario().resolve(profile("paper"))
    env = parallel_env(scenario(), rules="sea")
    with pytest.raises(FieldError, match="vector must not be an option of a reset"):
        env.reset(seed=1, options={"vector": (1.0, 0.0)})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[(name, 0.0) for name in ("origin_lat", "origin_lon", "current_speed", "current_toward")],
        *[(name, 1.0) for name in ("sigma", "sigma_x", "sigma_y", "pre_search_minutes")],
        ("origin_lat", -24.04), ("vector", (0.0, 0.0)), ("person_initial_position", (0, 0)),
        ("dispersion_inc", 0.0),
    ],
)  # fmt: skip
def test_every_field_that_an_incident_determines_is_refused_by_its_name(
    name: str, value: Any
) -> None:
    assert name in OF_INCIDENT
    with pytest.raises(FieldError, match=f"^{name} must not be given with an incident, which"):
        scenario().override(**{name: value}).resolve(SEA)


def test_wind_that_ends_before_the_search_is_refused_in_a_line(tmp_path: Path) -> None:
    file = tmp_path / "wind.csv"
    file.write_text("time,speed_mps,from\n2026-01-17T12:00Z,5,0\n2026-01-17T14:05Z,5,0\n")
    with pytest.raises(FieldError, match="wind .*wind.csv' has no value at .*2026-01-17T14:05:00Z"):
        scenario(wind={"file": str(file)}).resolve(SEA)


def write_tracks(path: Path) -> np.ndarray:
    """Write an OpenDrift file of our own drift; latitudes (T, M)."""
    netcdf = pytest.importorskip("netCDF4")
    incident = Incident.read(FIELDS)
    times = incident.search_start_s + 600.0 * np.arange(10)
    tracks = incident.tracks(times, 5000, np.random.default_rng(1))
    with netcdf.Dataset(path, "w") as file:
        file.createDimension("trajectory", 5000)
        file.createDimension("time", len(times))
        time = file.createVariable("time", "f8", ("time",))
        time[:], time.units = times, "seconds since 1970-01-01 00:00:00"
        for name, values in (("lat", tracks.lats_deg), ("lon", tracks.lons_deg)):
            file.createVariable(name, "f4", ("trajectory", "time"))[:] = values.T
    return tracks.lats_deg


@pytest.mark.slow
def test_tracks_of_another_model_are_the_ensemble(tmp_path: Path) -> None:
    write_tracks(tmp_path / "drift.nc")
    stated = {"tracks": str(tmp_path / "drift.nc"), "search_start": FIELDS["search_start"]}
    ours = scenario().resolve(SEA)
    given_scenario = Scenario(incident=stated, timestep_limit=60).resolve(SEA)
    theirs = tracks_of(given_scenario, SEA)
    assert theirs is not None and theirs.particles.shape[1] == 5000
    inside = (theirs.particles >= 0) & (theirs.particles < given_scenario.grid_size)
    assert inside.all(axis=2).mean(axis=1).min() >= 0.99
    assert given_scenario.grid_size.columns == pytest.approx(ours.grid_size.columns, abs=3)
    assert given_scenario.sigma_x == pytest.approx(ours.sigma_x, rel=0.1)
    fields = given_scenario.incident.to_json()
    assert Incident.may_be_sent(fields) and not Incident.may_be_sent(stated)
    assert Incident.read(json.dumps(fields, allow_nan=False)) == given_scenario.incident
    with pytest.raises(FieldError, match="incident: the tracks must cover .* got 2026-01-17T14:00"):
        Scenario(incident=stated, timestep_limit=900).resolve(SEA)
    with pytest.raises(FieldError, match="'wind' is not a field of an incident with tracks"):
        Scenario(incident={**stated, "wind": {"speed": 1, "from": 2}})


def pos_and_share_found(stated: Scenario, drones: int) -> tuple[float, float]:
    """Return POS and the share found by drones that each search a particle's cell per step."""
    tracks = tracks_of(stated.override(particles=10_000).resolve(SEA), SEA)
    assert tracks is not None
    rng = np.random.default_rng(4)
    hit = [np.zeros(10_000, bool) for _ in range(2)]
    # A cell as one number, which is quicker to look for.
    known, true = (of.astype(np.int64) @ (1 << 16, 1) for of in (tracks.particles, tracks.truth))
    for step in range(60):
        cells = known[step][rng.integers(0, 10_000, drones)]
        for found, passed in zip(hit, (known, true), strict=True):
            found |= np.isin(passed[step], cells)
    return float(hit[0].mean()), float(hit[1].mean())


@pytest.mark.slow
@pytest.mark.parametrize(
    "key",
    [
        "PIW-1",
        "LIFE-RAFT-DB-10",
        "SLDMB",
        [{"class": "LIFE-RAFT-DB-12", "weight": 2}, {"class": "PIW-1"}],
    ],
    ids=str,
)
@pytest.mark.parametrize("shore", [None, LAND])
def test_a_search_finds_as_many_persons_as_its_pos_has_it(key: str, shore: Any) -> None:
    stated = scenario(object=key, shore=shore, current={"speed": 0.4, "toward": 80, "error": 0.1})
    for drones in (2, 8, 30):
        pos, share = pos_and_share_found(stated, drones)
        # Both are samples; each searched cell was drawn from one of the particles.
        error = 4 * np.sqrt(2 * pos * (1 - pos) / 10_000) + 60 * drones / 10_000 * (1 - pos)
        assert share == pytest.approx(pos, abs=error)


@pytest.mark.slow
@pytest.mark.parametrize("truth", [{"wind": {"from": 180, "speed": 8.0}}, {"object": "SPORT-BOAT"}])
def test_where_truth_has_another_law_a_search_finds_fewer_than_its_pos(truth: Any) -> None:
    stated = scenario(truth=truth)
    pos, share = pos_and_share_found(stated, 30)
    assert share < pos - 0.1
    # The belief and its grid are those of the incident.
    wrong, right = stated.resolve(SEA), scenario().resolve(SEA)
    assert wrong.incident is not None and (wrong.vector, wrong.origin_lat) == (
        right.vector, right.origin_lat,
    )  # fmt: skip
    ours, theirs = tracks_of(wrong, SEA), tracks_of(right, SEA)
    assert ours is not None and theirs is not None
    assert np.array_equal(ours.particles, theirs.particles)
    again = Incident.read(json.dumps(wrong.incident.to_json(), allow_nan=False))
    assert again == wrong.incident and again.followed == wrong.incident.followed


def test_stokes_drift_is_optional_and_survives_a_message() -> None:
    moved = Incident.read({**FIELDS, "waves": {"speed": 0.2, "toward": 90}})
    assert Incident.read(FIELDS).waves is None and moved != Incident.read(FIELDS)
    assert Incident.read(json.dumps(moved.to_json(), allow_nan=False)) == moved
    assert not Incident.may_be_sent({**FIELDS, "waves": {"file": "waves.nc"}})
    times = moved.search_start_s + np.array([0.0, 3600.0])
    lons = [
        incident.tracks(times, 500, np.random.default_rng(1)).lons_deg[-1].mean()
        for incident in (moved, Incident.read(FIELDS))
    ]
    # Since the sighting, an hour before the search: 0.2 m/s for two hours are 1440 m.
    assert (lons[0] - lons[1]) * 101_700 == pytest.approx(1440, abs=15)
    total = {
        "times_s": [0.0, 4e9], "lats_deg": [-30, -20], "lons_deg": [-50, -40],
        "east_mps": [0.1] * 8, "north_mps": [0.0] * 8, "source": "merged.nc: utotal and vtotal",
    }  # fmt: skip
    waves = {"speed": 0.2, "toward": 90}
    assert Incident.read({**FIELDS, "current": total}).waves is None
    for fields in ({"waves": waves}, {"truth": {"waves": waves}}):
        with pytest.raises(FieldError, match="waves must not be given with a current utotal and"):
            Incident.read({**FIELDS, "current": total, **fields})
    with pytest.raises(FieldError, match="incident.waves must have no error, got 1"):
        Incident.read({**FIELDS, "waves": {"speed": 0.2, "toward": 90, "error": 1.0}})


def test_the_truth_of_a_message_names_no_file() -> None:
    assert not Incident.may_be_sent({**FIELDS, "truth": {"wind": {"file": "wind.csv"}}})
    assert Incident.may_be_sent({**FIELDS, "truth": {"object": "PIW-2"}})


def test_an_object_by_another_name_is_the_same_incident() -> None:
    by_key, by_alias = (
        Incident.read({**FIELDS, "object": name, "truth": {"object": other}})
        for name, other in (("PERSON-POWERED-VESSEL-1", "PIW-1"), ("sea kayak", "Man overboard"))
    )
    assert by_alias.identity == by_key.identity


RAFT_OR_PERSON = [{"class": "LIFE-RAFT-DB-12", "weight": 2}, {"class": "PIW-1"}]


def test_several_objects_survive_a_message_and_one_is_written_by_its_key() -> None:
    several = Incident.read({**FIELDS, "object": RAFT_OR_PERSON, "truth": {"object": "PIW-1"}})
    assert Incident.read(json.dumps(several.to_json(), allow_nan=False)) == several
    assert several.to_json()["object"] == [
        {"class": "LIFE-RAFT-DB-12", "weight": 2.0},
        {"class": "PIW-1", "weight": 1.0},
    ]
    one = Incident.read({**FIELDS, "object": [{"class": "PIW-1"}]})
    assert one == Incident.read(FIELDS) and one.to_json()["object"] == "PIW-1"


@pytest.mark.slow
def test_failed_searches_where_an_object_would_be_make_it_less_likely() -> None:
    stated = scenario(object=RAFT_OR_PERSON)
    forecast = forecast_for(stated, SEA)
    assert isinstance(forecast, EnsembleForecast)
    belief = forecast.belief()
    shares = belief.object_shares
    assert shares == pytest.approx({"LIFE-RAFT-DB-12": 2 / 3, "PIW-1": 1 / 3}, abs=1e-3)
    objects = forecast.tracks.objects
    assert objects is not None
    # Bayes' rule: a search of all cells in which persons are likelier than rafts.
    cells = forecast.cells[forecast.row(0)]
    poc = belief.poc()
    of_person = poc_of_cells(
        cells, forecast.weights * (objects == 1), forecast.scenario.grid_size, None
    )
    rows, cols = np.nonzero(of_person > poc / 2)
    searched = [(int(col), int(row)) for row, col in zip(rows, cols, strict=True)]
    taken = of_person[rows, cols].sum(), (poc - of_person)[rows, cols].sum()
    for look in searches_of(forecast.scenario, SEA, searched):
        belief.update([look])
    left = 1 / 3 - taken[0], 2 / 3 - taken[1]
    assert belief.object_shares["PIW-1"] == pytest.approx(left[0] / sum(left), abs=1e-3)
    assert belief.object_shares["PIW-1"] < 1 / 3 - 0.02
