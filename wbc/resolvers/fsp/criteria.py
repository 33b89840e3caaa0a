"""What makes one solution of a task better than another: quadratic criteria of rates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Criterion:
    """The least (v - r)' H (v - r).

    Attributes:
        weight: H, symmetric and positive definite [m, m], or its diagonal [m]; None: the identity. A joint with twice
            the weight moves less. The report's B = diag(b) is the diagonal b^2 (eq. 14), which makes joints with a
            small b move more.
        reference: r [m]; None: zero.

    Source: ORNL/TM-13096, sections 4.1.2 and 4.1.5: reference vector B and matrix H of its criterion modules, of which
    the report has least norm alone.

    Raises:
        ShapeError, NotFiniteError, RangeError: no such matrix or vector.
    """

    weight: Array | None = None
    reference: Array | None = None

    def __post_init__(self) -> None:
        if self.reference is not None:
            r = validation.ordinary_array("reference", self.reference)
            if r.ndim != 1:
                raise ShapeError("reference", self.reference, "expected one number for each joint")
            object.__setattr__(self, "reference", r)
        if self.weight is None:
            return
        H = validation.ordinary_array("weight", self.weight)
        if H.ndim not in (1, 2) or not H.size or (H.ndim == 2 and not _symmetric(H)):
            raise ShapeError("weight", self.weight, "expected a symmetric matrix, or its diagonal")
        if (H if H.ndim == 1 else np.linalg.eigvalsh(H)).min() <= 0.0:
            raise RangeError("weight", self.weight, "expected a positive definite matrix")
        object.__setattr__(self, "weight", H)

    def __call__(self, v: Any) -> float:
        """Its value at rates v [m]."""
        off = v if self.reference is None else v - self.reference
        return float(off @ self.times(off))

    def times(self, v: Array) -> Array:
        """H v, or H v' for rates in rows."""
        if self.weight is None:
            return v
        return np.asarray(v * self.weight if self.weight.ndim == 1 else v @ self.weight)

    @cached_property
    def root(self) -> Array:
        """L of H = L L', or its diagonal."""
        H = np.ones(1) if self.weight is None else self.weight
        return np.asarray(np.sqrt(H) if H.ndim == 1 else np.linalg.cholesky(H))

    def scaled(self, v: Array) -> Array:
        """L' v, or that of rates in rows."""
        if self.weight is None:
            return v
        return np.asarray(v * self.root if self.root.ndim == 1 else v @ self.root)

    def unscaled(self, a: Array, back: bool = False) -> Array:
        """L^-1 a of rows that act on rates, in rows; ``back``: L'^-1 u, the rates of scaled ones."""
        if self.weight is None:
            return a
        if self.root.ndim == 1:
            return np.asarray(a / self.root)
        return np.asarray(np.linalg.solve(self.root.T if back else self.root, a.T).T)

    def check(self, joints: int) -> None:
        """Whether it is about so many joints.

        Raises:
            ShapeError: it is not.
        """
        for name, value in (("weight", self.weight), ("reference", self.reference)):
            if value is not None and len(value) != joints:
                raise ShapeError(f"criterion.{name}", value.shape, f"expected {joints} joints")


def least_torque(inertia: Any, bias: Any, v: Any, dt: float, weight: Any = None) -> Criterion:
    """The least tau' W tau, tau = A (v+ - v) / dt + b, of the rates v+ of the next tick.

    Args:
        inertia: A [m, m]. bias: b, Coriolis and gravity [m]. v: rates now [m]. dt: [s]. weight: W, its diagonal [m];
            None: the identity. Least acceleration is this with an inertia of 1 and no bias.

    Raises:
        WbcError: bad input.
    """
    A, b, now, dt = _dynamics(inertia, bias, v, dt)
    W = np.ones(len(b)) if weight is None else validation.ordinary_array("weight", weight, b.shape)
    return Criterion(A @ (W[:, None] * A) / dt**2, now - dt * np.linalg.solve(A, b))


def least_power(inertia: Any, bias: Any, v: Any, dt: float) -> Criterion:
    """The least mechanical power v+' tau, tau = A (v+ - v) / dt + b: arguments as of :func:`least_torque`.

    Raises:
        WbcError: bad input.
    """
    A, b, now, dt = _dynamics(inertia, bias, v, dt)
    return Criterion(A / dt, 0.5 * (now - dt * np.linalg.solve(A, b)))


def least_acceleration(v: Any, weight: Any = None) -> Criterion:
    """The least (v+ - v)' W (v+ - v), W its matrix or diagonal.

    Raises:
        WbcError: bad input.
    """
    return Criterion(weight, v)


def _dynamics(inertia: Any, bias: Any, v: Any, dt: float) -> tuple[Array, Array, Array, float]:
    b = validation.ordinary_array("bias", bias)
    A = validation.ordinary_array("inertia", inertia, (len(b), len(b)))
    if not _symmetric(A) or np.linalg.eigvalsh(A).min() <= 0.0:
        raise RangeError("inertia", inertia, "expected a symmetric positive definite matrix")
    now = validation.ordinary_array("v", v, b.shape)
    return A, b, now, validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")


def _symmetric(H: Array) -> bool:
    return H.shape[0] == H.shape[1] and bool(np.allclose(H, H.T))
