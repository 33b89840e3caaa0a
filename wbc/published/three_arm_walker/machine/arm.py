"""The PUMA 600 arm: dimensions, frames, limits. Units: inch, radian.

    A(i-1, i) = Rot(z, theta_i + offset_i) Trans(z, s_i) Trans(x, a_i) Rot(x, alpha_i)                 (3-4), (3-5)

Named points: base O, neck N, shoulder S, elbow E, wrist W, hand H. Joint angles are 0 in the middle of their travel,
where the arm stands straight along z. Source: M. R. Patterson's thesis, 3.2.2, 4.2.2, Tables I and II.
"""

from __future__ import annotations

import numpy as np

from wbc.validation import Array

#: Base to neck [in]
NO = 26.0
#: Neck to shoulder [in]
SN = 6.0
#: Shoulder to elbow [in]
ES = 17.0
#: Elbow to wrist [in]
WE = 17.0
#: Wrist to hand [in]
HW = 6.0

#: Table II: offsets, alpha [rad]; a, s [in]
OFFSET = np.radians([180.0, 90.0, 90.0, 180.0, 180.0, 0.0])
ALPHA = np.radians([90.0, 0.0, 90.0, 90.0, 90.0, 0.0])
A = np.array([0.0, ES, 0.0, 0.0, 0.0, 0.0])
S = np.array([NO, SN, 0.0, WE, 0.0, HW])

#: Table I, positive and negative [rad]
TRAVEL = np.radians([160.0, 165.0, 135.0, 135.0, 105.0, 270.0])

#: Artificial limits (4.2.2): theta3 <= -margin keeps the elbow bent, theta2 >= -theta3 / 2 + margin keeps the wrist
#: off the axis of joint 1 [rad]
ELBOW_MARGIN = float(np.radians(1.0))

#: Where every arm starts [rad]: the hand on its axis, 48.94 in below the base
START = np.radians([0.0, 90.0, -85.0, 0.0, -5.0, 0.0])


def link(joint: int, theta: float) -> Array:
    """A(i-1, i) of joint i = 1 to 6 at an angle, 4 x 4 (3-5)."""
    i = joint - 1
    ct, st = np.cos(theta + OFFSET[i]), np.sin(theta + OFFSET[i])
    ca, sa = np.cos(ALPHA[i]), np.sin(ALPHA[i])
    return np.array(
        [
            [ct, -ca * st, sa * st, A[i] * ct],
            [st, ca * ct, -sa * ct, A[i] * st],
            [0.0, sa, ca, S[i]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def forward(theta: Array) -> Array:
    """The hand in the frame of the arm base, 4 x 4 (3-12)."""
    out = np.eye(4)
    for joint in range(1, 7):
        out = out @ link(joint, float(theta[joint - 1]))
    return out


def joint_beyond(theta: Array) -> int | None:
    """The first joint, 1 to 6, outside Table I or the artificial limits; None where all are within."""
    out = np.abs(theta) > TRAVEL
    out[1] |= theta[1] < -0.5 * theta[2] + ELBOW_MARGIN
    out[2] |= theta[2] > -ELBOW_MARGIN
    return int(out.argmax()) + 1 if out.any() else None


def joint_beyond_reach(hand: Array) -> int | None:
    """The joint that keeps the wrist from a hand pose in the frame of the arm base; None where it gets there.

    The wrist must lie within ES + WE of the shoulder (else 3, the elbow, is straight) and no nearer than SN to the axis
    of joint 1 (else 2). Nothing else is looked at: this is the reach of ideal tracking.
    """
    x, y, z = (float(v) for v in hand[:3, 3] - HW * hand[:3, 2])
    square = x * x + y * y
    if square < SN * SN:
        return 2
    # (distance from the shoulder)^2 = 2 ES^2 (1 + cos theta3), as ES = WE
    cosine = (square - SN * SN + (z - NO) ** 2 - ES * ES - WE * WE) / (2.0 * ES * WE)
    return 3 if abs(cosine) > 1.0 else None
