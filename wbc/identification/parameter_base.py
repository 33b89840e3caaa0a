"""What a motion can show of parameters at all: the base parameters, and of which others each is the sum.

    Y P = Q R (columns in order of what they add),   beta = phi_1 + (R_1^-1 R_2) phi_2,   tau = Y_1 beta

Source: Gautier 1991, Numerical calculation of the base inertial parameters of robots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from wbc import validation
from wbc.errors import ShapeError
from wbc.identification.regression import Regression
from wbc.validation import Array

#: A column that adds less than this part of its own length depends on the others
DEPENDENT = 1e-8
#: A column below this part of the largest is what rounding left of zero
NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Independent columns of a stacked regressor.

    Attributes:
        columns: of the independent ones, as they are numbered in phi. combination: ``[base, columns of phi]``, with
            beta = combination phi. condition: of the independent columns, each scaled to length 1.
    """

    columns: tuple[int, ...]
    combination: Array
    condition: float

    @property
    def count(self) -> int:
        """How many numbers the motion shows."""
        return len(self.columns)

    def shows(self, weights: Array) -> bool:
        """Whether weights' phi is a sum of base parameters: what is not cannot be known from this motion.

        Raises:
            ShapeError, NotFiniteError: no number for each of phi.
        """
        w = validation.ordinary_array("weights", weights, (self.combination.shape[1],))
        rest = w - self.combination.T @ w[list(self.columns)]
        return float(np.linalg.norm(rest)) <= 1e-6 * max(float(np.linalg.norm(w)), 1e-300)

    def text(self, names: Sequence[str], largest: int = 6) -> list[str]:
        """A line for each base parameter, as the sum that it is."""
        out = []
        for row in self.combination:
            parts = [(float(x), name) for x, name in zip(row, names, strict=True) if abs(float(x)) > 1e-6]
            parts.sort(key=lambda part: -abs(part[0]))
            more = f" + {len(parts) - largest} more" if len(parts) > largest else ""
            out.append(" ".join(f"{x:+.4g} {name}" for x, name in parts[:largest]) + more)
        return out


def base_parameters(W: Array, tolerance: float = DEPENDENT) -> BaseParameters:
    """The base parameters of a stacked regressor ``[rows, columns]``.

    Raises:
        ShapeError, NotFiniteError: no matrix, or one of zeros.
    """
    W = validation.ordinary_array("W", W)
    if W.ndim != 2 or not W.any():
        raise ShapeError("W", W.shape, "expected a regressor that is not zero")
    # Columns of one length: kilograms and kg m^2 do not decide what counts as small
    sizes = np.linalg.norm(W, axis=0)
    zero = sizes <= NOTHING * sizes.max()
    W, scale = np.where(zero, 0.0, W), np.where(zero, 1.0, sizes)
    R, order = qr(W / scale, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(R))
    rank = int((diagonal > tolerance * diagonal[0]).sum())
    first, rest = order[:rank], order[rank:]
    R_1 = R[:rank, :rank]
    combination = np.zeros((rank, W.shape[1]))
    combination[np.arange(rank), first] = 1.0
    combination[:, rest] = solve_triangular(R_1, R[:rank, rank:]) * scale[rest] / scale[first][:, None]
    combination[np.abs(combination) < 1e-9] = 0.0
    values = np.linalg.svd(R_1, compute_uv=False)
    ascending = np.argsort(first)
    return BaseParameters(
        tuple(int(k) for k in first[ascending]), combination[ascending], float(values[0] / values[-1])
    )


def identifiable(regression: Regression, states: int = 200, seed: int = 0) -> BaseParameters:
    """The base parameters of a robot over random states: no motion shows more."""
    robot, random = regression.robot, np.random.default_rng(validation.integer("seed", seed))
    q = np.array(
        [robot.random(int(random.integers(2**31))) for _ in range(validation.integer("states", states, low=1))]
    )
    v, a = random.normal(size=(2, states, robot.nv))
    return base_parameters(regression.matrix(q, v, a))
