# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Prose is plain English: docs, docstrings, comments, messages and descriptions of parameters."""

from __future__ import annotations

import re

import pytest
from tree import by_name, files, text

# Phrases that native readers stumble over, and what to write instead.
PHRASES = {
    r"what infos have with": "see `Faults.infos` for the keys that ...",
    r"what (?:a drone|it|this) is about": "the noun: status, purpose",
    r"at one mind": "make identical decisions",
    r"is no failed": "has not failed",
    r"begins? at none": "resets",
    r"could not do this and still": "would leave too little charge to return",
    r"what a kill costs": "a killed run loses",
    r"(?:take|takes|taking) no two": "run in under two",
    r"has one, if neither|a little more is allowed": "if neither value is valid",
    r"hands? out its arrays": "the caller owns the returned arrays",
    r"for good(?! in\b)": "permanently",
    r"more than its position is old|less than makes it": "longer than the age of the position",
    r"of which this is known": "with a saved record",
    r"all may be there again": "name what returns",
    r"be it that": "even if",
    r"the laxest": "the most permissive",
    r"for who(?! in\b|,)\b": "for those who, for consumers that",
    r"would do either": "would not work either",
    r"where is kept": "directory that records",
    r"do what those did": "reproduce this behaviour",
    r"who has not been allowed": "clients cannot, unless you allow it",
    r"is held by a test|held by a test against": "a test compares",
    r"nodes as they run\b": "the running nodes",
    r"could not be made is": "also if `__init__` fails",
    r"says? what (?:it|they) waits? for": "log what it is waiting for",
    r"bluer|the likelier": "probability, low to high",
    r"missions of 20\b": "19 of 20 missions",
    r"it takes linux": "requirements:",
    r"there it has no command": "once there, it has no command",
    r"as it lasts": "for its duration",
    r"in the place of": "instead of",
    r"\bfor ever\b": "forever",
    r"\banew\b": "again",
    r"is no (?:argument|file|record|factory|message|mcap|action)\b": "is not a ...",
    r"(?<!y )who (?:has the vehicle|comes late|reaches)": "who controls it, late joiners, anybody",
    r"is left to it\b|state the same thing, not alike": "is left alone, must agree",
    r"at so many times|nobody obeys|mode of rest": "at this many times, no subscriber, idle mode",
}
# Parts of the repository that are not our prose.
NOT_PROSE = (
    "LICENSE",
    "benchmarks/results/",
    "test/oracles/data/",
    "test/packaging/test_english.py",
)
PATTERNS = [
    (re.compile(rf"\b(?:{phrase})", re.IGNORECASE), instead) for phrase, instead in PHRASES.items()
]
# Most files have none: all at once, in lower case, takes a tenth of the time of one by one.
ANY = re.compile(rf"\b(?:{'|'.join(PHRASES)})")


def plain(content: str) -> str:
    """Return text as one line, without the marks of comments, strings and code."""
    return re.sub(r"[\s\"'`#*]+", " ", content)


def odd(name: str, content: str) -> list[str]:
    """Return the odd phrases of a text, each with what to write instead."""
    prose = plain(content)
    if not ANY.search(prose.lower()):
        return []
    return [
        f"{name}: {prose[max(found.start() - 20, 0) : found.end() + 20]!r}; write: {instead}"
        for pattern, instead in PATTERNS
        for found in pattern.finditer(prose)
    ]


@pytest.mark.slow
def test_no_file_has_an_odd_phrase() -> None:
    found = [
        line
        for name, path in by_name(files()).items()
        if not name.startswith(NOT_PROSE)
        for line in odd(name, text(path))
    ]
    assert found == []


@pytest.mark.parametrize(
    "content",
    [
        "The bluer, the likelier.",
        "# It stays there\n    # for good.",
        '"What a kill " "costs is the work on those under way"',
        "It is refused, be it that nobody asked.",
    ],
)
def test_an_odd_phrase_is_found_across_lines_and_strings(content: str) -> None:
    assert odd("module.py", content)


@pytest.mark.parametrize(
    "content", ["for whom the node waits", "a good forecast", "It takes one second.", "forever"]
)
def test_plain_english_has_no_odd_phrase(content: str) -> None:
    assert odd("module.py", content) == []
