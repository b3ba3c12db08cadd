# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions in metres from their records: flown again, reported, replayed from a bag."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from dsse_ros.base.fields import FieldError
from dsse_ros.cli.report import main as report
from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.recording.bag import BagWriter, Recorded
from dsse_ros.mission.recording.bag_replay import Replay
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_messages import MESSAGES, StepMessages
from dsse_ros.picture.map_axes import looked_runs
from dsse_ros.results.report.bags import MissionBag
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.metrics import metrics
from dsse_ros.results.report.recomputed import follow_belief, forecast_for, mission_views, views
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.metres_drones import strips_of
from dsse_ros.search.step.metres_paths import MOST_PIECES
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import flip_y
from dsse_ros.world.scenario.geodesy import geodetic_to_map
from dsse_ros.world.scenario.scenario import scenario_frame
from dsse_ros.world.searchers import registry
from dsse_ros.world.searchers.searcher import Searcher
from msg_adapters.stamps import to_stamp
from msg_adapters.topics import EACH_DRONE

PLACE: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 20, "particles": 500,
    "drones_positions": ((9, 9), (10, 10), (3, 3)), "vector": (0.3, 0.1), "sigma": 3.0,
    "wind_speed": 4.0, "timestep_limit": 12,
}  # fmt: skip
SEED = 4
KML = {"": "http://www.opengis.net/kml/2.2"}


def flown(*, vehicles: bool = False) -> Iterator[Mission]:
    """Yield a mission at its start and after each step, in some of which drones are held.

    Vehicles fly as they like, and do not always look.
    """
    env = parallel_env(**PLACE, vehicle_timed_actions=vehicles)
    mission, draw = Mission(env, SEED), np.random.default_rng(1)
    yield mission
    while not mission.done:
        joint: list[Any] = draw.uniform(-1, 1, (3, 2)).tolist()
        if mission.result.step % 3 == 1:
            joint[1] = None
        mission.command_all(joint)
        if vehicles:
            shape = (3, MOST_PIECES + 1)
            legs = draw.uniform(-20.0, 20.0, (*shape, 2)).cumsum(axis=1)
            starts = (mission.result.places + 0.5) * env.scenario.cell_size
            legs[:, 0] = 0.0
            paths, looked = starts[:, None] + legs, draw.random(shape) < 0.8
            for drone in mission.live:
                mission.set_flown(drone, paths[drone], looked[drone])
        mission.advance("hold")
        yield mission


def log_of(path: Path, *, vehicles: bool = False) -> tuple[RecordedMission, Mission]:
    log: MissionLog | None = None
    for mission in flown(vehicles=vehicles):
        frame = scenario_frame(mission.env.scenario)
        log = log or MissionLog(path, frame, metres=True, vehicles=vehicles)
        log.write(mission, mission.result)
    assert log is not None
    log.close()
    return read_csv(path)[0], mission


def messages_of(*, vehicles: bool = False) -> list[Recorded]:
    """Return what `sim_node` publishes of the mission."""
    found: list[Recorded] = []

    def publish(topic: str, message: Any) -> None:
        kind = f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"
        time_ns = 10**18 + 10**6 * len(found)
        found.append(
            Recorded(f"/{topic}", kind, time_ns, time_ns, bytes(serialize_message(message)))
        )

    for mission in flown(vehicles=vehicles):
        env, frame = mission.env, scenario_frame(mission.env.scenario)
        if not found:
            messages = StepMessages(mission, frame, 7)
            info = AgentsInfo(
                agents=tuple(env.possible_agents), actions=(), rules="flight", seed=SEED,
                frame=frame, timestep_limit=12, step_duration_s=env.scenario.step_duration_s,
                mission=1, run_id=7, definition=SearchDefinition(env.rules, env.scenario),
            )  # fmt: skip
            publish("agents", String(data=agents_json(info)))
        stamp = to_stamp(mission.result.stamp_ns)
        for topic in MESSAGES:
            if topic == "mission_report" and not mission.done:
                continue
            drones = range(3) if topic.startswith(EACH_DRONE) else range(1)
            for drone in drones:
                message = messages.make(topic, stamp, drone)
                if message is not None:
                    publish(topic.replace(EACH_DRONE, f"drone{drone}/"), message)
    return found


@pytest.mark.parametrize("vehicles", [False, True])
def test_a_record_is_flown_again_to_the_same_views_and_pos(tmp_path: Path, vehicles: bool) -> None:
    record, mission = log_of(tmp_path / "mission.csv", vehicles=vehicles)
    assert (record.flown is not None) == vehicles
    *_, last = mission_views(record, belief=True)
    assert record.pos is not None and last.pos == record.pos[-1] == mission.pos
    assert last.probability.tobytes() == mission.belief().tobytes()
    forecast = forecast_for(record, None)
    assert forecast is not None
    pos, beliefs = follow_belief(record, forecast, [len(record.steps) - 1])
    assert pos.tolist() == record.pos.tolist()
    assert beliefs[len(record.steps) - 1].tobytes() == mission.belief().tobytes()
    # The record has three decimals of a metre.
    assert np.allclose(record.places[-1], mission.result.places, rtol=0, atol=1e-5)


def test_a_record_of_another_mission_is_refused(tmp_path: Path) -> None:
    record, _ = log_of(tmp_path / "mission.csv")
    other = record.scenario.override(drones_positions=((7, 7), (6, 7), (5, 7)))
    moved = dataclasses.replace(record, scenario=other.resolve(record.rules))
    forecast = forecast_for(moved, None)
    assert forecast is not None
    with pytest.raises(FieldError, match="it does not match the record: step 0 is not of"):
        follow_belief(moved, forecast)


@pytest.mark.slow
def test_a_report_has_what_was_flown(tmp_path: Path) -> None:
    record, mission = log_of(tmp_path / "mission.csv")
    numbers = metrics(record)
    far = np.hypot(*np.moveaxis(np.diff(paths_of_mission(), axis=2), -1, 0)).sum()
    assert numbers["path_length"] == pytest.approx(far, abs=0.1)
    assert numbers["coverage"] is not None and 0.02 < numbers["coverage"] < 0.5
    assert report([str(tmp_path / "mission.csv"), "--out", str(tmp_path / "report")]) == 0
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "profile flight" in page and f"{mission.pos:.1%}" in page


def test_a_bag_is_replayed_and_each_difference_is_found(tmp_path: Path) -> None:
    messages = messages_of()
    (outcome,) = Replay(messages).missions()
    assert (outcome.difference, outcome.incomplete) == ("", "") and outcome.ended
    assert {"drone<i>/pose", "drone<i>/path", "mission_report"} <= outcome.compared.keys()
    place = next(
        i for i, message in enumerate(messages) if message.topic == "/drone2/pose" and i > 40
    )
    data = bytearray(messages[place].data)
    data[-4] ^= 1
    messages[place] = dataclasses.replace(messages[place], data=bytes(data))
    (outcome,) = Replay(messages).missions()
    assert outcome.difference.endswith("drone2/pose: the message differs in the replay")


def test_a_bag_has_the_same_record_as_a_log(tmp_path: Path) -> None:
    record, _ = log_of(tmp_path / "mission.csv")
    bag, topics = BagWriter(tmp_path / "mission.mcap"), {}
    for message in messages_of():
        if message.topic not in topics:
            topics[message.topic] = bag.add_topic(
                message.topic, message.type_name, message.offered_qos
            )
        bag.write(
            topics[message.topic], message.data, log_time_ns=message.log_time_ns,
            publish_time_ns=message.publish_time_ns,
        )  # fmt: skip
    bag.close()
    (recorded,) = MissionBag(tmp_path / "mission.mcap").missions
    assert recorded.turns is not None and record.turns is not None
    assert recorded.turns.tolist() == record.turns.tolist()
    assert np.allclose(recorded.places, record.places, rtol=0, atol=1e-4)
    forecast = forecast_for(recorded, None)
    assert forecast is not None and record.pos is not None
    assert follow_belief(recorded, forecast)[0].tolist() == record.pos.tolist()


def paths_of_mission(*, vehicles: bool = False) -> np.ndarray[Any, Any]:
    """Return the paths (K, N, P + 1, 2) that were flown."""
    results = [step.result.flown for step in flown(vehicles=vehicles)]
    return np.stack([result.paths for result in results if result is not None])


@pytest.mark.parametrize(("radius", "vehicles"), [(0.0, False), (90.0, False), (0.0, True)])
def test_the_paths_of_a_record_are_those_that_were_flown(
    radius: float, vehicles: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = Searcher(doc="a kind", speed=10.0, min_speed=6.0 * (radius > 0), turn_radius=radius)
    monkeypatch.setitem(registry.SEARCHERS, "kind", kind)
    monkeypatch.setitem(PLACE, "searchers", ("kind",))
    record, _ = log_of(tmp_path / "mission.csv", vehicles=vehicles)
    paths = paths_of_mission(vehicles=vehicles)
    assert (paths.shape[2] > 2) == (radius > 0 or vehicles)
    assert record.paths.shape == paths.shape
    # Of the log, which rounds to a millimetre.
    assert np.abs(record.paths - paths).max() < 0.01
    view = views(record, [len(paths) - 1])[len(paths) - 1]
    assert view.tracks[:, -1] == pytest.approx(record.places[-1]) and view.searches is None
    assert view.legs == paths.shape[2] - 1 and view.headings is not None
    assert (view.looked is None) != vehicles
    # Where headings are missing, a path is straight.
    gap = dataclasses.replace(record, courses=None, flown=None)
    if vehicles:
        return
    ends = np.linspace(0, 1, paths.shape[2])[:, None]
    straight = paths[3, :, :1] + ends * (paths[3, :, -1:] - paths[3, :, :1])
    assert np.abs(gap.paths[3] - straight).max() < 0.01


@pytest.mark.parametrize("vehicles", [False, True])
def test_a_record_in_metres_is_exported_as_paths_and_strips(tmp_path: Path, vehicles: bool) -> None:
    for module in ("rasterio", "gpxpy"):
        pytest.importorskip(module)
    shapely = pytest.importorskip("shapely")
    from dsse_ros.cli.export_gis import main

    record, _ = log_of(tmp_path / "mission.csv", vehicles=vehicles)
    out = tmp_path / "gis"
    assert main([str(tmp_path / "mission.csv"), "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["mission.kml", "poc.tif", "tracks.gpx"]
    frame, paths = scenario_frame(record.scenario), paths_of_mission(vehicles=vehicles)
    seen = record.looked_on_tracks(len(paths))
    root = ElementTree.parse(out / "mission.kml").getroot()
    marks = {mark.findtext("name", "", KML): mark for mark in root.iter(f"{{{KML['']}}}Placemark")}

    def metres(text: str) -> np.ndarray[Any, Any]:
        lon, lat, *_ = np.array([place.split(",") for place in text.split()], float).T
        x, y, _ = geodetic_to_map(frame, lat, lon, 0.0)
        return np.stack([x, y], axis=1)

    (width_m, *_) = strips_of(record.scenario)
    for n, name in enumerate(record.agents):
        track = metres(marks[name].findtext(".//LineString/coordinates", "", KML))
        flown_m = np.vstack([paths[0, n, -1:], paths[1:, n, 1:].reshape(-1, 2)])
        flown_m[:, 1] = flip_y(frame.extent.height, flown_m[:, 1])
        assert np.abs(track - flown_m).max() < 0.01
        polygons = [
            shapely.Polygon(
                metres(part.findtext("outerBoundaryIs//coordinates", "", KML)),
                [
                    metres(hole.text or "")
                    for hole in part.findall("innerBoundaryIs//coordinates", KML)
                ],
            )
            for part in marks[f"strip of {name}"].findall(".//Polygon", KML)
        ]
        strip = shapely.union_all(polygons)
        line = shapely.MultiLineString(looked_runs(flown_m, None if seen is None else seen[n]))
        expected = line.buffer(width_m / 2, cap_style="flat")
        assert strip.symmetric_difference(expected).area < 1e-3 * expected.area
        # No part of it is farther away.
        assert line.buffer(width_m / 2 + 0.1).contains(strip)
