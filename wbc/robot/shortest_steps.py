"""Newton's shortest steps to a configuration at which a residual is 0, within limits of position."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

#: A residual below this is 0 [m, rad]: rounding of poses metres from the origin
CLOSED = 1e-11
#: What a residual may be where no joint moves it [m, rad]: lengths and axes of a file are rounded
ROUNDED = 1e-6
#: Steps at most: they converge quadratically, or not at all
STEPS = 60
#: The longest step of a joint [rad, m]: residuals of rotations are straight over a fraction of a turn
LONGEST = 0.3
#: Singular values below this share of the largest are none: rows that they stand for are dependent
DEPENDENT = 1e-7


@dataclass(frozen=True, eq=False)
class ShortestSteps:
    """Steps q (+) -J^+ e, cut to :data:`LONGEST`, without joints that they push against their limits.

    Attributes:
        look: q -> (residual e [rows], its Jacobian J by degrees of freedom [rows, nv]).
        moved: (q, step) -> q (+) step.
        index: in q of the coordinate of each degree of freedom, -1 for none [nv].
        lower, upper: limits of position [nv]; those of degrees of freedom without a coordinate do not count.
    """

    look: Callable[[Array], tuple[Array, Array]]
    moved: Callable[[Array, Array], Array]
    index: np.ndarray
    lower: Array
    upper: Array

    @property
    def endless(self) -> Array:
        """Upper limits of none."""
        return np.full(len(self.index), np.inf)

    def outside(self, q: Array) -> list[int]:
        """Places in q of coordinates beyond their limits."""
        at, has = q[self.index], self.index >= 0
        return [int(place) for place in self.index[has & ((at < self.lower) | (at > self.upper))]]

    def unmoved(self, error: Array, jacobian: Array) -> Array:
        """What of a residual no joint moves, where that is up to :data:`ROUNDED`, else 0: e - U U'e, with the left
        singular vectors U of J.
        """
        left, sizes, _ = np.linalg.svd(jacobian, full_matrices=False)
        ways = left.T[sizes > DEPENDENT * sizes.max(initial=0.0)]
        fixed = error - ways.T @ (ways @ error)
        return np.asarray(fixed if np.abs(fixed).max(initial=0.0) <= ROUNDED else np.zeros_like(error))

    def root(self, q: Array) -> tuple[Array, float]:
        """(the best configuration on the way from q, its largest residual but for what is :meth:`unmoved`)."""
        best = q, np.inf
        for n in range(STEPS + 1):
            error, jacobian = self.look(q)
            opened = float(np.abs(error - self.unmoved(error, jacobian)).max(initial=0.0))
            if opened < best[1]:
                best = q, opened
            if opened <= CLOSED or n == STEPS:
                break
            step = self._step(q, error, jacobian)
            step *= min(1.0, LONGEST / max(float(np.abs(step).max(initial=0.0)), 1e-300))
            q = np.array(self.moved(q, step))
            has = self.index >= 0
            q[self.index[has]] = np.clip(q[self.index[has]], self.lower[has], self.upper[has])
        return best

    def _step(self, q: Array, error: Array, jacobian: Array) -> Array:
        """The shortest that closes the straight model best, without joints that it pushes against their limits."""
        free, at, has = np.ones(len(self.index), dtype=np.bool_), q[self.index], self.index >= 0
        while True:
            step = np.zeros(len(free))
            step[free] = -np.linalg.lstsq(jacobian[:, free], error, rcond=DEPENDENT)[0]
            pushed = has & (((at <= self.lower) & (step < 0.0)) | ((at >= self.upper) & (step > 0.0)))
            if not pushed.any():
                return step
            free[pushed] = False
