# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The plans of the drones as paths, from a planner that has them."""

from __future__ import annotations

from itertools import zip_longest

import numpy as np
from rclpy.publisher import Publisher

from dsse_ros.planners.planner import Plans
from dsse_ros.ros.runtime.last_published import LastPublished
from dsse_ros.ros.runtime.observed_step import ObservedStep
from dsse_ros.ros.runtime.qos import Endpoints
from dsse_ros.world.scenario.frames import map_positions
from msg_adapters.poses import path
from msg_adapters.stamps import header, to_stamp

PLAN = "drone<i>/plan"
PLAN_PERIOD_S = 0.5
"""Wall time between two messages of a plan, at least."""


class PlanPublishers:
    """Publishes the plan of each drone while somebody subscribes.

    Args:
        endpoints: Makes the publishers, once the drones are known.
    """

    def __init__(self, endpoints: Endpoints) -> None:
        self._endpoints = endpoints
        self._publishers: list[Publisher] = []
        self._published = LastPublished()

    def publish(self, observed: ObservedStep, plans: Plans) -> None:
        """Publish plans that have changed or that a new subscriber lacks.

        Args:
            observed: The step that was planned for.
            plans: By name of the drone; one without a plan gets an empty path.

        Raises:
            TypeError, ValueError: If a plan is none.
        """
        info, places = observed.info, observed.places.astype(np.float64)
        head = header(info.frame.map_frame, to_stamp(observed.stamp_ns))
        for drone in range(len(self._publishers), len(info.agents)):
            name = PLAN.replace("<i>", str(drone))
            self._publishers.append(self._endpoints.publisher(name))
        for drone, (agent, publisher) in enumerate(zip_longest(info.agents, self._publishers)):
            plan = np.asarray(plans.get(agent, ()), np.float64).reshape(-1, 2)
            if not self._published.is_news(publisher, observed.step_id, len(plan)):
                continue
            positions = map_positions(info.frame, plan, drone) if len(plan) else []
            if positions:
                x_m, y_m = places[drone].tolist()
                positions.insert(0, (x_m, y_m, info.frame.alt_of(drone)))
            publisher.publish(path(head, positions))
