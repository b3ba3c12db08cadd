# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The topics of a live search: inputs, their answers and the contacts."""

from __future__ import annotations

import json
from collections import Counter
from functools import partial
from typing import TYPE_CHECKING, Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from std_msgs.msg import String

from dsse_ros.base.fields import FieldError
from dsse_ros.base.message_types import message_class
from dsse_ros.base.result import Rejected
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.history import HistoryTexts
from dsse_ros.mission.live.inputs import KINDS
from dsse_ros.mission.run.live_intake import LiveIntake
from dsse_ros.ros.runtime.qos import Endpoints
from msg_adapters.live import (
    FramedDetection,
    contact_markers,
    detection_of_pose,
    detections_of_array,
)
from msg_adapters.stamps import header, to_nanoseconds
from msg_adapters.topics import EACH_DRONE, TOPICS

if TYPE_CHECKING:
    from dsse_ros.ros.nodes.sim_node import SimNode

ANSWER_S = 0.05
"""Wall time from an input to its answer: inputs that come together share the work."""
DETECTIONS = f"{EACH_DRONE}detections"


def serve(node: SimNode, endpoints: Endpoints, rejected: Counter[str]) -> None:
    """Serve the topics of a live search, if the mission is one.

    Args:
        node: The node.
        endpoints: Makes its endpoints.
        rejected: Counts the refused inputs by code.
    """
    if isinstance(node.mission.beliefs, LiveBeliefs):
        inputs = LiveInputs(node, endpoints, rejected)
        node.publishers_.after_step.append(inputs.on_step)


class LiveInputs:
    """Takes the inputs of a live search, and publishes answers and contacts.

    Args:
        node: As in `serve`.
        endpoints: As in `serve`.
        rejected: As in `serve`.
    """

    def __init__(self, node: SimNode, endpoints: Endpoints, rejected: Counter[str]) -> None:
        self._node, self._mission, self._frame = node, node.mission, node.frame
        self._intake = LiveIntake(node.mission, node.warn, rejected, node.files.journal)
        self._alarm = node.alarms.make(self._decide)
        self._due = False
        self._answers, self._contacts, self._markers, self._history = (
            endpoints.publisher(f"live/{name}")
            for name in ("answers", "contacts", "contact_markers", "history")
        )
        self._texts = HistoryTexts()
        for kind in KINDS:
            endpoints.subscription(f"live/{kind}", partial(self._on_text, kind))
        for name in node.mission.env.possible_agents:
            endpoints.subscription(f"{name}/detection_pose", partial(self._on_pose, name))
            if is_installed(DETECTIONS):
                topic = DETECTIONS.replace(EACH_DRONE, f"{name}/")
                endpoints.subscription(topic, partial(self._on_array, name))

    def on_step(self) -> None:
        """Take up the stamp of a step, and publish its looks and the contacts as they are then."""
        self._intake.clock.set(self._mission.result.step, self._seconds())
        self._publish_history()
        self._publish_contacts()

    @property
    def _search(self) -> tuple[int, int]:
        """run_id and number of the mission."""
        return self._node.publishers_.run_id, self._mission.number

    def _seconds(self) -> float:
        return to_nanoseconds(self._node.stamp()) / 1e9

    def _on_text(self, kind: str, message: String) -> None:
        self._intake.take(kind, message.data)
        self._arm()

    def _on_pose(self, drone: str, message: PoseWithCovarianceStamped) -> None:
        self._take(detection_of_pose(drone, message))

    def _on_array(self, drone: str, message: Any) -> None:
        for detection in detections_of_array(drone, message):
            self._take(detection)

    def _take(self, detection: FramedDetection) -> None:
        if detection.frame_id == self._frame.map_frame:
            self._intake.take_values("detection", detection.values)
        else:
            wanted = self._frame.map_frame
            reason = f"header.frame_id must be {wanted!r}, got {detection.frame_id[:80]!r}"
            rejected = Rejected("foreign_frame", reason)
            self._intake.refuse("detection", detection.values["id"], rejected)
        self._arm()

    def _arm(self) -> None:
        if not self._due:
            self._due = True
            self._alarm.set(ANSWER_S)

    def _decide(self) -> None:
        self._due, was_over = False, self._mission.done
        answers = self._intake.decide(self._seconds())
        if any(answer.ok for answer in answers):
            self._publish_history()
            self._publish_contacts()
            self._node.publishers_.publish_belief(self._node.settings.grid_scaling)
            if self._mission.done and not was_over:
                self._node.publish_change()
        for answer in answers:
            self._answers.publish(String(data=answer._replace(search=self._search).to_json()))

    def _publish_history(self) -> None:
        beliefs = self._mission.beliefs
        assert isinstance(beliefs, LiveBeliefs)
        self._history.publish(String(data=self._texts.next(self._search, beliefs.live_search)))

    def _publish_contacts(self) -> None:
        contacts = self._intake.contacts()
        self._contacts.publish(String(data=json.dumps(contacts, allow_nan=False)))
        head = header(self._frame.map_frame, self._node.stamp())
        cell_m = self._frame.cell_size_m
        self._markers.publish(contact_markers(head, contacts, cell_m))


def is_installed(topic: str) -> bool:
    """Return whether the type of a topic is installed."""
    try:
        message_class(TOPICS[topic].type_name)
    except FieldError:
        return False
    return True
