# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Units of speed, by pint with the units of CF (extra `drift`)."""

from __future__ import annotations

import logging
import re
from typing import Any

from dsse_ros.base.extras import pip_install
from dsse_ros.world.drift.netcdf import Unfit

_SI = ("m s-1", "m/s", "m s**-1")


def metres_per_second(variable: Any) -> float:
    """Return the factor that brings an `xarray` variable to m/s.

    Raises:
        Unfit: If it has no units, or they are not a speed.
    """
    units = " ".join(str(variable.attrs.get("units", "")).split())
    # Without a space, pint has the reciprocal of a millisecond.
    units = re.sub(r"^([cm]?m)\.?s(\^|\*\*)?-1$", r"\1 s-1", units)
    # Most files need no library, which takes a third of a second to load.
    if units in _SI:
        return 1.0
    if not units:
        raise Unfit(f"{variable.name} has no units; state units, such as m/s")
    registry = _registry()
    for spelling in (units, units.lower()):
        try:
            return float(registry.Quantity(1.0, registry.parse_units(spelling)).to("m/s").magnitude)
        # pint raises whatever its parser stumbles over.
        except Exception:
            continue
    raise Unfit(f"{variable.name} must be a speed, got units {units!r}")


def _registry() -> Any:
    """Return the registry of `pint` with the units of CF."""
    logger = logging.getLogger("pint.util")
    level = logger.level
    # It warns of each unit that CF redefines.
    logger.setLevel(logging.ERROR)
    try:
        from cf_xarray.units import units
    except ModuleNotFoundError as error:
        raise Unfit(f"{error.name} is missing; {pip_install('drift')}") from None
    finally:
        logger.setLevel(level)
    return units
