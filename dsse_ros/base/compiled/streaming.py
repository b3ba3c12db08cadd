# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A product written past the caches, for compiled code that fills more memory than they hold.

An ordinary store first reads the cache line that it writes to, and evicts other lines.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

LANES = 4
"""Elements written at once."""
ALIGNMENT = 16
"""Required alignment of the first element, in bytes."""


def _stream_product(_: Any, out: Any, start: Any, factor: Any, weights: Any) -> Any:
    """Do out[i] = factor * weights[i] for `LANES` elements from `start`, bit for bit.

    Args:
        out: Contiguous float32, aligned to `ALIGNMENT` bytes at `start`.
        start: The first index.
        factor: float64.
        weights: Contiguous float64.
    """

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        out, start, factor, weights = arguments
        doubles, floats = (ir.VectorType(t, LANES) for t in (ir.DoubleType(), ir.FloatType()))
        target, source = (
            builder.bitcast(
                builder.gep(context.make_array(kind)(context, builder, array).data, [start]),
                lanes.as_pointer(),
            )
            for kind, array, lanes in (
                (signature.args[0], out, floats), (signature.args[3], weights, doubles)
            )
        )  # fmt: skip
        factors = ir.Constant(doubles, ir.Undefined)
        for lane in range(LANES):
            factors = builder.insert_element(factors, factor, ir.IntType(32)(lane))
        products = builder.fmul(builder.load(source, align=8), factors)
        store = builder.store(builder.fptrunc(products, floats), target, align=ALIGNMENT)
        store.set_metadata("nontemporal", builder.module.add_metadata([ir.IntType(32)(1)]))
        return context.get_dummy_value()

    return types.void(out, types.intp, types.float64, weights), write


stream_product: Any = intrinsic(_stream_product)
