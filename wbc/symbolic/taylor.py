"""Jacobians by Taylor's series about a latched configuration: no trigonometry while the robot moves."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import ShapeError
from wbc.multibody import algebra
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics

Vector = NDArray[np.float64]


class TaylorJacobian:
    """J of rows e(q), approximated about q0, with s = q (-) q0:

        J_ik(q) ~ J_ik(q0) + sum_j J_ik,j s_j + 1/2 sum_jl J_ik,jl s_j s_l      (order 0, 1 or 2 of the terms)

    Entries are expanded along q0 (+) s, so that joints of every kind are covered; where q is a vector, J_ik,j is the
    Hessian of e_i. Its error is of order |s|^(order + 1).

    Source: M. Hirabayashi, MIT M.S. thesis, 1981, equations 3.25 to 3.32 (orders 0 and 1 of one arm).

    Args:
        kinematics: of any robot. rows: column of expressions in its ``q`` and in ``parameters``.
        order: 0, 1 or 2; None: no approximation. parameters: further symbols, one column.

    Raises:
        ShapeError: rows are no column. RangeError: no such order.
    """

    def __init__(
        self, kinematics: Kinematics, rows: ca.SX, order: int | None = 1, parameters: ca.SX | None = None
    ) -> None:
        if not isinstance(rows, ca.SX) or rows.shape[1] != 1:
            raise ShapeError("rows", rows, "expected a column of expressions")
        self.order = None if order is None else validation.integer("order", order, high=2)
        symbols = ca.SX(0, 1) if parameters is None else parameters
        q, s, n = kinematics.q, ca.SX.sym("s", kinematics.nv), kinematics.nv
        jacobian = ca.densify(ca.jacobian(rows, q) @ kinematics.tangent_map)
        self.rows, self._model, self._count = int(rows.shape[0]), kinematics.model, int(symbols.shape[0])
        self.value = SingleState(ca.Function("value", [q, symbols], [rows]))
        self._exact = SingleState(ca.Function("exact", [q, symbols], [jacobian]))
        terms = [ca.vec(ca.substitute(jacobian, q, kinematics.integrate(q, s)))]
        for _ in range(self.order or 0):
            terms.append(ca.vec(ca.jacobian(terms[-1], s)))
        at_rest = [ca.substitute(term, s, ca.SX.zeros(n, 1)) for term in terms]
        self._terms = SingleState(ca.Function("terms", [q, symbols], at_rest))
        self.latch(algebra(self._model).neutral(self._model), np.zeros(self._count))

    def latch(self, q: Vector, parameters: Sequence[float] | Vector = ()) -> None:
        """Expand about a configuration, and keep the parameters.

        Raises:
            ShapeError, NotFiniteError: they are none.
        """
        q = validation.ordinary_array("q", q, (self._model.nq,))
        self.parameters = validation.ordinary_array("parameters", parameters, (self._count,))
        self.q0, n = q, self._model.nv
        found = self._terms(q, self.parameters)
        #: J [rows, nv], its derivatives [rows, nv, nv] and [rows, nv, nv, nv], as far as the order has them
        self.terms = [term.reshape((self.rows, *(n,) * (k + 1)), order="F") for k, term in enumerate(found)]

    def at(self, q: Vector) -> Vector:
        """J [rows, nv] at a configuration, by the terms of the order, or exactly."""
        if self.order is None:
            return self._exact(q, self.parameters)[0]
        s = algebra(self._model).difference(self._model, self.q0, q)
        J: Vector = self.terms[0].copy()
        if self.order > 0:
            J += self.terms[1] @ s
        if self.order > 1:
            J += 0.5 * (self.terms[2] @ s) @ s
        return J
