"""Absolute stability of a sampled two-port with delay: Llewellyn's criterion, and no pole outside the unit circle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.validation import Array

#: Frequencies at which stability is judged at first
POINTS = 4096
#: Frequencies at which it is judged, at most
MOST = 2**20
#: What rounding may take from the criterion
ROUNDING = 1e-9


class Side(NamedTuple):
    """One device with its channels: mass over dt, damping beyond the reserve, stiffness times dt, and the others."""

    mass: float
    damping: float
    stiffness: float
    rate: float
    remote: float
    local: float


def absolute_stability(master: Side, slave: Side, forward: int, backward: int, dt: float) -> str:
    """What breaks stability with any passive operator and environment; empty if nothing does.

    With w = 1/z and velocities u over a period, (Z + C) u = (1 - local) f + C w^n u_r + remote w^n f_r where
    Z = m (1 - w) / dt + d and C = K dt w / (1 - w) + B w. Of the admittances Y that follow, at all |w| = 1

        Re Y11 >= 0,   Re Y22 >= 0,   2 Re Y11 Re Y22 - Re(Y12 Y21) - |Y12 Y21| >= 0,

    and the denominator (1 - w)^2 det has no zero in |w| < 1 (winding number).

    Args:
        forward, backward: delay [ticks].
    """
    points = POINTS
    while True:
        # Also frequencies far below the even grid's first
        even = (np.arange(points) + 0.5) * np.pi / points
        angles = np.concatenate((np.geomspace(1e-3, 1.0, 400, endpoint=False) * even[0], even))
        w = np.exp(-1j * angles)
        denominator, Y = _admittances(master, slave, forward, backward, w)
        steps = np.angle(denominator[1:] / denominator[:-1])
        if np.abs(steps).max() < 0.5 or points >= MOST:
            break
        points *= 4
    # It is real at both ends of the half circle, and clockwise each zero inside turns it back once on the whole
    first, last = np.angle(denominator[[0, -1]] * np.sign(denominator[[0, -1]].real))
    turns = -round(float(first + steps.sum() - last) / np.pi)
    if turns != 0:
        return f"the teleoperator is unstable by itself, with {turns} poles outside the unit circle"
    product = Y[0][1] * Y[1][0]
    size = 2.0 * np.abs(Y[0][0].real * Y[1][1].real) + 2.0 * np.abs(product)
    excess = 2.0 * Y[0][0].real * Y[1][1].real - product.real - np.abs(product)
    told = (
        ("Re Y11 >= 0", Y[0][0].real / np.abs(Y[0][0])),
        ("Re Y22 >= 0", Y[1][1].real / np.abs(Y[1][1])),
        ("2 Re Y11 Re Y22 >= Re(Y12 Y21) + |Y12 Y21|", excess / np.where(size > 0.0, size, 1.0)),
    )
    for name, margin in told:
        worst = int(np.argmin(margin))
        if margin[worst] < -ROUNDING:
            hertz = angles[worst] / (2.0 * np.pi * dt)
            return f"Llewellyn's bound {name} is broken at {hertz:.3g} Hz, by {-margin[worst]:.2g} of its terms"
    return ""


def _admittances(
    master: Side, slave: Side, forward: int, backward: int, w: Array
) -> tuple[Array, tuple[tuple[Array, Array], tuple[Array, Array]]]:
    """The denominator without its zero at 1, and Y, at points of the circle."""
    v = 1.0 - w
    there, back = w**forward, w**backward
    (Zm, Cm), (Zs, Cs) = (
        ((s.mass * v + s.damping) * v, s.stiffness * w + s.rate * w * v) for s in (master, slave)
    )  # both times 1 - w
    det = (Zm + Cm) * (Zs + Cs) - Cm * Cs * there * back
    a, b = 1.0 - master.local, 1.0 - slave.local
    top = (
        ((Zs + Cs) * a + Cm * back * slave.remote * there, (Zs + Cs) * master.remote * back + Cm * back * b),
        (Cs * there * a + (Zm + Cm) * slave.remote * there, Cs * there * master.remote * back + (Zm + Cm) * b),
    )
    rows = tuple((one * v / det, other * v / det) for one, other in top)
    return det / v, (rows[0], rows[1])
