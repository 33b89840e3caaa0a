"""Joint rates of a hand's velocity: resolved motion rate control by wrist decomposition. Units: inch, radian, second.

The last three axes meet in the wrist, so that two 3 x 3 inverses replace one of 6 x 6: joints 1 to 3 move the wrist,

    v4 = v + HW (z x w),    (td1, td2, td3) = J1^-1 v4,    J1^-1 divided by S s3 ES^2,    S = s2 + s23      (4-3, 4-10)

and joints 4 to 6 make the rotation that is left, w3 in frame 3:

    td6 = (c4 w3x + s4 w3y) / s5,    td5 = -s4 w3x + c4 w3y,    td4 = w3z - c5 td6                                (4-15)

Source: M. R. Patterson's thesis, 4.2, 4.2.1, 4.2.2 and the listing SOLVE. Row 2 of (4-12) is read with a minus.
"""

from __future__ import annotations

import numpy as np

from wbc.published.three_arm_walker.machine.arm import ES, HW, SN, forward
from wbc.published.three_arm_walker.machine.calibration import Variant
from wbc.published.three_arm_walker.machine.rigid import cross
from wbc.validation import Array

#: Below this |sin theta5|, axes 4 and 6 count as aligned
WRIST_SINGULAR = 1e-2


def joint_rates(theta: Array, twist: Array, singular: Variant = "listing") -> Array:
    """Rates of the six joints, unbounded [rad/s].

    Where axes 4 and 6 are aligned, the part of the rotation across axis 5 is left out (4-18), and the part about both
    is made by joint 6 (listing) or by joint 4 (text, 4-16 and 4-17). Elsewhere singular postures, theta3 = 0 and
    S = 0, are kept away from by the artificial limits; at them the rates are not finite.

    Args:
        theta: 6 [rad]. twist: of the hand, in the axes of the arm base: linear, angular [in/s, rad/s].
    """
    s1, c1 = np.sin(theta[0]), np.cos(theta[0])
    s2, c2, s3 = np.sin(theta[1]), np.cos(theta[1]), np.sin(theta[2])
    s23, c23 = np.sin(theta[1] + theta[2]), np.cos(theta[1] + theta[2])
    s4, c4, s5, c5 = np.sin(theta[3]), np.cos(theta[3]), np.sin(theta[4]), np.cos(theta[4])
    total = s2 + s23
    wrist = twist[:3] + HW * cross(forward(theta)[:3, 2], twist[3:])
    inverse = np.array(
        [
            [-s1 * s3 * ES, c1 * s3 * ES, 0.0],
            [s23 * (c1 * total * ES - s1 * SN), s23 * (s1 * total * ES + c1 * SN), c23 * total * ES],
            [total * (s1 * SN - c1 * total * ES), -total * (c1 * SN + s1 * total * ES), -total * (c2 + c23) * ES],
        ]
    )
    out = np.zeros(6)
    with np.errstate(divide="ignore", invalid="ignore"):
        out[:3] = inverse @ wrist / (total * s3 * ES**2)
    bend = out[1] + out[2]
    left = twist[3:] + np.array([bend * s1, -bend * c1, -out[0]])
    x, y, z = np.array([[c1 * c23, s1 * c23, -s23], [-s1, c1, 0.0], [c1 * s23, s1 * s23, c23]]) @ left
    out[4] = -s4 * x + c4 * y
    if abs(s5) < WRIST_SINGULAR:
        out[5 if singular == "listing" else 3] = z
    else:
        out[5] = (c4 * x + s4 * y) / s5
        out[3] = z - c5 * out[5]
    return out


def saturated(rates: Array, limits: Array) -> Array:
    """All rates times min(1, min_i limit_i / |rate_i|): slower along the same motion."""
    used = float(np.max(np.abs(rates) / limits))
    return rates / used if used > 1.0 else rates
