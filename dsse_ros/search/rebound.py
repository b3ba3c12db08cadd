# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Objects with views on their own arrays, which a plain copy or pickle would detach."""

from __future__ import annotations

from typing import Any


class Rebound:
    """An object whose copies create what `_bind` creates, instead of copying it."""

    _bound: set[str]

    def _bind(self) -> None:
        """Create the attributes that must not be copied."""
        raise NotImplementedError

    def _rebind(self) -> None:
        """Call `_bind`, and record which attributes are new."""
        before = set(vars(self))
        self._bind()
        self._bound = vars(self).keys() - before

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in vars(self).items() if k != "_bound" and k not in self._bound}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._rebind()
