"""Whether conditions have no real solution, proved by subdivision with bounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.analysis.algebra.fourier import fourier
from wbc.analysis.algebra.half_angles import HalfAngles, Relation
from wbc.validation import Array

#: Boxes that are looked at together
BOXES = 4000
#: Rounds of cutting each box in two; what is left then is not proved
ROUNDS = 80
#: What a bound must keep from zero, in parts of the sum of all coefficients: beyond any rounding
_ROOM = 1e-9


def proved_empty(half: HalfAngles, relations: Sequence[Relation], boxes: int = BOXES) -> bool:
    """Whether no configuration satisfies all of the relations. False proves nothing.

    Over a box with centre c and half widths h a relation f(q) = sum_k a_k cos(w_k.q + b_k) keeps within

        |f(q) - f(c)| <= sum_i |df/dq_i(c)| h_i + 1/2 sum_k |a_k| (|w_k|.h)^2

    of its value at the centre. Boxes in which some relation keeps from zero are done, the others are cut in the joint
    that counts most. Relations with sliding joints are not decided.
    """
    joints = sorted({k for r in relations for k in r.joints})
    if not relations or set(joints) & set(half.ring.slides):
        return False
    waves = [_WaveSum(half, r, joints) for r in relations]
    centre, width = np.zeros((1, len(joints))), np.full((1, len(joints)), np.nextafter(np.pi, 4.0))
    for _ in range(ROUNDS):
        left, weight = np.ones(len(centre), bool), np.zeros_like(centre)
        for one in waves:
            value, spread, share = one.bounds(centre, width)
            left &= np.abs(value) <= spread + _ROOM * one.size
            weight += share
        centre, width, weight = centre[left], width[left], weight[left]
        if not len(centre):
            return True
        if 2 * len(centre) > boxes:
            return False
        rows, cut = np.arange(len(centre)), np.argmax(weight, axis=1)
        width[rows, cut] /= 2.0
        low, high = centre.copy(), centre.copy()
        low[rows, cut] -= width[rows, cut]
        high[rows, cut] += width[rows, cut]
        centre, width = np.concatenate((low, high)), np.concatenate((width, width))
    return False


class _WaveSum:
    """A relation as a sum of waves in some joints; symbols take their values."""

    def __init__(self, half: HalfAngles, relation: Relation, joints: Sequence[int]) -> None:
        values = [float(v) for v in half.ring.symbols.values()]
        terms = fourier(half, relation.poly, relation.degrees)
        sliding = len(half.ring.slides)
        largest = max(abs(t.number) for t in terms)
        numbers = [
            float(t.number / largest) * float(np.prod([v**p for v, p in zip(values, t.powers[sliding:], strict=True)]))
            for t in terms
        ]
        self._number = np.array(numbers)
        self.size = float(np.abs(self._number).sum())
        self._wave = np.array([[t.frequency[k] / 2.0 for k in joints] for t in terms])
        # sin x = cos(x - pi/2)
        self._shift = np.array([-np.pi / 2.0 if t.sine else 0.0 for t in terms])

    def bounds(self, centre: Array, width: Array) -> tuple[Array, Array, Array]:
        """(values at the centres, how far they may be off, what each joint adds to that)."""
        phase = np.einsum("bj,tj->bt", centre, self._wave) + self._shift
        slope = np.abs(np.einsum("bt,tj->bj", -np.sin(phase) * self._number, self._wave)) * width
        reach = np.einsum("bj,tj->bt", width, np.abs(self._wave))
        curved = 0.5 * np.einsum("bt,t->b", reach * reach, np.abs(self._number))
        bent = np.einsum("bt,tj->bj", reach * np.abs(self._number), np.abs(self._wave)) * width
        value = np.einsum("bt,t->b", np.cos(phase), self._number)
        return value, slope.sum(1) + curved, (slope + 0.5 * bent) / max(self.size, 1e-300)
