"""A CasADi function evaluated again and again in memory that stays where it is."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from wbc.validation import Array


class SingleState:
    """f(x_1, x_2, ...) of a CasADi function at one state after another, in memory that stays where it is.

    A function that is called with arrays asks in Python what they are, which costs more than most functions here, and
    drops an interrupt that comes meanwhile. This does neither.

    Args:
        function: what to evaluate, with dense inputs. Where an output is sparse, a function of SX.

    Attributes:
        inputs: to be written; vectors, or matrices where an input has several columns.
        outputs: matrices, after :attr:`run`.
        output: the first of them column by column, a vector.
        run: evaluates.
    """

    def __init__(self, function: ca.Function) -> None:
        self._given, function = function, _dense(function)
        # CasADi keeps columns
        places = [np.zeros(function.size_in(k), order="F") for k in range(function.n_in())]
        self.inputs: list[Array] = [place[:, 0] if place.shape[1] == 1 else place for place in places]
        self.outputs: list[Array] = [np.zeros(function.size_out(k), order="F") for k in range(function.n_out())]
        self.output: Array = self.outputs[0].ravel("K")
        # The buffers point into arrays that must live as long as they do; so does the function
        self._function = function
        pair: Any = function.buffer()
        self._buffer, call = pair
        self.run: Callable[[], None] = call
        for k, array in enumerate(self.inputs):
            self._buffer.set_arg(k, memoryview(array.ravel("K").data))
        for k, array in enumerate(self.outputs):
            self._buffer.set_res(k, memoryview(array.ravel("K").data))
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[SingleState], tuple[ca.Function]]:
        return SingleState, (self._given,)

    def __call__(self, *values: Array | float) -> list[Array]:
        """Copies of the outputs at some inputs, which have the shapes of :attr:`inputs`; for any threads at once."""
        with self._lock:
            for array, value in zip(self.inputs, values, strict=True):
                array[:] = value
            self.run()
            return [array.copy() for array in self.outputs]


def _dense(function: ca.Function) -> ca.Function:
    if all(function.sparsity_out(k).is_dense() for k in range(function.n_out())):
        return function
    symbols = function.sx_in()
    return ca.Function(function.name(), symbols, [ca.densify(part) for part in function.call(symbols)])
