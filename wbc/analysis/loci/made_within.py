"""Exact Jacobians within a time: products of polynomials of many joints take long, and hear of no clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from flint import fmpq

from wbc.analysis.algebra.ring import Matrix
from wbc.analysis.jacobians.jacobian import symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel
from wbc.analysis.loci.child import Child, Report
from wbc.analysis.rows import Rows

#: Terms of a polynomial: powers, numerator, denominator
_Terms: TypeAlias = list[tuple[tuple[int, ...], int, int]]


def made_within(model: ExactModel, rows: Sequence[Rows], seconds: float) -> bool:
    """Whether the model knows the Jacobians of all declarations within a time; a process of their own makes them."""
    missing = [one for one in rows if (one, None) not in model.blocks]

    def work(report: Report) -> None:
        for one in missing:
            symbolic_jacobian(model, (one,))
            matrix, frame = model.blocks[one, None]
            report((one, _packed(matrix), frame))

    if missing:
        with Child(work, seconds) as child:
            child.wait()
        for one, packed, frame in child.reports:
            model.blocks.setdefault((one, None), (_unpacked(model, packed), frame))
    return all((one, None) in model.blocks for one in rows)


def _packed(matrix: Matrix) -> list[list[_Terms]]:
    """Polynomials of python-flint cannot be pickled; their terms can."""
    return [[[(tuple(map(int, e)), int(x.p), int(x.q)) for e, x in p.terms()] for p in row] for row in matrix]


def _unpacked(model: ExactModel, packed: list[list[_Terms]]) -> Matrix:
    ctx = model.ring.ctx
    return [[ctx.from_dict({e: fmpq(above, below) for e, above, below in terms}) for terms in row] for row in packed]
