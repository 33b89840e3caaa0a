"""How long a step of an explicit integrator may be before it blows up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.simulation.dynamics import Integrator
from wbc.validation import Array

#: Part of the stable step that is allowed
MARGIN = 0.9
#: A mode below this counts as none [1/s]
SLOW = 1e-3


def largest_step(mass: Array, stiffness: Array, damping: Array, rate: float, integrator: Integrator) -> float:
    """The longest step [s] at which every mode of M a + D v + K x = 0 and the drift of grips, exp(-rate t), decay:
    |R(h s)| <= 1 with R(z) = 1 + z + z^2/2 (midpoint) + z^3/6 + z^4/24 (rk4); infinite where nothing is stiff.

    Args:
        mass, stiffness, damping: M, K, D ``[nv, nv]``. rate: [1/s].
    """
    count = len(mass)
    state = np.block(
        [[np.zeros((count, count)), np.eye(count)], [-np.linalg.solve(mass, np.hstack([stiffness, damping]))]]
    )
    modes = np.append(np.linalg.eigvals(state), -rate)
    # The others move freely, whatever the step
    fast = modes[np.abs(modes) > SLOW]
    if not len(fast):
        return np.inf
    low, high = 0.0, 4.0 / float(np.abs(fast).max())
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _stable(middle * fast, integrator) else (low, middle)
    return MARGIN * low


def _stable(z: NDArray[np.complex128], integrator: Integrator) -> bool:
    growth = 1.0 + z + z**2 / 2.0
    if integrator == "rk4":
        growth = growth + z**3 / 6.0 + z**4 / 24.0
    # On the imaginary axis the midpoint grows by z^4 / 8 a step: slow modes may, by less than what anyone sees
    return bool((np.abs(growth) <= 1.0 + 1e-6).all())
