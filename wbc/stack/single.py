"""An expression evaluated at one state, again and again, without a new array."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from wbc.validation import Array


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
