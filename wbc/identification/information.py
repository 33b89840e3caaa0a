"""What a motion shows of parameters, and what it does not: the information that torques have gathered about them.

    Lambda = int Y'Y dt / noise^2,   std(w'phi) >= sqrt(w' Lambda^-1 w)

by Cramer and Rao: no estimator that is right on average is more exact, whatever it claims. A slow motion shows no
moments of inertia, and without gravity no masses either.
"""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.validation import Array

#: Directions with less than this part of the largest information, each parameter in units of its own, are not shown
LEAST = 1e-12


class Information:
    """Gathers information of n parameters.

    Args:
        count: n. noise: of each torque, a standard deviation over one second [N m or N].
    """

    def __init__(self, count: int, noise: float) -> None:
        self.noise = validation.scalar("noise", noise, low=0.0, open_low=True)
        self._gathered = np.zeros((count, count))
        self.time = 0.0

    def add(self, Y: Array, dt: float) -> None:
        """Torques Y phi of a regressor ``[rows, n]`` were there for a time [s]."""
        self._gathered += dt * (Y.T @ Y)
        self.time += dt

    def deviation(self, weights: Array) -> float:
        """Least standard deviation of weights' phi; infinite where the motion shows nothing of it.

        Raises:
            ShapeError, NotFiniteError: no n numbers.
        """
        w = validation.ordinary_array("weights", weights, (len(self._gathered),))
        sizes = np.sqrt(np.diag(self._gathered))
        seen = sizes > 0.0
        if w[~seen].any():
            return float("inf")
        scaled = self._gathered[np.ix_(seen, seen)] / np.outer(sizes[seen], sizes[seen])
        values, vectors = np.linalg.eigh(scaled)
        parts = vectors.T @ (w[seen] / sizes[seen])
        lost = values <= LEAST * values[-1]
        if np.linalg.norm(parts[lost]) > 1e-6 * np.linalg.norm(parts):
            return float("inf")
        kept = ~lost
        return float(self.noise * np.sqrt((parts[kept] ** 2 / values[kept]).sum()))

    def claims(self, weights: Array, within: float) -> bool:
        """Whether weights' phi can be claimed to be known within so much, by two standard deviations."""
        return 2.0 * self.deviation(weights) <= validation.scalar("within", within, low=0.0)
