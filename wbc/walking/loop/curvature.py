"""What rates that last for a period do to a hand beside what its Jacobian says."""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.validation import Array

#: Along the world's axes, at the hand
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Curvature:
    """Rates v that last for a period dt take a hand from p to p + dt J v + dt^2 / 2 dJ/dt v: some microns beside where
    the controller has it, tick by tick. Held hands put the body where they are, and where three of them that may tilt
    are nearly on one line, these microns turn it about that line by a hundred times as much. So each held hand is told

        J v = -dt / 2 dJ/dt v

    in place of 0, with v of the tick before.

    Args:
        dt: control period [s].
    """

    def __init__(self, walker: Walker, dt: float) -> None:
        model = walker.robot.model
        self._model, self._data, self._dt = model, model.createData(), dt
        self._frames, self._none = [model.getFrameId(arm.hand) for arm in walker.arms], np.zeros(model.nv)

    def go(self, q: Array, v: Array) -> None:
        """The machine is in a configuration, with the rates of the last tick ``[nv]``."""
        pin.forwardKinematics(self._model, self._data, q, v, self._none)

    def drift(self, arm: int, times: float = 1.0) -> Array:
        """dt / 2 dJ/dt v of the hand of an arm [m/s], times a number."""
        bias = pin.getFrameClassicalAcceleration(self._model, self._data, self._frames[arm], WORLD)
        return np.asarray((0.5 * self._dt * times) * bias.linear)
