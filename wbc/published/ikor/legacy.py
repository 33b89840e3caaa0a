"""HERMIES-III's Jacobian as the published program has it, with the two defects that its printed norms carry.

D1  The tool's 0.029 m stand behind joint 3 as an offset of the elbow; the forward kinematics have them along the hand.
D2  The platform's turn is computed with a position in which one cos 5 cos 6 stands for cos 5 sin 6.

Its orientation is that of the hand: the quarter turn that ends the chain of the listing is not in the printed norms.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.published.ikor.machines import HERMIES_BASE, HERMIES_LINKS, ArmMachine, hermies
from wbc.validation import Array

#: From the frame of the listing to that of the printed norms
QUARTER = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, eq=False)
class LegacyHermies(ArmMachine):
    """The forward kinematics of :func:`hermies` and the published Jacobian."""

    @cached_property
    def _other(self) -> ArmMachine:
        *others, tool = HERMIES_LINKS
        return hermies(self.base, (*others, 0.0), elbow=tool)

    def place(self, q: Array) -> tuple[Array, Array]:
        place, rotation = super().place(q)
        return place, rotation @ QUARTER

    def jacobian(self, q: Array) -> Array:
        J = self._other.jacobian(q)
        if self.base != "none":
            x, y = _arm_place(q)
            x, y, s, c = x + HERMIES_BASE[0], y + HERMIES_BASE[1], np.sin(q[-1]), np.cos(q[-1])
            J[0, -1], J[1, -1] = -x * s - y * c, x * c - y * s
        return J


def legacy_hermies(base: str = "none") -> LegacyHermies:
    """The published one, ``base``: none or holonomic."""
    machine = hermies(base)
    return LegacyHermies(**{name: getattr(machine, name) for name in machine.__dataclass_fields__})


def _arm_place(q: Array) -> tuple[float, float]:
    """Position of the hand before the arm's base by the formula with D2."""
    shoulder, upper, forearm, hand, tool = HERMIES_LINKS
    s1, s2, s3, s4, s5, s6 = np.sin(q[:6])
    c1, c2, c3, c4, c5, c6 = np.cos(q[:6])
    # D2: the first has c5 s6 by geometry
    along, across, out = hand * c5 * c6, hand * s5 * s6, hand * c6
    ends = []
    for a, b in ((c1, s1), (s1, -c1)):
        x = a * c2 * c3 - b * s3
        reach, rise = x * c4 - a * s2 * s4, x * s4 + a * s2 * c4
        ends.append(
            reach * (along + forearm) - rise * across + (a * c2 * s3 + b * c3) * out
            + tool * x + upper * a * s2 + shoulder * b
        )  # fmt: skip
    return ends[0], ends[1]
