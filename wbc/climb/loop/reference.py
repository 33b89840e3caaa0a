"""The motion of a plan at any time."""

from __future__ import annotations

import numpy as np

from wbc.climb.plan import ContactPlan
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array


class PlanReference:
    """q(t) of a plan. Between the knots i and i + 1, h apart, it is

        q_i (+) d(x),   d cubic with d(0) = 0, d(h) = q_{i+1} (-) q_i and the rates of v_i and v_{i+1} there

    Args:
        plan: at least one knot. robot: the climber's.

    Attributes:
        end: the last knot [s]. times: of the knots [s].
        knots: sizes of rates and accelerations of the joints ``(n - 1, nv)``, the larger of an interval's ends.
    """

    def __init__(self, plan: ContactPlan, robot: Robot) -> None:
        model = self._model = robot.model
        self.times, self._q = np.array(plan.times, dtype=float), np.array(plan.q, dtype=float)
        self.end = float(self.times[-1])
        moved, last = np.zeros((2, max(len(self.times) - 1, 0), robot.nv))
        for k, (a, b) in enumerate(zip(self._q, self._q[1:], strict=False)):
            moved[k] = pin.difference(model, a, b)
            # The rate of d at its end, which of a turning body is not v
            last[k] = pin.dDifference(model, a, b, pin.ArgumentPosition.ARG1) @ plan.v[k + 1]
        first, steps = np.array(plan.v, dtype=float)[:-1], np.diff(self.times)[:, None]
        square = (3.0 * moved / steps - 2.0 * first - last) / steps
        self._terms = np.stack([first, square, (first + last - 2.0 * moved / steps) / steps**2], axis=1)
        ends = 2.0 * square + 6.0 * steps * self._terms[:, 2]
        self.knots = (np.maximum(np.abs(first), np.abs(last)), np.maximum(np.abs(2.0 * square), np.abs(ends)))

    def q(self, time: float) -> Array:
        """The configuration ``[nq]`` at a time [s]; before the first knot and after the last one that of the knot."""
        k = int(self.times.searchsorted(time, side="right")) - 1
        if k < 0 or k >= len(self._terms):
            return np.array(self._q[0 if k < 0 else -1])
        x, (a, b, c) = time - self.times[k], self._terms[k]
        return np.asarray(pin.integrate(self._model, self._q[k], x * (a + x * (b + x * c))))

    def derivatives(self, time: float) -> tuple[Array, Array]:
        """(d', d'') ``[nv]`` of the joints at a time [s]: their rates and accelerations; 0 beyond the knots."""
        k = int(self.times.searchsorted(time, side="right")) - 1
        if k < 0 or k >= len(self._terms):
            return np.zeros(self._model.nv), np.zeros(self._model.nv)
        x, (a, b, c) = time - self.times[k], self._terms[k]
        return a + x * (2.0 * b + 3.0 * x * c), 2.0 * b + 6.0 * x * c
