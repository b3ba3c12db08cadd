# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Functions of tensors as graphs of CUDA, whose kernels start without Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor


class GraphedFunction:
    """A function whose kernels are recorded at the first call on a GPU, and then replayed.

    A call with inputs of other shapes is recorded for itself. Results are valid until the next
    call. On a CPU it is the function.

    Args:
        function: Takes tensors and returns them. Recording calls it a few times, so what it changes
            besides must allow that, and it must wait for nothing on the GPU.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self._recorded: dict[Any, tuple[torch.cuda.CUDAGraph, list[Tensor], Any]] = {}

    def __call__(self, *inputs: Tensor) -> Any:
        """Return what the function returns."""
        if inputs[0].device.type != "cuda":
            return self.function(*inputs)
        shapes = tuple(tensor.shape for tensor in inputs)
        if shapes not in self._recorded:
            self._recorded[shapes] = self._record([tensor.clone() for tensor in inputs])
        graph, places, results = self._recorded[shapes]
        for place, value in zip(places, inputs, strict=True):
            place.copy_(value)
        graph.replay()
        return results

    def _record(self, places: list[Tensor]) -> tuple[torch.cuda.CUDAGraph, list[Tensor], Any]:
        # Libraries prepare themselves at their first calls, on a stream of its own.
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            for _ in range(3):
                self.function(*places)
        torch.cuda.current_stream().wait_stream(stream)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            results = self.function(*places)
        return graph, places, results
