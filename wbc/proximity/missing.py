"""Whether a command lets pairs without a row close faster than their rows would: then they need one.

A row allows a pair, whose distance less the margin is h, to close at ``rate`` h, and no faster than its joints brake in
front of the margin (docs/reach.md). A pair without a row is checked at the command v, first by a bound on the speed of
all points of both bodies, and where that does not do, by the row itself. What closes faster than its row allows is
urgent: it has a row in the next choice, before any other, and so have those with rows that push.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.proximity.measured import Measured
from wbc.proximity.scene import Index
from wbc.validation import Array

#: How much of what its row allows a pair closes by: up to half of it; up to :data:`WHOLE` of it, or the pair is
#: within its margin; all of it; more than it, of which in the first case the pair is within its margin and opens too
#: slowly. ``native/missing.h`` has the same
LITTLE: Final = 0
HALF: Final = 1
ALL: Final = 2
TOO_MUCH: Final = 3
INWARD: Final = 4

WHOLE = 0.999


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


class Missing:
    """The check of a sensing in numpy; in C ``native/missing.h``.

    Attributes:
        urgent: of every pair :data:`LITTLE` to :data:`ALL`.
    """

    def __init__(self, sensing: Measured) -> None:
        self._sensing, scene = sensing, sensing.scene
        self._screws = Screws(scene.robot.model)
        self._tie = sensing.tie
        self.urgent: Index = np.zeros(len(scene.first), dtype=np.intp)

    def __call__(self, q: Array, v: Array, dt: float, braking: Array, outside: Array) -> int:
        """See :meth:`wbc.proximity.sensor.PairSensor.missing`.

        Args:
            outside: twist of what moves from outside at the world's origin [6].
        """
        found, rows = self._sensing, self._sensing.rows
        assert rows is not None
        if len(self.urgent) <= rows.count or found.pairs[0] < 0:
            return LITTLE  # all have rows, or nothing was measured yet
        self._screws.place(q)
        lines, chosen = rows.line.reshape(-1, 6), found.pairs
        of = np.concatenate([chosen, np.repeat(chosen, rows.corners)])
        most = self._used(of, rows.distance, lines, rows.drift, v, dt, braking)
        more = most[rows.count :].reshape(rows.count, rows.corners).max(axis=1, initial=LITTLE)
        self.urgent[:] = LITTLE
        self.urgent[chosen] = np.minimum(np.maximum(most[: rows.count], more), ALL)
        without = np.setdiff1d(np.arange(len(self.urgent)), chosen)
        near = without[~self._far(without, v, dt, braking, outside)]
        found.ask(near)
        worst = LITTLE
        for pair in near.tolist():
            gaps, lines = found.rows_of(pair)
            drift = lines @ outside * found.scene.outward[pair]
            used = int(self._used(np.full(len(gaps), pair), gaps, lines, drift, v, dt, braking).max())
            self.urgent[pair] = ALL if used >= TOO_MUCH else min(used, HALF)
            worst = max(worst, used)
        return worst

    def _far(self, pairs: Index, v: Array, dt: float, braking: Array, outside: Array) -> NDArray[np.bool_]:
        """Whether no row of a pair can matter, by bounds."""
        found, rows = self._sensing, self._sensing.rows
        assert rows is not None
        h = found.bounds()[pairs] - found.off - rows.margin.item()
        stop = float((np.abs(v) / braking).max())
        speed = self._fastest(pairs, (rows.pair_side[pairs] * v) @ self._screws.rows)
        moves = found.scene.outward[pairs] != 0.0
        own = np.where(moves, self._fastest(pairs, np.tile(outside, (len(pairs), 1))), 0.0)
        rate = rows.rate.item()
        return np.asarray((h > 0.0) & (speed * (dt + 0.5 * stop) + own * stop < h) & (speed + own < rate * h))

    def _fastest(self, pairs: Index, twists: Array) -> Array:
        """No point of one of the two bodies moves faster by the twist of its pair."""
        found, out = self._sensing, np.full(len(pairs), np.inf)
        spin = np.linalg.norm(twists[:, 3:], axis=1)
        for body in (found.scene.first[pairs], found.scene.second[pairs]):
            linear = twists[:, :3] + np.cross(twists[:, 3:], found.centers[body])
            radius = found.scene.radii[body]
            reach = np.where(np.isfinite(radius), np.linalg.norm(linear, axis=1), np.inf)
            out = np.minimum(out, reach + spin * np.where(np.isfinite(radius), radius, 0.0))
        return out

    @np.errstate(divide="ignore", invalid="ignore")
    def _used(self, of: Index, gap: Array, line: Array, drift: Array, v: Array, dt: float, braking: Array) -> Array:
        """How much of what they allow some rows close by."""
        rows = self._sensing.rows
        assert rows is not None
        entries = rows.pair_side[of] * (line @ self._screws.rows.T)
        h, closing = gap - rows.margin.item(), -entries @ v
        a = np.where(entries != 0.0, np.abs(entries) * braking, 0.0).sum(axis=1)
        lag = dt + np.maximum(-drift, 0.0) / a
        speed = 2.0 * h / (lag + np.sqrt(lag * lag + 2.0 * h / a)) + np.maximum(drift, 0.0)
        brakes = (h > 0.0) & (a > 0.0) & np.isfinite(a)
        allowed = rows.rate.item() * h + drift
        allowed = np.where(brakes, np.minimum(allowed, speed), allowed)
        used = np.where((closing > 0.5 * allowed) | ~(h > 0.0), HALF, LITTLE)
        used = np.where(closing > allowed - (1.0 - WHOLE) * np.abs(allowed) - self._tie, ALL, used)
        used = np.where(closing > allowed + self._tie, TOO_MUCH, used)
        return np.where(closing > np.maximum(allowed, 0.0) + self._tie, INWARD, used)
