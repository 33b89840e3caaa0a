"""What gives way when the rows cannot all hold: a declared order of sacrifice.

Every general row has a class; class by class, low numbers first, the least violation is found

    minimise 1/2 |s|^2    over v within its simple bounds, rows of lower classes as frozen before,
                          lower <= A_i v + unit_i s_i <= upper for the rows of this class,

and frozen: a row with s_i != 0 becomes the equality A_i v = (bound - unit_i s_i), because the least s is
unique. Last, the original objective is minimised over what is left. Simple bounds and rows of class 0 never give way.

The least-violation problem has no unique v; it is solved by a proximal sequence
(1/2 eps |v - v_previous|^2 added), which converges to the least s and keeps the solver's H positive definite.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import BoundsError
from wbc.qp.problem import QP, QPSolution
from wbc.qp.solvers.backend import Backend, Prepared
from wbc.qp.solvers.daqp import Daqp
from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

#: Weight of the proximal term, steps at most, and the change of s at which the sequence ends
PROXIMAL = 1e-6
STEPS = 30
SETTLED = 1e-12

#: Violations up to this (per unit of the row) count as none; rows of finished classes get this much tolerance
GIVEN_WAY = 1e-9

#: Variables beyond this times what counts as 1 are no answer
FAR_AWAY = 1e6
#: By how much a sum of rows has to be broken, per largest multiplier, for a proof that they contradict each other
_BROKEN = 1e-6

#: Rows and bounds whose multiplier exceeds this share of the largest one stay active in the later classes
_PUSHING = 1e-6


@dataclass(frozen=True, eq=False, slots=True)
class Relaxed:
    """Answer of :class:`Relaxation`.

    Attributes:
        x: finite and within the simple bounds, whatever happens [n].
        multipliers: of the last problem, whose relaxed rows are equalities [n + m]; zeros if ``failed``.
        flag: ``solved``: all rows hold, x is the plain minimiser; ``relaxed``: some rows gave way as
            declared, x minimises the objective over the rest; ``failed``: a solver gave no verdict, x is
            the point of least violation found last.
        slack: violation of each row at x, in the row's units, >= 0 [m].
        relaxed: rows whose slack exceeds the numerical tolerance [m].
        lower, upper: the bounds that x minimises the objective over, the given ones but for what gave way and
            what was held for it [n + m].
        iterations: of all solver calls together.
        added: what was added to the diagonal of H, and to g, where rows give way at prices; else None.
    """

    x: Array
    multipliers: Array
    flag: str
    slack: Array
    relaxed: NDArray[np.bool_]
    lower: Array
    upper: Array
    iterations: int
    added: tuple[Array, Array] | None = None


class Relaxation:
    """The cascade, with kept solvers, for problems with ``n`` variables and ``m`` general rows."""

    def __init__(
        self,
        n: int,
        m: int,
        solver: Backend | None = None,
        price: Array | None = None,
        steady: Array | None = None,
    ) -> None:
        """``solver`` solves the problems in v (default: DAQP behind prepared equalities).

        ``price``: rows give way at prices in place of an order: what a violation of one unit costs, per largest entry
        on the diagonal of H; 0 for rows that never give way [m]. ``steady``: what then brings variables to rest that
        nothing else moves, likewise; 0 by default [n].
        """
        self.n, self.m = n, m
        self._final = solver if solver is not None else Prepared(Daqp(n, m))
        self._stage = Prepared(Daqp(n + m, m))
        self._price, self._steady = price, np.zeros(n) if steady is None else steady
        self._priced = None if price is None else Prepared(Daqp(n + int((price > 0.0).sum()), m))

    def solve(
        self,
        qp: QP,
        order: NDArray[np.int_],
        unit: Array | None = None,
        size: Array | None = None,
        rest: Array | None = None,
    ) -> Relaxed:
        """Solve ``qp`` with its rows, or with as few as must give way in the declared order.

        Args:
            order: class of each general row; rows of a higher class give way first, those of class 0 never [m].
            unit: size of a violation that counts as 1, per row, in the row's units; default: the norm of
                the row, so that slacks are compared as joint motion [m].
            size: value of each variable that counts as 1, default 1: the problem is solved in x / size, so that the
                variables' units do not matter [n].
            rest: where rows give way at prices, what variables tend to that nothing else moves, 0 by default [n].

        Raises:
            ShapeError: ``order``, ``unit`` or ``size`` of the wrong length.
            BoundsError: a simple bound or a row whose lower value is above its upper one.
        """
        order = validation.real_array("order", order, (self.m,)).astype(np.int_)
        scale = np.linalg.norm(qp.A, axis=1) if unit is None else validation.real_array("unit", unit, (self.m,))
        scale = np.where(scale > 0.0, scale, 1.0)
        crossed = np.flatnonzero(qp.lower > qp.upper)
        if crossed.size:
            i = int(crossed[0])
            raise BoundsError(f"lower[{i}]", float(qp.lower[i]), f"above upper {qp.upper[i]:g}")
        if size is None:
            return self._solve(qp, order, scale, rest)
        size = validation.real_array("size", size, (self.n,))
        ends = np.concatenate((size, np.ones(self.m)))
        scaled = QP(qp.H * np.outer(size, size), qp.g * size, qp.lower / ends, qp.upper / ends, qp.A * size)
        found = self._solve(scaled, order, scale, None if rest is None else rest / size)
        x = np.clip(found.x * size, qp.lower[: self.n], qp.upper[: self.n])
        # a bound that is as it was comes back to the last digit
        lower = np.where(found.lower == scaled.lower, qp.lower, found.lower * ends)
        upper = np.where(found.upper == scaled.upper, qp.upper, found.upper * ends)
        low = (found.lower != scaled.lower) & (found.lower == scaled.upper)
        high = (found.upper != scaled.upper) & (found.upper == scaled.lower)
        lower, upper = np.where(low, qp.upper, lower), np.where(high, qp.lower, upper)
        added = None if found.added is None else (found.added[0] / size**2, found.added[1] / size)
        return replace(found, x=x, multipliers=found.multipliers / ends, lower=lower, upper=upper, added=added)

    def impossible(self, qp: QP, rows: NDArray[np.bool_], unit: Array, size: Array | None = None) -> bool:
        """Whether it is proven that no x within the simple bounds keeps ``rows`` [m].

        The multipliers y of their least violation add them up to one row y'A x <= y'side; it is a proof if the whole
        box breaks that (Farkas' lemma), where variables beyond FAR_AWAY times ``size`` count as none.
        """
        n, ends = self.n, np.ones(self.n) if size is None else size
        free = np.where(rows, 0.0, np.inf)
        with np.errstate(invalid="ignore"):
            low, high = qp.lower[n:] / unit - free, qp.upper[n:] / unit + free
        box = qp.lower[:n] / ends, qp.upper[:n] / ends
        lower, upper = np.concatenate((box[0], low)), np.concatenate((box[1], high))
        work = QP(qp.H, qp.g, lower, upper, qp.A * ends / unit[:, None])
        stage = self._least_violation(work, np.flatnonzero(rows), np.clip(0.0, *box))
        if stage is None:
            return False
        y = np.where(rows, stage.multipliers[-self.m :], 0.0)
        if not np.isfinite(np.where(y > 0.0, high, low)[y != 0.0]).all():
            return False
        at = -y * np.where(y == 0.0, 0.0, np.where(y > 0.0, high, low))
        total = y @ work.A
        reach = total * np.where(total > 0.0, np.maximum(box[0], -FAR_AWAY), np.minimum(box[1], FAR_AWAY))
        rounding = 1e3 * np.finfo(float).eps * float(np.abs(at).sum() + np.abs(reach).sum())
        return bool(at.sum() + reach.sum() > _BROKEN * np.abs(y).max(initial=0.0) + rounding)

    def _solve(self, qp: QP, order: NDArray[np.int_], scale: Array, rest: Array | None) -> Relaxed:
        plain = self._final.solve(qp)
        if plain.solved:
            return self._answer(qp, plain, "solved", plain.iterations, scale, (qp.lower, qp.upper))
        if self._price is not None and self._priced is not None:
            found = self._elastic(qp, scale, rest, self._price, self._priced)
            if found.flag != "failed":
                return found
        return self._cascade(qp, order, scale, plain.iterations)

    def _elastic(self, qp: QP, unit: Array, rest: Array | None, price: Array, solver: Backend) -> Relaxed:
        """The optimum where rows give way at their prices; the sides of those that do are moved to it."""
        n, gives = self.n, price > 0.0
        largest = float(np.diag(qp.H).max(initial=0.0))
        cost = np.where(gives, price * largest / unit**2, 1.0)
        more = self._steady * largest
        less = np.zeros(n) if rest is None else -more * rest
        steady = replace(qp, H=qp.H + np.diag(more), g=qp.g + less, give=np.where(gives, 1.0 / cost, 0.0))
        found = solver.solve(steady.with_slacks(), warm=False)
        x = np.clip(found.x[:n], qp.lower[:n], qp.upper[:n])
        lower, upper, at = qp.lower.copy(), qp.upper.copy(), np.where(gives, qp.A @ x, np.nan)
        equal = lower[n:] == upper[n:]
        lower[n:], upper[n:] = np.fmin(lower[n:], at), np.fmax(upper[n:], at)
        lower[n:], upper[n:] = np.where(equal & gives, at, lower[n:]), np.where(equal & gives, at, upper[n:])
        multipliers = np.concatenate((found.multipliers[:n], found.multipliers[-self.m :]))
        last = QPSolution(x, multipliers, found.flag)
        flag = "relaxed" if found.solved else "failed"
        return replace(self._answer(qp, last, flag, found.iterations, unit, (lower, upper)), added=(more, less))

    def _cascade(self, qp: QP, order: NDArray[np.int_], unit: Array, iterations: int) -> Relaxed:
        n = self.n
        work = QP(qp.H, qp.g, qp.lower.copy(), qp.upper.copy(), qp.A / unit[:, None])
        with np.errstate(invalid="ignore"):
            work.lower[n:] /= unit
            work.upper[n:] /= unit
        ends = work.lower[n:].copy(), work.upper[n:].copy()
        hard = order == 0
        work.lower[n:], work.upper[n:] = np.where(hard, ends[0], -np.inf), np.where(hard, ends[1], np.inf)
        v = np.clip(0.0, qp.lower[:n], qp.upper[:n])
        for level in np.unique(order[~hard]):
            rows = np.flatnonzero(order == level)
            work.lower[n + rows], work.upper[n + rows] = ends[0][rows], ends[1][rows]
            stage = self._least_violation(work, rows, v)
            if stage is None:
                # no verdict: the rows of this class stay free, later ones are still tried
                work.lower[n + rows], work.upper[n + rows] = -np.inf, np.inf
                continue
            iterations += stage.iterations
            v = self._freeze(work, rows, stage)
        last, tries = self._rest(work, v)
        iterations += tries
        flag = "relaxed" if last.solved else "failed"
        size = np.concatenate((np.ones(n), unit))
        x = np.clip(last.x if last.solved else v, work.lower[:n], work.upper[:n])
        final = QPSolution(x, last.multipliers / size, last.flag)
        self._meet(work, x)
        return self._answer(qp, final, flag, iterations, unit, (work.lower * size, work.upper * size))

    def _rest(self, work: QP, v: Array) -> tuple[QPSolution, int]:
        """The optimum over what the classes left, and the iterations; all that is held meets at v.

        Where nearly every joint is held, rounding may leave nothing else: then equalities get a
        tolerance, and at last their joints stay where they are.
        """
        last = self._final.solve(work, warm=False)
        iterations, rows = last.iterations, np.flatnonzero(work.lower[self.n :] == work.upper[self.n :])
        for tolerance in (GIVEN_WAY, np.inf):
            if last.solved or not rows.size:
                break
            if tolerance == np.inf:
                joints = np.flatnonzero((work.A[rows] != 0.0).any(axis=0))
                work.lower[joints] = work.upper[joints] = v[joints]
            loosened = work.copy()
            loosened.lower[self.n + rows] -= tolerance
            loosened.upper[self.n + rows] += tolerance
            last = self._final.solve(loosened, warm=False)
            iterations += last.iterations
        return last, iterations

    def _least_violation(self, work: QP, rows: NDArray[np.intp], v: Array) -> QPSolution | None:
        """(v, s) of the least |s| for ``rows``; the other rows of ``work`` are hard."""
        n, m = self.n, self.m
        free = np.full(m, np.inf)
        H = np.diag(np.concatenate((np.full(n, PROXIMAL), np.ones(m))))
        A = np.hstack((work.A, np.zeros((m, m))))
        A[rows, n + rows] = 1.0
        lower = np.concatenate((work.lower[:n], -free, work.lower[n:]))
        upper = np.concatenate((work.upper[:n], free, work.upper[n:]))
        problem = QP(H, np.zeros(n + m), lower, upper, A)
        best: QPSolution | None = None
        iterations = 0
        for _ in range(STEPS):
            problem.g[:n] = -PROXIMAL * v
            stage = self._stage.solve(problem, warm=best is not None)
            iterations += stage.iterations
            if not stage.solved:
                break
            change = np.inf if best is None else float(np.abs(stage.x[n:] - best.x[n:]).max(initial=0.0))
            best, v = stage, stage.x[:n]
            if change <= SETTLED:
                break
        return None if best is None else QPSolution(best.x, best.multipliers, "solved", iterations)

    def _freeze(self, work: QP, rows: NDArray[np.intp], stage: QPSolution) -> Array:
        """Write the least violation of a class into the bounds of its rows, and hold what pushes against it.

        Returns the point at which all that is held meets: the stage's x, put exactly on the bounds that are held.
        """
        n, m = self.n, self.m
        s = np.zeros(m)
        s[rows] = stage.x[n + rows]
        x = np.clip(stage.x[:n], work.lower[:n], work.upper[:n])
        given = rows[np.abs(s[rows]) > GIVEN_WAY]
        equal = np.flatnonzero(work.lower[n:] == work.upper[n:])
        pushing = np.abs(stage.multipliers) > _PUSHING * np.abs(s).max(initial=0.0)
        others = np.setdiff1d(rows, np.union1d(given, equal))
        work.lower[n + others] -= GIVEN_WAY
        work.upper[n + others] += GIVEN_WAY
        if given.size:
            fixed = np.flatnonzero(pushing[:n])
            at = np.where(stage.multipliers[fixed] > 0.0, work.upper[fixed], work.lower[fixed])
            x[fixed] = work.lower[fixed] = work.upper[fixed] = at
            before = np.setdiff1d(np.flatnonzero(pushing[n + m :]), rows)
            held = np.union1d(np.union1d(given, equal), before)
            work.lower[n + held] = work.upper[n + held] = (work.A @ x)[held]
        return x

    def _meet(self, work: QP, x: Array) -> None:
        """Move the sides that x misses by rounding to x: of dependent equalities, one set of digits holds them all."""
        n, value = self.n, work.A @ x
        low, high = work.lower[n:], work.upper[n:]
        close = (value >= low - 10.0 * GIVEN_WAY) & (value <= high + 10.0 * GIVEN_WAY)
        equal = close & (low == high)
        low[close] = np.where(equal, value, np.minimum(low, value))[close]
        high[close] = np.where(equal, value, np.maximum(high, value))[close]

    def _answer(
        self, qp: QP, last: QPSolution, flag: str, iterations: int, unit: Array, ends: tuple[Array, Array]
    ) -> Relaxed:
        x = np.clip(last.x, qp.lower[: self.n], qp.upper[: self.n])
        slack = qp.violation(x)[self.n :]
        return Relaxed(x, last.multipliers, flag, slack, slack > 10.0 * GIVEN_WAY * unit, *ends, iterations)


def relax(qp: QP, order: NDArray[np.int_], unit: Array | None = None) -> Relaxed:
    """:meth:`Relaxation.solve` with fresh solvers."""
    return Relaxation(qp.n, qp.m).solve(qp, order, unit)
