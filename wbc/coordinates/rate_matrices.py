"""The matrix of some coordinates' rates at one configuration after another, as one compiled call."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import casadi as ca
import numpy as np

from wbc.coordinates import expressions
from wbc.coordinates.rows import Coordinate
from wbc.native.compiled_function import compiled
from wbc.robot import Robot
from wbc.symbolic.evaluation import SingleState
from wbc.validation import Array


class RateMatrices:
    """A(q) of c' = A(q) v, for coordinates that are known beforehand [rows, nv].

    Args:
        native: compile to C, where a compiler is there; else the virtual machine evaluates.

    Attributes:
        robot: as given. row_slices: coordinate -> its rows in the matrix of all.
        units: m or rad of every row, of its integral.
    """

    def __init__(self, robot: Robot, coordinates: Iterable[Coordinate], *, native: bool = True) -> None:
        self.robot = robot
        every = tuple(coordinates)
        labels = [expressions.labels(robot, one) for one in every]
        ends = np.cumsum([0, *map(len, labels)]).tolist()
        self.row_slices = {one: slice(a, b) for one, (a, b) in zip(every, pairwise(ends), strict=True)}
        self.units = tuple(row.unit for some in labels for row in some)
        rates = expressions.rate_function(robot, every)
        q = ca.SX.sym("q", robot.nq)
        # CasADi keeps columns, numpy rows: the transpose is the same memory
        by_rows = ca.Function("rates", [q], [ca.vec(ca.densify(rates(q)).T)])
        self._state = SingleState(compiled(by_rows) if native else by_rows)
        self._shape = ends[-1], robot.nv

    def whole(self, q: Array) -> Array:
        """The matrix of all coordinates; ``q`` is not checked."""
        self._state.inputs[0][:] = q
        self._state.run()
        return self._state.output.reshape(self._shape).copy()
