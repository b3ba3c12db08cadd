# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of topics, parameters, states and profiles into the pages.

Run `python docs/tables.py` after a change of a topic, of a scenario's, a rule's or a node's fields,
of the arguments of a launch file, of the states of a vehicle, or of the spaces of an environment.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import re
import textwrap
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from dsse_ros import PROFILES, Rules, Scenario, parallel_env
from dsse_ros.base.fields import Spec, specs
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.options import PatternOptions
from dsse_ros.planners.registry import OPTIONS
from dsse_ros.planners.search_plan.units_file import UnitFields
from dsse_ros.results.campaign.config import CampaignSettings, PlannerEntry
from dsse_ros.ros.nodes.settings import (
    RUN_TIME_SETTINGS,
    PlannerSettings,
    RecorderSettings,
    ShowSettings,
    SimSettings,
    ViewerSettings,
)
from dsse_ros.screens.dashboard.settings import DashboardSettings
from dsse_ros.screens.tak.settings import CotSettings
from dsse_ros.vehicles.fleet.custody import MAY_ORDER, NEXT, Custody, Event
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.world.drift.leeway import Component, leeway_classes
from dsse_ros.world.scenario.fault_fields import FAULTS, FaultFields
from dsse_ros.world.scenario.rules import GROUPS
from msg_adapters.topics import TOPICS, Topic, published_by, subscribed_by

ROOT = Path(__file__).resolve().parents[1]
Rows = list[list[str]]
_MOST_CHOICES = 15
"""Number of choices that a table lists."""


def table(head: list[str], rows: Rows) -> str:
    """Return a Markdown table, without columns that are empty."""
    lines = [head, ["---"] * len(head), *rows]
    kept = [i for i in range(len(head)) if any(row[i] for row in rows)]
    return "".join("| " + " | ".join(cells[i] for i in kept) + " |\n" for cells in lines)


def shown(value: Any) -> str:
    """Return a value as YAML has it; nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, int | float):
        return f"`{value if isinstance(value, int) else round(value, 6) or value}`"
    if isinstance(value, GridShape) and value.columns == value.rows:
        return f"`{value.columns}`"
    if isinstance(value, str):
        return f"`{value}`" if value else '`""`'
    return f"`[{', '.join(shown(item).strip('`') for item in value)}]`"


def with_unit(default: str, spec: Spec) -> str:
    """Return a default with the unit of its field; the unit in brackets if there is none."""
    return f"{default} {spec.unit}".strip() if default or not spec.unit else f"({spec.unit})"


def meaning(spec: Spec) -> str:
    """Return what a field means, with its choices; the error for another value has its limits."""
    if len(spec.choices or ()) > _MOST_CHOICES:
        return f"{spec.doc} The error for another one lists the {len(spec.choices)} names."
    choices = ", ".join(f"`{choice}`" for choice in spec.choices or ())
    return f"{spec.doc} One of {choices}." if choices else spec.doc


def defaults(cls: type) -> dict[str, Any]:
    """Return the defaults of a dataclass, None where there is none."""
    return {
        f.name: None if f.default is dataclasses.MISSING else f.default
        for f in dataclasses.fields(cls)
    }


def settings_table(cls: type, run_time: Collection[str] = ()) -> str:
    """Return the table of a node's own settings."""
    values = defaults(cls)
    rows = [
        [
            f"`{name}`", with_unit(shown(values[name]), spec),
            "yes" if name in run_time else "", meaning(spec),
        ]
        # What it shares with others comes last.
        for name, spec in sorted(specs(cls).items(), key=lambda s: s[0] not in cls.__annotations__)
    ]  # fmt: skip
    return table(["Parameter", "Default", "At run time", "Meaning"], rows)


def scenario_table() -> str:
    """Return the table of a scenario's fields; a default may depend on the profile."""
    values, of_rules = defaults(Scenario), specs(Rules)
    rows = []
    # What says of the drones what they are comes last.
    own = sorted(specs(Scenario).items(), key=lambda s: s[0] not in Scenario.__annotations__)
    # What it has in common with faults is a table of its own.
    for name, spec in own:
        if name in specs(FaultFields):
            continue
        default = shown(values[name])
        if values[name] is None and name in of_rules:
            default = by_profile(name)
        rows.append([f"`{name}`", with_unit(default, spec), meaning(spec)])
    return table(["Field", "Default", "Meaning"], rows)


def faults_table() -> str:
    """Return the table of the fields of a scenario for faults."""
    values, of_fields = defaults(FaultFields), specs(FaultFields)
    rows = [
        [f"`{field}`", with_unit(shown(values[field]), of_fields[field]), meaning(of_fields[field])]
        for fault in FAULTS.values() for field in (*fault.switches, *fault.options)
    ]  # fmt: skip
    return table(["Field", "Default", "Meaning"], rows)


def planner_options_table() -> str:
    """Return the table of the planners' options, a row for those that are the same."""
    planners: dict[tuple[str, ...], list[str]] = {}
    for planner, options in OPTIONS.items():
        if options is PatternOptions:
            continue
        values = defaults(options)
        for name, spec in specs(options).items():
            row = (f"`{name}`", with_unit(shown(values[name]), spec), meaning(spec))
            planners.setdefault(row, []).append(f"`{planner}`")
    rows = [[row[0], ", ".join(names), *row[1:]] for row, names in planners.items()]
    return table(["Option", "Planners", "Default", "Meaning"], rows)


def rules_table() -> str:
    """Return a table of the rules' fields for each group of them."""
    texts = []
    for name, group in GROUPS.items():
        rows = [[f"`{field}`", by_profile(field), spec.doc] for field, spec in specs(group).items()]
        head = ["Field", "Default", "Meaning"]
        texts.append(f"\n**{name}.** {group.__doc__}\n\n{table(head, rows)}")
    return "".join(texts) + "\n"


def by_profile(field: str) -> str:
    """Return the value of a field in most profiles, and the others with their profiles."""
    profiles: dict[str, list[str]] = {}
    for profile, rules in PROFILES.items():
        profiles.setdefault(shown(getattr(rules, field)) or "centre", []).append(profile)
    usual = max(profiles, key=lambda value: len(profiles[value]))
    others = [f"{', '.join(of)}: {value}" for value, of in profiles.items() if value != usual]
    return "; ".join([usual, *others])


def card(profile: str) -> dict[str, str]:
    """Return the card of a profile: its spaces, actions, grid and limit."""
    env = parallel_env(rules=profile)
    agent, limit = env.possible_agents[0], env.scenario.timestep_limit
    _, infos = env.reset(seed=0)
    return {
        "Action space": f"`{env.action_space(agent)}`",
        "Observation space": f"`{env.observation_space(agent)}`",
        "State space": f"`{env.state_space}`",
        "Keys of `infos`": ", ".join(f"`{key}`" for key in infos[agent]),
        "Grid": f"{env.scenario.grid_size}",
        "Steps of a failed episode": f"{limit + 1 + env.rules.time_out_grace}",
    }


def cards_table() -> str:
    """Return the cards of all profiles, a column for each."""
    cards = [card(profile) for profile in PROFILES]
    rows = [[name, *(of[name] for of in cards)] for name in cards[0]]
    return table(["", *(f"`{profile}`" for profile in PROFILES)], rows)


def fields_table(cls: type) -> str:
    """Return the table of the fields of a file."""
    values = defaults(cls)
    rows = [
        [f"`{name}`", with_unit(shown(values[name]), spec), meaning(spec)]
        for name, spec in specs(cls).items()
    ]
    return table(["Field", "Default", "Meaning"], rows)


def states_table() -> str:
    """Return the states of a vehicle, and what may be sent to it in each."""
    rows = [
        [
            state.value, meanings(Custody)[state.name],
            ", ".join(f"`{order.__name__}`" for order in MAY_ORDER[state]) or "nothing",
        ]
        for state in Custody
    ]  # fmt: skip
    return table(["State", "Meaning", "Orders"], rows)


def events_table() -> str:
    """Return the state after each event, by the states before."""
    rows = []
    for event in Event:
        before: dict[str, list[str]] = {}
        for state, after in NEXT.items():
            if event in after:
                before.setdefault(after[event].value, []).append(state.value)
        changes = [
            f"{'every state' if len(states) == len(NEXT) else ', '.join(states)} → **{after}**"
            for after, states in before.items()
        ]
        rows.append([event.value, "; ".join(changes)])
    return table(["When", "State before → after"], rows)


def leeway_table() -> str:
    """Return the classes of leeway with their coefficients."""

    def shown_component(component: Component) -> str:
        slope, offset, std = component
        return f"{slope:g} {offset:+g} ± {std:g}"

    rows = [
        [
            f"`{key}`", category.description, ", ".join(f"`{name}`" for name in category.aliases),
            *(shown_component(part) for part in (category.downwind, category.right, category.left)),
            category.source,
        ]
        for key, category in leeway_classes().items()
    ]  # fmt: skip
    return table(["Class", "Object", "Also", "Downwind", "Right", "Left", "Source"], rows)


QOS = {
    "latched": "latched",
    "complete": "latched, 1000",
    "reliable": "reliable 10",
    "command": "reliable 10",
    "queued": "reliable 1000",
    "sensor": "sensor data",
}
"""Quality of service in the words of docs/topics.md."""


def topic_row(name: str, topic: Topic, subscriber: str = "") -> list[str]:
    """Return name, type and QoS of a topic: what it offers, or what a subscriber requests."""
    qos = topic.subscriber_qos.get(subscriber, topic.qos)
    return [f"`{name}`", f"`{topic.type_name.replace('/msg/', '/')}`", QOS[qos]]


def topics_table(topics: Mapping[str, Topic], subscriber: str = "") -> str:
    """Return topics with their contents."""
    rows = [[*topic_row(name, topic, subscriber), topic.content] for name, topic in topics.items()]
    return table(["Topic", "Type", "QoS", "Content"], rows)


def others_table() -> str:
    """Return the topics between other nodes than `sim_node`."""
    of_sim = {*published_by("sim_node"), *subscribed_by("sim_node")}
    return topics_table({name: topic for name, topic in TOPICS.items() if name not in of_sim})


def nodes_table() -> str:
    """Return the names of the topics of the other nodes."""
    rows = [
        [
            f"`{node}`",
            *(", ".join(f"`{name}`" for name in of(node)) for of in (subscribed_by, published_by)),
        ]
        for node in ("planner_node", "mavlink_bridge", "dashboard", "cot_gateway", "show")
    ]
    return table(["Node", "Subscribes to", "Publishes"], rows)


def meanings(enum: type) -> dict[str, str]:
    """Return the sentences below the members of an enumeration."""
    definition = ast.parse(textwrap.dedent(inspect.getsource(enum))).body[0]
    assert isinstance(definition, ast.ClassDef)
    return {
        ast.unparse(member.targets[0]): ast.literal_eval(sentence.value).removesuffix(".")
        for member, sentence in itertools.pairwise(definition.body)
        if isinstance(member, ast.Assign) and isinstance(sentence, ast.Expr)
    }


TABLES = {
    "published": lambda: topics_table(published_by("sim_node")),
    "subscribed": lambda: topics_table(subscribed_by("sim_node"), "sim_node"),
    "others": others_table,
    "nodes": nodes_table,
    "states": states_table,
    "events": events_table,
    "campaign": lambda: fields_table(CampaignSettings),
    "campaign_planner": lambda: fields_table(PlannerEntry),
    "search_units": lambda: fields_table(UnitFields),
    "sim_node": lambda: settings_table(SimSettings, RUN_TIME_SETTINGS),
    "planner_node": lambda: settings_table(PlannerSettings),
    "mavlink_bridge": lambda: settings_table(BridgeSettings),
    "dashboard": lambda: settings_table(DashboardSettings),
    "show": lambda: settings_table(ShowSettings),
    "recorder": lambda: settings_table(RecorderSettings),
    "viewer": lambda: settings_table(ViewerSettings),
    "cot_gateway": lambda: settings_table(CotSettings),
    "scenario": scenario_table,
    "faults": faults_table,
    "rules": rules_table,
    "planner_options": planner_options_table,
    "cards": cards_table,
    "leeway": leeway_table,
}
PAGES = tuple(
    f"docs/{name}.md"
    for name in (
        "campaign",
        "dashboard",
        "faults",
        "flight",
        "leeway",
        "parameters",
        "plan_search",
        "planners",
        "profiles",
        "recording",
        "ros",
        "rules",
        "topics",
        "viewers",
    )
)
_PLACE = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->\n)", re.DOTALL)


def with_tables(text: str) -> str:
    """Return a page with the tables as the code has them, each between two comments."""
    return _PLACE.sub(lambda place: f"{place[1]}{TABLES[place[2]]()}{place[3]}", text)


if __name__ == "__main__":
    for page in PAGES:
        path = ROOT / page
        path.write_text(with_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
