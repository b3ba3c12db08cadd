# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What SECURITY.md promises of the code and of the policy for sros2."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from sros2_policy import COMMANDS, EVERYTHING, WITH_SIM_TIME, as_expressions, policy
from tree import by_name, files

from dsse_ros.mission.run.command_intake import NAVIGATE_TO_POSE
from dsse_ros.ros.nodes.dashboard import _SERVICES
from dsse_ros.ros.nodes.operator_services import OPERATOR_SERVICES
from msg_adapters.topics import published_by, subscribed_by

ROOT = Path(__file__).resolve().parents[2]
OURS = ("dsse_ros/", "msg_adapters/", "launch/", "scripts/", "examples/", "docs/")
PICKLING = {"cloudpickle", "dill", "joblib", "marshal", "pickle", "shelve"}
SECRETIVE = {
    "dsse_ros/screens/dashboard/guard.py",
    "dsse_ros/screens/dashboard/settings.py",
    "dsse_ros/vehicles/mavlink/signing.py",
}
SECRETS = {"token", "cookie", "key", "credentials", "offered"}


# The policy for sros2; test_docs.py compares it with the running nodes.


def test_the_policy_has_the_topics_of_the_table() -> None:
    of_every_node = {"/parameter_events", "/rosout"}
    for name, rights in policy().items():
        assert rights["publish"] - of_every_node == as_expressions(published_by(name)), name
        if rights["subscribe"] != EVERYTHING:
            subscribed = as_expressions(subscribed_by(name))
            assert rights["subscribe"] - WITH_SIM_TIME == subscribed, name


def test_nobody_but_planners_and_people_may_command_a_drone() -> None:
    rights = policy()
    assert rights["sim_node"]["subscribe"] > COMMANDS
    may = {name: right["publish"] & COMMANDS for name, right in rights.items()}
    assert {name: topics for name, topics in may.items() if topics} == {
        "planner_node": {"joint_action", "joint_command"},
        "ros_env": {"joint_action", "joint_command"},
        # The wind that its vehicles fly in.
        "mavlink_bridge": {"vehicle_wind"},
        "dashboard": {
            f"live/{kind}"
            for kind in ("confirm", "dismiss", "searched", "sighting", "weather", "withdraw")
        },
        "operator": COMMANDS,
    }


def test_only_people_may_send_drones_by_an_action() -> None:
    may = {
        right: {name: rights[right] for name, rights in policy().items() if rights[right]}
        for right in ("execute", "call")
    }
    action = {f"drone*/{NAVIGATE_TO_POSE}"}
    assert may == {"execute": {"sim_node": action}, "call": {"operator": action}}


def test_nobody_may_publish_everything() -> None:
    assert not any(right["publish"] & EVERYTHING for right in policy().values())
    listening = {name for name, right in policy().items() if right["subscribe"] & EVERYTHING}
    assert listening == {"recorder", "foxglove_viewer", "operator"}


def test_only_trainings_and_people_may_change_a_simulation_but_for_the_buttons_of_the_page() -> (
    None
):
    requests = {name: right["request"] for name, right in policy().items() if right["request"]}
    assert requests.keys() == {"dashboard", "ros_env", "operator"}
    whom = ("mavlink_bridge", "drone*")
    of_vehicles = {f"{who}/{what}" for who in whom for what in OPERATOR_SERVICES}
    of_simulation = {f"sim_node/{service}" for service, *_ in _SERVICES.values()}
    assert requests["dashboard"] == of_simulation | of_vehicles
    simulation = {name.replace("~", "sim_node") for name in policy()["sim_node"]["reply"]}
    assert requests["operator"] > simulation | of_vehicles
    assert simulation > requests["ros_env"] | of_simulation


# The code


def calls(path: Path) -> Iterator[tuple[str, ast.Call]]:
    """Calls in a file, each with the name of what is called as it is written."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), node


def ours() -> dict[str, Path]:
    """Python of the packages, and of what is shipped and shown with them."""
    found = {
        name: path for name, path in by_name(files()).items()
        if name.startswith(OURS) and (name.endswith(".py") or name.startswith("scripts/"))
    }  # fmt: skip
    assert len(found) > 100
    return found


@pytest.mark.slow
def test_no_pickle_is_read_from_a_file() -> None:
    for name, path in ours().items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match node:
                case ast.Import(names=names):
                    imported = {alias.name.split(".")[0] for alias in names}
                case ast.ImportFrom(module=str(module)):
                    imported = {module.split(".")[0]}
                case _:
                    continue
            assert not imported & PICKLING, name
    loads = [
        (name, {keyword.arg: ast.unparse(keyword.value) for keyword in call.keywords})
        for name, path in ours().items()
        for called, call in calls(path)
        if called in ("np.load", "numpy.load")
    ]
    assert {name for name, _ in loads} >= {"dsse_ros/search/environments/snapshot.py"}
    assert [name for name, keywords in loads if keywords.get("allow_pickle") != "False"] == []


@pytest.mark.slow
def test_yaml_is_read_safely() -> None:
    safe = {"yaml.safe_load", "yaml.safe_dump"}
    found = {
        (name, called, *map(ast.unparse, call.args[1:]))
        for name, path in ours().items()
        for called, call in calls(path)
        if re.fullmatch(r"yaml\.\w*(load|parse|compose|dump)\w*", called) and called not in safe
    }
    # The loader of scenarios is PyYAML's safe one with less in it.
    assert found == {("dsse_ros/world/scenario/yaml_file.py", "yaml.load", "_Loader")}
    import yaml

    from dsse_ros.world.scenario.yaml_file import _Loader

    assert issubclass(_Loader, yaml.SafeLoader)


@pytest.mark.slow
def test_nothing_that_was_read_is_run() -> None:
    forbidden = re.compile(r"(?:eval|exec|os\.system|os\.popen|subprocess\.getoutput)")
    found = [
        f"{name}: {called}"
        for name, path in ours().items()
        for called, call in calls(path)
        if forbidden.fullmatch(called) or any(keyword.arg == "shell" for keyword in call.keywords)
    ]
    assert found == []


def test_secrets_are_compared_in_constant_time() -> None:
    compared = [
        f"{name}:{node.lineno}: {ast.unparse(node)}"
        for name, path in ours().items()
        if name in SECRETIVE
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Compare)
        and any(isinstance(op, ast.Eq | ast.NotEq) for op in node.ops)
        and any(
            word in SECRETS
            for part in (node.left, *node.comparators)
            for one in ast.walk(part)
            if isinstance(one, ast.Name | ast.Attribute)
            for word in (one.id if isinstance(one, ast.Name) else one.attr).strip("_").split("_")
        )
    ]
    assert compared == []
    guard = (ROOT / "dsse_ros/screens/dashboard/guard.py").read_text(encoding="utf-8")
    assert guard.count("hmac.compare_digest(") == 1
    assert guard.count("_equal(") == 4  # The function, the link, the header and the cookie.


# The page


def test_each_test_that_security_md_names_exists() -> None:
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    named = re.findall(r"\[`(test_\w+)`\]\((test/[\w/]+\.py)\)", text)
    assert len(named) > 10
    missing = [
        f"{path}: {name}" for name, path in named
        if f"\ndef {name}(" not in (ROOT / path).read_text(encoding="utf-8")
    ]  # fmt: skip
    assert missing == []
