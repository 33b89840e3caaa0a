"""Generalised forces that nobody commanded, from joints and their rates alone."""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.validation import Array


class MomentumObserver:
    """What acts on a robot beside the forces that are known, by its generalised momentum p = M v:

        r = K (p - p0 - integral (tau + C'v - g + r) dt),     dr/dt = K (tau_ext - r)

    (De Luca, Albu-Schaeffer, Haddadin, Hirzinger, Collision detection and safe reaction with the DLR-III lightweight
    manipulator arm, IROS 2006, eq. 13 to 16). No accelerations are measured, no mass matrix is inverted. Where the
    torque of one joint alone is not what was commanded, its number alone is not 0.

        observer = MomentumObserver(robot.model, gain=50.0, dt=0.001)
        observer.begin(q, v)
        residual = observer.update(q, v, torque)            # every dt

    Args:
        model: with masses. gain: K [1/s]; the residual is late by 1 / K. dt: period [s].

    Attributes:
        residual: r ``[nv]`` [N m; N].

    Raises:
        RangeError: a gain or a period that is not above 0, K dt above 1, or a model with Pinocchio's own mimic joints,
            whose Coriolis matrix Pinocchio gets wrong (4.1); those of a :class:`wbc.robot.Robot` are none of these.
    """

    def __init__(self, model: pin.Model, gain: float, dt: float) -> None:
        for joint in model.mimicking_joints:
            raise RangeError(
                "model", model.names[joint], "is a mimic joint of Pinocchio, whose Coriolis matrix is wrong"
            )
        self._model, self._data = model, model.createData()
        self._dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
        self._gain = validation.scalar("gain", gain, low=0.0, high=1.0 / self._dt, open_low=True, unit="1/s")
        self.residual = np.zeros(model.nv)
        self._sum, self._drift = np.zeros((2, model.nv))

    def begin(self, q: Array, v: Array) -> None:
        """At a state, with no residual."""
        self.residual[:] = 0.0
        self._sum[:] = self._momentum(q, v)

    def update(self, q: Array, v: Array, torque: Array) -> Array:
        """A period on.

        Args:
            q, v: at its end. torque: known generalised forces in it, those of contacts too ``[nv]`` [N m; N].

        Returns:
            r ``[nv]`` [N m; N], which the next call writes over.
        """
        before = self._drift.copy()
        momentum = self._momentum(q, v)
        self._sum += self._dt * (torque + 0.5 * (before + self._drift) + self.residual)
        self.residual[:] = self._gain * (momentum - self._sum)
        return self.residual

    def _momentum(self, q: Array, v: Array) -> Array:
        """p; and C'v - g of this state is kept."""
        model, data = self._model, self._data
        coriolis = pin.computeCoriolisMatrix(model, data, q, v)
        self._drift[:] = coriolis.T @ v - pin.computeGeneralizedGravity(model, data, q)
        mass = pin.crba(model, data, q, pin.Convention.WORLD)
        return np.asarray(mass @ v)
