"""What the QP of a torque tick costs by forms: equalities kept or eliminated, dense or sparse."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import thread_time
from typing import Any

import numpy as np
import osqp
from scipy import sparse

from bench.measured.torques import fixed_arm, humanoid, near, two_grips
from bench.sheet import Sheet, us
from wbc.api import Stack
from wbc.controller import core_of
from wbc.qp.problem import QP
from wbc.qp.solvers.daqp import Daqp
from wbc.tasks import TorqueLimits

#: States of each robot, how often each is solved, and the tolerance that OSQP is asked for
STATES, TURNS, NEAR = 24, 7, 1e-7


def parts() -> dict[str, Sheet | str]:
    """Three robots; the least of some turns, median over states, processor time."""
    rows = []
    stacks = {
        "Panda, hand and posture": (fixed_arm().add(TorqueLimits()), 0.05),
        "three-armed walker, two grips": (two_grips(), 0.001),
        "Talos, two surface contacts and a hand": (humanoid(), 0.002),
    }
    for name, (stack, spread) in stacks.items():
        problems = qps(stack, spread)
        n, m = problems[0].A.shape[1], problems[0].A.shape[0]
        solvers = Daqp(n, m), Eliminated(problems[0]), Sparse(problems)
        found = [cost(solver.solve, problems) for solver in solvers]
        assert all(np.abs(a - b).max() < 1e-6 * np.abs(a).max() for a, b in zip(found[0][1], found[1][1], strict=True))
        off = max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in zip(found[0][1], found[2][1], strict=True))
        rows.append((name, f"{n}, {m}", *(us(1e6 * seconds) for seconds, _ in found), f"{off:.0e}"))
    columns = (
        "one QP, median [us of processor time]",
        "variables, rows",
        "all kept, dense (DAQP)",
        "equalities eliminated, dense (numpy, DAQP)",
        "all kept, sparse (OSQP)",
        "OSQP's answers off by",
    )
    return {"cost": Sheet("", columns, rows)}


def qps(stack: Stack, spread: float) -> list[QP]:
    """Those of solved ticks at random states."""
    tick, out = stack.compile(command="torque", backend="vm"), []
    core = core_of(tick)
    for q in near(stack.robot, spread)[:STATES]:
        tick.reset(stack.robot.neutral)
        tick.step(q, np.zeros(stack.robot.nv))
        out.append(scaled(core.tick.qp()))
    return out


def scaled(qp: QP) -> QP:
    """In variables whose cost has curvature 1, rows of length 1: N and rad/s^2 differ by orders of magnitude."""
    column = 1.0 / np.sqrt(np.diag(qp.H))
    A = qp.A * column
    row = 1.0 / np.linalg.norm(A, axis=1)
    ends = np.concatenate([1.0 / column, row])
    return QP(qp.H * np.outer(column, column), qp.g * column, qp.lower * ends, qp.upper * ends, A * row[:, None])


def cost(solve: Callable[[QP], Any], problems: list[QP]) -> tuple[float, list[np.ndarray]]:
    """(median over the problems of the least of some turns [s], answers)."""
    best, answers = np.full(len(problems), np.inf), []
    for turn in range(TURNS):
        for k, qp in enumerate(problems):
            begun = thread_time()
            found = solve(qp)
            best[k] = min(best[k], thread_time() - begun)
            if turn == TURNS - 1:
                answers.append(np.array(found.x)[: qp.A.shape[1]])
    return float(np.median(best)), answers


class Eliminated:
    """x = x0 + Z y, the columns of Z orthonormal and across the equality rows: fewer variables, and bounds are rows."""

    def __init__(self, first: QP) -> None:
        n, m = first.A.shape[1], first.A.shape[0]
        self._equal = first.lower[n:] == first.upper[n:]
        self._left = n - int(self._equal.sum())
        self._inner = Daqp(self._left, n + m - (n - self._left))
        self._free = np.full(self._left, np.inf)

    def solve(self, qp: QP) -> Any:
        """Eliminate, solve, and put the variables back."""
        n, k = qp.A.shape[1], qp.A.shape[1] - self._left
        rows, equal = qp.A[self._equal], self._equal
        if k:
            basis, triangle = np.linalg.qr(rows.T, mode="complete")
            start = basis[:, :k] @ np.linalg.solve(triangle[:k].T, qp.lower[n:][equal])
            Z = basis[:, k:]
        else:
            start, Z = np.zeros(n), np.eye(n)
        A = np.vstack([Z, qp.A[~equal] @ Z])
        at = np.concatenate([start, qp.A[~equal] @ start])
        keep = np.concatenate([np.ones(n, bool), ~equal])
        H = Z.T @ qp.H @ Z
        lower = np.concatenate([-self._free, qp.lower[keep] - at])
        upper = np.concatenate([self._free, qp.upper[keep] - at])
        found = self._inner.solve(QP(0.5 * (H + H.T), Z.T @ (qp.g + qp.H @ start), lower, upper, A))
        return replace(found, x=start + Z @ found.x)


class Sparse:
    """The same by OSQP in the pattern of all problems together; the workspace is kept and its values are updated."""

    def __init__(self, problems: list[QP]) -> None:
        self._seen = np.any([qp.A != 0.0 for qp in problems], axis=0)
        self._hessian = np.triu(np.any([qp.H != 0.0 for qp in problems], axis=0))
        n, m = problems[0].A.shape[1], problems[0].A.shape[0]
        self._bounds = np.eye(n, dtype=bool)
        self._solver = osqp.OSQP()
        first = problems[0]
        P = sparse.csc_matrix(np.where(self._hessian, 1.0, 0.0))
        A = sparse.csc_matrix(np.vstack([self._bounds, self._seen]).astype(float))
        far = np.full(n + m, 1e30)
        P.data[:] = first.H.T[self._hessian.T]
        self._solver.setup(P, first.g, A, -far, far, eps_abs=NEAR, eps_rel=NEAR, max_iter=20_000, verbose=False)

    def solve(self, qp: QP) -> Any:
        """Update and solve."""
        wide = np.vstack([np.eye(qp.A.shape[1]), qp.A])
        pattern = np.vstack([self._bounds, self._seen])
        self._solver.update(q=qp.g, l=np.maximum(qp.lower, -1e30), u=np.minimum(qp.upper, 1e30))
        self._solver.update(Px=qp.H.T[self._hessian.T], Ax=wide.T[pattern.T])
        return self._solver.solve(raise_error=False)
