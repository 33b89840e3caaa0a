"""Whether a command lets pairs without a row close faster than their rows would: then they need one.

A row allows a pair, whose distance less the margin is h, to close at ``rate`` h, and no faster than its joints brake in
front of the margin (docs/reach.md). A pair without a row is checked at the command v, first by a bound on the speed of
all points of both bodies, and where that does not do, by the row itself (``native/missing.h``). What closes faster
than its row allows is urgent: it has a row in the next choice, before any other, and so have those with rows that push.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from wbc.multibody import pin
from wbc.validation import Array

#: How much of what its row allows a pair closes by: up to half of it; up to 0.999 of it, or the pair is
#: within its margin; all of it; more than it, of which in the first case the pair is within its margin and opens too
#: slowly
LITTLE: Final = 0
HALF: Final = 1
ALL: Final = 2
TOO_MUCH: Final = 3
INWARD: Final = 4


class Screws:
    """Twists (linear; angular) at the world's origin for a unit of each degree of freedom, ``rows`` [nv x 6]."""

    def __init__(self, model: pin.Model) -> None:
        self._model, self._data = model, model.createData()
        #: rows of mimic joints stand beside those of their leaders
        self._all = self._data.J.T
        self._folds = len(self._all) > model.nv
        self.rows: Array = np.zeros((model.nv, 6)) if self._folds else self._all
        begin = list(model.idx_vExtendeds)
        self._leader = np.zeros(len(self._all), dtype=np.intp)
        for joint in range(1, model.njoints):
            for k in range(int(model.nvExtendeds[joint])):
                self._leader[int(begin[joint]) + k] = int(model.idx_vs[joint]) + k

    def place(self, q: Array) -> None:
        """Those at a configuration."""
        pin.computeJointJacobians(self._model, self._data, q)
        if self._folds:
            self.rows[:] = 0.0
            np.add.at(self.rows, self._leader, self._all)
