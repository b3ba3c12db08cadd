# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The published module names in this process, for scripts that import them."""

from __future__ import annotations

import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

import dsse_ros.compat as v2
from dsse_ros.compat import v1, wrappers
from dsse_ros.compat.coverage import CoverageMatrix
from dsse_ros.compat.drifting import Person, ProbabilityMatrix
from dsse_ros.compat.published import DroneData

COLOURS = {"RED": (255, 0, 0), "GREEN": (0, 255, 0), "BLACK": (0, 0, 0)}

VERSIONS: dict[str, dict[str, dict[str, Any]]] = {
    "1.1.9": {
        "DSSE": {name: getattr(v2, name) for name in v2.__all__ if name != "Reward"},
        "DSSE.environment": {},
        "DSSE.environment.constants": {"Actions": v2.Actions, "Reward": v2.Reward, **COLOURS},
        "DSSE.environment.env": {"DroneSwarmSearch": v2.DroneSwarmSearch},
        "DSSE.environment.coverage_env": {"CoverageDroneSwarmSearch": v2.CoverageDroneSwarmSearch},
        "DSSE.environment.entities": {},
        "DSSE.environment.entities.drone": {"DroneData": DroneData},
        "DSSE.environment.entities.person": {"Person": Person},
        "DSSE.environment.simulation": {},
        "DSSE.environment.simulation.dynamic_probability": {"ProbabilityMatrix": ProbabilityMatrix},
        "DSSE.environment.simulation.particle_simulation": {"ParticleSimulation": CoverageMatrix},
        "DSSE.environment.wrappers": {
            name: getattr(wrappers, name)
            for name in wrappers.__all__
            if name != "CommunicationWrapper"
        },
        **{
            f"DSSE.environment.wrappers.{module}": {name: getattr(wrappers, name)}
            for module, name in (
                ("all_flatten_wrapper", "AllFlattenWrapper"),
                ("all_positions_wrapper", "AllPositionsWrapper"),
                ("communication_wrapper", "CommunicationWrapper"),
                ("matrix_encode_wrapper", "MatrixEncodeWrapper"),
                ("retain_drone_pos_wrapper", "RetainDronePosWrapper"),
                ("top_n_cells_wrapper", "TopNProbsWrapper"),
            )
        },
    },
    "0.1.13": {
        "DSSE": {},
        "DSSE.env": {"DroneSwarmSearch": v1.DroneSwarmSearch},
    },
}
"""The modules of each version, with the names in them."""


class _TestsOfDsse(MetaPathFinder):
    """Finds `DSSE.tests`, the package's own tests, where Python would without the aliases."""

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        if fullname != "DSSE.tests":
            return None
        return PathFinder.find_spec(fullname, [f"{entry or '.'}/DSSE" for entry in sys.path])


_TESTS = _TestsOfDsse()


def install_aliases(version: str = "1.1.9") -> None:
    """Make `import DSSE` in this process import this package; an installed `DSSE` is hidden.

    Args:
        version: Version of DSSE whose module names are installed.

    Raises:
        ValueError: If the version is neither 1.1.9 nor 0.1.13.
    """
    if version not in VERSIONS:
        raise ValueError(f"version must be one of {', '.join(VERSIONS)}, got {version!r}")
    for name in [name for name in sys.modules if name.split(".")[0] == "DSSE"]:
        del sys.modules[name]
    if _TESTS not in sys.meta_path:
        sys.meta_path.append(_TESTS)
    for name, contents in VERSIONS[version].items():
        module = ModuleType(name, f"An alias of dsse_ros.compat, in place of DSSE {version}.")
        # A path makes it a package, so that a missing submodule raises ModuleNotFoundError.
        module.__path__ = []
        module.__spec__ = ModuleSpec(name, None, is_package=True)
        vars(module).update(contents)
        sys.modules[name] = module
        parent, _, own = name.rpartition(".")
        if parent:
            setattr(sys.modules[parent], own, module)
