# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The program of Phung and Ha, MPSO (github.com/duongpm/MPSO), under GNU Octave."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

SEED = 1
_MVNPDF = """function y = mvnpdf (x, mu, sigma)
  d = x - mu;
  y = exp (-0.5 * sum ((d / sigma) .* d, 2)) / sqrt (det (2 * pi * sigma));
end
"""
"""A function of MATLAB that Octave has in a package only."""


class Flown(NamedTuple):
    """The result of MPSO.

    Attributes:
        value: Cumulative probability of detection of its path, by its own map.
        seconds: CPU time of all its iterations.
    """

    value: float
    seconds: float


def run(clone: Path) -> Flown:
    """Run the whole program of a clone, without its pictures.

    Raises:
        OSError: If there is no clone or no `octave-cli`.
        ValueError: If Octave does not run it.
    """
    program = (clone / "MPSO_MAIN.m").read_text(encoding="utf-8").split("%% Results")[0]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "mvnpdf.m").write_text(_MVNPDF, encoding="utf-8")
        main = Path(folder) / "main.m"
        printed = 'printf ("value %.10f %.3f\\n", GlobalBest.Cost, cputime);'
        main.write_text(f"rand ('twister', {SEED});\n{program}\n{printed}\n", encoding="utf-8")
        command = [
            "octave-cli",
            "--norc",
            "--path",
            folder,
            "--path",
            str(clone.resolve()),
            str(main),
        ]
        # Octave writes its variables to the working directory if it is killed.
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    lines = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("value ")]
    if not lines:
        raise ValueError(f"octave-cli stopped: {done.stderr.strip()[-500:]}")
    value, seconds = map(float, lines[-1])
    return Flown(value, seconds)
