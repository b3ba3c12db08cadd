# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Battery energy per step, in percent of a full battery."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.base.fields import FieldError, field

FULL = 100.0
"""Energy of a full battery, in percent."""


@dataclass(frozen=True, kw_only=True)
class BatteryFields:
    """Energy that actions need, in percent of a full battery."""

    battery_move: float = field(
        "float", "Energy of a move; 0: batteries do not run down.", 0.0, low=0, high=100, unit="%"
    )
    battery_search: float | None = field(
        "float", "Energy of a search; by default that of a move.", None, low=0, high=100, unit="%"
    )
    battery_hover: float | None = field(
        "float", "Energy of a step in place without a search; by default that of a move.", None,
        low=0, high=100, unit="%",
    )  # fmt: skip
    battery_return: float | None = field(
        "float", "Energy of a step on the way home; by default that of a move.", None,
        low=0, high=100, unit="%",
    )  # fmt: skip
    battery_reserve: float = field(
        "float", "Minimum charge of a drone when it arrives home.", 20.0,
        low=0, high=99, unit="%",
    )  # fmt: skip
    relief_steps: int = field(
        "int",
        "Steps after which a fully charged drone replaces one that returned; 0: no replacement.",
        0,
        low=0,
        high=10**6,
        unit="steps",
    )

    def resolved_battery(self) -> dict[str, float]:
        """Return the energies with nothing left to derive.

        Raises:
            FieldError: If there is no energy for a search, or fields are given without a battery.
        """
        stated = {
            name: getattr(self, name)
            for name in ("battery_search", "battery_hover", "battery_return")
        }
        if not self.battery_move:
            for name, value in {**stated, "relief_steps": self.relief_steps}.items():
                if value:
                    raise FieldError(f"{name} must be 0 without battery_move, got {value:g}")
        energies = {n: self.battery_move if e is None else e for n, e in stated.items()}
        if self.battery_reserve + energies["battery_search"] > FULL:
            raise FieldError(
                f"battery_reserve must be at most {FULL - energies['battery_search']:g} %, or "
                f"there is no energy for a search, got {self.battery_reserve:g}"
            )
        return energies
