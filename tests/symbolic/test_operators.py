"""Quick operators of SX make the expressions that CasADi's own make, and are gone afterwards."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.sparse import csc_matrix

from wbc.symbolic.operators import quick_operators

BINARY = [operator.add, operator.sub, operator.mul, operator.truediv]
IN_PLACE = [operator.iadd, operator.isub, operator.imul, operator.itruediv]


def symbol(name: str, rows: int, columns: int) -> ca.SX:
    return ca.SX.sym(name, rows, columns)


PAIRS: list[tuple[Any, Any]] = [
    (symbol("a", 3, 2), symbol("b", 3, 2)),
    (symbol("a", 3, 2), symbol("b", 1, 1)),
    (symbol("a", 1, 1), symbol("b", 3, 2)),
    (ca.SX.sym("a", ca.Sparsity.lower(3)), ca.SX.sym("b", ca.Sparsity.upper(3))),
    (ca.SX.sym("a", ca.Sparsity.lower(3)), 2.0),
    (2, symbol("b", 2, 2)),
    (symbol("a", 2, 2), True),
    (0.0, ca.SX(2, 2)),
    (symbol("a", 2, 1), np.array([1.0, 2.0])),
    (symbol("a", 2, 1), np.float64(2.0)),
    (symbol("a", 2, 1), ca.DM([1.0, 2.0])),
    (ca.DM([1.0, 2.0]), symbol("b", 2, 1)),
]


def same(made: Callable[[], Any], a: Any, b: Any) -> None:
    symbols = [x for x in (a, b) if isinstance(x, ca.SX)]
    arguments = [ca.symvar(x)[k] for x in symbols for k in range(len(ca.symvar(x)))]
    before = ca.Function("f", arguments, [made()]).serialize()
    with quick_operators():
        assert ca.Function("f", arguments, [made()]).serialize() == before


@pytest.mark.parametrize("act", BINARY)
@pytest.mark.parametrize("pair", range(len(PAIRS)))
def test_expressions_are_the_same(act: Callable[[Any, Any], Any], pair: int) -> None:
    a, b = PAIRS[pair]
    same(lambda: act(a, b), a, b)


@pytest.mark.parametrize("act", IN_PLACE)
def test_in_place_too_and_what_was_is_left(act: Callable[[Any, Any], Any]) -> None:
    a, b = symbol("a", 2, 2), symbol("b", 2, 2)

    def made() -> ca.SX:
        c = kept = +a
        c = act(c, b)
        assert ca.is_equal(kept, a, 3)
        return c

    same(made, a, b)


@pytest.mark.parametrize("act", BINARY)
def test_sizes_that_do_not_fit_are_refused(act: Callable[[Any, Any], Any]) -> None:
    a, b = symbol("a", 3, 2), symbol("b", 2, 2)
    with quick_operators(), pytest.raises(RuntimeError, match="Dimension mismatch"):
        act(a, b)
    with quick_operators(), pytest.raises((NotImplementedError, TypeError)):
        act(a, "b")


def test_they_are_gone_after_the_last_of_those_who_asked() -> None:
    own = ca.SX.__add__
    with quick_operators():
        quick = ca.SX.__add__
        assert quick is not own
        with quick_operators():
            assert ca.SX.__add__ is quick
        assert ca.SX.__add__ is quick
    assert ca.SX.__add__ is own
    with pytest.raises(ValueError, match="ended"), quick_operators():
        raise ValueError("ended")
    assert ca.SX.__add__ is own


@pytest.mark.parametrize("x", [symbol("a", 3, 2), ca.SX(0, 1), ca.SX.sym("a", ca.Sparsity.lower(3))])
def test_shapes_are_the_same(x: ca.SX) -> None:
    with quick_operators():
        assert x.shape == (x.size1(), x.size2())


def test_arrays_and_sparse_matrices_are_taken_as_before() -> None:
    x = symbol("a", 2, 2)
    for given in (np.arange(4.0).reshape(2, 2), csc_matrix(np.diag([1.0, 2.0])), np.eye(2, dtype=int), 2.0):
        same(lambda given=given: ca.mtimes(ca.SX(given), x) if np.ndim(given) else x * given, x, None)
