"""Momentum of a robot, and what of it it has given away."""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.validation import Array


class Balance:
    """What a robot gives to what it holds on to or stands on: momentum that it had, and got from gravity, and has no
    more.

    Momenta are (linear; angular about the world's origin) [N s, N m s]. What rotors of motors carry is in the joints'
    equations alone, as is usual.
    """

    def __init__(self, model: pin.Model) -> None:
        self._model, self._data = model, model.createData()
        self._weight = pin.computeTotalMass(model) * np.array(model.gravity.linear)
        #: Whether there is gravity at all
        self.falls = bool(self._weight.any())

    def momentum(self, q: Array, v: Array) -> Array:
        """``[6]``."""
        data = self._data
        out = np.array(pin.computeCentroidalMomentum(self._model, data, q, v).vector)
        out[3:] += pin.skew(data.com[0]) @ out[:3]
        return out

    def by_gravity(self, q: Array, h: float) -> Array:
        """In a time h [s]."""
        place = pin.centerOfMass(self._model, self._data, q)
        (a, b, c), (x, y, z) = place.tolist(), self._weight.tolist()
        return h * np.array([x, y, z, b * z - c * y, c * x - a * z, a * y - b * x])
