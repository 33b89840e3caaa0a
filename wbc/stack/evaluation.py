"""A CasADi function evaluated again and again in memory that stays where it is: at one state, or at many at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from wbc.native.compiled_function import compiled
from wbc.validation import Array

#: States of one call of the compiled loop
CHUNK = 128


class ManyStates:
    """f(x_1), ..., f(x_m) of a CasADi function with column vectors in and one column vector out.

    Args:
        function: what to evaluate. With a C compiler it becomes a library in the cache, named by what it computes.
    """

    def __init__(self, function: ca.Function) -> None:
        self.size = int(function.size1_out(0))
        loop = function.map(CHUNK)
        library = compiled(loop)
        self.compiled, loop = library is not loop, library
        # CasADi keeps columns, numpy rows: the same memory
        self._inputs = [np.zeros((CHUNK, function.size1_in(k))) for k in range(function.n_in())]
        self._output = np.zeros((CHUNK, self.size))
        # The buffers point into arrays that must live as long as they do; so does the function
        self._loop = loop
        pair: Any = loop.buffer()
        self._buffer, self._run = pair
        for k, array in enumerate(self._inputs):
            self._buffer.set_arg(k, memoryview(array.reshape(-1).data))
        self._buffer.set_res(0, memoryview(self._output.reshape(-1).data))

    def __call__(self, *inputs: Array) -> Array:
        """Values at m states, m x size; each input is m x its length."""
        count = len(inputs[0])
        out = np.empty((count, self.size))
        for begin in range(0, count, CHUNK):
            here = min(CHUNK, count - begin)
            for array, values in zip(self._inputs, inputs, strict=True):
                # The last chunk is filled up with its last state
                array[:here], array[here:] = values[begin : begin + here], values[begin + here - 1]
            self._run()
            out[begin : begin + here] = self._output[:here]
        return out


class SingleState:
    """f(x) of a CasADi function with column vectors in and one column vector out, in memory that stays where it is.

    Args:
        function: what to evaluate, of :func:`wbc.native.compiled_function.compiled` or not.

    Attributes:
        inputs: the vectors x, to be written. output: f(x), after :attr:`run`. run: evaluates.
    """

    def __init__(self, function: ca.Function) -> None:
        self.inputs: list[Array] = [np.zeros(function.size1_in(k)) for k in range(function.n_in())]
        self.output: Array = np.zeros(function.size1_out(0))
        # The buffers point into arrays that must live as long as they do; so does the function
        self._function = function
        pair: Any = function.buffer()
        self._buffer, call = pair
        self.run: Callable[[], None] = call
        for k, array in enumerate(self.inputs):
            self._buffer.set_arg(k, memoryview(array.data))
        self._buffer.set_res(0, memoryview(self.output.data))
