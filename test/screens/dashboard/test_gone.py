# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What has gone is not listened for any more, and is there again when it is back."""

from __future__ import annotations

from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rig import LATCHED, Rig, Sim

from dsse_ros.ros.nodes.dashboard import TOPICS

pytestmark = pytest.mark.slow

MISSION: dict[str, Any] = {"grid_size": 6, "num_drones": 1, "step_mode": "manual"}


@pytest.fixture(scope="module")
def page(rig: Rig, address: str) -> Rig:
    """The domain, with a page that was served."""
    assert address
    return rig


def started(rig: Rig, namespace: str) -> Sim:
    """A simulation that has begun to listen: one that is interrupted before ends otherwise."""
    sim = rig.sim(MISSION, namespace=namespace)
    assert list(sim.get("scenario.grid_size")[0]) == [6, 6]
    return sim


def listeners(rig: Rig, namespace: str) -> int:
    """How many subscribe to the topics of a simulation, beside the test."""
    topics = [f"{namespace}/{topic}" for topic in TOPICS]
    return sum(rig.node.count_subscribers(topic) for topic in topics)


def test_a_simulation_that_has_gone_is_not_subscribed_to_until_it_is_back(page: Rig) -> None:
    sim = started(page, "/here")
    # Those of the test, which go on, are one of them.
    page.until(lambda: listeners(page, "/here") == len(TOPICS) + 1, "the page to subscribe")
    sim.process.stop()
    page.until(lambda: listeners(page, "/here") == 1, "the page to give it up")
    again = started(page, "/here")
    page.until(lambda: listeners(page, "/here") == len(TOPICS) + 2, "the page to subscribe again")
    again.process.stop()


def test_vehicles_that_have_gone_are_not_subscribed_to(page: Rig) -> None:
    sim = started(page, "/there")
    topics = [f"/there/drone{i}/vehicle_state" for i in range(3)]
    # Somebody who waits for a vehicle is none.
    waiting = page.node.create_subscription(DiagnosticArray, topics[2], lambda _: None, LATCHED)
    publishers = [
        page.node.create_publisher(DiagnosticArray, topic, LATCHED) for topic in topics[:2]
    ]
    page.until(lambda: all(p.get_subscription_count() for p in publishers), "the page to subscribe")
    assert page.node.count_subscribers(topics[2]) == 1
    page.node.destroy_publisher(publishers.pop())
    page.until(lambda: not page.node.count_subscribers(topics[1]), "the page to give it up")
    assert publishers[0].get_subscription_count() == 1
    page.node.destroy_publisher(publishers.pop())
    page.node.destroy_subscription(waiting)
    sim.process.stop()
