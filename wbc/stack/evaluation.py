"""A CasADi function evaluated at many states at once."""

from __future__ import annotations

import casadi as ca
import numpy as np

from wbc.native.compiled_function import compiled
from wbc.symbolic.evaluation import SingleState
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
        self.compiled = library is not loop
        self._loop = SingleState(library)

    def __call__(self, *inputs: Array) -> Array:
        """Values at m states, m x size; each input is m x its length."""
        count = len(inputs[0])
        out = np.empty((count, self.size))
        for begin in range(0, count, CHUNK):
            here = min(CHUNK, count - begin)
            for columns, values in zip(self._loop.inputs, inputs, strict=True):
                # The last chunk is filled up with its last state
                rows = columns.T
                rows[:here], rows[here:] = values[begin : begin + here], values[begin + here - 1]
            self._loop.run()
            out[begin : begin + here] = self._loop.outputs[0].T[:here]
        return out
