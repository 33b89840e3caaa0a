"""Integrals of rates that are the derivative of nothing, along the way that the robot goes: what drift is for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin

from wbc.coordinates import expressions
from wbc.coordinates.rows import Coordinate
from wbc.robot import Robot
from wbc.validation import Array


class RateIntegrals:
    """How far coordinates have gone on the way from configuration to configuration, less what they were to go:

        off = int A(q) dq - int rate dt                                      [m, rad]

    by the trapezoidal rule on the geodesic between two ticks: (A(q0) + A(q1)) / 2 times the step. The pitch plane's
    rate alpha, beta, gamma, rotation about an axis and parts of a rotation have no other drift than this one, which
    depends on the way.

    Attributes:
        masks: coordinate -> 1 for rows that are rates only, 0 for the others. Only coordinates with some are in it.
    """

    def __init__(self, robot: Robot, coordinates: Iterable[Coordinate]) -> None:
        self._model = robot.model
        masks = {one: expressions.rate_only(robot, one).astype(float) for one in coordinates}
        self.masks = {one: mask for one, mask in masks.items() if mask.any()}
        self._off: dict[Coordinate, Array] = {}
        #: What was planned at the last configuration, and the matrix there
        self._went: dict[Coordinate, tuple[Array, Array]] = {}
        self._q: Array | None = None

    def forget(self) -> None:
        """Begin anew, wherever the robot is next."""
        self._off, self._went, self._q = {}, {}, None

    def restart(self, rows: Iterable[Coordinate]) -> None:
        """Some coordinates count from here on."""
        for one in rows:
            self._off.pop(one, None)

    def advance(self, q: Array, rates: Mapping[Coordinate, Array]) -> None:
        """The robot is at ``q`` now, on the shortest way from where it was; ``rates``: A(q) of active coordinates."""
        if self._q is not None and self._went:
            step = pin.difference(self._model, self._q, q)
            for one, (planned, before) in self._went.items():
                if one in rates:
                    gone = 0.5 * (before + rates[one]) @ step - planned
                    self._off[one] = self._off.get(one, 0.0) + self.masks[one] * gone
        self._q, self._went = np.array(q), {}

    def plan(self, one: Coordinate, rate: Array, dt: float, matrix: Array) -> None:
        """A coordinate with the matrix A(q) is to go at a rate until the next :meth:`advance`."""
        if one in self.masks:
            self._went[one] = rate * dt, matrix

    def off(self, one: Coordinate) -> Array:
        """What a coordinate is ahead by, one number a row; zero in rows with another drift."""
        found = self._off.get(one)
        return np.zeros(len(self.masks[one])) if found is None else found

    def cap(self, one: Coordinate, most: float) -> None:
        """Forget what a coordinate is ahead by beyond ``most``."""
        if one in self._off:
            self._off[one] = np.clip(self._off[one], -most, most)
