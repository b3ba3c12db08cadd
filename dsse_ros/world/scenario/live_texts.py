# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The texts of the topics `live/contacts` and `live/answers`, JSON, as values."""

from __future__ import annotations

import json
from typing import NamedTuple

from dsse_ros.base.json_reader import read_json
from dsse_ros.world.scenario.json_keys import Keys

STATES = ("open", "confirmed", "dismissed")
"""States of a contact."""
MAX_CONTACTS = 10_000
"""Largest number of contacts in a text."""


class ShownContact(NamedTuple):
    """What one or several detections have found.

    Attributes:
        name: Its name, such as c1.
        state: One of `STATES`.
        lat_deg: WGS84 latitude at present: it drifts.
        lon_deg: WGS84 longitude.
        x_m: Metres to the east in the map frame.
        y_m: Metres to the north.
        radius_m: Standard deviation of its place along both axes.
        time_s: Time of its last detection, since the search began.
        utc: The same in UTC; "" if unknown.
        detections: Number of its detections.
        probability: That it is the person; None unless it is open.
    """

    name: str
    state: str
    lat_deg: float
    lon_deg: float
    x_m: float
    y_m: float
    radius_m: float
    time_s: float
    utc: str
    detections: int
    probability: float | None


class Answer(NamedTuple):
    """What has become of an input.

    Attributes:
        id: Identity of the input, "" if it has none.
        kind: Its kind, such as sighting.
        ok: Whether it was accepted.
        code: `again` if it had been accepted before; why it was refused; "" otherwise.
        reason: Why not, in one line; "" if it was.
        contact: Name of the contact that it is about; "" for none.
        input: Identity of the input that it withdraws; "" for none.
        pos_before: POS before the inputs that came with it; None if unknown.
        pos_after: POS after them.
        poc_moved: Share of the POC that they have moved to other cells; None if unknown.
        search: run_id and number of its mission.
    """

    id: str
    kind: str
    ok: bool = True
    code: str = ""
    reason: str = ""
    contact: str = ""
    input: str = ""
    pos_before: float | None = None
    pos_after: float | None = None
    poc_moved: float | None = None
    search: tuple[int, int] = (0, 0)

    def to_json(self) -> str:
        """Return the text, see `answer_from_json`."""
        values = self._asdict() | {"contact": self.contact or None, "input": self.input or None}
        run_id, mission = values.pop("search")
        return json.dumps(values | {"run_id": run_id, "mission": mission}, allow_nan=False)


def contacts_from_json(text: str) -> tuple[ShownContact, ...]:
    """Return the contacts in a text of `live/contacts`.

    Raises:
        ValueError: If the text is not such JSON; one line that names the key.
    """
    listed = read_json(text, "contacts")
    if not isinstance(listed, list) or len(listed) > MAX_CONTACTS:
        raise ValueError(f"contacts must be a list of at most {MAX_CONTACTS}")
    return tuple(_contact(Keys(contact, f"contacts[{i}]")) for i, contact in enumerate(listed))


def _contact(keys: Keys) -> ShownContact:
    if keys.value("state") not in STATES:
        keys.refuse("state", f"one of {', '.join(STATES)}")
    return ShownContact(
        name=keys.text("contact"),
        state=keys.text("state"),
        lat_deg=keys.number("lat"),
        lon_deg=keys.number("lon"),
        x_m=keys.number("x"),
        y_m=keys.number("y"),
        radius_m=keys.number("radius"),
        time_s=keys.number("time"),
        utc=_text(keys, "utc"),
        detections=keys.integer("detections", 0),
        probability=_number(keys, "probability"),
    )


def answer_from_json(text: str) -> Answer:
    """Return the answer in a text of `live/answers`.

    Raises:
        ValueError: If the text is not such JSON; one line that names the key.
    """
    keys = Keys(read_json(text, "answer"), "answer")
    return Answer(
        id=_text(keys, "id"),
        kind=keys.text("kind"),
        ok=keys.flag("ok", default=False),
        code=_text(keys, "code"),
        reason=_text(keys, "reason"),
        contact=_text(keys, "contact"),
        input=_text(keys, "input"),
        pos_before=_number(keys, "pos_before"),
        pos_after=_number(keys, "pos_after"),
        poc_moved=_number(keys, "poc_moved"),
        search=(keys.integer("run_id", 0), keys.integer("mission", 0)),
    )


def _text(keys: Keys, key: str) -> str:
    """Return a text; "" where it is missing or null."""
    if not keys.has(key) or keys.value(key) is None:
        return ""
    return keys.text(key, may_be_empty=True)


def _number(keys: Keys, key: str) -> float | None:
    """Return a number; None where it is missing or null."""
    return None if not keys.has(key) or keys.value(key) is None else keys.number(key)
