# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of a report equal those that plain code computes from the bag, read by rosbags."""

from __future__ import annotations

import csv
import json
import math
import struct
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
import yaml
from bags import Bag
from flights import SCENARIO, environment, fly
from rosbags.highlevel import AnyReader

from dsse_ros.base.fields import FieldError
from dsse_ros.cli.report import main
from dsse_ros.mission.recording.bag import BagWriter, read_bag
from dsse_ros.results.report.bags import MissionBag
from dsse_ros.results.report.metrics import metrics
from dsse_ros.results.report.recomputed import follow_belief, forecast_for, views

# ROS 2's own imports, on the first message that is converted.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")

FORMATS = {2: "B", 1: "b", 3: "h", 6: "I", 7: "f", 8: "d"}
"""Of struct, for a PointField's datatype."""


def points(cloud: Any) -> list[dict[str, float]]:
    """Return the points of a cloud, field by field."""
    data = bytes(cloud.data)
    return [
        {
            f.name: struct.unpack_from(f"<{FORMATS[f.datatype]}", data, start + f.offset)[0]
            for f in cloud.fields
        }
        for start in range(0, len(data), cloud.point_step)
    ]


def plain(path: Path) -> dict[int, dict[str, float | None]]:
    """Return the metrics of each mission of a bag, by plain loops over its messages."""
    agents: dict[int, Any] = {}
    reports: dict[int, list[list[dict[str, float]]]] = {}
    beliefs: dict[tuple[int, int], Any] = {}
    images: dict[tuple[int, int], Any] = {}
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/agents":
                info = json.loads(message.data)
                agents[info["mission"]] = info
            elif connection.topic == "/belief":
                stamp = (message.header.stamp.sec, message.header.stamp.nanosec)
                size = message.width
                images[stamp] = [
                    list(struct.unpack_from(f"<{size}f", bytes(message.data), 4 * size * row))
                    for row in range(size)
                ]
            elif connection.topic == "/step_report":
                rows = points(message)
                stamp = (message.header.stamp.sec, message.header.stamp.nanosec)
                reports.setdefault(int(rows[0]["mission"]), []).append(rows)
                beliefs[int(rows[0]["mission"]), int(rows[0]["step"])] = images[stamp]
    return {
        number: metrics_of(agents[number], steps, number, beliefs)
        for number, steps in reports.items()
    }


def metrics_of(
    info: Any,
    steps: list[list[dict[str, float]]],
    number: int,
    beliefs: dict[tuple[int, int], Any],
) -> dict[str, float | None]:
    """Return the metrics of one mission."""
    pod = info["definition"]["scenario"]["probability_of_detection"]
    step_s, search = info["step_duration_s"], info["actions"].index("search")
    drones = range(len(info["agents"]))
    flying = set(drones)
    length = [0.0 for _ in drones]
    cells: list[tuple[float, float]] = []
    pos, waited_s, first_s, collisions, nearest, total = 0.0, 0.0, None, 0, math.inf, 0.0
    left_s = info["timestep_limit"] * step_s
    for k, rows in enumerate(steps):
        if k and flying and k <= info["timestep_limit"]:
            waited_s += (1 - pos) * step_s
            left_s -= step_s
        if k:
            belief, taken = [list(row) for row in beliefs[number, k - 1]], 0.0
            for i in sorted(flying) if k <= info["timestep_limit"] else ():
                if rows[i]["action"] == search:
                    col, row = int(rows[i]["col"]), int(rows[i]["row"])
                    cells.append((col, row))
                    taken += belief[row][col] * pod
                    belief[row][col] *= 1 - pod
            pos += (1 - pos) * taken
            for i in drones:
                before, now = steps[k - 1][i], rows[i]
                length[i] += math.hypot(now["x"] - before["x"], now["y"] - before["y"])
        for i, j in combinations(sorted(flying), 2):
            away = math.hypot(rows[i]["x"] - rows[j]["x"], rows[i]["y"] - rows[j]["y"])
            nearest = min(nearest, away)
            collisions += away == 0 and k > 0
        for i in drones:
            total += rows[i]["reward"]
            if rows[i]["found"] and first_s is None:
                first_s = k * step_s
            if rows[i]["terminated"] or rows[i]["truncated"]:
                flying.discard(i)
    return {
        "pos": pos,
        "expected_time_at_least": waited_s + (0.0 if first_s else (1 - pos) * left_s),
        "expected_time_at_most": waited_s + (1 - pos) * left_s,
        "time_to_detection": first_s,
        "coverage": len(set(cells)) / math.prod(info["grid_size"]),
        "coverage_factor": len(cells) / math.prod(info["grid_size"]),
        "redundancy": 1 - len(set(cells)) / len(cells),
        "searches": len(cells),
        "path_length": sum(length),
        "longest_path": max(length),
        "collisions": collisions,
        "separation": nearest,
        "episode_return": total,
    }


@pytest.mark.slow
def test_the_report_of_a_bag_has_the_numbers_of_the_bag(tmp_path: Path) -> None:
    bag = tmp_path / "mission.mcap"
    env = environment()
    flown = fly(env, Bag(bag, env), seeds=(3, 4, 5, 6), searching=0.5)
    assert main([str(bag), "--out", str(tmp_path / "out"), "--steps", "0"]) == 0
    with (tmp_path / "out" / "missions.csv").open(newline="") as file:
        rows = {int(row["mission"]): row for row in csv.DictReader(file)}
    computed = plain(bag)
    assert len(rows) == len(computed) == len(flown) == 4
    for number, expected in computed.items():
        for name, value in expected.items():
            text = rows[number][name]
            close = None if value is None else pytest.approx(value, rel=1e-5, abs=1e-5)
            assert (float(text) if text else None) == close, (number, name)
    for mission in flown:
        assert float(rows[mission.number]["pos"]) == pytest.approx(mission.pos[-1], abs=1e-9)
    with (tmp_path / "out" / "metrics.csv").open(newline="") as file:
        chosen = {row["metric"]: row["value"] for row in csv.DictReader(file)}
    assert chosen.items() <= rows[4].items()


def test_a_bag_that_is_cut_off_is_read_with_one_line_on_where(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bag = tmp_path / "mission.mcap"
    env = environment()
    fly(env, Bag(bag, env), steps=3)
    content = bag.read_bytes()
    assert MissionBag(bag).missions and not caplog.messages
    bag.write_bytes(content[:-8])
    read = MissionBag(bag)
    (record,) = read.missions
    read.beliefs(record, range(len(record.steps)))
    (line,) = caplog.messages
    assert f"is cut off at byte {len(content) - 8}" in line and line.endswith("is missing")


def test_beliefs_are_those_that_were_published(tmp_path: Path) -> None:
    bag = tmp_path / "mission.mcap"
    env = environment("v2", person_amount=2)
    fly(env, Bag(bag, env), seeds=(1, 2))
    read = MissionBag(bag)
    for record in read.missions:
        forecast = forecast_for(record, None)
        assert forecast is not None
        wanted = range(len(record.steps))
        beliefs, computed = read.beliefs(record, wanted), follow_belief(record, forecast, wanted)[1]
        assert set(beliefs) == set(wanted)
        for k in wanted:
            assert beliefs[k] == pytest.approx(computed[k], abs=1e-6)


def test_a_step_report_that_was_lost_is_in_the_mission_report(tmp_path: Path) -> None:
    env = environment()
    fly(env, Bag(tmp_path / "whole.mcap", env))
    fly(env, Bag(tmp_path / "lossy.mcap", env, skip=(0, 2, 3)))
    (complete,), (lossy,) = (
        MissionBag(tmp_path / name).missions for name in ("whole.mcap", "lossy.mcap")
    )
    assert metrics(lossy) == metrics(complete)
    # Where the mission does not end, what is missing stays so.
    fly(env, Bag(tmp_path / "cut.mcap", env, skip=(0, 2, 3)), steps=5)
    (cut,) = MissionBag(tmp_path / "cut.mcap").missions
    assert cut.steps.tolist() == [1, 4, 5] and cut.missing_steps == 3
    assert forecast_for(cut, None) is None and not cut.complete


def test_of_runs_with_the_same_stamps_each_has_its_own_maps(tmp_path: Path) -> None:
    for run_id, sigma in ((7, 1.0), (8, 4.0)):
        env = environment(sigma=sigma)
        fly(env, Bag(tmp_path / f"{run_id}.mcap", env, run_id=run_id))
    bag = MissionBag(tmp_path)
    assert [(mission.run_id, mission.number) for mission in bag.missions] == [(7, 1), (8, 1)]
    for record in bag.missions:
        (published,) = bag.beliefs(record, [0]).values()
        assert published == pytest.approx(views(record, [0])[0].probability, abs=1e-6)


def test_a_topic_of_another_type_is_somebody_elses(tmp_path: Path) -> None:
    env = environment()
    fly(env, Bag(tmp_path / "mission.mcap", env))
    kept = list(read_bag(tmp_path / "mission.mcap"))
    bag = BagWriter(tmp_path / "more.mcap")
    for message in [
        *kept,
        *(
            replace(m, topic=f"/other/{name}")
            for m in kept[:1]
            for name in ("step_report", "belief")
        ),
    ]:
        topic = bag.add_topic(message.topic, message.type_name)
        bag.write(
            topic,
            message.data,
            log_time_ns=message.log_time_ns,
            publish_time_ns=message.log_time_ns,
        )
    bag.close()
    assert kept[0].type_name == "std_msgs/msg/String"
    alone, beside = (MissionBag(tmp_path / f"{name}.mcap") for name in ("mission", "more"))
    assert len(beside.missions) == len(alone.missions) and beside.namespace == alone.namespace


def test_of_several_simulations_one_is_chosen(tmp_path: Path) -> None:
    # A file of two namespaces, made of two folders' worth of files as rosbag2 splits them.
    env = environment()
    fly(env, Bag(tmp_path / "a.mcap", env, namespace="/a"))
    fly(env, Bag(tmp_path / "b.mcap", env, namespace="/b/c"), seeds=(2,))
    with pytest.raises(FieldError, match="namespace: choose one of the file: /a, /b/c"):
        MissionBag(tmp_path)
    with pytest.raises(
        FieldError, match=r"namespace must be one of the file \(/a, /b/c\), got 'c'"
    ):
        MissionBag(tmp_path, "c")
    (of_b,) = MissionBag(tmp_path, "b/c").missions
    assert of_b.seed == 2


@pytest.mark.slow
def test_a_bag_that_does_not_say_what_was_searched_needs_a_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    env = environment()
    fly(env, Bag(tmp_path / "mission.mcap", env, definition=False))
    out = tmp_path / "out"
    arguments = [str(tmp_path / "mission.mcap"), "--out", str(out), "--steps", "1"]
    assert main(arguments) == 2
    assert "agents does not describe the search; use --scenario" in capsys.readouterr().err
    fields = {**SCENARIO, "person_initial_position": [4, 4]}
    fields["drones_positions"] = [[3, 4], [4, 3], [5, 5]]
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump(fields))
    assert main([*arguments, "--scenario", str(tmp_path / "scenario.yaml")]) == 0
    assert (out / "figures" / "map_step_1.png").is_file()
    assert main([*arguments, "--scenario", "santos"]) == 2
    assert "scenario: 20 x 20 cells of 130 m are not the recorded 9 x 9" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("topics", "says"),
    [
        (("agents",), "no step of a mission"),
        (("step_report",), "mission 1: no message of the topic agents"),
        (("probability",), "has none of the topics"),
    ],
)
def test_a_bag_without_a_mission_is_refused(
    topics: tuple[str, ...], says: str, tmp_path: Path
) -> None:
    env = environment()
    fly(env, Bag(tmp_path / "mission.mcap", env, topics=topics))
    with pytest.raises(FieldError, match=says):
        MissionBag(tmp_path / "mission.mcap")


def test_a_bag_of_a_larger_grid_than_is_allowed_is_refused(tmp_path: Path) -> None:
    env = environment()
    fly(env, Bag(tmp_path / "mission.mcap", env))
    with pytest.raises(
        FieldError, match="mission 1: grid_size must have at most 80 cells.* got 9 x 9"
    ):
        MissionBag(tmp_path / "mission.mcap", max_cells=80)
    assert MissionBag(tmp_path / "mission.mcap", max_cells=81).missions
    line = "--max-cells=80"
    assert main([str(tmp_path / "mission.mcap"), line, "--out", str(tmp_path / "out")]) == 2
