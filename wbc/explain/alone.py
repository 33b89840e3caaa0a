"""One task of a past tick without the others: its error anywhere, and the nearest that any configuration comes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.explain.past import PastTick, rows_of
from wbc.multibody import pin
from wbc.stack.layout import Block
from wbc.stack.tables import stops
from wbc.tasks.mechanism import Mechanism
from wbc.validation import Array

Mask = NDArray[np.bool_]

#: Errors below this are zero [rad, characteristic lengths]
MET = 1e-5
#: Starts of a search after the first two, which are the tick's configuration and one beside it
_STARTS = 16
#: Steps from each start
_STEPS = 40
#: How far the second start is from the first [rad, characteristic lengths]
_ASIDE = 0.05
#: A search ends where all starts came equally near, and these are so many; the first two count as one
_AGREED = 6
#: Singular values below this do not count [rows and joints in radians or characteristic lengths]
SINGULAR = 1e-4


@dataclass(frozen=True, eq=False)
class Rates:
    """Rows of the task at a configuration, in radians and characteristic lengths: J d is the change of e by a step d.

    Attributes:
        J: [rows, nv]. e: [rows]. A, b: equality rows of the stack, A d = b keeps them.
    """

    J: Array
    e: Array
    A: Array
    b: Array

    def kernel(self, joints: Mask) -> Array:
        """Orthonormal steps of some joints that keep the equality rows [joints, directions]."""
        count = int(joints.sum())
        if not len(self.A):
            return np.eye(count)
        _, sizes, turned = np.linalg.svd(self.A[:, joints])
        rank = int((sizes > 1e-9 * max(1.0, sizes.max(initial=0.0))).sum())
        return np.asarray(turned[rank:].T)

    def lost(self, free: Mask, least: float) -> tuple[Array, float]:
        """(part of e along which these joints move the task by singular values below ``least``, the smallest one)."""
        J = self.J[:, free] @ self.kernel(free)
        if not J.size:
            return self.e, 0.0
        turned, sizes, _ = np.linalg.svd(J)
        reached = turned[:, : int((sizes > least).sum())]
        smallest = 0.0 if len(sizes) < len(self.e) else float(sizes.min())
        return np.asarray(self.e - reached @ (reached.T @ self.e)), smallest


@dataclass(frozen=True, eq=False)
class NearestAnswer:
    """The nearest configuration that a search found, the error there, and how many starts it had."""

    q: Array
    e: Array
    starts: int

    @property
    def met(self) -> bool:
        """The task's error is zero there."""
        return bool(np.abs(self.e).max(initial=0.0) < MET)


class Alone:
    """The task's rows that count, with equality rows (what the mechanism and holds ask for) and position limits.

    Targets stand still: whatever an input says of the rate of another is zero here.
    """

    def __init__(self, past: PastTick, block: Block) -> None:
        self._past, self.block = past, block
        self._tick = past.tick.twin()
        self._tick.state[:] = past.tick.state
        self.counts = self._tick.weight[block.span] > 0.0
        layout = past.layout
        for each in layout.blocks.values():
            for slot in each.slots.values():
                if slot.input.rate is not None:
                    self._tick.p[each.slots[slot.input.rate].span] = 0.0
        self._tick.p[block.slots["gain"].span], self._tick.plain[0] = 1.0, 1.0
        self._scales = layout.row_scales(past.stack)[block.span]
        self._dofs = layout.dof_scales(past.stack)[: layout.nv]
        ends = stops(past.stack, layout)
        at = np.array(ends.bounds[: layout.nv])
        on = at >= 0
        on[on] = self._tick.bound_enabled[at[on]] != 0.0
        self.lower = np.where(on, ends.lower[: layout.nv], -np.inf)
        self.upper = np.where(on, ends.upper[: layout.nv], np.inf)
        self._own = np.zeros(layout.general_rows, dtype=bool)
        for each in layout.of_form("rows"):
            self._own[each.span] = isinstance(each.entry.item, Mechanism)
        self._index = past.stack.robot.position_index

    def at(self, q: Array, own: bool = False) -> Rates:
        """Rows at a configuration; ``own``: with the equality rows of the mechanism only."""
        tick, past, nv = self._tick, self._past, self._past.layout.nv
        tick.q[:] = q
        qp = tick.qp()
        J, e = rows_of(tick, self.block)[0], tick.report[past.places["error"]][self.block.span]
        low, high = qp.lower[past.layout.variables :], qp.upper[past.layout.variables :]
        equal = (low == high) & (self._own if own else True)
        A = (qp.A[equal] * past.layout.dof_scales(past.stack))[:, :nv]
        sizes = np.linalg.norm(A, axis=1)
        kept = sizes > 1e-9
        A, b = A[kept] / sizes[kept, None], low[equal][kept] / sizes[kept] * float(tick.dt[0])
        chosen = self.counts
        return Rates((J[:, :nv] * self._dofs / self._scales[:, None])[chosen], (e / self._scales)[chosen], A, b)

    def free(self, q: Array, here: Rates) -> Mask:
        """Joints that their position limits let go downhill."""
        return ~self.blocked(q, -here.J.T @ here.e)

    def moved(self, q: Array, step: Array) -> Array:
        """q (+) step."""
        return np.asarray(pin.integrate(self._past.stack.robot.model, q, step * self._dofs))

    def blocked(self, q: Array, downhill: Array, limited: bool = True) -> Mask:
        """Joints that their position limits do not let go downhill."""
        if not limited:
            return np.zeros(len(downhill), dtype=bool)
        at = np.where(self._index >= 0, q[np.maximum(self._index, 0)], 0.0)
        known = self._index >= 0
        return known & (((at >= self.upper - 1e-9) & (downhill > 0.0)) | ((at <= self.lower + 1e-9) & (downhill < 0.0)))

    def _within(self, q: Array) -> Array:
        out, known = q.copy(), self._index >= 0
        out[self._index[known]] = np.clip(q[self._index[known]], self.lower[known], self.upper[known])
        return out

    def descend(self, q: Array, limited: bool = True, own: bool = False) -> tuple[Array, Array]:
        """(configuration, error) where Levenberg and Marquardt's method from q ends:
        d = -(J'J + mu |J|^2 I)^-1 J'e in the steps that limits and equality rows leave.
        """
        q = self._within(q) if limited else q
        here, mu = self.at(q, own), 1e-3
        for _ in range(_STEPS):
            cost = float(here.e @ here.e)
            if np.abs(here.e).max(initial=0.0) < 0.01 * MET and np.abs(here.b).max(initial=0.0) < MET:
                break
            downhill = -here.J.T @ here.e
            free = ~self.blocked(q, downhill, limited)
            kernel = here.kernel(free)
            J = here.J[:, free] @ kernel
            back = np.zeros(len(free))
            if len(here.b):
                back[free] = np.linalg.lstsq(here.A[:, free], here.b, rcond=1e-9)[0]
            if not J.size or (np.linalg.norm(J.T @ here.e) < 1e-9 and np.abs(back).max() < 1e-9):
                break
            step = back.copy()
            left, sizes, right = np.linalg.svd(J, full_matrices=False)
            if sizes[0] > 0.0:  # mu counts in J's own size, whatever the rows are counted in
                part = sizes / sizes[0]
                step[free] -= kernel @ (right.T @ (part / (part**2 + mu) * (left.T @ here.e))) / sizes[0]
            step *= min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
            there_q = self.moved(q, step)
            there_q = self._within(there_q) if limited else there_q
            there = self.at(there_q, own)
            new = float(there.e @ there.e)
            off = float(np.abs(here.b).max(initial=0.0))
            if new < cost or off > MET:
                finished = cost - new < 1e-8 * cost and off <= MET
                q, here, mu = there_q, there, max(0.2 * mu, 1e-9)
                if finished:
                    break
            else:
                mu *= 10.0
                if mu > 1e9:
                    break
        return q, here.e

    def holds(self) -> bool:
        """Whether other items than the mechanism hold the robot where it is, by equality rows."""
        return len(self.at(self._past.tick.q).A) > len(self.at(self._past.tick.q, own=True).A)

    def _starts(self, anywhere: bool) -> Iterator[Array]:
        """The tick's configuration, one beside it, and random ones; the same for the same tick."""
        robot, q = self._past.stack.robot, self._past.tick.q.copy()
        random = np.random.default_rng(0)
        yield q
        yield self.moved(q, _ASIDE * random.choice((-1.0, 1.0), robot.nv))
        for seed in range(_STARTS if anywhere else 0):
            yield robot.random(seed)

    def nearest(self, limited: bool = True, own: bool = False) -> NearestAnswer:
        """The nearest configuration, from all starts or until one of them meets the target.

        What is held stays held: then there are no random starts, unless ``own`` lets everything go but the mechanism.
        """
        best: tuple[float, Array, Array] = (np.inf, np.zeros(0), np.zeros(0))
        found: list[float] = []
        for q0 in self._starts(own or not self.holds()):
            q, e = self.descend(q0, limited, own)
            off = float(np.linalg.norm(e))
            found.append(off)
            if off < best[0]:
                best = off, q, e
            # One that ended elsewhere says that there are several minima, of which the first ones need not be the least
            agreed = len(found) > _AGREED and max(found) < best[0] * (1.0 + 1e-3)
            if np.abs(e).max(initial=0.0) < MET or agreed:
                break
        return NearestAnswer(best[1], best[2], len(found))

    def escape(self, q: Array) -> tuple[float, Array]:
        """(least curvature of |e|^2 / 2, the step of length 1 along it) within what limits and equality rows leave.

            J'J + d(e'J)/dq,      e as it is here

        Where the gradient J'e vanishes and the curvature is negative, this step gives it back fastest. The sign is that
        of its largest number, positive, or away from a limit there.
        """
        nv, by, here = self._past.layout.nv, 1e-4, self.at(q)
        slopes = np.zeros((nv, nv))
        for k in range(nv):
            ends = [here.e @ self.at(self.moved(q, sign * by * np.eye(nv)[k])).J for sign in (1.0, -1.0)]
            slopes[k] = (ends[0] - ends[1]) / (2.0 * by)
        curvature = here.J.T @ here.J + 0.5 * (slopes + slopes.T)
        free = self.free(q, here)
        kernel = here.kernel(free)
        if not kernel.size:
            return 0.0, np.zeros(nv)
        values, vectors = np.linalg.eigh(kernel.T @ curvature[np.ix_(free, free)] @ kernel)
        step = np.zeros(nv)
        step[free] = kernel @ vectors[:, 0]
        most = int(np.abs(step).argmax())
        step *= -1.0 if (step[most] > 0.0) == bool(self.blocked(q, np.eye(nv)[most])[most]) else 1.0
        return float(values[0]), step
