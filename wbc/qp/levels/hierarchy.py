"""Strict levels of least squares over common rows, as :class:`wbc.qp.levels.cascade.Cascade` takes and answers them.

Variables x are counted in their own units (radians, characteristic lengths), rows in theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array


@dataclass(eq=False, slots=True)
class Level:
    """One level:   minimise 1/2 |W^(1/2) (rows x - b)|^2 + 1/2 s' diag(soft_weight) s   over what earlier levels leave.

    Attributes:
        rows: [m, n]. weight: W, at most 1 [m]. wanted: rows' W b [n].
        soft: general rows whose violation s is minimised here, and which hold from then on. soft_weight: of each s^2.
        bent: None, or two matrices [n, n]: what is added to rows' W rows and makes it positive definite, and the
            curvature in it; the directions in which that is large are taken as well, and nothing else is damped.
    """

    rows: Array
    weight: Array
    wanted: Array
    soft: NDArray[np.intp]
    soft_weight: Array
    bent: tuple[Array, Array] | None = None


@dataclass(eq=False, slots=True)
class Hierarchy:
    """Levels over   lower <= [1; A] x <= upper, n + m rows; those in ``soft`` of a level hold from there on.

    Attributes:
        x: where the cascade begins: on the equalities, and within the other sides or as far outside as they may be [n].
    """

    x: Array
    lower: Array
    upper: Array
    A: Array
    levels: list[Level]


@dataclass(eq=False, slots=True)
class Achieved:
    """What became of one level; the last of :attr:`Answer.levels` is the least x of all that is left.

    Attributes:
        x: its optimum [n].
        rank: directions that it takes. free: directions that it leaves.
        singular: least singular value of the directions that it takes; inf if it takes none.
        damping: |W^(1/2) rows (x - x without damping)|, or a bound on it.
        stationarity, complementarity: residuals of the optimality conditions, in units of rows.
        error: bound on the error of x for the rows that bind and the optimum of earlier levels as they were found.
        disturbance: largest change of its rows by later levels.
        share: part of each row, 0 to 1, that earlier levels and equalities leave free [m].
        solved: its optimum was found; else x is that of the level before.
    """

    x: Array
    rank: int
    free: int
    singular: float
    damping: float
    stationarity: float
    complementarity: float
    error: float
    share: Array
    solved: bool
    disturbance: float = 0.0


@dataclass(eq=False, slots=True)
class Answer:
    """Answer of a cascade.

    Attributes:
        x: [n].
        multipliers: of each row, from the first level at which it pushes, in units of that level [n + m].
        pushes: place of that level, -1 for rows that push at none [n + m].
        dropped: of equality rows that depend on others, by how much they are off; -1 for all others [m].
        levels: one for each level, and the least x of what is left.
        iterations: of all solver calls together.
    """

    x: Array
    multipliers: Array
    pushes: NDArray[np.int_]
    dropped: Array
    levels: list[Achieved]
    iterations: int
