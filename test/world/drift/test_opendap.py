# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An OPeNDAP address is read as a file, and only in part: from a small server on loopback."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import unquote

import numpy as np
from forecasts import LATS, SPAN, levels, pair, written

from dsse_ros.world.drift.flow_files import read_forecast

TYPES = {np.dtype("f4"): "Float32", np.dtype("f8"): "Float64"}


class Opendap(BaseHTTPRequestHandler):
    """Answers by DAP 2.0 (https://www.opendap.org/pdf/ESE-RFC-004v1.2.pdf) with `dataset`."""

    dataset: Any
    bytes_sent: int = 0

    def log_message(self, *_: Any) -> None:
        """Keep quiet."""

    def do_GET(self) -> None:
        path, _, wanted = unquote(self.path).partition("?")
        chosen = dict(map(self.sliced, wanted.split(","))) if wanted else self.dataset.variables
        lines = [
            f"  {TYPES[var.dtype]} {name}{''.join(f'[{d} = {n}]' for d, n in var.sizes.items())};\n"
            for name, var in chosen.items()
        ]
        answer = f"Dataset {{\n{''.join(lines)}}} sea;\n".encode()
        if path.endswith(".das"):
            blocks = [
                f"  {name} {{\n"
                + "".join(f'    String {key} "{value}";\n' for key, value in variable.attrs.items())
                + "  }\n"
                for name, variable in chosen.items()
            ]
            answer = f"Attributes {{\n{''.join(blocks)}}}\n".encode()
        elif path.endswith(".dods"):
            parts = (
                struct.pack(">II", variable.size, variable.size)
                + variable.values.astype(variable.dtype.newbyteorder(">")).tobytes()
                for variable in chosen.values()
            )
            answer += b"\nData:\n" + b"".join(parts)
        Opendap.bytes_sent += len(answer)
        self.send_response(200)
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def sliced(self, text: str) -> tuple[str, Any]:
        """Return a variable of a constraint such as `uo[0:5][0][2:1:4]`."""
        name = text.partition("[")[0]
        found = [[*map(int, part.split(":"))] for part in re.findall(r"\[([\d:]+)\]", text)]
        slices = (slice(ends[0], ends[-1] + 1, ends[1] if ends[2:] else 1) for ends in found)
        variable = self.dataset[name].variable
        return name, variable.isel(dict(zip(variable.dims, slices, strict=False)))


@contextmanager
def served(dataset: Any) -> Iterator[str]:
    """Serve a data set; yields its address."""
    Opendap.dataset = dataset
    with ThreadingHTTPServer(("127.0.0.1", 0), Opendap) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/thredds/dodsC/sea.nc"
        server.shutdown()


def test_an_opendap_address_is_read_as_a_file_and_in_part(tmp_path: Path) -> None:
    dataset = levels(
        pair("current", ("uo", "vo")), "depth", np.linspace(0.5, 900.0, 40), np.linspace(1, 0, 40),
        units="m", standard_name="depth", positive="down",
    )  # fmt: skip
    with served(dataset) as address:
        flow = read_forecast("current", address, SPAN)
    assert flow == read_forecast("current", written(dataset, tmp_path), SPAN)
    assert flow.source == f"{address}: uo and vo"
    # Two variables at 40 depths are over 2 MB.
    assert Opendap.bytes_sent < 2 * dataset["uo"].nbytes / 20 and len(LATS) > len(flow.lats_deg)
