"""What a controller believes of an arm: its equations of motion, by the thesis' recursion or by Pinocchio."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wbc import validation
from wbc.multibody import mass_matrix, pin
from wbc.published.newton_euler.links import SerialChain
from wbc.published.newton_euler.recursion import Equations, LinearModel, equations, linear_model
from wbc.validation import Array


class ArmDynamics(Protocol):
    """An arm on a fixed base with n joints, of which nq numbers say where they are."""

    n: int
    nq: int

    def equations(self, q: Array, v: Array) -> Equations:
        """H and h at positions q [nq] and velocities v [n]."""

    def linear_model(self, q: Array, v: Array, a: Array) -> LinearModel:
        """The model linearised about q [nq], v and a, [n] each."""

    def error(self, q: Array, wanted: Array) -> Array:
        """q (-) wanted [n], of positions [nq] each."""


class ByRecursion:
    """The thesis' own equations of its arms."""

    def __init__(self, arm: SerialChain) -> None:
        self.arm, self.n, self.nq = arm, arm.n, arm.n

    def equations(self, q: Array, v: Array) -> Equations:
        return equations(self.arm, q, v)

    def linear_model(self, q: Array, v: Array, a: Array) -> LinearModel:
        """By the product rule on the recursion."""
        return linear_model(self.arm, q, v, a)

    def error(self, q: Array, wanted: Array) -> Array:
        return np.asarray(q - wanted)


class Rigid:
    """The same of a ``pin.Model`` of any joints on a fixed base, by Pinocchio."""

    def __init__(self, model: pin.Model) -> None:
        self.model, self._data, self.n, self.nq = model, model.createData(), model.nv, model.nq

    def equations(self, q: Array, v: Array) -> Equations:
        model, data = self.model, self._data
        return Equations(mass_matrix(model, data, q), np.array(pin.nonLinearEffects(model, data, q, v)))

    def linear_model(self, q: Array, v: Array, a: Array) -> LinearModel:
        """By the derivatives of inverse dynamics."""
        by_q, by_v, _ = (np.array(x) for x in pin.computeRNEADerivatives(self.model, self._data, q, v, a))
        found = self.equations(q, v)
        return LinearModel(found.H, found.h, by_v, by_q)

    def error(self, q: Array, wanted: Array) -> Array:
        return np.asarray(pin.difference(self.model, wanted, q))


def dynamics_of(arm: SerialChain | ArmDynamics) -> ArmDynamics:
    """Of an arm put together from vectors the thesis' equations."""
    return ByRecursion(arm) if isinstance(arm, SerialChain) else arm


def measured(dynamics: ArmDynamics, q: Array, v: Array) -> tuple[Array, Array]:
    """Positions [nq] and velocities [n] as they were measured.

    Raises:
        ShapeError, NotFiniteError, RangeError: they are no such numbers.
    """
    sizes = (dynamics.nq,), (dynamics.n,)
    return validation.ordinary_array("q", q, sizes[0]), validation.ordinary_array("v", v, sizes[1])
