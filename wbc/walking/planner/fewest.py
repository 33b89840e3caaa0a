"""Whether a plan with fewer re-grasps than one that was found leads to the end: every stance is looked at that could.

A search keeps the promising stances, and begins with some. With h_arm(g) re-grasps that an arm needs at least from its
grip g to the end of the path, whatever the other arms do, a stance needs at least the sum h over its grips; of stances
after d re-grasps only those with d + h <= k can lead to the end with k. They are few as long as k is small.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.slices import Slices
from wbc.walking.planner.sound import sound_slices
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.stances.candidates import Fan
from wbc.walking.planner.stances.nodes import Found, Node
from wbc.walking.planner.stances.together import together
from wbc.walking.planner.starts import Beginning, grips_at_first
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.planner.swings.move import Key

#: Plans of more re-grasps are left as they are; so are those for which more stances would have to be looked at
FEW, MOST = 4, 4000


def fewer_slices(
    known: BodySearch, beginning: Beginning, found: Found, sample: int = 0
) -> Slices[tuple[Found, tuple[SwingLaw, ...]] | None]:
    """The fewest moves, and their laws, if they are fewer than those of a plan that was found; else None.

    Args:
        known: the search that found it; its swings need not be computed again. beginning: of the plan. sample: from
            which on hands may be lifted.
    """
    best, count = None, len(found.moves)
    while 0 < count <= FEW:
        search = _Fewer(known, count - 1)
        starts = search.starts(beginning, sample)
        yield None
        if not 0 < len(starts) <= MOST:
            break
        less, laws = yield from sound_slices(search, starts, sample)
        if not less.complete or len(less.moves) >= count:
            break
        best, count = (less, laws), len(less.moves)
    return best


def least_regrasps(grips: Grips, finish: int) -> Ints:
    """How many re-grasps an arm needs at least from each grip on to the last sample; more than grips for never."""
    out = np.full(len(grips), len(grips) + 1, dtype=np.int64)
    out[grips.last >= finish] = 0
    for arm in np.unique(grips.arm):
        mine = np.nonzero((grips.arm == arm) & (grips.hold >= 0))[0]
        # The next grip ends later, and those that end last are known first
        for grip in mine[np.argsort(-grips.last[mine], kind="stable")].tolist():
            if out[grip]:
                after = mine[grips.last[mine] > grips.last[grip]]
                out[grip] = 1 + out[after].min(initial=len(grips))
    return out


class _Fewer(BodySearch):
    """A search over all stances from which at most ``most`` moves may lead to the end."""

    def __init__(self, known: BodySearch, most: int) -> None:
        path, grips, patient = known.path, known.grips, known.patient
        super().__init__(known.walker, known.structure, path, grips, known=known, patient=patient, width=None)
        self._most, self._least = most, least_regrasps(grips, len(path) - 1)

    def starts(self, beginning: Beginning, sample: int) -> list[Key]:
        """Stances that the plan may begin with."""
        choices = grips_at_first(self.walker, self.structure, self.path, self.grips, beginning)
        out, least, holds = list[Key](), self._least.tolist(), self.grips.hold.tolist()
        # What all other arms need at least leaves so much to an arm
        fewest = [min(least[g] for g in mine) for mine in choices]
        spare = self._most - sum(fewest)
        choices = [[g for g in mine if least[g] - few <= spare] for mine, few in zip(choices, fewest, strict=True)]
        for key in together(choices, lambda one, other: holds[one] != holds[other]):
            if sum(least[g] for g in key) <= self._most and self.until(key, 0) > sample:
                out.append(key)
                if len(out) > MOST:
                    break
        return out

    def _moves(self, level: Sequence[tuple[Key, Node]], rows: range) -> list[Fan]:
        # The level that is being made is the next one
        left = self._most - len(self._levels)
        needs = self._least[np.array([key for key, _ in level], dtype=np.int64)].sum(axis=1)
        out = []
        for fan in super()._moves(level, rows):
            need = needs[fan.parent] - self._least[fan.source] + self._least[fan.target]
            out.append(fan.of(np.nonzero(need <= left)[0]))
        return out
