# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Positions as people write them: degrees, degrees and minutes, or degrees, minutes and seconds.

All of these are one latitude: `38.675`, `38.675 N`, `38 40.5 N`, `38-40.5N`, `38°40.5'N`,
`N38°40'30"`, `3840.5N` and `384030N`.
"""

from __future__ import annotations

import re

LAT_LETTERS, LON_LETTERS = "NS", "EW"
"""The letter of each half of the Earth, the positive one first."""
EXAMPLES = "38 40.5 N 009 25.1 W, 38-40-30N 009-25-06W or 38.675, -9.418"
_MARKS = {"°": " ", "º": " ", "'": " ", "′": " ", "’": " ", '"': " ", "″": " ", "”": " ", ":": " "}
_NUMBER = r"\d+(?:\.\d*)?"
_ANGLE = re.compile(
    rf"(?P<before>[NSEW])?\s*(?P<sign>[-+])?(?P<parts>{_NUMBER}(?:(?:\s+|\s*-\s*){_NUMBER}){{0,2}})"
    rf"\s*(?P<after>[NSEW])?"
)


def degrees(text: str, letters: str) -> float:
    """Return a latitude or a longitude in degrees.

    Args:
        text: The angle; without a letter it is positive unless it has a minus.
        letters: `LAT_LETTERS` or `LON_LETTERS`.

    Raises:
        ValueError: If it is no such angle.
    """
    match = _ANGLE.fullmatch(_plain(text))
    if match is None:
        raise ValueError
    letter = match["before"] or match["after"] or ""
    if (match["before"] and match["after"]) or letter not in ("", *letters):
        raise ValueError
    if letter and match["sign"]:
        raise ValueError
    parts = re.split(r"\s*-\s*|\s+", match["parts"])
    whole = len(parts[0].partition(".")[0])
    if len(parts) == 1 and letter and whole > 3:
        parts = _run_together(parts[0], 2 if letters == LAT_LETTERS else 3)
    if any("." in part for part in parts[:-1]) or any(float(part) >= 60 for part in parts[1:]):
        raise ValueError
    size = sum(float(part) / 60**power for power, part in enumerate(parts))
    return -size if letter == letters[1] or match["sign"] == "-" else size


def position(text: str) -> tuple[float, float]:
    """Return the latitude and the longitude of a position in degrees.

    Latitude and longitude are separated by a comma or a semicolon; those with letters, and two
    plain numbers, by a space too. With letters they may be in either order.

    Raises:
        ValueError: If it is no position.
    """
    plain = _plain(text)
    parts = re.split(r"\s*[,;]\s*", plain)
    if len(parts) == 1:
        letters = list(re.finditer("[NSEW]", plain))
        if not letters:
            parts = plain.split()
        elif len(letters) == 2:
            cut = letters[1].start() if plain[0] in "NSEW" else letters[0].end()
            parts = [plain[:cut], plain[cut:]]
    if len(parts) != 2:
        raise ValueError
    first, second = parts
    if re.search("[EW]", first) and re.search("[NS]", second):
        first, second = second, first
    return degrees(first, LAT_LETTERS), degrees(second, LON_LETTERS)


def _plain(text: str) -> str:
    """Return an angle in capitals, with spaces for the marks of degrees, minutes and seconds."""
    for mark, plain in _MARKS.items():
        text = text.replace(mark, plain)
    return text.strip().upper()


def _run_together(digits: str, of_degrees: int) -> list[str]:
    """Return the parts of digits without separators, such as 3840.5 or 384030."""
    whole, point, fraction = digits.partition(".")
    if len(whole) - of_degrees not in (2, 4):
        raise ValueError
    parts = [whole[:of_degrees]]
    parts += [whole[i : i + 2] for i in range(of_degrees, len(whole), 2)]
    return [*parts[:-1], parts[-1] + point + fraction]
