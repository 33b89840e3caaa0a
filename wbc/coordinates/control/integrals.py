"""Integrals of rates that are the derivative of nothing, along the robot's path: what drift is for them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wbc.coordinates import expressions
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.coordinates.rows import Coordinate
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

#: Numbers of rows
Rows: TypeAlias = NDArray[np.intp]


class RateIntegrals:
    """How far coordinates have gone on the path from configuration to configuration, less what they were to go:

        off = int A(q) dq - int rate dt                                      [m, rad]

    by the trapezoidal rule on the geodesic between two ticks: (A(q0) + A(q1)) / 2 times the step. The pitch plane's
    rate alpha, beta, gamma, rotation about an axis and parts of a rotation have no other drift than this one, which
    depends on the path.

    Attributes:
        masked: coordinates with rows that are rates only; only these count. off: see above, one number a row of all
            coordinates, zero in rows with another drift. rows: those that count at present.
    """

    def __init__(self, robot: Robot, rates: RateMatrices) -> None:
        self._model, self._slices = robot.model, rates.row_slices
        self._plain = robot.nq == robot.nv
        self._mask = np.zeros(len(rates.units))
        for one, rows in rates.row_slices.items():
            self._mask[rows] = expressions.rate_only(robot, one)
        self.masked = {one for one, rows in rates.row_slices.items() if self._mask[rows].any()}
        self.off = np.zeros(len(self._mask))
        self.rows: Rows = np.zeros(0, dtype=np.intp)
        #: Where the robot was, the matrix of all rows there, and what the rows were to go from there
        self._q: Array | None = None
        self._before = np.zeros((len(self._mask), robot.nv))
        self._planned = np.zeros(len(self._mask))

    def forget(self) -> None:
        """Begin anew, wherever the robot is next."""
        self.off[:], self._q = 0.0, None
        self.rows = np.zeros(0, dtype=np.intp)

    def restart(self, rows: Iterable[Coordinate]) -> None:
        """Some coordinates count from here on."""
        for one in rows:
            self.off[self._slices[one]] = 0.0

    def follow(self, rows: Rows) -> None:
        """Another pair is active; what it has not planned yet does not count until the tick after the next one."""
        self.rows = np.intersect1d(self.rows, rows)

    def advance(self, q: Array, every: Array) -> None:
        """The robot is at ``q`` now, on the shortest path from where it was; ``every``: A(q) of all coordinates."""
        rows = self.rows
        if self._q is not None:
            step = q - self._q if self._plain else pin.difference(self._model, self._q, q)
            gone = (self._before[rows] + every[rows]) @ (0.5 * step) - self._planned[rows]
            self.off[rows] += self._mask[rows] * gone
        self._q = None

    def plan(self, rows: Rows, q: Array, every: Array, rates: Array, dt: float) -> None:
        """Rows are to go at rates until the next :meth:`advance`."""
        self._q, self._before, self.rows = q, every, rows
        np.multiply(rates, dt, out=self._planned)

    def cap(self, rows: Rows, most: float) -> None:
        """Forget what rows are ahead by beyond ``most``."""
        self.off[rows] = np.clip(self.off[rows], -most, most)
