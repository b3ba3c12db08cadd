# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The policy for sros2 as it is in the file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

from msg_adapters.topics import EACH_DRONE, TOPICS

POLICY = Path(__file__).resolve().parents[2] / "config" / "sros2_policy.xml"
EVERYTHING = {"/*"}
WITH_TF2_MSGS = {"/tf", "/tf_static"}
WITH_VISION_MSGS = {f"{EACH_DRONE}detections"}
WITH_SIMULATION_INTERFACES = {
    f"~/{name}"
    for name in (
        "get_simulation_state", "get_simulator_features", "reset_simulation",
        "set_simulation_state", "step_simulation",
    )
}  # fmt: skip
WITH_SIM_TIME = {"/clock"}

RIGHTS = ("publish", "subscribe", "reply", "request", "execute", "call")
"""Of topics, services and actions."""

Rights = dict[str, set[str]]


def policy() -> dict[str, Rights]:
    """What each enclave may do: names by each of `RIGHTS`."""
    rights: dict[str, Rights] = {}
    for enclave in ElementTree.parse(POLICY).getroot().iterfind("./enclaves/enclave"):
        name = enclave.attrib["path"].removeprefix("/dsse_ros/")
        rights[name] = {kind: set() for kind in RIGHTS}
        for rule in enclave.iterfind("./profiles/profile/*"):
            ((kind, value),) = rule.attrib.items()
            assert value == "ALLOW"
            names = [element.text or "" for element in rule]
            assert len(names) == len(set(names))
            rights[name][kind].update(names)
    return rights


def as_expressions(names: Iterable[str]) -> set[str]:
    """Names of topics and services as the policy has them, with each drone's in one."""
    return {name.replace(EACH_DRONE, "drone*/") for name in names}


COMMANDS = as_expressions(
    name
    for name, topic in TOPICS.items()
    if topic.qos in ("command", "queued") and "operator" in topic.publishers
)
