# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The steps and inputs of a live search as JSON; numbers come back bit for bit."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from dsse_ros.base.json_reader import read_json
from dsse_ros.mission.live.inputs import KINDS
from dsse_ros.mission.live.live_search import Entry
from dsse_ros.mission.live.step_looks import StepLooks

STEP = "step"
_LONGEST = 1 << 30
"""Characters of the records of a mission."""
_TYPES = {
    "drones": np.int64, "numbers": np.int64, "cells": np.int64, "paths": np.float64,
    "looked": np.bool_, "flown": np.bool_,
}  # fmt: skip


def to_json(record: StepLooks | Entry) -> dict[str, Any]:
    """Return a record as JSON values."""
    if isinstance(record, Entry):
        return {
            "kind": record.kind, "id": record.id, "time_s": record.time_s,
            "received_s": record.received_s, "values": dict(record.values),
            "derived": dict(record.derived),
        }  # fmt: skip
    arrays = {name: getattr(record, name) for name in _TYPES}
    return {"kind": STEP} | {
        name: {"shape": list(array.shape), "values": array.astype(_stored(name)).ravel().tolist()}
        for name, array in arrays.items()
    }


def _stored(name: str) -> type:
    return np.int64 if _TYPES[name] is np.bool_ else _TYPES[name]


def from_json(values: Any) -> StepLooks | Entry:
    """Return the record of `to_json`.

    Raises:
        ValueError: If it is not a record.
    """
    try:
        if values["kind"] != STEP:
            if values["kind"] not in KINDS:
                raise ValueError
            return Entry(**values)
        return StepLooks(
            *(
                np.array(values[name]["values"], kind).reshape(values[name]["shape"])
                for name, kind in _TYPES.items()
            )
        )
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
        kind = values.get("kind") if isinstance(values, dict) else values
        raise ValueError(f"record must be of a live search, got {kind!r}") from None


def read_back(entry: Entry) -> Entry:
    """Return an entry as its readers will find it, from its own text.

    Raises:
        ValueError: If its text cannot be read, or is of another entry.
    """
    (again,) = from_text(to_text([entry]))
    if again != entry:
        raise ValueError(f"{entry.kind} must be the same when it is read again")
    return again


def to_text(records: list[StepLooks | Entry]) -> str:
    """Return records as JSON text."""
    return json.dumps([to_json(record) for record in records], allow_nan=False)


def from_text(text: str) -> list[StepLooks | Entry]:
    """Return the records of `to_text`.

    Raises:
        ValueError: If the text is no JSON of them.
    """
    return [from_json(record) for record in read_json(text, "records", _LONGEST)]
