"""Three turns in place of the quaternion of a ball joint or a floating base: numbers without manifold."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from wbc.rotations import exponential, matrices, quaternion_product
from wbc.validation import Array

#: Axes of the three turns, the usual order first
ORDERS = ((2, 1, 0), (0, 2, 1), (1, 0, 2), (0, 1, 2), (1, 2, 0), (2, 0, 1))
#: Another order of axes is taken where the sine of the second turn would be larger: at 1 two turns are about one axis
STEEP = 0.8


@dataclass(frozen=True)
class BallTurns:
    """Three turns for a ball joint, or for the rotation of a floating base:

        R = exp(a [e_i]) exp(b [e_j]) exp(c [e_k])

    Attributes:
        number: of a among the coordinates; b and c follow. place: of the quaternion in q.
        carries: the three coordinates before a are the position of a floating base. order: (i, j, k).
    """

    number: int
    place: int
    carries: bool
    order: tuple[int, int, int] = ORDERS[0]

    @property
    def span(self) -> slice:
        """The three coordinates."""
        return slice(self.number, self.number + 3)

    def suits(self, q: Array) -> bool:
        """Whether they are not steep at a configuration."""
        return self._steep(q, self.order) <= STEEP

    def suited(self, q: Array) -> BallTurns:
        """The same, or with another order, so that they are not steep at a configuration."""
        return self if self.suits(q) else replace(self, order=min(ORDERS, key=lambda order: self._steep(q, order)))

    def _steep(self, q: Array, order: tuple[int, int, int]) -> float:
        """|sin b| of the three turns in an order."""
        return float(abs(matrices(q[self.place : self.place + 4])[order[0], order[2]]))

    def angles(self, q: Array, near: Array) -> Array:
        """(a, b, c) of a configuration, those nearest to ``near`` of all that there are."""
        axes = np.eye(3)[list(self.order)]
        sign = np.linalg.det(axes)
        turned = axes @ matrices(q[self.place : self.place + 4]) @ axes.T
        level = np.hypot(turned[1, 2], turned[2, 2]) > 1e-9
        first = np.arctan2(-turned[1, 2], turned[2, 2]) if level else sign * near[0]
        found = []
        for a in (first, first + np.pi):
            rest = exponential(np.array([[-a, 0.0, 0.0]]))[0] @ turned
            x = sign * np.array([a, np.arctan2(rest[0, 2], rest[2, 2]), np.arctan2(rest[1, 0], rest[1, 1])])
            found.append(x + 2.0 * np.pi * np.round((near - x) / (2.0 * np.pi)))
        return min(found, key=lambda x: float(np.linalg.norm(x - near)))

    def quaternion(self, x: Any, math: ModuleType) -> list[Any]:
        """(x, y, z, w) at coordinates [n, ...], in numpy or CasADi."""
        first, second, third = (self._turn(k, x[self.number + k], math) for k in range(3))
        return quaternion_product(quaternion_product(first, second), third)

    def _turn(self, k: int, angle: Any, math: ModuleType) -> list[Any]:
        out = [0.0 * angle] * 3 + [math.cos(0.5 * angle)]
        out[self.order[k]] = math.sin(0.5 * angle)
        return out

    def angular_velocity(self, x: Array, rate: Array) -> Array:
        """In the axes of what it carries [..., 3]; x and its rates are [n, ...]."""
        i, j, k = self.order
        second, third = (self._turn(m, x[self.number + m], np) for m in (1, 2))
        after = [matrices(np.stack(turns, axis=-1)) for turns in (quaternion_product(second, third), third)]
        a, b, c = rate[self.span]
        return np.asarray(
            a[..., None] * after[0][..., i, :] + b[..., None] * after[1][..., j, :] + c[..., None] * np.eye(3)[k]
        )
