"""Rate control as the thesis has it: joints are integrated from rates and the body follows from a holding arm.

    support arms    hand twist = -(that of its base) + error of its hold / dt
    swing arm       hand twist = command - (that of its base)
    v_a = R_b^T (v - v_v - w_v x (p_hand - p_v)),    w_a = R_b^T (w - w_v)              axes of the arm base

Units: inch, radian, second. Holds are kept where the hand was when it grasped, so an offset within the tolerance stays.
Source: M. R. Patterson's thesis, 5.3.2 and MAIN; AVEL, HLDPOS, MOVROB and ROBST, not listed, are reconstructions.
"""

from __future__ import annotations

import numpy as np

from wbc.published.three_arm_walker.machine.arm import ES, HW, SN, START, forward, joint_beyond
from wbc.published.three_arm_walker.machine.calibration import Variant, WalkerCalibration
from wbc.published.three_arm_walker.machine.grid import cross, inverse
from wbc.published.three_arm_walker.machine.motion import CYCLE, pose_error
from wbc.published.three_arm_walker.machine.plant import CycleCommand, Fault
from wbc.published.three_arm_walker.machine.reach import ARMS, Shoulders
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


class LiteralPlant:
    """A body whose arms are moved by SOLVE.

    Args:
        shoulders: of the body. body: where it starts, the arms in their starting posture.
        calibration: for the joint rates. singular: what SOLVE does where joints 4 and 6 are aligned.

    Attributes:
        joints, rates: 3 x 6 [rad, rad/s].
    """

    def __init__(
        self, shoulders: Shoulders, body: Array, calibration: WalkerCalibration, singular: Variant = "listing"
    ) -> None:
        self.shoulders, self.body, self.singular = shoulders, body, singular
        self.limits = np.array(calibration.joint_rates)
        self.joints, self.rates = np.tile(START, (ARMS, 1)), np.zeros((ARMS, 6))
        self.latched: list[Array | None] = [None] * ARMS

    @property
    def hands(self) -> Array:
        return np.asarray(self.body @ self.shoulders.frames @ np.array([forward(theta) for theta in self.joints]))

    def place(self, arm: int, pose: Array) -> int | None:
        """Hands are where their joints put them."""
        return None

    def move(self, twist: Array, order: CycleCommand) -> Fault | None:
        hands = self.hands
        for arm in range(ARMS):
            self._latch(arm, order.supporting[arm], hands[arm])
            latched = self.latched[arm]
            if latched is not None:
                self._drive(arm, twist, pose_error(latched, hands[arm]) / CYCLE, hands[arm])
            elif arm == order.arm and order.twist is not None:
                self._drive(arm, twist, order.twist, hands[arm])
        joints = self.joints + CYCLE * self.rates
        for arm in range(ARMS):
            joint = joint_beyond(joints[arm])
            if joint is not None:
                self.rates[:] = 0.0
                return Fault(joint, arm + 1)
        self.joints = joints
        self._find_body()
        return None

    def _latch(self, arm: int, supporting: bool, hand: Array) -> None:
        if not supporting:
            self.latched[arm] = None
        elif self.latched[arm] is None:
            self.latched[arm] = hand

    def _drive(self, arm: int, body: Array, twist: Array, hand: Array) -> None:
        """AVEL, SOLVE: rates for a hand twist in fixed axes on a moving base."""
        turn = (self.body @ self.shoulders.frames[arm])[:3, :3].T
        carried = body[:3] + cross(body[3:], hand[:3, 3] - self.body[:3, 3])
        relative = np.concatenate([turn @ (twist[:3] - carried), turn @ (twist[3:] - body[3:])])
        self.rates[arm] = saturated(joint_rates(self.joints[arm], relative, self.singular), self.limits)

    def _find_body(self) -> None:
        """ROBST: the body's pose from the first arm that holds; it stays where none does."""
        for arm, latched in enumerate(self.latched):
            if latched is not None:
                self.body = latched @ inverse(self.shoulders.frames[arm] @ forward(self.joints[arm]))
                return
