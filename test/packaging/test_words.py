# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Names and prose use the terms of ROS, MAVLink, PettingZoo and search theory, no private words.

It holds for all under version control: code, descriptions of parameters, log lines, tests and docs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from tree import by_name, files, text

# Private words, and what is written in their place. Of an identifier each part is a word.
WORDS = {
    # search, planners
    r"wish(?:e[sd])?": "requested cells",
    r"settl(?:e[sd]?|ing)": "resolve conflicts, update, decide, wait until quiet",
    "adrift": "num_missing",
    "conventional": "FlattenedObservationWrapper",
    "manners?": "behaviour, options",
    "of sea, persons and planner": "of the map, the persons and the planner",
    "probability covered|searched [0-9.]+ ?%|pos_cumulative|search_effort": "POS",
    "rooms": "packages",
    # nodes
    "crowds?": "publisher counts",
    "introduce[ds]?": "log connections",
    "told|tells?|telling|said": "publish, report, log, contain",
    "whoever": "late joiners, a caller, anybody",
    # benchmarks
    "contenders?": "baselines",
    "anchors": "reference values",
    "dearer": "slower",
    "floor": "baseline",
    # flight
    "dialects?": "autopilot",
    "helm": "command sender, setpoint streamer, mode ownership",
    "escorts?": "VehicleFollower",
    "telegrams?": "mavlink_messages",
    "last_words": "final messages",
    "set[-_]points?": "setpoint",
    "believe[ds]?|believing": "confirm_peer, accept",
    r"grumbl(?:e[sd]?|ing)": "ignored NACK",
    "goodbyes?": "cancel",
    "waits for a search": "waiting for step_report",
}

# Identifiers that are plain English otherwise, exactly as they are written here.
NAMES = {
    r"(?:worlds\[\"|\bw\.)(?:flying|adrift|over)\b": "num_active, num_missing, done",
    r"\b(?:mission|scheduler|watcher)\.over\b": "done",
    r"(?:drones\[\"|\bd\.)earned\b": "episode_return",
    r"\b_meet\b": "configure",
    r"\bclass Pilot\b|\bPilot\(": "VehicleController",
    r"\b(?:Said|Heard)\b": "Outgoing, Incoming",
}

# File, the word there, and why it may stand there.
ALLOWED = (
    ("CHANGELOG.rst", ".*", "names what was renamed"),
    ("LICENSE", ".*", "is Apache's"),
    ("benchmarks/results/", ".*", "was recorded before"),
    ("test/oracles/data/", ".*", "was recorded before"),
    ("test/packaging/test_words.py", ".*", "lists the words"),
    ("", "person adrift", "drifts at sea"),
    ("", r"math\.floor|np\.floor", "rounds down"),
    ("", "sea_floor", "is in standard names of CF"),
    ("", r"\.tell", "is the position in a file"),
    ("", r"(?:mavlink|pymavlink)[ .']*dialects?", "is MAVLink's: a set of messages"),
    ("test/packaging/test_docs.py", "anchors", "are HTML's"),
    ("docs/conf.py", "myst_heading_anchors", "is the name of an option"),
    ("dsse_ros/flight/", r"settl\w+", "is what a transfer does until its line is quiet"),
    ("dsse_ros/nodes/mavlink_bridge.py", r"settle\w*", "is the wait for latched messages"),
    ("test/flight/", r"settl\w+", "is what a transfer does until its line is quiet"),
)


def private(name: str, content: str) -> Iterator[str]:
    """Private words in a file of this name, each with its line and what to write."""
    kept = [re.compile(word, re.IGNORECASE) for path, word, _ in ALLOWED if name.startswith(path)]
    # Most files have none: to look for each word, or at each line, takes several seconds.
    likely = (PATTERNS if ANY.search(content.lower()) else []) + OF_NAMES
    there = [(pattern, term) for pattern, term in likely if pattern.search(content)]
    for number, line in enumerate(content.splitlines() if there else [], start=1):
        spared = [match.span() for one in kept for match in one.finditer(line)]
        for pattern, term in there:
            for found in pattern.finditer(line):
                if not any(low <= found.start() and found.end() <= high for low, high in spared):
                    yield f"{name}:{number}: {found[0]!r} is a private word; write {term}"


PATTERNS = [
    (re.compile(f"(?<![a-z])(?:{one})(?![a-z])", re.IGNORECASE), t) for one, t in WORDS.items()
]
ANY = re.compile(f"(?<![a-z])(?:{'|'.join(WORDS)})(?![a-z])")
OF_NAMES = [(re.compile(one), term) for one, term in NAMES.items()]


@pytest.mark.slow
def test_no_file_has_a_private_word() -> None:
    found = [line for name, path in by_name(files()).items() for line in private(name, text(path))]
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "self._wishes = []",
        "class Crowd:",
        "def settle_flags(w):",
        "The vehicle is told to land.",
        "SET_POINT_RATE = 5.0",
        "from dsse_ros.flight.telegrams import Heard",
        'world.worlds["over"]',
        "Where no floor is:",
    ],
)
def test_a_private_word_is_found_in_names_and_in_prose(line: str) -> None:
    assert list(private("dsse_ros/module.py", line))


@pytest.mark.parametrize(
    "line",
    [
        "drones that look for a person adrift at sea",
        "at = math.floor(file.tell() / 2)",
        "from pymavlink.dialects.v20 import ardupilotmega",
        'infos["over"]',
        "The pilot takes over.",
        "tellurium, settlement, wishbone",
    ],
)
def test_plain_english_is_none(line: str) -> None:
    assert list(private("dsse_ros/module.py", line)) == []
