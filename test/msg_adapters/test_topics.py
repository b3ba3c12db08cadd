# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of topics: its rows fit together; it gives nobody an endpoint that it does not list."""

from __future__ import annotations

import pytest

from dsse_ros.base.message_types import message_class
from dsse_ros.ros.runtime.qos import COMMANDS, COMPLETE, LATCHED, PROFILES, offered, requested
from msg_adapters.topics import TOPICS, Topic, replayed, topic_of


@pytest.mark.parametrize(("name", "topic"), TOPICS.items())
def test_a_row_names_an_installed_type_and_who_uses_it(name: str, topic: Topic) -> None:
    package = topic.type_name.partition("/")[0]
    if package in ("tf2_msgs", "vision_msgs"):
        pytest.importorskip(package)
    assert message_class(topic.type_name).__name__ == topic.type_name.rpartition("/")[2]
    assert topic.publishers and topic.subscriber_qos.keys() <= {*topic.subscribers}
    assert {topic.qos, *topic.subscriber_qos.values()} <= PROFILES.keys()
    if "sim_node" in (*topic.publishers, *topic.subscribers):
        assert topic.content, name


def test_what_replay_compares_belongs_to_the_mission() -> None:
    compared = replayed("compared")
    assert compared and all(topic.publishers == ("sim_node",) for topic in compared.values())
    assert replayed("followed").keys() == {"agents", "live/history", "step_report"}
    assert replayed("belief", "after report", "between steps", "once").keys() <= compared.keys()


def test_a_topic_of_each_drone_has_one_row() -> None:
    assert topic_of("drone12/pose") is topic_of("drone<i>/pose") is TOPICS["drone<i>/pose"]


def test_endpoints_have_the_type_and_the_qos_of_the_row() -> None:
    kind, qos = offered("drone3/cmd_action_name", "operator")
    assert kind.__name__ == "String" and qos is COMMANDS
    assert requested("step_report", "show")[1] is COMPLETE
    assert requested("step_report", "planner_node")[1] is LATCHED


def test_who_is_not_in_the_row_gets_no_endpoint() -> None:
    with pytest.raises(ValueError, match="show must be one of the publishers of agents"):
        offered("agents", "show")
    with pytest.raises(ValueError, match="recorder must be one of the subscribers of agents"):
        requested("agents", "recorder")
    with pytest.raises(KeyError):
        requested("nothing", "show")
