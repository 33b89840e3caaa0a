"""The best rates of a solution space under equality constraints, without iteration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import InfeasibleError, RangeError, ShapeError
from wbc.resolvers.fsp.compiled import library
from wbc.resolvers.fsp.criteria import Criterion
from wbc.resolvers.fsp.space import NOISE, RANK, SolutionSpace
from wbc.validation import Array

PLAIN = Criterion()


@dataclass(frozen=True, eq=False)
class EqualityRow:
    """A constraint a' v = value, such as a joint that returns into its range or a point that leaves an obstacle.

    Attributes:
        name: for errors and reports. a: [m]. value: of the rate, or of the step.

    The report has it as beta_i = a' g_i / value with sum t_i beta_i = 1 (eqs. 12 and 13), which has no value 0.
    """

    name: str
    a: Array
    value: float

    def __post_init__(self) -> None:
        a = validation.ordinary_array(f"{self.name}.a", self.a)
        if a.ndim != 1:
            raise ShapeError(f"{self.name}.a", self.a, "expected one number for each joint")
        object.__setattr__(self, "a", a)
        object.__setattr__(self, "value", validation.scalar(f"{self.name}.value", self.value))


def joint_row(name: str, joint: int, joints: int, step: float) -> EqualityRow:
    """v_l = step: eq. 13 of the report."""
    a = np.zeros(joints)
    a[validation.integer("joint", joint, high=joints - 1)] = 1.0
    return EqualityRow(name, a, step)


def point_row(name: str, J: Any, normal: Any, step: float) -> EqualityRow:
    """n' J v = step for a point of a link: eq. 12 of the report.

    Args:
        J: of the point [3, m], zero for joints beyond it. normal: unit vector [3], where the point shall go.

    Raises:
        RangeError: no unit vector. ShapeError, NotFiniteError: bad input.
    """
    n = validation.ordinary_array("normal", normal, (3,))
    if abs(np.linalg.norm(n) - 1.0) > 1e-6:
        raise RangeError("normal", normal, "expected a unit vector")
    J = validation.ordinary_array("J", J)
    if J.ndim != 2 or len(J) != 3:
        raise ShapeError("J", J.shape, "expected three rows")
    return EqualityRow(name, n @ J, step)


def lost_rows(J: Any, x: Any, rows: Sequence[int]) -> tuple[EqualityRow, ...]:
    """Rows of a task that a generator is to leave out, as constraints: where J is nearly singular the blocks are
    inverted without them, and they come back here (Rank_lost_betas of the report).
    """
    J, x = np.asarray(J, dtype=np.float64), np.asarray(x, dtype=np.float64)
    return tuple(EqualityRow(f"task row {k}", J[k], float(x[k])) for k in rows)


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best rates.

    Attributes:
        v: [m]. t: their coordinates, v = sum t_i g_i.
        kept, redundant, left_out: names of the constraints that decide, that follow from others, and that contradict
            earlier ones and were given up.
    """

    v: Array
    t: Array
    kept: tuple[str, ...] = ()
    redundant: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def best(
    space: SolutionSpace, criterion: Criterion = PLAIN, rows: Sequence[EqualityRow] = (), *, in_order: bool = False
) -> Optimum:
    """The v of the space with the least (v - r)' H (v - r) and a_k' v = value_k, by the null-space form:

        v = g_1 + D' z,   D the self-motions,   min over z,   (A D') z = values - A g_1

    It is eq. 11 where the Gram matrix is regular (:func:`parametric`), and holds where it is not, as for x = 0.

    Args:
        in_order: constraints that contradict earlier ones are left out; else they are an error.

    Raises:
        InfeasibleError: constraints contradict each other or the task; ``value`` has their names.
        ShapeError: a criterion or constraint about other joints.
    """
    m = space.J.shape[1]
    criterion.check(m)
    if any(len(row.a) != m for row in rows):
        raise ShapeError("rows", [len(row.a) for row in rows], f"expected {m} numbers in each")
    # In u = L' v, H = L L', the criterion is the plain distance
    V, A = (
        criterion.scaled(np.asarray(space.vectors, dtype=np.float64)),
        criterion.unscaled(np.array([row.a for row in rows]).reshape(-1, m)),
    )
    r = np.zeros(m) if criterion.reference is None else criterion.scaled(criterion.reference)
    values = np.array([row.value for row in rows], dtype=np.float64)
    t = _coordinates(V, r, A, values)
    names: tuple[tuple[str, ...], ...] = (tuple(row.name for row in rows), (), ())
    if t is None:
        Q = np.linalg.qr((V[1:] - V[0]).T)[0]
        names = _independent(A, Q, space.vectors[0], rows, in_order)
        some = [k for k, row in enumerate(rows) if row.name in names[0]]
        t = _coordinates(V, r, A[some], values[some])
        assert t is not None
    return Optimum(t @ space.vectors, t, *names)


def one_shot(J: Array, x: Array, A: Array, values: Array, criterion: Criterion = PLAIN) -> Array | None:
    """The same v from one factorisation of [J; A], without the vectors of the space; None where its rows are dependent.

    With u = L' (v - r), H = L L', it is the least |u| with [J; A] L'^-1 u = [x; values] - [J; A] r.
    """
    J, x, A, values = (np.asarray(one, dtype=np.float64) for one in (J, x, A, values))
    r = criterion.reference
    if r is not None:
        x, values = x - J @ r, values - A @ r
    if criterion.weight is not None:
        J, A = criterion.unscaled(J), criterion.unscaled(A)
    (n, m), p = J.shape, len(A)
    if functions := library(n + p + m):
        u = np.empty(m)
        found = None if functions.wbc_least(J, x, A, values, u, n, p, m) else u
    else:
        F = np.concatenate((J, A))
        found = _least(F, np.concatenate((x, values)), np.sqrt((F * F).sum(axis=1)))
    if found is None:
        return None
    u = criterion.unscaled(found, back=True)
    return np.asarray(u if r is None else u + r)


def _coordinates(V: Array, r: Array, A: Array, values: Array) -> Array | None:
    """t of a space's [K, m] point nearest to r with A v = values; None where rows of A are dependent in the space."""
    (K, m), p = V.shape, len(A)
    t = np.empty(K)
    if functions := library(K + p + m):
        failed = functions.wbc_coordinates(V, r, A, values, t, K, p, m)
    else:
        D = V[1:] - V[0]
        Q, R = np.linalg.qr(D.T)
        failed = 2 * bool(m + 1 < K or (np.abs(R.diagonal()) <= RANK * np.sqrt((D * D).sum(axis=1))).any())
        y = Q.T @ (r - V[0])
        more = _least(A @ Q, values - A @ (V[0] + Q @ y), np.sqrt((A * A).sum(axis=1)))
        failed = failed or more is None
        if more is not None and not failed:
            t[1:] = np.linalg.solve(R, y + more)
            t[0] = 1.0 - t[1:].sum()
    if failed == 2:
        raise RangeError("vectors", V, "the vectors of the space are dependent")
    return None if failed else t


def _least(C: Array, off: Array, sizes: Array) -> Array | None:
    """The least y with C y = off, None where a row has nothing of its size beside the others."""
    k, n = C.shape
    if not k:
        return np.zeros(n)
    Q, R = np.linalg.qr(C.T)
    if k > n or (np.abs(R.diagonal()) <= np.maximum(RANK * sizes, NOISE * sizes.max())).any():
        return None
    return np.asarray(Q @ np.linalg.solve(R.T, off))


def _independent(
    A: Array, Q: Array, g: Array, rows: Sequence[EqualityRow], in_order: bool
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Names of rows that decide, that follow from earlier ones, and that contradict them; Q: basis of the self-motions.

    Raises:
        InfeasibleError: one does, and nothing shall be left out.
    """
    kept: list[str] = []
    redundant: list[str] = []
    out: list[str] = []
    axes, values, mixes = np.zeros((0, Q.shape[1])), np.zeros(0), np.zeros((0, len(rows)))
    for k, row in enumerate(rows):
        c, size = A[k] @ Q, float(np.linalg.norm(A[k]))
        value, mix = row.value - float(row.a @ g), np.eye(len(rows))[k]
        for _ in range(2):
            along = axes @ c
            c, value, mix = c - along @ axes, value - float(along @ values), mix - along @ mixes
        left = float(np.linalg.norm(c))
        if left > RANK * size:
            axes, values = np.vstack((axes, c / left)), np.append(values, value / left)
            mixes = np.vstack((mixes, mix / left))
            kept.append(row.name)
            continue
        scale = abs(row.value) + float(np.abs(row.a) @ np.abs(g)) + float(np.abs(mix) @ [abs(r.value) for r in rows])
        if abs(value) <= 1e-9 * scale:
            redundant.append(row.name)
        elif in_order:
            out.append(row.name)
        else:
            names = tuple(r.name for r, part in zip(rows, mix, strict=True) if abs(part) > 1e-9 * np.abs(mix).max())
            what = "contradict each other within the task" if len(names) > 1 else "contradicts the task"
            raise InfeasibleError("rows", names, f"{' and '.join(names)} {what}, by {abs(value):.3g}")
    return tuple(kept), tuple(redundant), tuple(out)


def parametric(
    space: SolutionSpace, rows: Sequence[EqualityRow] = (), *, weight: Array | None = None, null: bool = False
) -> Array:
    """t of the least v' H v by the report's closed form (eqs. 9 to 11):

        t = G^-1 C (C' G^-1 C)^-1 c,   C = [e, beta_1 ...],   c = (1, 1 ...),  for the null space (0, 1 ...)

    Here the rows of C are a_k' g_i and c has their values, which is the same times d_k.

    Raises:
        RangeError: the Gram matrix is singular (x = 0), or constraints are dependent or more than M - N.
    """
    G = space.gram(weight)
    C = np.column_stack([np.ones(space.span), *(space.vectors @ row.a for row in rows)])
    c = np.array([0.0 if null else 1.0, *(row.value for row in rows)])
    try:
        through = np.linalg.solve(G, C)
        t = through @ np.linalg.solve(C.T @ through, c)
    except np.linalg.LinAlgError:
        t = np.full(space.span, np.nan)
    # Twice, as G is the square of the vectors: the first answer corrects itself
    if not np.isfinite(t).all() or not np.allclose(C.T @ t, c, rtol=1e-6, atol=1e-9):
        raise RangeError("space", space.condition(weight), "the closed form needs regular Gram and constraint matrices")
    return np.asarray(t)
