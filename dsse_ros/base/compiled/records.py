# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Records of the compiled functions: a class has the fields, for NumPy and for the types alike."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias, get_type_hints

import numpy as np

Int: TypeAlias = int | np.int64
"""An integer: compiled branches that return one need the same type, and some have a smaller one."""
Int8: TypeAlias = Annotated[Int, "i1"]
UInt64: TypeAlias = Annotated[int, "u8"]

_FORMATS = {int: "i8", float: "f8", bool: "?"}


def dtype_of(record: type) -> np.dtype[np.void]:
    """Return the data type of an array of records, aligned.

    Args:
        record: A class whose annotations are the fields: int, float, bool, or an `Annotated` with
            what NumPy takes as the type of a field.
    """
    hints: dict[str, Any] = get_type_hints(record, include_extras=True)
    fields: list[Any] = [(name, _format_of(hint)) for name, hint in hints.items()]
    return np.dtype(fields, align=True)


def _format_of(hint: Any) -> Any:
    return _FORMATS[hint] if hint in _FORMATS else hint.__metadata__[0]
