# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The reader of all JSON that others have written: in messages, forms, parameters and files.

What it returns can be written as JSON again, and read back as an equal value.
"""

from __future__ import annotations

import json
import math
from typing import Any

LONGEST = 1 << 26
"""Characters, or bytes, of a text."""
DEEPEST = 64
"""Objects and lists around a value: each caller's stack has room for them."""
_MOST_DIGITS = 20
"""Characters of an integer: those of 2^64, or a sign and 19 digits. Longer ones become floats."""
_TOO_DEEP = f"JSON must have at most {DEEPEST} objects and lists in each other"


def read_json(text: str | bytes, where: str, longest: int = LONGEST) -> Any:
    """Return the value of a JSON text.

    Numbers are finite, the keys of an object differ, and each text can be encoded.

    Args:
        text: The text; bytes are UTF-8. It may begin with a byte order mark.
        where: Name of the text, with which errors begin.
        longest: Largest number of characters, or of bytes.

    Raises:
        ValueError: If the text is not such JSON, in one line.
    """
    if len(text) > longest:
        unit = "bytes" if isinstance(text, bytes) else "characters"
        raise ValueError(f"{where}: JSON must have at most {longest} {unit}, got {len(text)}")
    try:
        decoded = text.decode() if isinstance(text, bytes) else text
        value = json.loads(
            decoded.removeprefix("\ufeff"), parse_constant=_finite, parse_float=_finite,
            parse_int=_integer, object_pairs_hook=_object,
        )  # fmt: skip
        _check_depth(value)
        if "\\u" in decoded:
            json.dumps(value, ensure_ascii=False).encode()
    except UnicodeDecodeError as error:
        raise ValueError(f"{where}: JSON must be UTF-8, got byte {error.start} of it") from None
    except UnicodeEncodeError:
        raise ValueError(f"{where}: JSON must not have half of a surrogate pair") from None
    except RecursionError:
        raise ValueError(f"{where}: {_TOO_DEEP}") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"{where}: not JSON: {error}") from None
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    return value


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"numbers must be finite, got {text[:40]}")
    return number


def _integer(text: str) -> int | float:
    return int(text) if len(text) <= _MOST_DIGITS else _finite(text)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in values if keys.count(key) > 1)
        raise ValueError(f"keys of an object must differ, got {twice[:40]!a} twice")
    return values


def _check_depth(value: Any) -> None:
    level = [value]
    for _ in range(DEEPEST + 1):
        level = [
            inner
            for outer in level
            if isinstance(outer, dict | list)
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return
    raise ValueError(_TOO_DEEP)
