# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the page knows of a mission is what the mission did, in any step."""

from __future__ import annotations

import array
import functools
import itertools
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import OccupancyGrid
from played import Played, Step

from dsse_ros.screens.dashboard.inbox import Inbox, Received
from dsse_ros.screens.dashboard.map_image import map_png
from dsse_ros.screens.dashboard.missions import ShownMission, ShownMissions
from dsse_ros.screens.dashboard.search_history import LAYERS, DroneState, MapImage, MapImages
from msg_adapters.images import probability_image
from msg_adapters.occupancy import occupancy_to_array
from msg_adapters.stamps import header, to_stamp

FOUND, STATE = 16, 7
FIELDS = {"grid_size": 7, "num_drones": 3, "sigma": 2.0, "timestep_limit": 25}


published = itertools.count(1)


def receive(
    mission: ShownMission, topic: str, message: Any, published_ns: int | None = None
) -> None:
    mission.receive(topic, lambda: message, published_ns or next(published))


def show(mission: ShownMission, played: Played, *steps: Step) -> None:
    receive(mission, "agents", played.agents)
    for step in steps:
        for topic, message in step.messages.items():
            receive(mission, topic, message)
    assert mission.trouble == {}


@pytest.fixture(scope="module")
def played() -> Played:
    return Played(**FIELDS)


@pytest.fixture(scope="module")
def steps(played: Played) -> list[Step]:
    """Of a mission that takes a while."""
    return next(found for seed in range(20) if len(found := list(played.play(seed))) > 8)


def test_every_step_can_be_looked_at_again(played: Played, steps: list[Step]) -> None:
    mission = ShownMission("")
    show(mission, played, *steps)
    history = mission.history
    assert history is not None and history.steps == [step.number for step in steps]
    assert history.done == played.mission.done
    earned = np.zeros(3)
    for i, (step, path) in enumerate(zip(steps, history.paths(mission.looks), strict=True)):
        earned = earned + step.rewards
        number, *flat = path
        cells, looked = np.array(flat[:9]).reshape(-1, 3), np.array(flat[9:]).reshape(-1, 2)
        assert number == step.number == history.steps[history.index(step.number)]
        np.testing.assert_array_equal(cells[:, :2], step.cells)
        np.testing.assert_array_equal(looked, step.cells[np.asarray(step.searched)])
        np.testing.assert_array_equal((cells[:, 2] & FOUND) > 0, step.found)
        np.testing.assert_array_equal((cells[:, 2] & STATE) == DroneState.FLYING, step.flying)
        np.testing.assert_allclose(history.rewards[i], earned)
        assert history.pos_at(i) == pytest.approx(step.pos)


def test_each_step_has_its_own_map(played: Played, steps: list[Step]) -> None:
    mission = ShownMission("")
    show(mission, played, *steps)
    history = mission.history
    assert history is not None
    for layer in LAYERS:
        for i in range(len(steps)):
            found = history.map_at(layer, i)
            assert found is not None, layer
            assert found[0] == history.stamps_ns[i]


def test_a_new_search_takes_the_place_of_the_old_one(played: Played) -> None:
    mission = ShownMission("")
    for seed in (3, 4):
        shown = list(played.play(seed, steps=5))
        show(mission, played, *shown)
        assert mission.history is not None and mission.info is not None
        assert mission.history.key == (played.run_id, played.mission.number)
        assert mission.history.steps == [step.number for step in shown]
        # The last map of the search before is none of this one.
        first = mission.history.map_at("belief_grid", 0)
        assert first is not None and first[0] == mission.history.stamps_ns[0]


def test_a_simulation_that_was_started_again_goes_on_in_its_place(played: Played) -> None:
    mission = ShownMission("")
    show(mission, played, *played.play(3, steps=8))
    again = Played(run_id=78, **FIELDS)
    shown = list(again.play(5, steps=3))
    show(mission, again, *shown)
    assert mission.history is not None and mission.history.key[0] == 78
    assert mission.history.steps == [step.number for step in shown]
    assert len(mission.history.maps["probability_grid"]) == len(shown)


@pytest.mark.parametrize("late", [False, True])
def test_maps_of_a_run_are_never_shown_in_another_one(late: bool) -> None:
    """Both runs begin at the same stamp."""
    played, again, mission = Played(**FIELDS), Played(run_id=78, **FIELDS), ShownMission("")
    (first,), (second,) = played.play(3, steps=0), again.play(4, steps=0)
    topics = ["probability_grid", "belief_grid", "step_report"]
    for topic in reversed(topics) if late else topics:
        # A page that was opened later gets the latched messages in any order.
        receive(mission, topic, first.messages[topic], 100 + topics.index(topic))
    other = second.messages
    assert other["step_report"].header.stamp == first.messages["step_report"].header.stamp
    receive(mission, "probability_grid", other["probability_grid"], 500)
    receive(mission, "step_report", other["step_report"], 510)
    history = mission.history
    assert history is not None and history.map_at("belief_grid", 0) is None
    found = history.map_at("probability_grid", 0)
    assert found is not None
    assert found[1] == map_png(occupancy_to_array(other["probability_grid"]))


def test_a_run_with_the_same_run_id_begins_again_if_its_steps_do(played: Played) -> None:
    mission = ShownMission("")
    show(mission, played, *played.play(3, steps=5))
    again = Played(**FIELDS)
    (first,) = again.play(3, steps=0)
    show(mission, again, first)
    history = mission.history
    assert history is not None and history.steps == [0]
    assert len(history.maps["belief_grid"]) == 1


def test_reports_that_arrive_after_that_of_the_mission_change_nothing() -> None:
    played, mission = Played(**FIELDS), ShownMission("")
    first, *others = played.play(3)
    assert others
    receive(mission, "step_report", first.messages["step_report"], 1)
    receive(mission, "mission_report", played.mission_report, 100)
    for step in others:
        receive(mission, "step_report", step.messages["step_report"], 1 + step.number)
    assert mission.history is not None
    assert mission.history.steps == [step.number for step in (first, *others)]


@functools.cache
def shown_whole(seed: int) -> tuple[Played, list[Step], ShownMission]:
    """A mission that was played to its end, and the page's that has all of it."""
    played, complete = Played(**FIELDS), ShownMission("")
    steps = list(played.play(seed))
    show(complete, played, *steps)
    return played, steps, complete


@pytest.mark.slow
@given(st.data())
def test_missed_steps_come_with_the_report_of_the_mission(data: Any) -> None:
    played, steps, complete = shown_whole(data.draw(st.integers(0, 9)))
    partly = ShownMission("")
    kept = data.draw(st.sets(st.integers(0, len(steps) - 1), min_size=1))
    show(partly, played, *(steps[i] for i in sorted(kept)))
    receive(partly, "mission_report", played.mission_report)
    assert complete.history is not None and partly.history is not None
    assert partly.history.steps == complete.history.steps
    assert list(partly.history.paths(partly.looks)) == list(complete.history.paths(complete.looks))
    for i in range(len(steps)):
        np.testing.assert_array_equal(partly.history.rewards[i], complete.history.rewards[i])


def test_a_drone_that_is_lost_between_two_steps_is_lost_in_the_last_one() -> None:
    played, mission = Played(**FIELDS, collisions=False), ShownMission("")
    show(mission, played, *played.play(1, steps=2))
    assert mission.history is not None
    revision, before = mission.history.revision, mission.history.states[2].tolist()
    assert before[1] == DroneState.FLYING
    played.mission.lose(1)
    show(mission, played, played.step())
    assert mission.history.revision > revision and len(mission.history) == 3
    assert mission.history.states[2].tolist() == [before[0], DroneState.LOST, before[2]]


def test_pos_that_comes_before_its_report_is_kept(played: Played) -> None:
    mission = ShownMission("")
    shown = list(played.play(3, steps=4))
    for step in shown:
        receive(mission, "probability_of_success", step.messages["probability_of_success"])
    for step in shown:
        receive(mission, "step_report", step.messages["step_report"])
    assert mission.history is not None
    assert [pos for _, pos in mission.history.pos] == [step.pos for step in shown]


@pytest.mark.parametrize(
    "topic", ["agents", "step_report", "probability_of_success", "probability_grid"]
)
def test_a_message_that_cannot_be_read_is_named_and_changes_nothing(
    played: Played, topic: str
) -> None:
    mission = ShownMission("")
    shown = list(played.play(3, steps=2))
    show(mission, played, *shown)
    good = {**shown[0].messages, "agents": played.agents}[topic]
    broken = type(good)()
    receive(mission, topic, broken)
    assert mission.history is not None and len(mission.history) == 3
    if topic != "step_report":
        assert topic in mission.trouble and "\n" not in mission.trouble[topic]
    receive(mission, topic, good)
    assert mission.trouble == {}


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(1, 40)), min_size=1, max_size=60))
def test_images_are_never_more_than_there_is_room_for(images: list[tuple[int, int]]) -> None:
    maps = MapImages(max_bytes=200)
    for stamp, size in images:
        maps.add(MapImage(stamp, bytes([stamp]) * size))
        assert len(maps) <= 2 or maps._bytes <= 200
        last = max(other for other, _ in images[: images.index((stamp, size)) + 1])
        found = maps.at(10**9)
        assert found is not None and found[0] >= last - 50
    for stamp in range(51):
        found = maps.at(stamp)
        assert found is None or (found[0] <= stamp and set(found[1]) == {found[0]})


@pytest.mark.parametrize("exact_first", [False, True])
def test_an_exact_map_takes_the_place_of_the_one_for_display(
    played: Played, exact_first: bool
) -> None:
    mission = ShownMission("")
    (step,) = played.play(3, steps=0)
    receive(mission, "agents", played.agents)
    belief = played.mission.belief()
    exact = probability_image(
        header(played.frame.map_frame, to_stamp(played.mission.result.stamp_ns)), belief
    )
    messages = [("belief_grid", step.messages["belief_grid"]), ("belief", exact)]
    for topic, message in reversed(messages) if exact_first else messages:
        receive(mission, topic, message)
    receive(mission, "step_report", step.messages["step_report"])
    assert mission.trouble == {} and mission.history is not None
    found = mission.history.map_at("belief_grid", 0)
    assert found is not None and found.top == pytest.approx(float(belief.max()))
    assert found.png == map_png(occupancy_to_array(step.messages["belief_grid"]))


def test_drones_that_collide_are_lost_with_each_other_and_with_no_other_one() -> None:
    played = Played(
        **{**FIELDS, "num_drones": 4, "drones_positions": [[0, 0], [2, 0], [5, 5], [6, 6]]}
    )
    mission, actions = ShownMission(""), played.env.rules.actions
    played.mission.reset(3)
    show(mission, played, played.step())
    moves = [
        # The first two meet in the cell between them, one step later the others in a corner.
        ("right", "left", "search", "search"),
        (None, None, "right", "search"),
        (None, None, "down", "search"),
    ]
    for names in moves:
        played.mission.command_all([-1 if n is None else actions.index(n) for n in names])
        played.mission.advance("search")
        show(mission, played, played.step())
    history = mission.history
    assert history is not None
    last = len(history) - 1
    assert [history.states[last][i] == DroneState.LOST for i in range(4)] == [True] * 4
    assert [history.collided_with(last, i) for i in range(4)] == [[1], [0], [3], [2]]
    assert [history.collided_with(1, i) for i in (0, 1)] == [[1], [0]]


def test_the_page_gets_every_report_and_of_a_map_only_the_last() -> None:
    inbox = Inbox(["step_report"])
    for number in range(5):
        for topic in ("step_report", "probability_grid"):
            for namespace in ("/a", "/b"):
                inbox.put(Received(namespace, topic, lambda n=number: n))
    taken = inbox.take()
    for namespace in ("/a", "/b"):
        read = [
            (message.topic, message.read()) for message in taken if message.namespace == namespace
        ]
        assert [n for topic, n in read if topic == "step_report"] == [0, 1, 2, 3, 4]
        assert [n for topic, n in read if topic == "probability_grid"] == [4]
    assert inbox.take() == []


def test_missions_are_kept_apart_by_namespace(played: Played) -> None:
    missions = ShownMissions()
    for namespace, steps in (("/b", 2), ("", 1), ("/a", 3)):
        for step in played.play(1, steps=steps):
            report = step.messages["step_report"]
            missions.take([Received(namespace, "step_report", lambda report=report: report)])
    assert list(missions.by_namespace) == ["", "/a", "/b"]
    lengths = [len(mission.history or ()) for mission in missions.by_namespace.values()]
    assert lengths == [2, 4, 3]


def test_a_message_that_cannot_even_be_deserialized_is_named_too() -> None:
    missions, mission = ShownMissions(), ShownMission("")

    def read() -> Any:
        raise RuntimeError("not\nenough bytes")

    mission.receive("agents", read)
    assert mission.trouble == {"agents": "not enough bytes"}
    missions.take([Received("", "agents", read), Received("", "publishers", lambda: 1)])
    assert missions.by_namespace[""].publishers == 1


def publish(missions: ShownMissions, namespace: str, **messages: Any) -> None:
    missions.take(
        [
            Received(namespace, topic, lambda message=message: message)
            for topic, message in messages.items()
        ]
    )


def test_a_mission_that_has_gone_makes_room_and_one_that_goes_on_does_not(played: Played) -> None:
    missions = ShownMissions(max_missions=2)
    for namespace in ("/a", "/b"):
        publish(missions, namespace, agents=played.agents, publishers=1)
    publish(missions, "/c", agents=played.agents)
    assert list(missions.by_namespace) == ["/a", "/b"]
    kept = missions.by_namespace["/a"]
    publish(missions, "/b", publishers=0)
    publish(missions, "/c", agents=played.agents)
    assert list(missions.by_namespace) == ["/a", "/c"] and missions.by_namespace["/a"] is kept
    # Of two that have gone it is the one that was heard of less recently.
    publish(missions, "/c", publishers=0)
    publish(missions, "/a", publishers=0)
    publish(missions, "/d", agents=played.agents)
    assert list(missions.by_namespace) == ["/a", "/d"]


@pytest.mark.slow
@given(st.data())
def test_all_missions_together_take_no_more_than_there_is_room_for(
    played: Played, data: Any
) -> None:
    room = 20_000
    missions = ShownMissions(max_missions=4, max_bytes=room)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    names = st.sampled_from(["/a", "/b", "/c", "/d", "/e"])
    for stamp in range(1, data.draw(st.integers(1, 60))):
        namespace = data.draw(names)
        if data.draw(st.integers(0, 9)) == 0:
            publish(missions, namespace, publishers=0)
            continue
        size = data.draw(st.integers(1, 40))
        noise = rng.integers(0, 101, (size, size)).astype(np.int8)
        message = OccupancyGrid(data=array.array("b", noise.tobytes()))
        message.info.width = message.info.height = size
        message.header.stamp.sec = stamp
        layer = data.draw(st.sampled_from(["probability_grid", "belief_grid"]))
        before = missions.by_namespace.get(namespace)
        (step,) = played.play(1, steps=0)
        report = step.messages["step_report"]
        report.header.stamp = message.header.stamp
        publish(missions, namespace, publishers=1, **{layer: message, "step_report": report})
        now = missions.by_namespace
        assert len(now) <= 4
        left = [
            maps
            for mission in now.values()
            if mission.history
            for maps in mission.history.maps.values()
        ]
        # What cannot be given up are the first and the last map of those that go on.
        all_gone_on = all(mission.publishers for mission in now.values())
        assert sum(mission.nbytes for mission in now.values()) <= room or (
            all_gone_on and max(map(len, left)) <= 2
        )
        if before is not None:
            history = now[namespace].history
            assert history is not None
            found = history.maps[layer].at(10**12)
            assert found is not None and found[0] == stamp * 10**9


def test_the_names_of_vehicles_are_not_endless(played: Played) -> None:
    mission = ShownMission("")
    show(mission, played)
    for number in range(1200):
        status = DiagnosticStatus(name=f"x{number}", message="ok")
        receive(mission, f"x{number}/vehicle_state", DiagnosticArray(status=[status]))
    assert len(mission.vehicles) == 1000 and len(mission.trouble) == 200
